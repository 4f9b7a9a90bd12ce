"""A slice of a caster is the run that castfem.run makes of its case, to the last digit."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_caster import STOP, STRAINED, caster

import castfem
from castfem.model import Case
from castfem.model.caster import slice_of
from castfem.runs import restart
from castfem.runs.caster.strand import Strand
from castfem.runs.output.checkpoint import load_checkpoint
from castfem.runs.output.history import read_columns
from castfem.runs.results.registry import Columns

SPRAY = {
    "law": "spray", "correlation": "nozaki", "water_temperature": "25 degC", "flow": "2 L/min",
}  # fmt: skip
ZONES = {
    "cooling": [
        {"name": "mould", "to": "100 mm", "surface": [
            {"law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC"}]},
        {"name": "ring", "to": "300 mm", "surface": [SPRAY]},
    ],
}  # fmt: skip


def _advanced(case: Case) -> Any:
    """The strand of a caster, its slices' rows by number, and their states as they left."""
    strand = Strand(case)
    rows: dict[int, list[dict[str, float]]] = {}
    ends: dict[int, Any] = {}
    for clock in strand.instants:
        for one in strand.waiting(clock):
            simulation, sample = one.loop.simulation, one.advance(clock)
            assert sample.time == one.age
            rows.setdefault(one.number, []).append(Columns(simulation).row(sample))
            if one.has_left:
                ends[one.number] = restart.arrays(one.run_state)
        strand.release()
        assert len(strand.inside) <= 8  # of 14: memory is that of those inside
    return strand, rows, ends


@pytest.fixture(scope="module")
def advanced() -> Any:
    """A caster with water."""
    found = _advanced(caster(ZONES, {"ring": ["2 L/min", "2 L/min", "1 L/min", "0 L/min"]}))
    yield found
    found[0].destroy()


@pytest.fixture(scope="module")
def strained() -> Any:
    """A caster with mechanics, through a stop."""
    found = _advanced(caster(STRAINED, STOP))
    yield found
    found[0].destroy()


@pytest.mark.parametrize(
    ("which", "number"),
    [*(("advanced", number) for number in (3, 6, 9)), ("strained", 2), ("strained", 4)],
)
def test_a_slice_is_the_run_of_its_case(
    which: str, number: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    strand, rows, ends = request.getfixturevalue(which)
    case = slice_of(strand.base, strand.starts[number - 1])
    assert castfem.run(case, tmp_path).case == case  # the file of a slice has all its digits
    history = read_columns(tmp_path / "history.csv")
    assert len(rows[number]) >= 3
    for row in rows[number]:
        (line,) = np.flatnonzero(np.abs(history["time"] - row["time"]) < 1e-9)
        written = {name: float(f"{value:.12g}") for name, value in row.items()}
        assert set(written) == set(history.columns)
        alone = {name: float(history[name][line]) for name in history}
        np.testing.assert_equal(alone, written)
    _, arrays = load_checkpoint(tmp_path / "checkpoint.h5")
    ended = {name: values for name, values in ends[number].items() if values is not None}
    assert set(arrays) == set(ended)
    assert ("stress_deviator" in ended) == (which == "strained")
    for name, values in ended.items():
        assert np.array_equal(arrays[name], values, equal_nan=True), name


def test_what_a_slice_meets_is_that_of_its_own_time(advanced: Any) -> None:
    strand, rows, _ = advanced
    young = slice_of(strand.base, strand.starts[12]).casting
    assert young.poured_superheat == 20.0 and young.travel.speed(0.0) < 3.0 / 60.0
    old = slice_of(strand.base, strand.starts[0]).casting
    assert old.poured_superheat == 40.0 and old.clock == pytest.approx(-200 / 60, abs=1e-6)
    assert old.travel.speed(-old.clock) == pytest.approx(0.06)
    heat = {number: found[-1]["heat_removed"] for number, found in rows.items()}
    assert heat[8] > heat[2]  # the slow-down cools it longer


def test_steady_casting_is_one_slice_at_every_instant() -> None:
    same = {"speed": ["3.6 m/min"] * 4, "superheat": None, "mould_heat": None}
    strand = Strand(caster({}, same))
    by_position: dict[float, float] = {}
    for clock in strand.instants:
        for one in strand.waiting(clock):
            row = Columns(one.loop.simulation).row(one.advance(clock))
            known = by_position.setdefault(round(row["position"], 9), row["heat_removed"])
            assert row["heat_removed"] == pytest.approx(known, rel=2e-4)
        strand.release()
    strand.destroy()
    assert len(by_position) > 8
