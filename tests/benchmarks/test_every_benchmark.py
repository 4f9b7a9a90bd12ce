"""Every benchmark is imported, and run in its shortest form where that takes some seconds."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from benchmarks import billet_run
from benchmarks.__main__ import BENCHMARKS, PAGES
from benchmarks.report import PAGE, ROOT, Output

pytestmark = pytest.mark.slow

SHORT = 'casting.length="40 mm"'
SLOW = {
    "accuracy": "16 s of processor time, most of it the time stepping that tests/thermal covers",
    "caster": "22 s: a caster of 20 m, run by tests/runs",
    "costs": "30 s: processes of their own, several times each",
    "weiner_boley": "44 s: past 21 s of freezing; tests/closed_forms runs the shipped case",
    "billet": "six billets at their shipped cells",
    "billet_error": "four billets to the mould's exit",
    "billet_trade": "billets that are compared with a reference at the mould's exit",
    "billet_cost": "repeated billets; its runs are tested in test_billet_benchmarks.py",
    "hot_mould": "billets and tubes; tests/mould_fit and tests/hot_mould run coarse ones",
    "shell3d": "tests/bulging/test_shell3d.py has two of its slabs",
    "slab_bending": "slabs through bender and straightener; test_slab_tables.py tests what is read",
    "slab_error": "some ten slabs down their caster; test_slab_tables.py tests how it compares",
    "slab_sprays": "slabs down their caster; test_slab_tables.py tests what is read off them",
    "optimum": "some 150 billets; tests/optimisation drives the search by results that are known",
    "optimum_interval": "some 150 billets; tests/optimisation has spreads and fronts",
    "slabs": "reads what `make slabs` has run; test_slab_tables.py tests how",
    "sensitivity": "some forty billets; tests/sensitivity has smaller ones",
    "stated_error": "ladders of five cases; tests/cli/test_cli_error.py has short ones",
    "systems": "systems from nothing, over a network; `make test-pip` sets one up",
    "throughput": "a sweep of 32 billets, several times",
    "verification": "tests/closed_forms runs what it runs",
}
"""Imported alone, and why; `python -m benchmarks NAME --quick` runs them."""

SMALL: dict[str, dict[str, Any]] = {
    "coupling": {"CASES_TO_RUN": (("taper_1", (), 0.5),)},
    "corner": {
        "CELLS": {"4": ("4", "4", "18", "22")},
        "KINDS": {
            mush: {"cells 4 mm": ("casting.length=200 mm",)} for mush in ("skeleton", "none")
        },
    },
    "billet_grid": {"LENGTH": "8 mm", "HALF": {"mesh": 0.9}},
    "windows": {"MOULDS": {"taper_0": (3.0, billet_run.mesh(3.0))}, "REFERENCE": 0.2},
    "sensitivity_errors": {
        "QUICK": ("casting.length=100 mm", "mesh.surface_size=1 mm", "mesh.corner_size=1 mm"),
        "RUNS": (("billet125/thermal", (), ("heat_removed",), ("casting.superheat",)),),
    },
}
"""What is tried of the others, where even `--quick` is more than a test needs."""


@pytest.mark.parametrize("file", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_module_is_imported(file: Path) -> None:
    """Every name that a module takes from another is there."""
    import_module("benchmarks" if file.stem == "__init__" else f"benchmarks.{file.stem}")
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        # Those within functions, which an import alone does not reach.
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
