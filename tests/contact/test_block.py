"""An elastic block and a tapered wall that is pushed into it: resultant, iterations, units."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from castfem.physics.contact.summary import summary
from contact.setups import tapered_block

# With the penalty the wall is a spring: to 0.05 % it must be 500 times as stiff as a cell.
FACTORS = {"penalty": 1000.0, "nitsche": None}
METHODS = tuple(FACTORS)
CELLS = ("quadrilateral", "triangle")
FORCE = 40e9 / (1 - 0.3**2) * 0.03e-3  # E/(1 - nu^2) times the mean closure, per length of wall
STEPS = np.linspace(0.1, 1.0, 10)


@pytest.mark.parametrize(("method", "cell"), zip(METHODS, CELLS, strict=True))
def test_resultant(method: str, cell: str) -> None:
    setup = tapered_block(method, cell=cell, factor=FACTORS[method])
    for time in STEPS:
        result = setup.step(time)
        assert result.newton <= 5
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert -found.force[1] == pytest.approx(FORCE, rel=5e-4)
    assert found.share == 1.0
    assert found.penetration < 2e-8
    assert found.points[0] == 0


UNITS = ((1e-3, 1.0), (1.0, 1e6), (1e-3, 1e6), (1e3, 1e-6))  # m, Pa


@pytest.mark.parametrize(("method", "cell"), zip(METHODS, CELLS, strict=True))
def test_units_do_not_matter(method: str, cell: str) -> None:
    """Units of length and stress, apart and together: the same iterations, the same numbers."""
    setups = [tapered_block(method, *unit, cell=cell) for unit in ((1.0, 1.0), *UNITS)]
    for time in STEPS:
        one, *others = (setup.step(time) for setup in setups)
        first = one.state.contact
        top = first.pressure.max()
        for other, (_, stress) in zip(others, UNITS, strict=True):
            second = other.state.contact
            assert other.newton == one.newton
            assert np.array_equal(second.status, first.status)
            assert second.pressure * stress == pytest.approx(first.pressure, abs=1e-6 * top)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("factor", [300.0, 3e5])
def test_three_decades_of_stiffness(method: str, factor: float) -> None:
    setup = tapered_block(method, factor=factor / 100 if method == "nitsche" else factor)
    for time in STEPS:
        assert setup.step(time).newton <= 5
    found = summary(setup.problem.contact, setup.state.contact, setup.state.generalized_strains)
    assert -found.force[1] == pytest.approx(FORCE, rel=5e-4)


@pytest.mark.parametrize("method", METHODS)
def test_a_failed_step_leaves_nothing_behind(method: str) -> None:
    """The old state is as it was, to the bit, and the next try goes as if nothing had been."""
    setup = tapered_block(method, options={"snes_max_it": 6})
    setup.step(0.1)
    old = setup.state
    assert old.contact is not None
    kept = {f.name: np.copy(getattr(old.contact, f.name)) for f in fields(old.contact)}
    moved = old.displacement.copy()
    good = setup.stepper.step(old, 0.2, old.temperature)
    bad = tapered_block(method, options={"snes_max_it": 1})
    failed = bad.stepper.step(bad.state, 0.5, bad.state.temperature)
    assert not failed.converged and failed.state is bad.state
    setup.problem.solver.snes.setTolerances(max_it=1)
    failed = setup.stepper.step(old, 0.5, old.temperature)
    assert not failed.converged and failed.state is old
    for name, value in kept.items():
        assert np.array_equal(getattr(old.contact, name), value), name
    assert np.array_equal(old.displacement, moved)
    setup.problem.solver.snes.setTolerances(max_it=6)
    again = setup.stepper.step(old, 0.2, old.temperature)
    assert np.array_equal(again.state.displacement, good.state.displacement)
    assert np.array_equal(again.state.contact.pressure, good.state.contact.pressure)
    assert again.newton == good.newton


def test_no_contact_compiles_no_contact() -> None:
    from mechanics.setups import SliceSetup, box, mapped

    setup = SliceSetup(mapped(2, 2, box(1.0, 1.0)))
    assert setup.problem.contact is None and setup.state.contact is None
    assert not [name for name in setup.section.compiled if "contact" in name]
