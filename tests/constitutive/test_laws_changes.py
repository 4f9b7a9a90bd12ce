"""How the answer of a law changes with what a step is given: against differences of answers."""

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
WIDE = (1e-4, 1e-5)  # of what is given: distances of differences


def sized(rng: np.random.Generator, of: Array) -> Array:
    """Changes in all ways of the size of what they change."""
    return np.asarray(rng.uniform(-1.0, 1.0, (WAYS, *of.shape)) * of)


def limited(rows: Array, most: float) -> Array:
    """Rows (n, 4) made no longer than `most`."""
    length = np.linalg.norm(rows, axis=1)[:, None]
    return np.asarray(rows * np.minimum(1.0, most / np.maximum(length, 1e-300)))


def asked(law: RadialReturn) -> tuple[MaterialStep, Array, Array, Array, StepChange]:
    """A step of random states, from solid to liquid, and random changes of it."""
    states = random_states(law, POINTS, 1, 5)
    ((step, stress, state),) = states.parts()
    strain = limited(step.strain_increment * (DT / step.dt), 1e-3)
    stress = limited(stress, 1e8) * (step.temperature_old <= SOLIDUS)[:, None]
    step = replace(step, dt=DT, strain_increment=strain)
    rng = np.random.default_rng(7)
    coefficients = law.coefficients(step.temperature_old, step.temperature)
    ways = sized(rng, coefficients)
    ways[:, coefficients == 1.0] = 0.0  # shares of one phase, of a whole step
    change = StepChange(
        coefficients=ways,
        strain=sized(rng, step.strain_increment),
        thermal=sized(rng, step.thermal_increment),
        stress_old=sized(rng, stress),
        state_old=sized(rng, state),
        dt=rng.uniform(-DT, DT, WAYS),
    )
    return step, stress, state, coefficients, change


def answered(law: RadialReturn, way: int, by: float) -> Response:
    """The answer as it is some way along a change."""
    step, stress, state, coefficients, change = asked(law)
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
    """Of answers on both sides, and which points do the same on both."""
    above, below = (answered(law, way, sign * by) for sign in (1.0, -1.0))
    found = {name: (getattr(above, name) - getattr(below, name)) / (2.0 * by) for name in PARTS}
    return found, above.flows == below.flows


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_changes_are_differences_of_answers(law: RadialReturn) -> None:
    """As nearly as differences over two distances agree, which they do but where flow sets in."""
    step, stress, state, coefficients, change = asked(law)
    here = law.integrate(step, stress, state, coefficients=coefficients)
    found = law.differentiate(step, stress, state, change, coefficients=coefficients)
    shear = coefficients[:, constants.SHEAR]
    trial = np.abs(stress).max(axis=1) + shear * np.abs(step.strain_increment).max(axis=1)
    strained = 1e-2 * trial / shear  # what the state of a point that hardly flows is to be seen by
    # Where nearly all stress is lost it is a difference of nearly equal numbers.
    clear = ~here.flows | (equivalent_stress(here.stress) > 1e-3 * trial)
    for way in range(WAYS):
        (far, _), (near, alike) = (differences(law, way, by) for by in WIDE)
        alike &= clear
        for name in PARTS[:: 1 if state.size else 2]:
            now, known = getattr(here, name), near[name]
            size = np.maximum(np.abs(now), np.abs(known))
            if name == "stress":
                size = np.repeat(size.max(axis=1)[:, None], 4, axis=1)
            elif name == "state":
                size = size + strained[:, None]
            else:
                size += strained * np.abs(here.stress).max(axis=1)
            apart, off = np.abs(far[name] - known), np.abs(getattr(found, name)[way] - known)
            sure = ((apart <= 1e-3 * size).T & alike).T
            assert sure.mean() > 0.9, name
            assert (off[sure] <= 3.0 * apart[sure] + 1e-6 * size[sure]).all(), name


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_the_tangent_is_the_change_by_strain(law: RadialReturn) -> None:
    """The tangent is written by hand, the change follows from the flow stress."""
    step, stress, state, coefficients, change = asked(law)
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


@pytest.mark.parametrize("name", ["hoff", "steel", "steel signed", "yield given"])
def test_what_flows_goes_on_flowing(name: str) -> None:
    """At the yield limit the change is that of the side the point is on."""
    law = LAWS[name]
    step, stress, state, coefficients, change = asked(law)
    here = law.integrate(step, stress, state, coefficients=coefficients)
    found = law.differentiate(step, stress, state, change, coefficients=coefficients)
    elastic = ~here.flows
    assert elastic.any() and not elastic.all()
    assert not found.dissipation[:, elastic].any()


def test_nothing_given_nothing_changed() -> None:
    law = LAWS["steel blend signed recovering"]
    step, stress, state, coefficients, change = asked(law)
    none = StepChange(
        *(np.zeros_like(getattr(change, part)) for part in
          ("coefficients", "strain", "thermal", "stress_old", "state_old", "dt"))
    )  # fmt: skip
    found = law.differentiate(step, stress, state, none, coefficients=coefficients)
    assert isinstance(found, ResponseChange)
    for name in PARTS:
        assert not getattr(found, name).any(), name


@pytest.mark.parametrize("exponent", [0.003, 0.005, 0.008, 0.01])
def test_a_law_that_hardly_knows_the_rate_has_finite_changes(exponent: float) -> None:
    """At low stress its increments are all but 0, and dS/d dp all but as large as numbers are."""
    constants_of = [Constant(value) for value in (300e6, 0.0, exponent, 0.0, 0.0)]
    law = NortonHoff(steel_like(), *constants_of)
    count, along = 20000, np.array([1.0, 0.0, 0.0, 0.0])
    stress = np.geomspace(1e5, 1e8, count)[:, None] * along
    nothing, warm = np.zeros(count), np.full(count, 1200.0)
    step = MaterialStep(np.zeros((count, 4)), nothing, warm, warm, DT)
    state = law.initial_state(count)
    here, columns = law.integrate(step, stress, state), law.coefficients(warm, warm)
    given = np.array([1e8, 1e10, 1e11])
    change = StepChange(
        coefficients=np.zeros((3, *columns.shape)), strain=np.zeros((3, count, 4)),
        thermal=np.zeros((3, count)), stress_old=given[:, None, None] * np.tile(along, (count, 1)),
        state_old=np.zeros((3, *state.shape)), dt=np.zeros(3),
    )  # fmt: skip
    found = law.differentiate(step, stress, state, change)
    assert here.flows.any()
    assert (np.abs(found.stress) <= (1.0 + 1e-9) * given[:, None, None]).all()
