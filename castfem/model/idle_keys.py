"""Keys that a sound case gives, and that change nothing in it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from castfem.base.tables import Table
from castfem.base.tolerances import ROUNDING
from castfem.model.extraction import COUPLED
from castfem.model.problems import Problem

if TYPE_CHECKING:
    from castfem.model.base import TableModel
    from castfem.model.case import Case

_REPEATED = ("passes", "settled", "window_error")


def idle_keys(case: Case) -> Iterator[Problem]:
    """Yield keys that were given and have no effect, with the reason."""
    yield from _coupling(case)
    yield from _liquid(case)
    yield from _elastic(case)
    yield from _extraction(case)
    yield from _clock(case)
    yield from _longest_step(case)


def _given(table: TableModel) -> list[str]:
    """Keys with another value than their default: the case of a run names the defaults, too."""
    fields = type(table).model_fields
    needed = {name for name, field in fields.items() if field.is_required()}
    plain = type(table).model_validate(table.model_dump(mode="json", include=needed))
    return [n for n in fields if getattr(table, n) != getattr(plain, n)]


def _longest_step(case: Case) -> Iterator[Problem]:
    """Yield a step that was asked for and is never taken, since fields are written within it."""
    time, every = case.thermal.time, case.output_every
    given: dict[tuple[str, ...], float | None] = {("step",): time.step}
    if time.adaptive is not None and "largest" in _given(time.adaptive):
        given = {("adaptive", "largest"): time.adaptive.largest}
    for name, step in given.items():
        if case.output_fields and step is not None and step > every * (1.0 + ROUNDING):
            yield Problem(
                ("thermal", "time", *name),
                f"({step:.4g} s) is cut to output.every ({every:.4g} s): the states of the fields "
                "end a step; write them less often, or none (output.fields = [])",
            )


def _clock(case: Case) -> Iterator[Problem]:
    """Yield a start by the clock, where nothing goes by it."""
    if case.casting.clock == 0.0:
        return
    water = [] if case.water is None else [case.water.flow]
    water += [getattr(law, "flow", None) for zone in case.cooling for law in zone.surface]
    water += [] if case.secondary is None else [c.flow for c in case.secondary.circuit]
    given = (case.casting.speed, case.casting.superheat, *water)
    if not any(isinstance(value, Table) and value.over == "time" for value in given):
        yield Problem(
            ("casting", "start", "time"),
            "has no effect: neither speed, nor superheat, nor a flow of water is over time",
        )


def _coupling(case: Case) -> Iterator[Problem]:
    """Yield what is told of windows that are not repeated, or of a coupling that is not there."""
    table = case.coupling
    given = _given(table)
    if case.mechanics is None:
        for name in given:
            yield Problem(("coupling", name), "has no effect without [mechanics]")
        return
    if "strain_error" in given and (table.growth or 1.0) == 1.0:
        yield Problem(("coupling", "strain_error"), "has no effect without coupling.growth")
    for name in (n for n in _REPEATED if n in given):
        if case.mould is None:
            reason = "without [mould]: no gap opens, and a window is not repeated"
        elif table.order != "thermal_first":
            reason = f'with order = "{table.order}": a window is not repeated'
        elif name == "window_error" and table.passes == 1:
            reason = "with passes = 1: the error of a window is found by repeating it"
        else:
            continue
        yield Problem(("coupling", name), f"has no effect {reason}")


def _liquid(case: Case) -> Iterator[Problem]:
    """Yield a modulus of liquid that is fed, where no mushy zone is stiffer than it."""
    table = case.mechanics
    if table is None or table.liquid_has_modulus:
        return
    if "liquid_stiffness" in _given(table):
        yield Problem(
            ("mechanics", "liquid_stiffness"),
            "has no effect: liquid that is fed is as soft as its pressure allows; what has this "
            'modulus is liquid = "elastic", or a mushy zone that stiffens (mush)',
            inherited=False,  # the case above may be of another liquid
        )


def _elastic(case: Case) -> Iterator[Problem]:
    """Yield moduli of the steel that are changed beside an elasticity of its own name."""
    if case.mechanics is None or case.mechanics.elasticity is None:
        return
    for name in ("youngs_modulus", "poisson_ratio"):
        if name in case.steel.overrides:
            yield Problem(
                ("steel", "overrides", name),
                "has no effect beside mechanics.elasticity, which holds it; leave one of them out",
            )


def _extraction(case: Case) -> Iterator[Problem]:
    """Yield friction and bending that a maker's curve has in it."""
    table = None if case.machine is None else case.machine.extraction
    rolls = None if case.machine is None else case.machine.pairs()
    if table is None or rolls is None or table.resistance == COUPLED:
        return
    names = ["bending"]
    if not any(pair.locked for pair in rolls.pairs):
        names += ["friction_axis", "friction_surface"]
    for name in names:
        if name in _given(table):
            yield Problem(
                ("machine", "extraction", name),
                "has no effect beside a maker's curve, which has it in it",
            )
