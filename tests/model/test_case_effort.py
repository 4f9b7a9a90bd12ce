"""Cases of millions of steps are refused with their number, long ones are told."""

from __future__ import annotations

from pathlib import Path

import pytest

from castfem.model import read_case

TAPERED = Path(__file__).parents[2] / "cases" / "billet125" / "taper_0.toml"


@pytest.mark.parametrize(
    ("change", "key", "count"),
    [
        ("coupling.interval=1e-9 s", "coupling.interval", "10 000 000 000 coupling windows"),
        ("coupling.mechanical_step=1e-9 s", "coupling.mechanical_step", "mechanical steps"),
        ("thermal.time.step=1 us", "thermal.time.step", "10 000 000 thermal steps"),
        ("output.every=1e-9 s", "output.every", "10 000 000 000 states of the fields"),
    ],
)
def test_a_run_without_end_is_refused_with_its_count(change: str, key: str, count: str) -> None:
    found = [line for line in read_case(TAPERED, [change]).problems if f": {key}: " in line]
    assert len(found) == 1 and count in found[0] and "at most" in found[0], found


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            ["casting.speed=1 um/min"],
            "--set: casting.speed: (1e-06 m/min) takes 4.2e+02 days for 0.6 m: give a higher one",
        ),
        (["casting.speed=1e-9 m/min"], "--set: casting.speed: (1e-09 m/min) is beyond"),
        (["casting.length=1e9 m"], "--set: casting.length: (1e+12 mm) is beyond"),
    ],
)
def test_a_strand_that_makes_a_run_without_end_is_named_alone(
    changes: list[str], said: str
) -> None:
    (line,) = read_case(TAPERED, changes).problems
    assert line.startswith(said)


def test_slow_is_no_fault_where_steps_are_few() -> None:
    slow = ["casting.speed=9 mm/min", "coupling.interval=0.2 s", "output.every=10 s"]
    assert not read_case(TAPERED, slow).problems


def test_output_that_is_not_written_makes_no_states() -> None:
    assert not read_case(TAPERED, ["output.every=1e-9 s", "output.fields=[]"]).problems


def test_a_long_run_is_told_with_its_time() -> None:
    (line,) = read_case(TAPERED, ["coupling.mechanical_step=50 us"]).warnings
    assert "(5e-05 s) makes 200 000 mechanical steps" in line
    assert line.endswith("5.6 hours")
    line, cut = read_case(TAPERED, ["output.every=1 ms"]).warnings
    assert "10 000 states of the fields" in line
    assert "is cut to output.every (0.001 s)" in cut
