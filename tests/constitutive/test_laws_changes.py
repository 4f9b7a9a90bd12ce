"""Derivatives of the response of a law by its input, compared with finite differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from castfem.base.tables import Constant
from castfem.base.types import Array, Flags
from castfem.physics.constitutive import MaterialStep, NortonHoff, Response, equivalent_stress
from castfem.physics.constitutive.base import ResponseChange, StepChange
from castfem.physics.constitutive.flow_laws import RadialReturn
from castfem.physics.constitutive.kernel import constants

from .samples import SOLIDUS, every_law, random_states, steel_like

LAWS = every_law()
POINTS, WAYS, DT = 4000, 3, 0.2
PARTS = ("stress", "state", "dissipation")
DISTANCES = (1e-4, 1e-5)  # of the finite differences, relative to the input


def sized(rng: np.random.Generator, of: Array) -> Array:
    """Return random changes of the size of `of`, one for each direction of change."""
    return np.asarray(rng.uniform(-1.0, 1.0, (WAYS, *of.shape)) * of)


def limited(rows: Array, most: float) -> Array:
    """Scale rows (n, 4) so that none is longer than `most`."""
    length = np.linalg.norm(rows, axis=1)[:, None]
    return np.asarray(rows * np.minimum(1.0, most / np.maximum(length, 1e-300)))


def step_and_change(law: RadialReturn) -> tuple[MaterialStep, Array, Array, Array, StepChange]:
    """Return a step of random states, from solid to liquid, and random changes of its input."""
    states = random_states(law, POINTS, 1, 5)
    ((step, stress, state),) = states.parts()
    strain = limited(step.strain_increment * (DT / step.dt), 1e-3)
    stress = limited(stress, 1e8) * (step.temperature_old <= SOLIDUS)[:, None]
    step = replace(step, dt=DT, strain_increment=strain)
    rng = np.random.default_rng(7)
    coefficients = law.coefficients(step.temperature_old, step.temperature)
    ways = sized(rng, coefficients)
    ways[:, coefficients == 1.0] = 0.0  # fractions of a single phase and of a complete step
    change = StepChange(
        coefficients=ways,
        strain=sized(rng, step.strain_increment),
        thermal=sized(rng, step.thermal_increment),
        stress_old=sized(rng, stress),
        state_old=sized(rng, state),
        dt=rng.uniform(-DT, DT, WAYS),
    )
    return step, stress, state, coefficients, change


def moved_response(law: RadialReturn, way: int, by: float) -> Response:
    """Return the response to the input moved by a multiple of a change."""
    step, stress, state, coefficients, change = step_and_change(law)
    moved = MaterialStep(
        step.strain_increment + by * change.strain[way],
        step.thermal_increment + by * change.thermal[way],
        step.temperature_old,
        step.temperature,
        step.dt + by * float(change.dt[way]),
    )
    return law.integrate(
        moved, stress + by * change.stress_old[way], state + by * change.state_old[way],
        coefficients=coefficients + by * change.coefficients[way],
    )  # fmt: skip


def differences(law: RadialReturn, way: int, by: float) -> tuple[dict[str, Array], Flags]:
    """Return central differences, and the points that flow on both sides or on neither."""
    above, below = (moved_response(law, way, sign * by) for sign in (1.0, -1.0))
    found = {name: (getattr(above, name) - getattr(below, name)) / (2.0 * by) for name in PARTS}
    return found, above.flows == below.flows


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_changes_match_differences_of_responses(law: RadialReturn) -> None:
    """The error is at most that of the differences, estimated from two distances."""
    step, stress, state, coefficients, change = step_and_change(law)
    here = law.integrate(step, stress, state, coefficients=coefficients)
    found = law.differentiate(step, stress, state, change, coefficients=coefficients)
    shear = coefficients[:, constants.SHEAR]
    trial = np.abs(stress).max(axis=1) + shear * np.abs(step.strain_increment).max(axis=1)
    strained = 1e-2 * trial / shear  # scale for the state of a point that hardly flows
    # Where nearly all stress relaxes, the stress is a difference of nearly equal numbers.
    clear = ~here.flows | (equivalent_stress(here.stress) > 1e-3 * trial)
    for way in range(WAYS):
        (far, _), (near, alike) = (differences(law, way, by) for by in DISTANCES)
        alike &= clear
        for name in PARTS[:: 1 if state.size else 2]:
            value, difference = getattr(here, name), near[name]
            size = np.maximum(np.abs(value), np.abs(difference))
            if name == "stress":
                size = np.repeat(size.max(axis=1)[:, None], 4, axis=1)
            elif name == "state":
                size = size + strained[:, None]
            else:
                size += strained * np.abs(here.stress).max(axis=1)
            apart = np.abs(far[name] - difference)
            off = np.abs(getattr(found, name)[way] - difference)
            sure = ((apart <= 1e-3 * size).T & alike).T
            assert sure.mean() > 0.9, name
            assert (off[sure] <= 3.0 * apart[sure] + 1e-6 * size[sure]).all(), name


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_tangent_is_derivative_by_strain(law: RadialReturn) -> None:
    """The tangent is coded by hand; the change follows from the flow stress."""
    step, stress, state, coefficients, change = step_and_change(law)
    tangent = law.integrate(step, stress, state, coefficients=coefficients).tangent
    none = {name: np.zeros((4, *getattr(change, name).shape[1:])) for name in
            ("coefficients", "thermal", "stress_old", "state_old", "dt")}  # fmt: skip
    strain = np.repeat(np.eye(4)[:, None], POINTS, axis=1)
    by_strain = StepChange(strain=strain, **none)
    found = law.differentiate(step, stress, state, by_strain, coefficients=coefficients)
    size = np.abs(tangent).max(axis=(1, 2))[:, None]
    for way in range(4):
        off = np.abs(found.stress[way] - tangent[:, :, way]) / size
        assert off.max() < 1e-6, way


@pytest.mark.parametrize("name", ["hoff", "steel", "steel signed", "yield limit"])
def test_change_of_an_elastic_point_has_no_flow(name: str) -> None:
    """At the yield limit the change is one-sided: that of the branch the point is on."""
    law = LAWS[name]
    step, stress, state, coefficients, change = step_and_change(law)
    here = law.integrate(step, stress, state, coefficients=coefficients)
    found = law.differentiate(step, stress, state, change, coefficients=coefficients)
    elastic = ~here.flows
    assert elastic.any() and not elastic.all()
    assert not found.dissipation[:, elastic].any()


def test_zero_change_of_input_gives_zero_change() -> None:
    law = LAWS["steel blend signed recovering"]
    step, stress, state, coefficients, change = step_and_change(law)
    none = StepChange(
        *(np.zeros_like(getattr(change, part)) for part in
          ("coefficients", "strain", "thermal", "stress_old", "state_old", "dt"))
    )  # fmt: skip
    found = law.differentiate(step, stress, state, none, coefficients=coefficients)
    assert isinstance(found, ResponseChange)
    for name in PARTS:
        assert not getattr(found, name).any(), name


@pytest.mark.parametrize("exponent", [0.003, 0.005, 0.008, 0.01])
def test_nearly_rate_independent_law_has_finite_changes(exponent: float) -> None:
    """At low stress dp underflows almost to 0, and dS/d dp almost overflows."""
    parameters = [Constant(value) for value in (300e6, 0.0, exponent, 0.0, 0.0)]
    law = NortonHoff(steel_like(), *parameters)
    count, along = 20000, np.array([1.0, 0.0, 0.0, 0.0])
    stress = np.geomspace(1e5, 1e8, count)[:, None] * along
    nothing, warm = np.zeros(count), np.full(count, 1200.0)
    step = MaterialStep(np.zeros((count, 4)), nothing, warm, warm, DT)
    state = law.initial_state(count)
    here, coefficients = law.integrate(step, stress, state), law.coefficients(warm, warm)
    stress_change = np.array([1e8, 1e10, 1e11])
    change = StepChange(
        coefficients=np.zeros((3, *coefficients.shape)), strain=np.zeros((3, count, 4)),
        thermal=np.zeros((3, count)),
        stress_old=stress_change[:, None, None] * np.tile(along, (count, 1)),
        state_old=np.zeros((3, *state.shape)), dt=np.zeros(3),
    )  # fmt: skip
    found = law.differentiate(step, stress, state, change)
    assert here.flows.any()
    assert (np.abs(found.stress) <= (1.0 + 1e-9) * stress_change[:, None, None]).all()
