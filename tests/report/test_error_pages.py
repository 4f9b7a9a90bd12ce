"""Where errors are tabulated is told of shipped cases as shipped, and of nothing else."""

from __future__ import annotations

import pytest

from castfem.model import load_case
from castfem.model.shipped_cases import find
from castfem.runs.results.run_case import error_lines as lines

BILLET = 'docs/billet.md, "Error of the shipped default"'


@pytest.fixture
def ran(tmp_path):
    """Makes the folder of a run of a shipped case, with changes."""

    def _ran(name: str, *changes: str):
        folder = tmp_path / f"{len(list(tmp_path.iterdir()))}"
        folder.mkdir()
        (folder / "case.toml").write_text(load_case(find(name), changes).resolved_toml())
        return folder

    return _ran


def test_a_shipped_case_names_the_page_on_its_errors(ran):
    assert lines({"": ran("billet125/taper_1")}) == [f"errors of these numbers: {BILLET}"]
    assert lines({"": ran("billet125/thermal", "output.figures=false")}) == [
        "errors of these numbers: docs/benchmarks.md"
    ]


@pytest.mark.parametrize(
    "change",
    ["mesh.surface_size=1.2 mm", "coupling.interval=0.2 s", "casting.length=1 m", "title=mine"],
)
def test_a_changed_case_has_no_tabulated_errors(ran, change):
    assert lines({"": ran("billet125/taper_1", change)}) == []


def test_a_shipped_case_that_was_not_measured_names_no_page(ran):
    assert lines({"": ran("billet125/mechanics_first")}) == []


def test_runs_without_tabulated_errors_are_left_out(ran, tmp_path):
    runs = {"one": ran("billet125/taper_1"), "other": ran("verification/neumann"), "no": tmp_path}
    assert lines(runs) == [f"errors of these numbers, of one: {BILLET}"]
