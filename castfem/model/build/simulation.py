"""The objects of a run, built once from its case."""

from __future__ import annotations

from collections.abc import MutableMapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base.constants import EXACT, ROUNDING
from castfem.base.libraries import cache_folder
from castfem.base.stopwatch import Stopwatch
from castfem.fem import reductions
from castfem.fem.probes import LineProbes
from castfem.fem.rank_zero import on_root
from castfem.fem.section import Section
from castfem.model.build.cooling import Zones
from castfem.model.build.start import given_profile
from castfem.model.machine_from_case import build_machine
from castfem.model.mechanics import Way
from castfem.model.section import meshing
from castfem.physics.coupling.staggered import LIMITS, StaggeredCoupling
from castfem.physics.coupling.step_control import LIMITS as STEP_LIMITS
from castfem.physics.coupling.step_control import Adaptive, StepControl
from castfem.physics.coupling.subcycling import MechanicalSteps, ThermalSteps
from castfem.physics.machine.machine import STANDING
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Surface
from castfem.physics.thermal.deformed_section import Shape
from castfem.physics.thermal.problem import ThermalProblem
from castfem.physics.thermal.stage import VERTEX, tolerance_of_steps
from castfem.physics.thermal.stepper import ThermalStepper

if TYPE_CHECKING:
    from castfem.base.types import Array
    from castfem.meshes import SectionMesh
    from castfem.model import Case
    from castfem.physics.closed_forms import ClosedForm
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel
    from castfem.physics.mechanics.equilibrium_parts import StrainedSlice
    from castfem.physics.mechanics.stepper import MechanicalStepper


CurveEnds = tuple[float, float, float]


@dataclass(slots=True)
class Simulation:
    """The objects of one run."""

    case: Case  #: the case
    machine: Machine  #: positions and times of the slice
    steel: Steel  #: its steel
    section: Section  #: the distributed mesh
    stepper: ThermalStepper  #: thermal time stepping (with the problem and its curve)
    zones: Zones  #: the machine's cooling
    probes: LineProbes  #: lines at which results are read
    control: StepControl  #: choice of the step: thermal, or with mechanics the coupling window
    steps: ThermalSteps  #: thermal steps
    mechanics: MechanicalStepper | None  #: the mechanical step; None for a case without
    #: the slice for reading its states: that of the mechanics, or a perturbed one; None without
    #: mechanics
    strained: StrainedSlice | None
    coupling: StaggeredCoupling | None  #: coupling of both; None without coupling windows
    start_temperature: float  #: temperature at the meniscus, K
    watch: Stopwatch  #: timings
    #: when its mechanics end, s; inf if at the end of the run
    mechanics_end: float = np.inf
    exact: ClosedForm | None = None  #: closed-form solution for comparison, if the case names one

    @property
    def stations(self) -> list[float]:
        """Positions short of the end for which the case has reference numbers, m."""
        return stations(self.case)

    @property
    def problem(self) -> ThermalProblem:
        """The thermal problem."""
        return self.stepper.problem

    @property
    def centred_probes(self) -> tuple[str, ...]:
        """Probes that end in the centre of the section, so that they measure half of its size."""
        return tuple(
            name
            for name, (start, end) in self.probes.lines.items()
            if np.linalg.norm(end) <= ROUNDING * np.linalg.norm(start)
        )

    def destroy(self) -> None:
        """Free the PETSc objects; many simulations may be built in one process."""
        self.problem.destroy()
        if self.mechanics is not None:
            self.mechanics.problem.destroy()
        self.probes.destroy()


def build(
    case: Case, comm: MPI.Comm, watch: Stopwatch | None = None, other: Simulation | None = None
) -> Simulation:
    """Build the objects of `case` on the ranks of `comm` (collective).

    Args:
        case: Case to compute.
        comm: Communicator.
        watch: Stopwatch to charge; a new one if None.
        other: Simulation of a case with the same steel and section on the same ranks, to share
            both.

    Raises:
        InputError: The steel, the mesh or the solver options are unavailable.
    """
    watch = watch if watch is not None else Stopwatch()
    with watch.section("setup: steel"):
        machine = build_machine(case)
        steel = case_steel(case) if other is None else other.steel
        start = starting_temperature(case, steel)
        exact = _closed_form(case, steel, start)
    with watch.section("setup: mesh"):
        if other is None:
            section = Section(comm, on_root(comm, lambda: build_mesh(case)))
        else:
            section = other.section
        probes = LineProbes(section, _probe_lines(case, section))
    with watch.section("setup: mechanics"):
        mechanics = None
        if case.mechanics is not None:  # a thermal simulation does not even import them
            from castfem.model.build.mechanics import build_mechanics

            mechanics = build_mechanics(case, machine, steel, section, probes, watch)
    shape = None
    if mechanics is not None and case.coupling.follow_shape:
        shape = Shape(section, mechanics.problem.space, steel.solidus)
    with watch.section("setup: thermal"):
        zones = Zones(case, machine, steel, Surface(section, shape))
        curve = thermal_curve(
            steel, curve_ends(case, steel, zones, start), start, keeps_mass=shape is not None
        )
        probes.conducts = curve
        stepping = case.thermal.time
        allowed = stepping.adaptive
        tolerance = tolerance_of_steps(allowed.tolerance) if allowed else VERTEX.tight
        problem = ThermalProblem(
            section, curve, case.thermal.solver, tolerance, watch=watch, shape=shape
        )
    stepper = ThermalStepper(problem, stepping.scheme, estimate=stepping.step is None)
    acting = () if mechanics is None else mechanics.problem.slice.interactions
    ends = [end for one in acting for end in (*one.between, *one.knots)]
    milestones = _milestones(case, machine, zones, [end for end in ends if 0.0 < end < np.inf])
    ended = case.mechanics_end()
    mechanics_end = np.inf if ended is None else machine.time_at(ended)
    if mechanics is None:
        control = thermal = step_control(case, milestones)
    else:
        control = _windows(case, machine, [*milestones, mechanics_end])
        thermal = step_control(case, [time for time in milestones if time > mechanics_end])
    steps = ThermalSteps(stepper, thermal)
    coupling = _coupling(case, machine, steps, mechanics, zones)
    return Simulation(
        case, machine, steel, section, stepper, zones, probes, control, steps, mechanics,
        None if mechanics is None else mechanics.problem, coupling,
        start_temperature=start, watch=watch, mechanics_end=mechanics_end, exact=exact,
    )  # fmt: skip


def build_beside(
    case: Case, other: Simulation, problems: MutableMapping[CurveEnds, ThermalProblem]
) -> Simulation:
    """Build a simulation whose cooling is that of another, at other times.

    Args:
        case: Case that differs from the other only in speed, superheat, water and start.
        other: Simulation whose mesh and steel are shared, without mechanics also its operators and
            probes: use the two in turn.
        problems: Heat balances without mechanics so far, by the ends of their curves; also shared.
    """
    if case.mechanics is not None:
        return build(case, other.section.comm, other=other)
    machine, steel = replace(other.machine, travel=case.casting.travel), other.steel
    start = starting_temperature(case, steel)
    zones = Zones(case, machine, steel, other.zones.surface, other.zones)
    ends = curve_ends(case, steel, zones, start)
    problem = problems.get(ends)
    if problem is None:
        problem = problems[ends] = other.problem.of_curve(thermal_curve(steel, ends, start))
    stepping = case.thermal.time
    stepper = ThermalStepper(problem, stepping.scheme, estimate=stepping.step is None)
    control = step_control(case, _milestones(case, machine, zones, []))
    return replace(
        other, case=case, machine=machine, zones=zones, stepper=stepper, control=control,
        steps=ThermalSteps(stepper, control), start_temperature=start,
        probes=other.probes.of_curve(problem.curve),
    )  # fmt: skip


def _probe_lines(case: Case, section: Section) -> dict[str, tuple[Array, Array]]:
    """Lines of the probes; where a machine bends the strand, named separately for both faces."""
    named = {}
    for name, line in section.probes.items():
        opposite = [n for n in section.probes if n.replace("_extrados", "") == name != n]
        if case.bends and opposite:
            name = opposite[0].replace("_extrados", "_intrados")
        named[name] = line
    return named


def _windows(case: Case, machine: Machine, milestones: list[float]) -> StepControl:
    """Step control of the coupling windows, of equal times or of equal lengths of strand."""
    given = case.coupling.interval
    windows = partial(
        StepControl, case.casting.duration, milestones, order=LIMITS.order,
        tolerance=case.coupling.window_error or LIMITS.allowed, most=case.coupling.growth or 1.0,
    )  # fmt: skip
    if not isinstance(given, Way):
        return windows(fixed=given)
    length, unit = given.length, machine.window_time(given.length)
    return windows(
        fixed=STANDING * unit, longest=lambda time: machine.window(time, length), unit=unit
    )


def _closed_form(case: Case, steel: Steel, start: float) -> ClosedForm | None:
    """The closed-form solution a case is compared with; None if it names none."""
    if case.verification is None:
        return None
    from castfem.model.cooling import PrescribedTemperature
    from castfem.physics.closed_forms import closed_form

    (law,) = case.cooling[0].surface
    assert isinstance(law, PrescribedTemperature), "the case has been checked"
    return closed_form(case.verification.closed_form, steel, law.value, start)


def _coupling(
    case: Case,
    machine: Machine,
    steps: ThermalSteps,
    mechanics: MechanicalStepper | None,
    zones: Zones,
) -> StaggeredCoupling | None:
    if mechanics is None:
        return None
    gap, given = None, case.coupling
    window = given.interval
    duration = machine.window_time(window.length) if isinstance(window, Way) else window
    if (wall := mechanics.problem.contact) is not None:
        from castfem.physics.mechanics.surface_gap import SurfaceGap

        gap = SurfaceGap(wall)
        zones.sides = gap
    return StaggeredCoupling(
        steps, MechanicalSteps(mechanics, given.mechanical_step), given.dissipation, zones, gap,
        duration, given.passes, given.settled, given.order,
        given.strain_error or STEP_LIMITS.strain,
        _reach(mechanics.problem.section) if (given.growth or 1.0) > 1.0 else None,
    )  # fmt: skip


def _reach(section: Section) -> tuple[float, float]:
    """Largest |x| and |y| of the section, m (collective)."""
    place = np.abs(section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2])
    x, y = (reductions.largest(section.comm, values) for values in place.T)
    return x, y


def case_steel(case: Case) -> Steel:
    """The steel of the case, with its composition and overrides."""
    from castfem.physics.materials import load_steel

    given = case.steel
    return load_steel(
        given.name,
        composition=given.composition or None,
        overrides=given.changes,
        origin=f"{case.title}: steel",
    )


def curve_ends(case: Case, steel: Steel, zones: Zones, start: float) -> CurveEnds:
    """Return between which temperatures T(H) is needed, and where it is zero, K.

    They span the coldest ambient temperature, or a cold room, to the start (K) or the initial
    profile.
    """
    profile = given_profile(case)
    given = () if profile is None else profile.values
    coldest, hottest = zones.ambient_range()
    lowest = max(min(coldest, start, *given), 280.0)
    highest = max(start, *given, hottest if hottest < np.inf else start, steel.liquidus)
    return lowest, highest, start


def thermal_curve(
    steel: Steel, ends: CurveEnds, start: float, keeps_mass: bool = False
) -> ThermalCurve:
    """T(H), tabulated to 2 K beyond its ends (`curve_ends`), constant farther on.

    Args:
        steel: The steel.
        ends: Ends of the curve.
        start: Temperature at the meniscus, K.
        keeps_mass: Whether the slice moves, so that solid keeps its mass and not its volume.
    """
    lowest, highest, _ = ends
    return steel.thermal_curve(lowest - 2.0, highest + 2.0, start, start if keeps_mass else None)


def starting_temperature(case: Case, steel: Steel) -> float:
    """Temperature of the steel at the meniscus, K."""
    if case.casting.temperature is not None:
        return case.casting.temperature
    return steel.liquidus + (case.casting.poured_superheat or 0.0)


def stations(case: Case) -> list[float]:
    """Positions short of the end for which the case has reference numbers, m."""
    length = case.casting.length
    return sorted({r.at for r in case.reference if r.at is not None and r.at < length})


def _milestones(case: Case, machine: Machine, zones: Zones, ends: list[float]) -> list[float]:
    """Times at which a step must end, s: output, stations, changes of cooling, mould and speed.

    Args:
        case: The case.
        machine: Turns positions into instants.
        zones: Cooling zones.
        ends: Positions where an interaction with the slice begins, ends or changes its slope, m.
    """
    due = [machine.time_at(p) for p in stations(case)]
    if case.output_fields or case.output.by_clock:
        due += case.output_times()
    bends = (*machine.bends, *_drawn(case)) if case.mechanics is not None else ()
    changes = [machine.time_at(p) for p in (*case.mould_knots(), *bends, *ends)]
    changes += [*zones.changes, *machine.kinks]
    end = case.casting.duration
    return due + _apart(changes, [0.0, *due, end], end)


def _apart(times: list[float], fixed: list[float], end: float) -> list[float]:
    """Remove times that differ from a fixed or another one only by rounding.

    Table rows in other units or with few digits miss the end of a zone or of the run by rounding:
    the solver cannot take such a step. Differences that `StepControl` resolves are kept.
    """
    given, kept = np.unique(times), np.sort(fixed)
    after = np.searchsorted(kept, given)
    before, after = np.maximum(after - 1, 0), np.minimum(after, len(kept) - 1)
    near = np.minimum(abs(given - kept[before]), abs(given - kept[after]))
    given = given[(near <= EXACT * end) | (near > ROUNDING * end)]
    gaps = np.diff(given, prepend=-np.inf)
    return [float(t) for t in given[(gaps <= EXACT * end) | (gaps > ROUNDING * end)]]


def _drawn(case: Case) -> tuple[float, ...]:
    """Positions of the rolls that cause axial effort, m: its slope changes there."""
    if case.machine is None or case.machine.extraction is None:
        return ()
    rolls = case.machine.pairs()
    assert rolls is not None, "the case has been checked"
    return tuple(pair.position for pair in rolls.pairs)


def step_control(case: Case, milestones: list[float], least: float = 0.0) -> StepControl:
    """Thermal step control of the case, for `least` seconds or more; it hits the milestones (s)."""
    duration, stepping = max(case.casting.duration, least), case.thermal.time
    if stepping.step is not None:
        return StepControl(duration, milestones, fixed=stepping.step)
    given = stepping.adaptive
    if given is None:
        raise ValueError("a case has a fixed step or an adaptive one")
    adaptive = Adaptive(given.tolerance, given.first, given.smallest, given.largest)
    order = 3 if stepping.scheme == "sdirk2" else 2
    return StepControl(duration, milestones, adaptive=adaptive, order=order)


def build_mesh(case: Case) -> SectionMesh:
    """The section's mesh, from the user's cache if it is there."""
    from castfem import meshes

    with meshing():
        return meshes.cached(meshes.build, cache_folder() / "meshes", **case.mesh_parameters())
