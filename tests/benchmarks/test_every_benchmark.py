"""Every benchmark is imported, and run in its shortest form if that takes some seconds."""

from __future__ import annotations

import ast
import csv
import json
import re
import sys
from collections.abc import Iterator
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks import __main__ as command
from benchmarks import accuracy, caster, costs, opponent, reference
from benchmarks.__main__ import BENCHMARKS, PAGES
from benchmarks.accuracy import GRADED, cheapest, default_settings, errors, sweep
from benchmarks.billet import CASE, INSTANTS, Settings, billet_case, refined, run
from benchmarks.report import PAGE, ROOT, Output
from castfem.model import load_case

pytestmark = pytest.mark.slow


SHORT = 'casting.length="40 mm"'
SLOW = {
    "accuracy": "16 s of processor time, most of it the time stepping that tests/thermal covers",
    "caster": "22 s: a caster of 20 m, run by tests/runs",
    "costs": "30 s: processes of their own, several times each",
    "billet": "six billets at their shipped cells",
    "billet_error": "four billets to the mould's exit",
    "billet_trade": "billets that are compared with a reference at the mould's exit",
    "billet_cost": "repeated billets; its runs are tested below",
    "slab_error": "some ten slabs down their caster; test_slab_tables.py tests how it compares",
    "slab_sprays": "slabs down their caster; test_slab_tables.py tests what is read off them",
    "slabs": "reads what `make slabs` has run; test_slab_tables.py tests how",
    "sensitivity": "some forty billets; tests/sensitivity has smaller ones",
    "stated_error": "ladders of five cases; tests/cli/test_cli_error.py has short ones",
    "systems": "systems from nothing, over a network; `make test-pip` sets one up",
    "throughput": "a sweep of 32 billets, several times",
    "verification": "tests/closed_forms runs what it runs",
}
"""Only imported, with the reason; `python -m benchmarks NAME --quick` runs them."""

SCRIPTED = ("opponent", "plain_script")  # with another library

FOUND = SimpleNamespace(value=0.48, low=0.2, high=0.7, open_low=False, open_high=True)
SMALL: dict[str, dict[str, Any]] = {
    "billet_grid": {"LENGTH": "8 mm", "HALF": {"mesh": 0.9}},
    # tests/optimisation tests such searches with known results.
    "optimum_holds": {"search": lambda *_: SimpleNamespace(values=(FOUND,))},
    "caster_error": {"KINDS": {"slices": (4.0, 2.0)}},
    "sensitivity_errors": {
        "QUICK": ("casting.length=100 mm", "mesh.surface_size=1 mm", "mesh.corner_size=1 mm"),
        "RUNS": (("billet125/thermal", (), ("heat_removed",), ("casting.superheat",)),),
    },
}
"""Reduced settings where even `--quick` is more than a test needs."""


@pytest.mark.parametrize("file", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_module_is_imported(file: Path) -> None:
    """Every name that a module imports from another exists."""
    if file.stem in SCRIPTED:
        pytest.importorskip("skfem", reason="needs the extra benchmark: tools/env.sh benchmark")
    import_module("benchmarks" if file.stem == "__init__" else f"benchmarks.{file.stem}")
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        # Also imports within functions, which an import of the module does not reach.
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.startswith("benchmarks")
        ):
            module = import_module(node.module)
            for name in node.names:
                found = hasattr(module, name.name)
                assert found or import_module(f"{node.module}.{name.name}"), name.name


@pytest.mark.parametrize("name", BENCHMARKS)
def test_benchmark_has_its_page_and_shows_its_data(name: str) -> None:
    module = import_module(BENCHMARKS[name])
    assert callable(module.main) and callable(module.show)
    assert "<!-- begin " in PAGE.with_name(PAGES.get(name, PAGE.name)).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [n for n in BENCHMARKS if n not in SLOW])
def test_shortest_form_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It fills its tables in a copy of its page and writes its data."""
    if name in SCRIPTED:
        pytest.importorskip("skfem", reason="needs the extra benchmark: tools/env.sh benchmark")
    module = import_module(BENCHMARKS[name])
    if hasattr(module, "QUIET"):
        monkeypatch.setattr(module, "QUIET", (*module.QUIET, SHORT))
    for made, fewer in SMALL.get(name, {}).items():
        monkeypatch.setattr(module, made, fewer)
    output = Output(tmp_path, PAGES.get(name, PAGE.name))
    module.main(output, True)
    original = PAGE.with_name(output.name).read_text(encoding="utf-8")
    assert output.page.read_text(encoding="utf-8") != original
    assert list((tmp_path / "data").glob("*.csv"))


def test_plain_script_agrees() -> None:
    """On one mesh with the same steps it differs only by its quadrature of the Laplacian."""
    pytest.importorskip("skfem", reason="needs the extra benchmark: tools/env.sh benchmark")
    billet, slab = opponent.BILLET, replace(opponent.STRAND, theirs=())
    case = billet.case(1.2, 0.25)
    times = np.arange(5.0, 10.1, 0.5)
    one = opponent.ours(billet, case).at(times)
    other = opponent.theirs(billet, case)("sdirk2", 0.25, None).at(times)
    assert np.abs(one - other)[:2].max() < 1.0
    assert other[2] == pytest.approx(one[2], rel=2e-4)
    case = slab.case(5.0, 1.0)
    times = np.arange(60.0, 120.0, 1.0)
    one = opponent.ours(slab, case).at(times)
    other = opponent.theirs(slab, case)("sdirk2", 0.5, 0.05).at(times)
    assert np.abs(one - other)[:2].max() < 5.0
    assert other[2] == pytest.approx(one[2], rel=1e-3)


# The benchmarks of the billet run and fill their page.


def between(output: Output, name: str) -> list[str]:
    """Return the lines between the markers of a table."""
    page = output.page.read_text(encoding="utf-8")
    found = re.search(rf"<!-- begin {name} -->\n(.*?)<!-- end {name} -->", page, re.DOTALL)
    return found[1].splitlines()


def test_case_of_the_benchmark_is_the_shipped_one() -> None:
    shipped, ours = load_case(CASE), billet_case(default_settings())
    assert ours.mesh_parameters() == shipped.mesh_parameters()
    given, used = shipped.thermal.time, ours.thermal.time
    assert given.step is not None
    assert (used.scheme, used.step) == (given.scheme, given.step)
    assert ours.cooling == shipped.cooling
    assert ours.mechanics is None


def test_coarse_run_is_near_the_reference_at_every_instant() -> None:
    found = run(replace(refined(GRADED, 3.0), step=0.25))
    assert found.mid_face.shape == found.heat.shape == INSTANTS.shape
    off = errors(found, reference.load()["rounded"])
    assert max(off["mid_face_late_K"], off["corner_late_K"]) < 3.0
    assert off["heat_late_percent"] < 0.2
    assert abs(off["mid_face_exit_K"]) <= off["mid_face_late_K"]


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Use a sweep of two runs for each corner, and coarse defaults."""

    def few(corner: str, quick: bool = False) -> Iterator[Settings]:
        chosen = [s for s in sweep(corner, quick=True) if s.surface_size == 1.2 and s.step == 0.5]
        assert chosen
        yield from chosen[:2]

    monkeypatch.setattr(accuracy, "sweep", few)
    monkeypatch.setattr(
        accuracy, "default_settings", lambda: Settings(surface_size=1.2, tolerance=5.0)
    )


@pytest.mark.usefixtures("short")
def test_section_fills_its_tables(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    words = ["benchmarks", "accuracy", "--quick", "--output", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    command.main()
    output = Output(tmp_path)
    assert len(between(output, "reference")) == 2 + 2 * len(reference.QUANTITIES)
    assert len(between(output, "defaults")) == 2 + 2
    for corner in ("rounded", "sharp"):
        lines = between(output, f"levels {corner}")
        assert len(lines) > 2 and all(line.startswith("|") for line in lines)
    with (tmp_path / "data" / "accuracy.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert {row["variant"] for row in rows} == {"rounded", "sharp"}
    assert all(0.0 < float(row["mid_face_late_K"]) < 10.0 for row in rows)
    assert (tmp_path / "figures" / "accuracy.png").stat().st_size > 10_000


def test_unknown_section_is_refused(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["benchmarks", "acuracy"])
    with pytest.raises(SystemExit) as caught:
        command.main()
    assert caught.value.code == 2
    assert "acuracy" in capsys.readouterr().err


def test_shares_of_the_time_loop_add_up() -> None:
    found = run(Settings(surface_size=1.2, step=0.5))
    parts = costs.shares(found)
    assert sum(parts.values()) == pytest.approx(1.0)
    assert 0.0 < costs.libraries(found) < 1.0
    assert sum(found.sections.values()) == pytest.approx(found.wall, rel=0.05)


def test_caster_is_followed_to_its_places(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(caster, "LENGTH", 1.0)
    monkeypatch.setattr(caster, "PLACES", (0.6, 0.9))
    found = caster.advance(Settings(surface_size=1.2, tolerance=10.0))
    assert found["steps"] > 20
    assert found["shell"].shape == (2,)
    assert found["shell"][1] > found["shell"][0] > 0.0
    assert np.isnan(found["closed_m"]), "the core is open still"


def test_cheapest_run_within_a_level() -> None:
    def row(seconds: float, kelvin: float, heat: float) -> dict[str, Any]:
        return {
            "seconds": seconds, "mid_face_late_K": kelvin, "corner_late_K": 0.0,
            "heat_late_percent": heat, "cell": "quadrilateral",
        }  # fmt: skip

    rows = [row(3.0, 0.05, 0.01), row(1.0, 0.2, 0.01), row(2.0, 0.05, 0.5), row(4.0, 0.01, 0.01)]
    assert cheapest(rows, (0.1, 0.02)) == rows[0]
    assert cheapest(rows, (0.3, 0.02)) == rows[1]
    assert cheapest(rows, (0.1, 0.02), cell="triangle") is None


def test_stored_reference_has_its_uncertainty() -> None:
    stored = json.loads(reference.FILE.read_text(encoding="utf-8"))
    assert set(stored["units"]) >= {"mid_face", "corner", "heat"}
    for corner in reference.load().values():
        for quantity, values in corner.values.items():
            assert values.shape == corner.uncertainty[quantity].shape == INSTANTS.shape
            assert (corner.uncertainty[quantity] >= 0.0).all()
        late = INSTANTS >= 5.0
        assert corner.uncertainty["corner"][late].max() < 0.01, "a hundredth of the finest level"
