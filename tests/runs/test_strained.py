"""Runs with mechanics: files, axial forces, steps, friction and the first shell.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from runs.billet_runs import FED, Kept, billet, cells, run, run_in_memory, shipped

from castfem.base.errors import RunFailure
from castfem.model import Case, load_case, shipped_cases
from castfem.model.build.simulation import build
from castfem.physics.contact.state import SLIP
from castfem.runs.output.fields import Fields
from castfem.runs.output.history import read_history

CASES = Path(__file__).parents[2] / "cases"
IDEALISED_CELLS = (*cells(2, 10, 15), "coupling.interval=0.25 s", "casting.length=120 mm")


def idealised(*overrides: str) -> Case:
    return load_case(CASES / "billet125" / "idealised.toml", (*IDEALISED_CELLS, *overrides))


def test_fields_history_and_balances(tmp_path: Path) -> None:
    summary = run(idealised("output.every=0.5 s"), tmp_path)
    with Fields(tmp_path) as fields:
        assert {"displacement", "stress", "von_mises", "viscoplastic_strain"} < set(fields.names)
        last = len(fields.times) - 1
        stress, mises = fields.values("stress", last), fields.values("von_mises", last)
        moved = fields.values("displacement", last)
    assert stress.shape[1] == 9 and moved.shape[1] == 3
    assert not moved[:, 2].any()
    # Averages over the same points: the equivalent of the mean is below the mean equivalent.
    tensor = stress.reshape(-1, 3, 3)
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
    of_mean = np.sqrt(1.5 * np.einsum("nij,nij->n", deviator, deviator))
    assert (of_mean <= mises * (1 + 1e-5) + 10.0).all()
    history = read_history(tmp_path / "history.csv")
    last_row = history.iloc[-1]
    assert last_row["von_mises_max"] == pytest.approx(
        1e-6 * summary.quantities["von_mises_max"].value, rel=1e-9
    )
    assert summary.quantities["size_mid_face"].value == pytest.approx(
        0.125 + 2e-3 * last_row["displacement_mid_face"], rel=1e-12
    )
    assert history["force_error"].max() < 1e-6
    assert summary.balances["axial force"]["error"].value < 1e-6
    assert summary.balances["heat"]["whole"].value < 1e-9
    assert summary.steps["coupling windows"] == 8


def test_dissipation_heats(tmp_path: Path) -> None:
    """The work dissipated by flow is in the heat balance, and can be left out."""
    with_, without = (
        run(idealised(f"coupling.dissipation={share}"), tmp_path / str(share)) for share in (1, 0)
    )
    generated = [s.balances["heat"]["generated"].value for s in (with_, without)]
    assert generated[0] > 0.0 == generated[1]
    assert with_.balances["heat"]["whole"].value < 1e-9


# A strip that freezes at one temperature has no mushy zone: its skeleton changes nothing


def test_skeleton_at_isothermal_freezing_changes_nothing() -> None:
    """When its flow stress fell to zero with the solid fraction, its cells folded."""
    path = shipped_cases.find("verification/weiner_boley_coarse")
    found = []
    for mush in ("none", "skeleton"):
        kept = run_in_memory(load_case(path, (f"mechanics.mush={mush}", "casting.length=20 mm")))
        state = kept.states[-1].mechanical
        found.append((kept.value("axial_strain"), np.abs(state.stress).max()))
    (strain, stress), (strain_with, stress_with) = found
    assert abs(strain_with / strain - 1.0) < 1e-3
    assert abs(stress_with / stress - 1.0) < 0.02


# The first of (38), checked by hand: stress, external force, accumulated friction, remainder.


WITH_FRICTION = (
    "casting.length=150 mm",
    "mould.friction.law=coulomb",
    "mould.friction.coefficient=0.3",
)


@pytest.mark.parametrize("method", ["penalty", "nitsche"])
def test_friction_and_external_force_balance_the_stress(tmp_path: Path, method: str) -> None:
    external = 'mechanics.planes.force="8 N"'
    summary = run(billet("taper_1", *WITH_FRICTION, external, f"mould.contact={method}"), tmp_path)
    terms = {name: q.value for name, q in summary.balances["axial force"].items()}
    assert terms["external"] == 2.0  # of the quarter
    assert terms["friction"] > 1.0
    assert terms["force"] == pytest.approx(terms["external"] + terms["friction"], rel=1e-6)
    assert abs(terms["reaction"]) < 1e-6 * terms["force"]
    # Sticking or sliding: the strand moves along a wall at rest, so most of it slides.
    touching, sticking = (summary.quantities[f"contact_{n}"].value for n in ("share", "sticking"))
    assert 0.0 <= sticking < 0.5 * touching
    # The force of the whole strand is four times that of the quarter.
    found = summary.quantities
    assert found["mould_pull"].value == pytest.approx(4.0 * terms["friction"], rel=1e-12)
    assert found["mould_friction"].value > 0.0
    # The pull is the sum over the steps of friction times the length of the step.
    table = read_history(tmp_path / "history.csv")
    travelled = np.diff(table["position"])
    pull = -np.cumsum(table["friction_force"].to_numpy()[1:] * travelled)
    assert np.allclose(table["friction_pull"].to_numpy()[1:], pull, rtol=1e-6)
    header = (tmp_path / "history.csv").read_text().splitlines()[0]
    assert "friction_force [kN/m]" in header and "friction_pull [kN]" in header


def test_force_strains_quarter_and_half_equally() -> None:
    force = ("casting.length=30 mm", 'mechanics.planes.force="1 kN"')
    quarter, half = (
        run_in_memory(billet("coupled", *force, f"section.symmetry={s}")).samples[-1].mechanics
        for s in ("quarter", "half")
    )
    assert quarter.strain > 1e-3
    assert half.strain == pytest.approx(quarter.strain, rel=1e-5)


def test_reaction_of_imposed_planes(tmp_path: Path) -> None:
    held = 'mechanics.planes.a0="0"'
    summary = run(shipped("taper_1", *WITH_FRICTION, held), tmp_path)
    terms = {name: q.value for name, q in summary.balances["axial force"].items()}
    assert abs(terms["reaction"]) > terms["friction"] > 1.0
    assert terms["reaction"] == pytest.approx(terms["force"] - terms["friction"], rel=1e-12)


# A billet with each law of friction, from the case file to the force on the strand


# Law -> friction over the mould's pressure; friction without pressure, Pa, and its limit over
# pressure.
LAWS = {
    "limited, coefficient=0.3, yield_stress=10 MPa": (0.3, 0.0, 0.0),
    "tresca, share=0.3, yield_stress=10 MPa": (0.0, 0.3 * 10e6 / 3.0**0.5, 1.0),
    "viscous, stress=500 Pa, speed=3.6 m/min": (0.0, 500.0, 1.0),
    "viscous, stress=1 MPa, speed=3.6 m/min, coefficient=0.2, yield_stress=10 MPa": (0.2, 1e6, 1.0),
}


@pytest.mark.parametrize("law", list(LAWS))
def test_friction_of_each_law(law: str) -> None:
    """The strand slides down the mould: friction at every point is the law's, and opposes it."""
    keys = f"law={law}".split(", ")
    kept = run_in_memory(
        shipped("taper_1", "casting.length=210 mm", *(f"mould.friction.{key}" for key in keys))
    )
    assert kept.summary is not None and kept.summary.status == "finished"
    assert kept.summary.steps["coupling windows cut back"] == 0
    state = kept.states[-1].mechanical.contact
    slides = state.status == SLIP
    assert slides.sum() > 0.5 * len(slides)
    share, most, steepest = LAWS[law]
    expected = share * state.pressure + np.minimum(steepest * state.pressure, most)
    size = np.hypot(*state.friction.T)
    # Viscous friction at the casting speed, except what slides in the plane.
    assert size == pytest.approx(expected, rel=1e-3, abs=1e-3)
    assert -state.friction[:, 1] == pytest.approx(size, rel=2e-2, abs=1e-3)
    if most == 500.0:  # the full value where there is pressure
        assert (size > 499.0).any()


# Steps of the mechanics within a window: as many as requested, and the same as windows


ALONE = ("casting.length=60 mm", "coupling.dissipation=0", "coupling.follow_shape=false")
STEPS = ("thermal.time.step=0.05 s",)


def shape(kept: Kept) -> list[np.ndarray]:
    state = kept.states[-1].mechanical
    return [state.displacement, state.stress, state.internal, kept.states[-1].thermal.enthalpy]


def test_steps_within_a_window_equal_shorter_windows() -> None:
    """Where the mechanics do not act on the heat, the length of the window does not matter."""
    kept = [
        run_in_memory(billet("idealised", *ALONE, *STEPS, f"coupling.interval={window}", *step))
        for window, step in (
            ("0.1 s", ()),
            ("0.5 s", ("coupling.mechanical_step=0.1 s",)),
            ("0.5 s", ()),
        )
    ]
    assert [len(k.states) - 1 for k in kept] == [10, 2, 2]
    for one, other in zip(shape(kept[0]), shape(kept[1]), strict=True):
        assert np.abs(one - other).max() <= 1e-7 * np.abs(one).max()
    longer = np.abs(shape(kept[0])[1] - shape(kept[2])[1]).max()
    assert longer > 1e-3 * np.abs(shape(kept[0])[1]).max()


def test_work_and_iterations_are_those_of_all_steps() -> None:
    changes = ("casting.length=90 mm", "thermal.time.step=62.5 ms")
    step = "coupling.mechanical_step=62.5 ms"
    short, several = (
        run_in_memory(billet("taper_3", *changes, *more))
        for more in (("coupling.interval=62.5 ms",), ("coupling.interval=0.25 s", step))
    )
    heating = [sum(s.heating.sum() for s in kept.states) for kept in (short, several)]
    assert heating[1] == pytest.approx(heating[0], rel=0.05)
    newton = [
        sum(r.mechanics.newton for r in kept.samples if r.mechanics) for kept in (short, several)
    ]
    assert newton[1] == pytest.approx(newton[0], rel=0.2)
    assert several.value("heat_removed") == pytest.approx(short.value("heat_removed"), rel=5e-3)


# The slice keeps its thickness while slivers of solid freeze in fed liquid


COULOMB = 'mould.friction={law="coulomb",coefficient=0.3}'
BEFORE_SHELL = ("casting.length=120 mm", *FED)


def strained(window: str, *sets: str) -> Kept:
    return run_in_memory(billet("taper_1", *BEFORE_SHELL, f"coupling.interval={window}", *sets))


def axial_strains(kept: Kept) -> list[float]:
    """Return the axial strain after each window."""
    return [s.mechanical.generalized_strains[0] for s in kept.states if s.mechanical is not None]


def test_axial_strain_does_not_depend_on_the_window() -> None:
    """It once drifted with each step: at 20 ms to +0.09 %, with friction to +0.6 %."""
    coarse, fine = (axial_strains(strained(window, COULOMB)) for window in ("0.1 s", "0.04 s"))
    assert max(max(coarse), max(fine)) < 2e-5
    assert coarse[-1] == pytest.approx(-0.6e-3, abs=0.1e-3)
    assert fine[-1] == pytest.approx(coarse[-1], abs=0.6e-4)


def test_small_force_hardly_moves_planes_without_a_shell() -> None:
    """A hundredth of a newton on the strand: liquid alone yielded by 0.2 % in 40 mm."""
    kept = strained("0.1 s", "casting.length=40 mm", "mechanics.planes.force=0.01 N")
    strains = axial_strains(kept)
    assert len(strains) > 5
    assert 0.0 < max(strains) < 2e-6


# The first gap that a coupling window is tried with


TO_180 = 'casting.length="180 mm"'


def test_steadily_opening_gap_is_found_at_once() -> None:
    """The remaining error is a fifth of the tolerance of the coupling, with hardly a repetition."""
    found = []
    for settled in ("1 K", "0.01 K"):
        kept = run_in_memory(
            shipped("taper_0", TO_180, "coupling.interval=0.1 s", f"coupling.settled={settled}")
        )
        found.append((kept.value("surface_temperature_corner"), kept.summary.steps))
    (corner, steps), (settled_corner, _) = found
    assert abs(corner - settled_corner) < 0.2  # 0.7 with the gap at the beginning
    assert steps["coupling iterations"] < 1.2 * steps["coupling windows"]


def test_slice_is_extrapolated_by_its_motion() -> None:
    """Displacement, free scalars and the generalized strains that belong to them."""
    case = billet("taper_0", TO_180)
    before, now = (state.mechanical for state in run_in_memory(case).states[-2:])
    simulation = build(case, MPI.COMM_SELF)
    ahead = simulation.mechanics.going_on(now, 2.0 * now.time - before.time)
    simulation.destroy()
    assert ahead.time == 2.0 * now.time - before.time
    owned = slice(0, len(now.rate))
    for name, part in (("displacement", owned), ("scalars", ...), ("generalized_strains", ...)):
        one, two, three = (getattr(s, name)[part] for s in (before, now, ahead))
        assert np.abs(two - one).max() > 1e-7  # m, or of strain
        np.testing.assert_allclose(three - two, two - one, rtol=1e-9, atol=1e-18)


def test_liquid_without_a_wall_is_named_as_the_reason() -> None:
    wide = billet("taper_1", *BEFORE_SHELL, "mould.width=127 mm", "mould.height=127 mm")
    with pytest.raises(
        RunFailure, match=r"smallest step .*; mould\.width: \(127 mm\) leaves a gap"
    ):
        run_in_memory(wide)
