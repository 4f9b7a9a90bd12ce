"""From [machine.extraction] to the axial effort of a run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import ufl
from dolfinx import fem, la

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section
from castfem.model.build_machine import coupled_pairs, known_resistance
from castfem.model.machine import thickness_of
from castfem.physics.machine.extraction.effort import CoupledResistance, Effort, Pairs, RollForces
from castfem.physics.machine.extraction.resistance import pressed, tributary_lengths
from castfem.physics.machine.machine import GRAVITY

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.mechanics import GeneralizedPlaneStrain
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel


def build_effort(
    case: Case,
    given: GeneralizedPlaneStrain,
    machine: Machine,
    steel: Steel,
    section: Section,
) -> Effort | None:
    """The effort of a case; None without [machine.extraction], or if nothing balances it.

    Raises:
        StrandStopsError: The drives are weaker than the rolls of a curve that is known.
    """
    table = None if case.machine is None else case.machine.extraction
    if table is None or case.machine is None or given.neutral_axis not in (None, "free"):
        return None
    rolls = case.machine.pairs()
    assert rolls is not None, "the case has been checked"
    known = known_resistance(table, case.machine)
    if known is not None:
        return known
    pairs = coupled_pairs(table, rolls)
    return CoupledResistance(
        pairs,
        pressed_rolls(case, pairs, machine, steel, section),
        table.bending,
        pays_work=given.closing != "axial",
    )


@dataclass(frozen=True, slots=True)
class PressedRolls:
    """Rolls that carry the pressure of the liquid over the length of strand that is theirs.

    That is statics: it holds whatever the shell does between rolls that are alike. What rolls that
    are not bear besides, the strip tells of a run whose faces bulge.
    """

    #: by the index of each pair the pressure of the liquid in the middle of the strand there, Pa,
    #: and the length of strand that the pair carries, m
    loads: Mapping[int, tuple[float, float]]
    #: of the liquid behind a wide face, m, of temperatures at the owned vertices (collective)
    width: Callable[[Array], float]

    def on_pair(self, index: int, temperature: Array, added: float) -> float:
        """See `castfem.physics.machine.extraction.effort.RollForces`."""
        width = self.width(temperature)
        return float(pressed(*self.loads[index], width)) + added * width


def pressed_rolls(
    case: Case, pairs: Pairs, machine: Machine, steel: Steel, section: Section
) -> RollForces:
    """Forces of bulging by statics."""
    density, places = float(steel.density(steel.liquidus + 1.0)), pairs.places  # of the liquid
    pressure = [density * GRAVITY * machine.height(float(place)) for place in places]
    thickness = thickness_of(case.section)
    assert thickness is not None, "a strand that is bent has a thickness"
    core = LiquidWidth(section, thickness, steel.solid_fraction)
    lengths = tributary_lengths(places)
    return PressedRolls(
        dict(zip(pairs.numbers, zip(pressure, lengths, strict=True), strict=True)), core
    )


class LiquidWidth:
    """Width of what is liquid in the middle of the thickness, m; of the mushy zone its liquid part.

    It is the mean over a twentieth of the thickness to each side of the middle.
    """

    def __init__(
        self, section: Section, thickness: float, solid_fraction: Callable[[Array], Array]
    ) -> None:
        self._comm, self._solid = section.comm, solid_fraction
        space, own = section.vertex_space, section.owned
        area = fem.assemble_vector(fem.form(ufl.TestFunction(space) * ufl.dx))
        area.scatter_reverse(la.InsertMode.add)
        x, y = np.abs(space.tabulate_dof_coordinates()[:own, :2]).T
        nearest = reductions.smallest(self._comm, y)
        middle = y <= max(0.05 * thickness, nearest * (1.0 + 1e-9))
        width = 2.0 * reductions.largest(self._comm, np.where(middle, x, 0.0))
        weight = np.where(middle, area.array[:own], 0.0)
        self._weight = weight * width / reductions.total(self._comm, float(weight.sum()))

    def __call__(self, temperature: Array) -> float:
        """Width at temperatures of the owned vertices (owned,), K (collective)."""
        liquid = 1.0 - np.asarray(self._solid(temperature))
        return reductions.total(self._comm, float(self._weight @ liquid))
