"""States the model cannot speak of are refused: the solid judged strictly, the liquid less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from castfem.physics.constitutive import load_law
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from mechanics.setups import SliceSetup, box, mapped

SIZE, COLD, HOT = 0.1, 1000.0, 1800.0
LAW = ThermoElastic(Elasticity.constant(1e10, 0.3, Solidity.between(1700.0, 1750.0)))


def refusal(
    temperature: float,
    *,
    large: bool = False,
    generalized_strains: tuple[float, ...] = (0, 0, 0, 0),
    right: float | None = None,
    law: Law = LAW,
    path: float = 0.0,
    **u: float,
) -> str:
    """What is said of a square of 4 x 4 cells whose middle, or all of it, is displaced.

    Args:
        temperature: Of all of it, K.
        large: Whether strain is large.
        generalized_strains: Generalized strains.
        right: Of its right half, K, if that is another.
        law: Of the material.
        path: Viscoplastic strain that it has summed up.
        u: "middle": the middle node along x, m; "xx", "xy", "yx", "yy": displacement gradients;
            "half": that is yx of the right half alone.
    """
    given = {"large_strain": large}
    setup = SliceSetup(mapped(4, 4, box(SIZE, SIZE)), law, judge=True, given=given)
    problem, judge = setup.problem, setup.stepper._validity
    assert judge is not None
    x, y = problem.space.tabulate_dof_coordinates()[:, :2].T
    along = u.get("xx", 0.0) * x + u.get("xy", 0.0) * y
    moved = np.column_stack([along, u.get("yx", 0.0) * x + u.get("yy", 0.0) * y])
    moved[np.hypot(x - 0.5 * SIZE, y - 0.5 * SIZE) < 1e-9, 0] += u.get("middle", 0.0)
    moved[:, 1] += u.get("half", 0.0) * np.maximum(x - 0.5 * SIZE, 0.0)
    problem.fields.u.x.array[:] = moved.ravel()
    problem.fields.generalized_strains.value[:] = generalized_strains
    state = replace(
        setup.state,
        displacement=moved.ravel(),
        generalized_strains=np.array(generalized_strains, float),
        internal=np.full_like(setup.state.internal, path),
    )
    heat = np.full(problem.points.count, temperature)
    if right is not None:
        heat[problem.points.position[:, 0] > 0.5 * SIZE] = right
    return judge.refusal(state, heat)


@pytest.mark.parametrize("large", [False, True])
def test_what_is_as_it_was_is_kept(large: bool) -> None:
    assert refusal(COLD, large=large) == "" == refusal(HOT, large=large)
    assert refusal(COLD, large=large, xx=-0.02, generalized_strains=(-0.02, 0.1, 0.1, 0.01)) == ""


def test_liquid_that_folds_means_nothing_at_small_strain() -> None:
    """Its stand-in may distort; where the equations are those of the slice as it is it may not."""
    assert refusal(HOT, middle=0.15 * SIZE) == ""
    assert "the liquid folds" in refusal(HOT, middle=0.15 * SIZE, large=True)
    for large in (False, True):
        assert "the shell folds" in refusal(COLD, middle=0.15 * SIZE, large=large)


@pytest.mark.parametrize("temperature", [COLD, HOT])
def test_thickness(temperature: float) -> None:
    """The planes are those of solid and liquid alike."""
    for a0, times in ((-1.2, -0.2), (-1.0, 0.0), (-0.15, 0.85), (0.2, 1.2)):
        assert f"{times:.3g} times as thick" in refusal(
            temperature, generalized_strains=(a0, 0, 0, 0)
        )
    assert refusal(temperature, generalized_strains=(0.2, 0, 0, 0), large=True) == ""
    assert "as thick" in refusal(temperature, generalized_strains=(0, -12.0, 0, 0))
    assert "as thick" in refusal(temperature, generalized_strains=(0, -12.0, 0, 0), large=True)
    assert "times as thick" in refusal(temperature, generalized_strains=(np.nan, 0, 0, 0))


def test_small_strain_has_a_range() -> None:
    """A shell that turns, a section that bulges: at large strain both are what they are."""
    told = refusal(COLD, xy=-0.25, yx=0.25)
    assert "the shell turns by 0.245 rad (at most 0.2)" in told and "strain" in told
    assert refusal(COLD, xy=-0.25, yx=0.25, large=True) == ""
    assert refusal(HOT, xy=0.05) == ""
    assert "bulge or shrinkage is 0.15" in refusal(COLD, xx=0.15)
    assert "look at loads" in refusal(COLD, xx=0.15)
    assert "look at loads" in refusal(HOT, xx=0.15)
    assert "there is no shell yet" in refusal(HOT, generalized_strains=(0.15, 0, 0, 0))
    assert refusal(HOT, xx=0.15, large=True) == ""


@pytest.mark.parametrize("temperature", [COLD, HOT])
@pytest.mark.parametrize("change", [0.35, -0.35, 4.8])
def test_no_section_bulges_or_shrinks_by_a_third(temperature: float, change: float) -> None:
    """Soft liquid without a shell that runs apart to 4.8 times its size is no strand."""
    for along in ("xx", "yy"):
        told = refusal(temperature, large=True, **{along: change})
        assert f"bulge or shrinkage is {abs(change):.3g} of the section (at most 0.3)" in told
    assert "bulge" not in refusal(temperature, large=True, xx=0.25)


def test_what_has_turned_as_liquid_is_told_from_a_shell_that_turns() -> None:
    """The right half turns by atan(0.3), and is 10 or 700 K below the solidus of 1700 K."""
    fresh = "and no more than 0 rad where it is 50 K below its solidus: cells of the front"
    for right, told in ((1690.0, True), (COLD, False)):
        found = refusal(COLD, half=0.6, right=right)
        assert "the shell turns by 0.291 rad (at most 0.2)" in found
        assert (fresh in found) == told
    # Nothing is colder: it is not known which it is.
    assert "below its solidus" not in refusal(1690.0, half=0.6)


def test_strain_that_is_borne() -> None:
    """A bar drawn out beyond 10 %, and one that is squeezed on all sides, are taken back."""
    for component, value, told in ((0, 0.15, "strained by 0.15"), (None, -0.03, "mean stress")):
        setup = SliceSetup(mapped(1, 1, box(SIZE, SIZE)), LAW, judge=True, start=COLD)
        stress = np.zeros((setup.problem.points.count, 4))
        if component is None:
            stress[:, :3] = 3.0 * 1e10 / (3.0 * (1.0 - 0.6)) * value
        else:
            stress[:, component] = value * 3.0 * 1e10 / 2.6
        judge = setup.stepper._validity
        assert judge is not None
        temperature = np.full(setup.problem.points.count, COLD)
        state = replace(setup.state, stress=stress)
        assert told in judge.refusal(state, temperature)
        assert judge.refusal(state, np.full_like(temperature, HOT)) == ""


def test_strain_to_and_fro_is_no_strain() -> None:
    """What hardening has summed up counts as far as the cell is distorted: 0.086 and 0.104 here."""
    law = load_law("kozlowski_zhu", LAW.elasticity, carbon=0.1)
    for drawn, kept in ((0.075, True), (0.09, False)):
        found = refusal(COLD, law=law, path=0.3, xx=drawn, generalized_strains=(-drawn, 0, 0, 0))
        assert (found == "") == kept and ("strained by 0.104" in found) == (not kept)
        assert refusal(COLD, law=law, path=0.09, xx=drawn) == ""
    # At large strain the path counts, whose limit is ten times as much.
    for path, kept in ((0.3, True), (1.1, False)):
        assert (refusal(COLD, law=law, path=path, large=True) == "") == kept
