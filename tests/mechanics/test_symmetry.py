"""Whole, half and quarter are one; so are a section and the same lying on its side."""

from __future__ import annotations

import numpy as np
import pytest

from mechanics.casting import CastSetup, billet_mesh

SIZES = {"width": 0.1, "height": 0.08, "surface_size": 2e-3, "core_size": 1e-2}


def values(setup: CastSetup) -> dict[tuple[float, float], np.ndarray]:
    """Displacement and stress by vertex in the first quadrant."""
    moved, stress = setup.moved, setup.stress
    found = {}
    for (x, y), u, s in zip(setup.vertices, moved, stress, strict=True):
        if x > -1e-9 and y > -1e-9:
            if min(x, y) < 1e-9:
                s[3] = 0.0  # odd across the axes: its mean around them is one-sided in a quarter
            found[round(x * 1e6) + 0.0, round(y * 1e6) + 0.0] = np.concatenate([u / 1e-4, s / 1e6])
    return found


@pytest.mark.parametrize(("radius", "cell"), [(5e-3, "quadrilateral"), (0.0, "triangle")])
def test_whole_half_and_quarter_agree(radius: float, cell: str) -> None:
    """In stress and displacement; the pins of the whole section carry no force."""
    if radius and cell == "triangle":
        pytest.skip("unstructured triangles of a whole section are no mirror images")
    setups = {
        name: CastSetup(billet_mesh(name, cell=cell, corner_radius=radius, **SIZES)).advance(
            1.0, 0.25
        )
        for name in ("quarter", "half", "whole")
    }
    free = {"quarter": ("a0",), "half": ("a0", "a2"), "whole": ("a0", "a1", "a2")}
    quarter = values(setups["quarter"])
    for name, setup in setups.items():
        assert setup.problem.slice.planes.free == free[name]
        assert setup.state.generalized_strains[0] == pytest.approx(
            setups["quarter"].state.generalized_strains[0], rel=1e-7
        )
        assert np.abs(setup.state.generalized_strains[1:]).max() < 1e-7
        others = values(setup)
        assert len(others) == len(quarter)
        tolerance = 1e-6 if cell == "quadrilateral" else 2e-2
        worst = max(float(np.abs(others[k] - quarter[k]).max()) for k in quarter)
        assert worst < tolerance
        balance = setup.results[-1].balance
        assert balance is not None
        if name == "whole":
            pressure = setup.state.pressure.max() * 0.1
            assert np.abs(balance.support).max() < 1e-6 * pressure


def test_a_section_on_its_side() -> None:
    """Rotated by 90 degrees: displacement and stress turn with it."""
    upright = CastSetup(billet_mesh(**SIZES)).advance(1.0, 0.25)
    lying = CastSetup(billet_mesh(**(SIZES | {"width": 0.08, "height": 0.1}))).advance(1.0, 0.25)
    one, other = values(upright), values(lying)
    swap = [1, 0, 3, 2, 4, 5]
    assert len(one) == len(other)
    for (x, y), found in one.items():
        assert np.abs(other[y, x][swap] - found).max() < 1e-6
    assert lying.state.generalized_strains[0] == pytest.approx(
        upright.state.generalized_strains[0], rel=1e-8
    )


def test_supports_of_a_quarter_carry_the_pressure() -> None:
    """On each line of symmetry what the stress and the pressure leave: nothing in all."""
    setup = CastSetup(billet_mesh()).advance(1.0, 0.25)
    balance = setup.results[-1].balance
    assert balance is not None
    pressure = setup.state.pressure.max()
    assert np.abs(balance.support).max() < 1e-6 * pressure * 0.0625
    assert abs(balance.axial[0]) < 1e-6 * pressure * 0.0625**2
    assert balance.forces_error < 1e-8
    assert balance.axial_error < 1e-8
