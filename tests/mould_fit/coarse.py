"""The billet with coarse cells and long coupling intervals, for the tests of strand and mould."""

from __future__ import annotations

from pathlib import Path

from runs.billet_runs import cells

from castfem.model import Case, load_case

CASES = Path(__file__).parents[2] / "cases" / "billet125"
COARSE = (*cells(3, 12, 16), "coupling.interval=0.5 s", "output.figures=false")


def coarse(name: str, *changes: str) -> Case:
    """Load a shipped billet with coarse cells and further changes."""
    return load_case(CASES / f"{name}.toml", (*COARSE, *changes))
