"""A slab that keeps its stresses from its own mould to the rolls between which it bulges."""

from __future__ import annotations

import json
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import pytest
from interrupted import history_of
from runs.billet_runs import Kept, cells, run, run_in_memory, simulated
from runs.bulging_slab import SLAB, below, rolls_of
from small_case import small

from castfem.base.errors import InputError, RunFailure
from castfem.model import Case, load_case
from castfem.physics.contact.roll_support import RollSupport
from castfem.physics.contact.state import ContactState
from castfem.physics.mechanics.state import MechanicalResult
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_history
from castfem.runs.results.sample import Sample

END, ROLLS = 0.3, (0.38, 0.5, 0.66)
TAPER = 0.02  # 1/m


def slab(**changes: object) -> Case:
    """Return a slab of 400 x 100 mm, cast through a mould of 300 mm, on three pairs of rolls."""
    replaced = {
        "casting": {"speed": "0.6 m/min", "length": "0.51 m", "superheat": "20 K"},
        "mould": {"length": f"{END} m", "taper": {"wide_face": f"{100 * TAPER} %/m"}},
        "machine.rolls.position": [f"{place} m" for place in ROLLS],
        "coupling": {"interval": "60 mm", "passes": 1},
        "mechanics": {"law": "kozlowski_zhu_signed", "liquid": "fed", "bulging": "elastic"},
    } | {key.replace("__", "."): value for key, value in changes.items()}
    table = deepcopy(SLAB) | replaced
    table["cooling"][0]["to"] = f"{END} m"
    table["cooling"][0]["surface"][0]["gap_conductivity"] = "0.15 W/(m K)"
    return small(table)


@pytest.fixture(scope="module")
def own() -> Kept:
    return run_in_memory(slab())


def wall_of(sample: Sample) -> ContactState:
    mechanical = sample.state.mechanical
    return next(one for one in mechanical.interactions if isinstance(one, ContactState))


def test_mould_holds_the_faces_and_then_the_rolls(own: Kept) -> None:
    within = [s for s in own.samples if 0.0 < s.position <= END]
    assert within[-1].position == pytest.approx(END)
    for sample in within:
        assert all(bed.stiffness == 0.0 for bed in rolls_of(sample).beds.values())
        assert (wall_of(sample).pressure > 0.0).any()
    for sample in own.samples[len(within) + 1 :]:
        assert not (wall_of(sample).pressure > 0.0).any()
        assert all(bed.stiffness > 0.0 for bed in rolls_of(sample).beds.values())


def test_first_roll_is_where_the_mould_leaves_the_face(own: Kept) -> None:
    """Half of the taper's reduction of 100 mm, and the reduction by the apertures below."""
    left = 0.05 / (1.0 + TAPER * END) - 0.05
    for position in (END, *ROLLS[:2]):
        sample = below(own, position)
        bed = rolls_of(sample).beds["wide_face_intrados"]
        lost = np.interp(sample.position, ROLLS, [0.0, -0.1e-3, -0.15e-3])
        assert bed.offset == pytest.approx(left + lost, abs=1e-9)
        moved = sample.strained.moved["mid_face"]
        # The edges also hold the face, more so the narrower it is.
        assert moved == pytest.approx(bed.rest, abs=20e-6)


def test_end_of_mould_supports_the_first_span(own: Kept) -> None:
    first, second = (rolls_of(below(own, place)).memory for place in (END, ROLLS[0]))
    assert first["z"][:, -1] == pytest.approx(np.full(2, ROLLS[0] - END))
    assert second["z"][:, -1] == pytest.approx(np.full(2, ROLLS[1] - ROLLS[0]))
    assert first["load"].min() > 0.0 and not first["force"].any()
    assert second["force"] == pytest.approx(0.5 * (first["load"] + second["load"]))


def test_first_roll_at_the_mould_end_has_no_span_above() -> None:
    places = [f"{place} m" for place in (END, *ROLLS[1:])]
    kept = run_in_memory(slab(machine__rolls__position=places, casting__length="0.32 m"))
    memory = rolls_of(kept.samples[-1]).memory
    assert memory["z"][:, -1] == pytest.approx(np.full(2, ROLLS[1] - END))
    assert memory["force"] == pytest.approx(0.5 * memory["load"])


def test_rolls_pull_as_the_case_states() -> None:
    """By default they do not pull below a mould, whose corners leave the line of the rolls."""
    begun = {"at": "mould_exit"}
    for changes, pulls in (
        ({}, False),
        ({"mechanics__bulging": {"model": "elastic", "pull": True}}, True),
        ({"mould": None, "casting__start": begun}, True),
        ({"mould": None, "casting__start": begun,
          "mechanics__bulging": {"model": "elastic", "pull": False}}, False),
    ):  # fmt: skip
        with simulated(slab(**changes)) as simulation:
            given = simulation.mechanics.problem.slice.interactions
            (rolls,) = (one for one in given if isinstance(one, RollSupport))
            assert rolls.pull == pulls


def test_run_resumes_byte_for_byte(tmp_path: Path) -> None:
    """Stopped between the mould and the first roll: the bulge there is not computed again."""
    case = slab(casting__length="0.39 m")
    assert history_of(case, tmp_path / "a") == history_of(case, tmp_path / "b", 6)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"machine__rolls__position": ["0.29 m", "0.5 m", "0.66 m"]},
         r"position \(0\.29 m\) lies within the mould, which ends at 0\.3 m"),
        ({"casting__start": {"at": "mould_exit"}},
         r"casting\.start\.at: .* begins below the mould"),
        ({"mechanics__bulging": {"model": "none", "pull": True}},
         r'bulging\.pull: has no effect with model = "none"'),
    ],
)  # fmt: skip
def test_conflicting_input_is_rejected(changes: dict[str, object], text: str) -> None:
    with pytest.raises(InputError, match=text) as caught:
        slab(**changes)
    assert len(str(caught.value).splitlines()) == 1


# A freezing billet with mechanics in far too long steps, and with a solver that gives up


CASES = Path(__file__).parents[2] / "cases"
COARSE = ("mechanics.law=norton_hoff_kozlowski", *cells(2, 6, 12), "output.fields=[]")


def billet(*overrides: str, name: str = "idealised") -> Case:
    return load_case(CASES / "billet125" / f"{name}.toml", (*COARSE, *overrides))


def test_windows_a_hundred_times_longer(tmp_path: Path) -> None:
    """Two windows of 5 s through the mould: in balance, and about the stress of windows of 0.4 s.

    Heat keeps its own steps; long steps miss the bulge of the first soft shell. The shell is
    measured in the deformed slice, so it contains the error of its strains, a thousandth.
    """
    long = run(billet("coupling.interval=5 s"), tmp_path / "long")
    fine = run(billet("coupling.interval=0.4 s"), tmp_path / "fine")
    assert long.status == "finished" and long.steps["coupling windows"] == 2
    for name, close in (
        ("shell_mid_face", 2e-3),
        ("heat_removed", 1e-3),
        ("von_mises_corner", 0.2),
        ("axial_strain", 0.25),
    ):
        ours, theirs = (s.quantities[name].value for s in (long, fine))
        assert ours == pytest.approx(theirs, rel=close), name
    for balance in ("axial force", "forces in the plane"):
        assert abs(long.balances[balance]["error"].value) < 1e-6
    table = read_history(tmp_path / "long" / "history.csv")
    assert all(complete(row) for _, row in table.iterrows())


def test_table_that_misses_the_end_by_rounding(tmp_path: Path) -> None:
    """As with inches written as millimetres: no step runs from its last row to the end."""
    heat = []
    for last in (300.0, 299.9999999988, 300.0000000012):
        table = {"position": [0, last], "position_unit": "mm", "value": [2e3, 1e3]}
        law = {"law": "contact", "wall": "160 degC"}
        law["coefficient"] = table | {"unit": "W/(m^2 K)"}  # type: ignore[assignment]
        stepping = {"adaptive": {"tolerance": "1 K"}}
        changes = {"casting.length": "300 mm", "thermal.time": stepping, "cooling.0.surface": [law]}
        found = run(small(changes), tmp_path / str(last))
        assert found.status == "finished"
        steps = np.diff(read_history(tmp_path / str(last) / "history.csv")["time"])
        assert steps.min() > 1e-5  # the smallest of a case
        heat.append(found.quantities["heat_removed"].value)
    assert heat[1:] == pytest.approx(2 * heat[:1], rel=1e-9)


def complete(row: pandas.Series) -> bool:
    """Return whether a row of a history has a number for everything that exists.

    Only with a shell there is a cell that contains the solidus.
    """
    cells = [name for name in row.index if name.startswith("solidus_cell_")]
    has_shell = {name: row[name.replace("solidus_cell_", "shell_")] > 0.0 for name in cells}
    assert cells and all(np.isfinite(row[name]) == is_ for name, is_ in has_shell.items())
    return bool(np.isfinite(row.drop(cells).to_numpy()).all())


def failed(folder: Path, reason: str) -> float:
    """Return the time a failed run has reached, s: in its record and in its last, valid row."""
    record = json.loads((folder / "run.json").read_text())
    assert record["status"] == "failed" and record["reason"] == reason
    table = read_history(folder / "history.csv")
    last = table.iloc[-1]
    assert record["reached"]["time"] == pytest.approx(last["time"], rel=1e-11)
    assert complete(last) and abs(last["force_error"]) < 1e-6
    return float(last["time"])


def test_solver_failure_has_a_reason(tmp_path: Path) -> None:
    """One Newton iteration is not enough: cut back to the smallest step, then failed."""
    short = ("casting.length=120 mm", "coupling.interval=0.5 s")
    with pytest.raises(RunFailure) as caught:
        run(billet(*short, "mechanics.solver.snes_max_it=1", "mechanics.tolerance=1e-8"), tmp_path)
    message = str(caught.value)
    for part in ("mechanics", "smallest step", "DIVERGED_MAX_IT", "forces", "x tolerance"):
        assert part in message
    assert failed(tmp_path, message) < 2.0


def test_failed_run_resumes_from_its_last_good_state(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing converges beyond 1 s, until it does: resumed, it is the run that never failed.

    The failed attempts have computed states, of contact and friction too: the checkpoint has none.
    """
    case = billet(
        "casting.length=105 mm", "coupling.interval=0.25 s", "mould.friction.law=coulomb",
        "mould.friction.coefficient=0.2", "mechanics.liquid=fed", "mechanics.ferrostatic=full",
        name="taper_0",
    )  # fmt: skip
    complete = run(case, tmp_path / "whole")
    step = MechanicalStepper.step

    def stuck(self: MechanicalStepper, old: Any, time: float, *rest: Any) -> MechanicalResult:
        result = step(self, old, time, *rest)
        if time < 1.0 + 1e-9:
            return result
        return replace(result, converged=False, state=old, reason="stuck", balance=None)

    with monkeypatch.context() as patch:
        patch.setattr(MechanicalStepper, "step", stuck)
        with pytest.raises(RunFailure, match="stuck") as caught:
            run(case, tmp_path / "cut")
    assert failed(tmp_path / "cut", str(caught.value)) == pytest.approx(1.0, rel=1e-11)
    resumed = run(case, tmp_path / "cut", resume=True)
    assert resumed.status == "finished" and resumed.steps == complete.steps
    assert complete.quantities["gap_max"].value > 1e-6
    for name, quantity in complete.quantities.items():
        ours = resumed.quantities[name].value
        assert ours == pytest.approx(quantity.value, rel=1e-9, abs=1e-15), name
    (_, one), (_, other) = (
        load_checkpoint(tmp_path / name / "checkpoint.h5") for name in ("whole", "cut")
    )
    assert one.keys() == other.keys() and one["contact_friction"].any()
    for name, values in one.items():
        size = np.abs(values[np.isfinite(values)]).max(initial=1e-300)
        assert np.allclose(other[name], values, rtol=0.0, atol=1e-9 * size), name
