"""The table of what a sweep costs: shares of the whole, and the pairs."""

from __future__ import annotations

from pathlib import Path

from benchmarks import sweep_cost
from benchmarks.report import Output


def test_shares_are_those_of_the_whole(tmp_path: Path) -> None:
    times = {"march": (3.0, 32), "each": (0.5, 32), "first": (1.0, 2), "imports": (2.0, 2)}
    times |= {"parent": (2.0, 1), "figures": (2.0, 0)}
    output = Output(tmp_path, "scripting.md")
    output.csv(
        "sweep_cost",
        [
            {"part": part, "each [s]": each, "times": count, "whole [s]": 121.0}
            for part, (each, count) in times.items()
        ],
    )
    pairs = [(False, 8.0), (True, 5.0), (False, 9.0), (True, 4.0)]
    output.csv(
        "sweep_at_once",
        [{"turn": 0, "at once": way, "wall [s]": wall, "load": 0.1} for way, wall in pairs],
    )
    sweep_cost.show(output)
    text = output.page.read_text(encoding="utf-8")
    assert "| the time loops | 3.00 | 32 | 80.0 |" in text
    assert "| start of a worker, its imports | 2.00 | 2 | 3.3 |" in text
    assert "figures of a run, with `--figures` | 2.00 |  |  |" in text
    assert "took 121 s, the parts add up to 120 s" in text and "2.00 times as fast" in text


def test_tapers_are_as_many_as_runs() -> None:
    assert len(set(sweep_cost.tapers(32))) == 32
