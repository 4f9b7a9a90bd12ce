"""Build the constitutive law from the table [mechanics] and the steel of a case."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.parameters import (
    DeltaShare,
    load_elasticity,
    load_law,
    problems_at,
)

if TYPE_CHECKING:
    from castfem.fem.snes import Options
    from castfem.model.mechanics import Mechanics
    from castfem.physics.materials import Steel


def build_law(
    table: Mechanics,
    steel: Steel,
    law_origin: str = "mechanics.law",
    elasticity_origin: str = "mechanics.elasticity",
) -> RadialReturn:
    """The law of the slice, with the elasticity and the mushy zone of `table`.

    Args:
        table: The table of the case.
        steel: Steel of the case.
        law_origin: File and key that name the law ("billet.toml: mechanics.law"), for messages.
        elasticity_origin: File and key that name the elasticity.

    Raises:
        InputError: Lists all problems found, one line each.
    """
    solidity = Solidity.of(
        steel,
        stiffness_ratio=table.liquid_stiffness,
        mushy_zone=table.mushy_zone,
        coherency=table.coherent_from,
        memory=table.liquid != "fed",
    )
    delta = None if steel.diagram is None else DeltaShare(steel.diagram)
    problems: list[str] = []
    try:
        elasticity = _elasticity(table, steel, solidity)
    except InputError as error:
        problems += problems_at(elasticity_origin, error).problems
        elasticity = load_elasticity(solidity=solidity)
    try:
        law = load_law(table.law, elasticity, carbon=steel.composition.get("C"), delta_share=delta)
    except InputError as error:
        problems += problems_at(law_origin, error).problems
    if problems:
        raise InputError(problems)
    return law


def _elasticity(table: Mechanics, steel: Steel, solidity: Solidity) -> Elasticity:
    """The named set, or each of the steel's own; missing properties are those of carbon steel."""
    if table.elasticity is not None:
        return load_elasticity(table.elasticity, solidity)
    found = load_elasticity(solidity=solidity)
    if steel.has("youngs_modulus"):
        found = replace(found, young=steel.youngs_modulus)
    return replace(found, poisson=steel.poisson_ratio) if steel.has("poisson_ratio") else found


def try_solver(table: str, options: Options) -> None:
    """Try the options of `thermal.solver` or `mechanics.solver` over the defaults of one rank.

    Args:
        table: "thermal" or "mechanics".
        options: The user's options.

    Raises:
        InputError: An option belongs to no family that PETSc knows, PETSc rejects its value, or
            the solver cannot use it.
    """
    if table == "thermal":
        from castfem.physics.thermal.operators import iterative_options

        iterative_options(1, options)
        return
    from castfem.fem.snes import try_options
    from castfem.physics.mechanics.newton import split_options

    nonlinear, linear = split_options(options, symmetric=False)
    try_options("mechanical_", {**nonlinear, **linear})
