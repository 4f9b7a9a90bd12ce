"""Cases with [machine.extraction]: force and balance of the slice, resume, invalid input."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from bent_case import BENT, bent
from runs.billet_runs import Kept, run_in_memory

from castfem.base.errors import InputError, RunFailure
from castfem.model import Case, load_case
from castfem.physics.machine.extraction.drives import StrandStopsError
from castfem.runs import loop
from castfem.runs.output.history import read_history

ROLLS = {
    "position": [0.1, 0.35, 0.6, 0.85, 1.1, 1.35],
    "position_unit": "m",
    "diameter": [120] * 6,
    "diameter_unit": "mm",
    "radius_extrados": ["straight", 10, 5, 7.5, 15, "straight"],
    "radius_extrados_unit": "m",
    "driven": [False, False, True, False, False, True],
    "capacity": ["", "", 8, "", "", 90],
    "capacity_unit": "kN",
}
CURVE = {"position": [0.1, 0.6, 1.35], "position_unit": "m", "value": [2, 12, 30], "unit": "kN"}


def drawn(resistance: Any = None, **changes: Any) -> Case:
    """Return the bent billet with drives at 0.6 and 1.35 m."""
    extraction = {"resistance": CURVE if resistance is None else resistance}
    rolls = ROLLS | changes.pop("rolls", {})
    table = {"rolls": rolls, "extraction": extraction | changes.pop("extraction", {})}
    return bent(machine=table, **changes)


def test_makers_curve_loads_the_slice() -> None:
    """The force is 12 kN above the drive at 0.6 m, 4 below it, and 22 at the last drive."""
    run = run_in_memory(drawn(casting__length="1.7 m"))
    seen = {round(s.position, 6): s for s in run.samples}
    for position, effort in ((0.1, 2e3), (0.6, 12e3), (0.85, 10e3), (1.35, 22e3), (1.7, 0.0)):
        found = seen[position]
        assert found.withdrawal.effort == pytest.approx(effort, abs=1e-6)
        ours = found.mechanics
        assert 2.0 * ours.load == pytest.approx(effort, abs=1e-6)
        # N - k M = F: the curve contains the work of bending.
        if ours.balance is not None:
            left = ours.balance.axial[0] - ours.bending.curvature * ours.bending.moment
            assert left == pytest.approx(0.5 * effort, abs=1.0)
    assert all(
        s.withdrawal.resistance - s.withdrawal.drives == pytest.approx(s.withdrawal.effort)
        for s in run.samples
    )
    assert seen[1.7].withdrawal.drives == pytest.approx(30e3)


@pytest.fixture(scope="module")
def coupled() -> Kept:
    return run_in_memory(drawn("coupled", casting__length="1.7 m"))


def test_coupled_drives_supply_friction_and_bending(coupled: Kept) -> None:
    """N - k M is the effort, which contains the work of bending; the drives supply just both."""
    last = coupled.samples[-1]
    for sample in coupled.samples[1:]:
        ours = sample.mechanics
        closing = ours.balance.axial[0] - ours.bending.curvature * ours.bending.moment
        assert 2.0 * closing == pytest.approx(sample.withdrawal.effort, abs=1.0)
    work = -2.0 * last.mechanics.bending.work
    assert work > 0.0
    assert last.withdrawal.friction > 0.0
    total = last.withdrawal.friction + work
    assert last.withdrawal.resistance == pytest.approx(total, rel=1e-9)
    assert last.withdrawal.drives == pytest.approx(total, rel=1e-9)
    assert last.withdrawal.effort == pytest.approx(0.0, abs=1e-6 * total)


def test_solid_strand_loads_rolls_only_by_bending(coupled: Kept) -> None:
    """Friction of bending is the coefficient times the jumps of shear, summed over the pairs."""
    places = np.array(ROLLS["position"])
    seen = {round(s.position, 6): 2.0 * s.mechanics.bending.moment for s in coupled.samples}
    moments = np.array([seen[p] for p in places.tolist()])
    shear = np.diff(moments) / np.diff(places)
    jumps = np.abs(np.diff(np.concatenate([[moments[0] / 0.25], shear])))
    assert coupled.samples[-1].withdrawal.friction == pytest.approx(0.015 * jumps.sum(), rel=1e-9)


def test_axial_closing_leaves_the_work_out() -> None:
    """As in the thesis: the drives supply friction only."""
    given = {"closing": "axial"}
    run = run_in_memory(drawn("coupled", mechanics__planes=given, casting__length="1.7 m"))
    last = run.samples[-1]
    assert last.mechanics.bending.work < 0.0
    assert last.withdrawal.resistance == pytest.approx(last.withdrawal.friction, rel=1e-12)


@pytest.mark.parametrize("resistance", [None, "coupled"])
def test_killed_run_resumes_byte_for_byte(
    tmp_path: Path, resistance: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    case = drawn(resistance, output__checkpoint_every=1)
    loop.run(case, tmp_path / "whole", comm=MPI.COMM_SELF)
    _killed(monkeypatch, case, tmp_path / "cut", after=0.7)
    loop.run(case, tmp_path / "cut", comm=MPI.COMM_SELF, resume=True)
    histories = [(tmp_path / name / "history.csv").read_bytes() for name in ("whole", "cut")]
    assert histories[0] == histories[1]
    names = {column.split(" [")[0] for column in read_history(tmp_path / "cut" / "history.csv")}
    assert {"effort", "roll_resistance", "drive_force"} <= names


def _killed(monkeypatch: pytest.MonkeyPatch, case: Case, folder: Path, after: float) -> None:
    """Run a case to beyond a position (m), and stop it as if it were killed."""

    class KilledError(BaseException):
        pass

    advance = loop.TimeLoop.advance

    def dying(self: loop.TimeLoop) -> None:
        if self.run_state.position > after:
            raise KilledError
        advance(self)

    with monkeypatch.context() as patched:
        patched.setattr(loop.TimeLoop, "advance", dying)
        with pytest.raises(KilledError):
            loop.run(case, folder, comm=MPI.COMM_SELF)


def test_stopping_strand_is_refused_or_ends_the_run() -> None:
    weak = {"capacity": ["", "", 8, "", "", 9]}
    with pytest.raises(StrandStopsError, match=r"resist with 30 kN, .* with 17 kN at most"):
        run_in_memory(drawn(rolls=weak))
    nothing = {"capacity": ["", "", 0.001, "", "", 0.001]}
    with pytest.raises(RunFailure, match=r"^300 mm below the meniscus .*the strand would stop"):
        run_in_memory(drawn("coupled", rolls=nothing))


def test_resolved_case_is_the_same(tmp_path: Path) -> None:
    path = tmp_path / "resistance.csv"
    path.write_text("position [mm], value [kN]\n100, 2\n600, 12\n1350, 30\n")
    case = drawn({"file": str(path)})
    assert case.machine is not None and case.machine.extraction is not None
    resolved = tmp_path / "case.toml"
    resolved.write_text(case.resolved_toml())
    path.unlink()
    assert load_case(resolved).physics_hash() == case.physics_hash()
    other = drawn().with_({"machine.extraction.friction_axis": 0.02})
    assert case.physics_hash() != other.physics_hash()


REFUSED: dict[str, tuple[dict[str, Any], str, str]] = {
    "force": (
        {"mechanics__planes": {"force": "5 kN"}}, "mechanics.planes.force",
        "stands beside [machine.extraction]",
    ),
    "work twice": (
        {"mechanics__planes": {"force_contains_bending": False}}, "force_contains_bending",
        "a maker's curve has the work of bending in it",
    ),
    "no drive": (
        {"rolls": {"driven": [False] * 6, "capacity": [""] * 6}}, "machine.extraction",
        "no pair of rolls is driven",
    ),
    "an effort": (
        {"resistance": CURVE | {"value": [2, 12, 3]}}, "extraction.resistance",
        "falls from 12 kN at 0.6 m to 3 kN at 1.35 m",
    ),
    "a word": ({"resistance": "couple"}, "extraction.resistance", '"coupled"'),
}  # fmt: skip


@pytest.mark.parametrize("mistake", REFUSED)
def test_invalid_input_is_rejected(mistake: str) -> None:
    """One line: key, reason, fix."""
    changes, key, words = REFUSED[mistake]
    with pytest.raises(InputError) as caught:
        drawn(**changes)
    (problem,) = caught.value.problems
    assert key in problem
    assert words in problem


def test_case_without_extraction_is_unchanged() -> None:
    """It has no column and no state of it, and its own planes."""
    run = run_in_memory(bent())
    state = run.states[-1].mechanical
    assert state is not None and state.bending.withdrawal is None
    assert "extraction" not in BENT["machine"]
