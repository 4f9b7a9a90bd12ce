"""Derivatives of solidification compared with closed forms: Neumann, and Weiner and Boley."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from scipy.integrate import quad
from sensitivity.test_mechanical_derivatives import Marks
from sensitivity.test_mould_derivatives import short

import castfem
from castfem.base.types import Array
from castfem.fem.compat import assemble_owned
from castfem.model.build.simulation import build
from castfem.model.load import from_document
from castfem.physics.closed_forms import Neumann
from castfem.physics.closed_forms.half_space import ALPHA, YIELD, HalfSpace
from castfem.physics.materials.curve import ThermalCurve
from castfem.physics.thermal.boundary import Cooling, Patch
from castfem.physics.thermal.flux_laws import Contact, Convection, SurfaceLaw
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.followed_run import follow
from castfem.studies.sensitivity.perturbed_simulation import CurveDifference, same_laws
from castfem.studies.sensitivity.perturbed_slices import DIFFERENCES, slope, slope_by_temperature
from castfem.studies.sensitivity.shape_change import ByMotion

COARSE = {
    "casting.length": "83.3333333333 mm", "output.fields": [], "output.figures": False,
    "section.length": "20 mm", "mesh.core_size": "4 mm", "mesh.surface_depth": "11 mm",
    "thermal.time.step": "0.25 s", "coupling.interval": "0.25 s",
}  # fmt: skip
SLOPES = {"steel.thermal_expansion": ("alpha", ALPHA), "law.yield_stress": ("yield_stress", YIELD)}
BEGUN = 0.25  # of the time: strains are compared from there on; before, one or two cells freeze


@dataclass(slots=True)
class StrainSlopes(Marks):
    """Recorder of the derivatives of the axial strain after each window."""

    noted: list[tuple[float, list[float]]] = field(default_factory=list)

    def step(self, run: RunState, sample: Sample) -> None:
        Marks.step(self, run, sample)
        slopes = self.derivatives.coupled.mechanical.slopes
        if slopes[0]:
            self.noted.append(
                (run.state.time, [float(s["generalized_strains"][0]) for s in slopes])
            )


def moment(form: HalfSpace, time: float) -> float:
    """Return the moment of the stress about the surface, N m per m2 of its height."""
    size = 2.0 * np.sqrt(form.diffusivity * time)
    ends = (0.0, form.compressed, form.stretched, form.front)

    def integrand(zeta: float) -> float:
        return zeta * float(form.stress(np.array([size * zeta]), time)[0])

    parts = (quad(integrand, low, high)[0] for low, high in pairwise(ends))
    return float(size**2 * sum(parts))


def test_half_space_has_the_derivatives_of_weiner_and_boley() -> None:
    """Axial strain and moment of the stress by contraction and yield stress, at 5 s.

    Fifteen cells are frozen then, three of them elastic. A depth of the closed form is that of a
    tread or riser on them: sums over the shell and the strain over a time are compared.
    """
    document = castfem.load("verification/weiner_boley_coarse").with_(COARSE).document()
    del document["verification"]
    simulation = build(from_document(document), MPI.COMM_SELF)
    marks = StrainSlopes(follow(simulation, list(SLOPES)))
    loop = TimeLoop(simulation, marks)
    loop.run()
    slopes, points = (
        marks.derivatives.coupled.mechanical.slopes,
        simulation.mechanics.problem.points,
    )
    times, noted = np.array([t for t, _ in marks.noted]), np.array([s for _, s in marks.noted])
    end, later = times[-1], times > BEGUN * times[-1]
    # The strain of the closed form is proportional to log t: on cells it changes in steps.
    rates = np.polyfit(np.log(times[later]), noted[later], 1)[0]
    lever = points.deviator.volume * points.deviator.position[:, 0] / 0.5e-3
    for number, (name, (key, value)) in enumerate(SLOPES.items()):
        ends = [HalfSpace(**{key: value * share}) for share in (1.001, 0.999)]
        rate = 0.5 * (ends[0].rate - ends[1].rate) / 0.2
        assert rates[number] == pytest.approx(rate, rel=0.05), name
        if key == "yield_stress":
            exact = (moment(ends[0], end) - moment(ends[1], end)) / 0.2
            slope = points.recovered(slopes[number]["stress"])[:, 2]
            assert lever @ slope == pytest.approx(exact, rel=0.05)


MELT = {
    "output.fields": [], "output.figures": False, "mesh.surface_size": "1.2 mm",
    "mesh.core_size": "1.2 mm", "section.width": "1.2 mm", "thermal.time.step": "0.2 s",
}  # fmt: skip
# Conductivity, density, specific heat, latent heat, temperatures of surface, freezing and pouring.
NUMBERS = (33.0, 7500.0, 661.0, 272e3, 1273.15, 1767.55, 1823.15)


def test_melt_has_the_derivatives_of_neumann() -> None:
    """Heat by latent heat and conductivity, and so the front, which that heat has frozen.

    On the mesh the front is at a vertex: its own derivative is 0 or unbounded, and not stated. Heat
    of 21 s through cells of 1.2 mm, twelve of which freeze.
    """
    case = castfem.load("verification/neumann").with_(MELT)
    names = {"steel.latent_heat": (3, 1e3), "steel.conductivity": (0, 0.01 * NUMBERS[0])}
    found = castfem.sensitivities(case, list(names), "heat_removed")
    for name, (place, unit) in names.items():
        heats = []
        for sign in (1.0, -1.0):
            k, density, c, latent, surface, melting, poured = (
                value * (1.0 + 1e-4 * sign * (number == place))
                for number, value in enumerate(NUMBERS)
            )
            form = Neumann((k, c), (k, c), density, latent, surface, melting, poured)
            heats.append(2.0 * 21.0 * form.flux(21.0) * 1.2e-3)
        exact = unit * (heats[0] - heats[1]) / (2e-4 * NUMBERS[place])
        assert found.gradient["heat_removed"][name] == pytest.approx(exact, rel=1e-2), name


# Laws that derivatives do not evaluate again: stored differences, unchanged laws


def _curve(solidus: float, slope: float = 0.0, jump: float = 0.0) -> ThermalCurve:
    """Return a steel that freezes from 1780 K, and there isothermally by `jump` (J/m3)."""
    knots = np.array([300.0, solidus, 1780.0, 1900.0])
    capacity, latent = np.array([4e6, 5e6, 6e6]), np.array([0.0, 3e7, 0.0])
    jumps, k = np.array([0.0, 0.0, jump, 0.0]), np.array([30.0, 32.0, 35.0])
    tables = (knots, capacity, (1.0 + slope) * capacity, latent, jumps)
    return ThermalCurve(tables, (knots, k, (1.0 + slope) * k), 1850.0)


@pytest.mark.parametrize("slope", [0.0, 0.1])
@pytest.mark.parametrize("jump", [0.0, 2e9])
def test_difference_of_curves_is_that_of_their_values(slope: float, jump: float) -> None:
    above, below = _curve(1740.01, slope, jump), _curve(1739.99, slope, jump * 1.00001)
    ends = above.enthalpy(250.0), above.enthalpy(2000.0)
    met = [curve.enthalpy(curve.knots, side) for curve in (above, below) for side in ("left",)]
    enthalpy = np.concatenate([np.linspace(*ends, 501), *met])
    difference = CurveDifference(above, below)
    one, other = above.at(enthalpy), below.at(enthalpy)
    assert np.abs(one.temperature - other.temperature).max() > 1e-3
    for found, first, second, size in (
        (difference.temperature, one.temperature, other.temperature, 2000.0),
        (difference.conduction, one.conduction, other.conduction, 5e4),
    ):
        assert found(enthalpy) == pytest.approx(first - second, rel=0.0, abs=1e-14 * size)


def _cooling(law: SurfaceLaw, dofs: int = 4) -> Cooling:
    return Cooling([(Patch(np.arange(dofs), np.ones(dofs)), law)], [])


def test_unchanged_laws_are_distinguished_from_changed_ones() -> None:
    beside = (Convection(100.0, 400.0),)
    one = Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=beside)
    same = Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=(Convection(100.0, 400.0),))
    assert same_laws(_cooling(one), _cooling(same))
    others = [
        Contact(1601.0, 430.0, 0.15, gap=np.zeros(4), beside=beside),
        Contact(1600.0, 430.0, 0.15, gap=np.full(4, 1e-4), beside=beside),
        Contact(1600.0, 430.0, 0.15, gap=np.zeros(4), beside=(Convection(101.0, 400.0),)),
        Contact(1600.0, 430.0, 0.15, gap=np.zeros(4)),
        Contact(1600.0, lambda time: 430.0, 0.15, gap=np.zeros(4), beside=beside),
        Convection(1600.0, 430.0),
    ]
    assert not any(same_laws(_cooling(one), _cooling(other)) for other in others)
    assert not same_laws(_cooling(one), _cooling(same, 5))
    assert not same_laws(_cooling(one), Cooling([], []))


def test_slope_at_a_jump_or_kink_is_that_of_one_side() -> None:
    def jumps(t: Array) -> Array:
        return np.where(t > 1000.0, 1e9, 0.0) + 3.0 * t

    def bends(t: Array) -> Array:
        return np.where(t > 1000.0, 5.0, 2.0) * (t - 1000.0)

    at = np.array([900.0, 1000.0, 1000.0 + 0.5 * DIFFERENCES.warmer])
    assert slope_by_temperature(jumps, at, jumps(at)) == pytest.approx([3.0, 3.0, 3.0], rel=1e-3)
    assert slope_by_temperature(bends, at, bends(at))[:2] == pytest.approx([2.0, 2.0])
    smooth = slope(np.array([1.0201]), np.array([1.0]), np.array([0.9801]), 0.01)
    assert smooth == pytest.approx([2.0])  # it bends, and has no kink there


def test_narrow_blend_has_its_slope_at_its_begin() -> None:
    """Like the weight of delta ferrite, whose blend is narrow: that is no kink."""

    def blended(t: Array) -> Array:
        x = np.clip((t - 1700.0) / 3.0, 0.0, 1.0)
        return x * x * (3.0 - 2.0 * x)

    for x in (0.01, 0.1, 0.5, 0.99):
        at = np.array([1700.0 + 3.0 * x])
        (found,) = slope_by_temperature(blended, at, blended(at))
        assert found == pytest.approx(2.0 * x * (1.0 - x), rel=1e-5), x


# Effect of the shape on the heat balance, compared with differences of assembled forms


@pytest.mark.parametrize("what", ["volume", "perimeter"])
def test_form_changes_with_the_motion_of_the_slice(what: str) -> None:
    """By displacement and by two generalized strains, both motions at once."""
    simulation = build(short(), MPI.COMM_SELF)
    section, shape = simulation.section, simulation.problem.shape
    name, form = "heat.volume.moved", shape.volume
    if what == "perimeter":
        name, form = next(iter(simulation.zones.surface.forms().values()))
    rng, size = np.random.default_rng(0), len(shape.displacement.x.array)
    here = 1e-5 * rng.standard_normal(size), np.array([1e-3, 0.0, 0.0, 2e-3])
    moves = rng.standard_normal((2, size)), np.array([[0.5, 0, 0, 0], [-1.0, 0, 0, 2.0]])
    shape.take(*here)
    by_motion = ByMotion(section, shape, name, form)
    found = by_motion(*moves)
    assert shape.generalized_strains.value == pytest.approx(here[1], abs=0.0)
    compiled, step = section.compile(name, form), 1e-8
    for number in range(2):
        ends = []
        for sign in (1.0, -1.0):
            shape.take(
                *(at + sign * step * move[number] for at, move in zip(here, moves, strict=True))
            )
            ends.append(assemble_owned(compiled, section.owned))
        known = (ends[0] - ends[1]) / (2.0 * step)
        assert np.abs(found[number] - known).max() < 1e-6 * np.abs(known).max()
    by_motion.destroy()
    simulation.destroy()
