"""Build the mechanics of the slice and the axial effort of a run from a case."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import ufl
from dolfinx import fem, la

from castfem.base.constants import ROUNDING
from castfem.base.errors import CaseError, InputError
from castfem.base.stopwatch import Stopwatch
from castfem.base.tables import Table, as_function
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.probes import LineProbes
from castfem.fem.section import Section
from castfem.model import mechanics as given
from castfem.model.build.law import build_law
from castfem.model.heat_law import no_expansion
from castfem.model.machine import thickness_of
from castfem.model.machine_from_case import coupled_pairs, known_resistance
from castfem.model.mechanics import axis_position, places_of
from castfem.model.mould_from_case import build_mould
from castfem.physics.constitutive.base import Law
from castfem.physics.contact.settings import Contact, SurfaceInteraction
from castfem.physics.machine.extraction.effort import CoupledResistance, Effort, Pairs, RollForces
from castfem.physics.machine.extraction.resistance import pressed, tributary_lengths
from castfem.physics.machine.machine import GRAVITY, over_time
from castfem.physics.mechanics.generalized_plane_strain import (
    PlainPlanes,
    Planes,
    TimeHistory,
    allowed_strains,
    zero,
)
from castfem.physics.mechanics.machine_bending import BentPlanes, ImposedAxis
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.slice_definition import Ferrostatic, Slice
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import PrescribedDisplacement

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.mechanics import GeneralizedPlaneStrain
    from castfem.model.mould import Mould
    from castfem.model.section import Section as Strand
    from castfem.physics.machine import Machine
    from castfem.physics.machine.extraction.effort import Effort
    from castfem.physics.materials import Steel


def build_mechanics(
    case: Case,
    machine: Machine,
    steel: Steel,
    section: Section,
    probes: LineProbes,
    watch: Stopwatch,
) -> MechanicalStepper | None:
    """The mechanics of `case` (collective); None for a case without.

    Raises:
        InputError: The law, a boundary group or a solver option is unavailable, the steel lacks a
            property, or a free strain across cannot be distinguished from a displacement.
    """
    table = case.mechanics
    if table is None:
        return None
    if lack := no_expansion(steel):
        raise CaseError(f"steel.name: {lack}")
    problem = MechanicalProblem(
        section,
        make_slice(case, table, machine, steel, section, probes),
        table.solver,
        tolerance=table.tolerance,
        watch=watch,
    )
    _check_across(problem)
    return MechanicalStepper(problem)


def _check_across(problem: MechanicalProblem) -> None:
    """Reject a free strain across that is a displacement like any other: no side follows it."""
    apart = problem.constraints.spread(component=1)
    if "across" in problem.slice.planes.free and apart <= ROUNDING * problem.scales.length:
        problem.destroy()
        raise InputError(
            "mechanics.planes.across: free along y, as the section's sides are: nothing tells the "
            'two apart; hold two sides, such as [[mechanics.held]] on = ["side_low", "side_high"], '
            'component = "y", or leave across out'
        )


def make_slice(
    case: Case,
    table: given.Mechanics,
    machine: Machine,
    steel: Steel,
    section: Section,
    probes: LineProbes,
    law: Law | None = None,
) -> Slice:
    """Material, boundary conditions and loads of the slice of `case`; `law` replaces its own."""
    if law is None:
        law = build_law(table, steel)
    wall = None if case.mould is None else _wall(case.mould, case.section, machine, section)
    interactions: tuple[SurfaceInteraction, ...] = () if wall is None else (wall,)
    held = any(one.holds_liquid for one in interactions)
    ferrostatic = _ferrostatic(table, machine, steel, "free" if held else "held")
    if table.bulging is not None and table.bulging.bears:
        from castfem.model.build.roll_supports import build_roll_supports

        rolls = build_roll_supports(
            case, table.bulging, machine, steel, section, probes, law, ferrostatic, wall
        )
        interactions = (*interactions, *rolls)
    return Slice(
        law=law,
        thermal_strain=steel.thermal_strain,
        planes=_planes(case, table.planes, machine, steel, section),
        held=tuple(_held(one) for one in table.held),
        ferrostatic=ferrostatic,
        interactions=interactions,
        large_strain=table.strain == "large",
        liquid=table.liquid,
    )


def _wall(table: Mould, strand: Strand, machine: Machine, section: Section) -> Contact:
    return Contact(
        wall=build_mould(table, strand),
        on=section.outer_groups,
        position=machine.position,
        method=table.contact.method,
        factor=table.contact.factor,
        friction=table.friction.build(),
    )


def _shared(value: float | Table, machine: Machine, parts: int) -> TimeHistory:
    """Load over time on each of the equal parts of the section, from a load on the whole."""
    if value == 0.0:
        return zero
    whole = over_time(value, machine)
    return lambda time: whole(time) / parts


def _planes(
    case: Case,
    table: given.GeneralizedPlaneStrain,
    machine: Machine,
    steel: Steel,
    section: Section,
) -> Planes:
    """Constraint of the planes: the rolls of a machine that bends the strand, or the case."""
    force = _shared(table.force, machine, section.multiplicity)
    if case.bends:
        effort = None
        if case.machine is not None and case.machine.extraction is not None:
            effort = build_effort(case, table, machine, steel, section)
        return _bent(case, table, machine, force, effort, section.multiplicity)
    free = given.free_strains(table, allowed_strains(section.groups))
    imposed = {
        name: as_function(value)
        for name in ("a0", "a1", "a2", "across")
        if name not in free and (value := getattr(table, name)) is not None
    }
    return PlainPlanes(
        free=free,
        imposed=imposed,
        force=force,
        moment_x=_shared(table.moment_x, machine, section.multiplicity),
        moment_y=_shared(table.moment_y, machine, section.multiplicity),
    )


def _bent(
    case: Case,
    table: given.GeneralizedPlaneStrain,
    machine: Machine,
    force: TimeHistory,
    effort: Effort | None,
    parts: int,
) -> BentPlanes:
    """Planes that follow the curvature of the machine."""
    thickness = thickness_of(case.section)
    assert thickness is not None, "a strand that can be bent has a thickness"
    axis = table.neutral_axis
    planes = BentPlanes(
        curvature=lambda time: machine.curvature(machine.position(time), "extrados"),
        half_thickness=0.5 * thickness,
        neutral_axis=None if isinstance(axis, Mapping) else axis_position(axis, thickness),
        force=force,
        test_direction=table.closing or "tangential",
        contains_work=effort.contains_work if effort else bool(table.force_contains_bending),
        effort=effort,
        position=machine.position,
        parts=parts,
    )
    if not isinstance(axis, Mapping):
        return planes
    places = [axis_position(place, thickness) or 0.0 for place in places_of(axis)]
    times = (0.0, *(machine.time_at(position) for position in machine.bends))
    imposed = ImposedAxis.alternating(planes.middle, times, *places)
    return replace(planes, neutral_axis=imposed)


def _held(one: given.GivenDisplacement) -> PrescribedDisplacement:
    component = "xy".index(one.component)
    if one.value == 0.0:
        return PrescribedDisplacement(one.on, component)
    return PrescribedDisplacement(one.on, component, _everywhere(as_function(one.value)))


def _everywhere(history: TimeHistory) -> Callable[[Array, float], Array]:
    return lambda positions, time: np.full(len(positions), history(time))


def _ferrostatic(
    table: given.Mechanics, machine: Machine, steel: Steel, outside: Literal["held", "free"]
) -> Ferrostatic | None:
    """Pressure of the liquid; None if it is left out.

    Where no wall holds the liquid at the surface by contact, it is held from `outside`.
    """
    if table.ferrostatic == "off":
        return None
    head = machine.head(steel.liquid_density)
    return Ferrostatic(head, steel.solid_fraction, table.ferrostatic, outside)


def build_effort(
    case: Case,
    given: GeneralizedPlaneStrain,
    machine: Machine,
    steel: Steel,
    section: Section,
) -> Effort | None:
    """The effort of a case; None without [machine.extraction], or if nothing balances it.

    Raises:
        StrandStopsError: The drives are weaker than the rolls of a given curve.
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
    """Rolls that carry the pressure of the liquid over their length of strand.

    This is statics: it holds for any behaviour of the shell between equal rolls. Additional loads
    of uneven rolls come from the strip of a run whose faces bulge.
    """

    #: for each pair, by index: liquid pressure in the middle of the strand, Pa, and length of
    #: strand that the pair carries, m
    loads: Mapping[int, tuple[float, float]]
    #: width of the liquid behind a wide face, m, from temperatures at the owned vertices
    #: (collective)
    width: Callable[[Array], float]

    def on_pair(self, index: int, temperature: Array, added: float) -> float:
        """See `castfem.physics.machine.extraction.effort.RollForces`."""
        width = self.width(temperature)
        return float(pressed(*self.loads[index], width)) + added * width


def pressed_rolls(
    case: Case, pairs: Pairs, machine: Machine, steel: Steel, section: Section
) -> RollForces:
    """Bulging forces by statics."""
    # density of the liquid
    density, places = float(steel.density(steel.liquidus + 1.0)), pairs.places
    pressure = [density * GRAVITY * machine.height(float(place)) for place in places]
    thickness = thickness_of(case.section)
    assert thickness is not None, "a strand that is bent has a thickness"
    core = LiquidWidth(section, thickness, steel.solid_fraction)
    lengths = tributary_lengths(places)
    return PressedRolls(
        dict(zip(pairs.numbers, zip(pressure, lengths, strict=True), strict=True)), core
    )


class LiquidWidth:
    """Width of the liquid in the middle of the thickness, m, with the liquid fraction of the mush.

    It is the mean over a twentieth of the thickness on each side of the middle.
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
        """Width for temperatures of the owned vertices (owned,), K (collective)."""
        liquid = 1.0 - np.asarray(self._solid(temperature))
        return reductions.total(self._comm, float(self._weight @ liquid))
