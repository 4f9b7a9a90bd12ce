"""Every benchmark is imported, and run in its shortest form where that takes some seconds."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from benchmarks import billet_run, corner, throughput, wall_study
from benchmarks.__main__ import BENCHMARKS, PAGES
from benchmarks.report import PAGE, ROOT, Output

SHORT = 'casting.length="40 mm"'
SLOW = {
    "accuracy": "16 s of processor time, most of it the time stepping that tests/thermal covers",
    "caster": "22 s: a caster of 20 m, run by tests/time_loop",
    "jumps": "its runs with a fine step; tests/thermal covers what they show",
    "mean_stress": "meshes to n = 16; tests/mechanics has the coarse ones",
    "latent_heat": "15 s: needs its whole run to have fronts to compare",
    "costs": "30 s: processes of their own, several times each",
    "weiner_boley": "44 s: past 21 s of freezing; tests/verification runs the shipped case",
    "mechanical_cost": "processes of their own, several times each",
    "billet": "some 20 billets",
    "billet_moved": "two billets at their shipped cells",
    "billet_inputs": "some 30 billets",
    "billet_error": "four billets to the mould's exit",
    "billet_convergence": "some 20 billets",
    "billet_trade": "billets that are compared with a reference at the mould's exit",
    "billet_cost": "repeated billets; its runs are tested in test_billet_benchmarks.py",
    "section": "repeated billets; tests/mould_fit/test_section.py has coarse ones",
    "hot_mould": "billets and tubes; tests/mould_fit and tests/hot_mould run coarse ones",
    "faster": "ten billets, each in another way",
    "bulging": "slabs down their caster; tests/runs/test_bulging_slab.py has short ones",
    "strip_shell": "half a minute; tests/bulging/test_shell_ahead.py has its foresight",
    "strip_start": "some seconds; tests/bulging/test_creeping_strip.py has one of its starts",
    "strip_order": "half a minute; tests/bulging has its orders",
    "lost_roll": "a minute; tests/bulging/test_ode_strip.py and test_uneven.py have its parts",
    "creeping_plate": "14 s; test_creeping_plate.py has smaller plates",
    "shell3d": "tests/bulging/test_shell3d.py has two of its slabs",
    "moving_strip": "two minutes; tests/bulging/test_moving_strip.py has coarse ones",
    "slab_bending": "slabs through bender and straightener; test_slab_tables.py tests what is read",
    "slab_error": "some ten slabs down their caster; test_slab_tables.py tests how it compares",
    "slab_reversal": "slabs down their caster; test_slab_reversal.py has its fibres",
    "slab_extremes": "some thirty coarse slabs; tests/runs/test_bulging_slab.py has its ends",
    "slab_cells": "processes of their own, with up to some 4000 cells",
    "slab_downstream": "slabs down their caster; test_slab_tables.py has their cases",
    "slab_ranks": "processes of their own, on one rank and on two",
    "slab_opponent": "slabs of 4 m; test_slab_duel.py has a short one",
    "slab_mould": "slabs through a mould; tests/benchmarks/test_slab_tables.py has its cases",
    "slab_sprays": "slabs down their caster; test_slab_tables.py tests what is read off them",
    "optimum": "some 150 billets; tests/design drives the search by results that are known",
    "optimum_holds": "some 80 short billets, half of them on fine cells; tests/design as above",
    "optimum_interval": "some 150 billets; tests/design has spread and front of known results",
    "optimum_gradients": "some 80 billets; tests/sensitivity has the derivatives",
    "optimum_fit": "some 100 billets; test_optimum_fit.py fits what is known",
    "optimum_methods": "some 150 billets; tests/optimisation/test_descent.py drives the search",
    "optimum_time": "some 80 billets by three levels; its parts are those of the others",
    "slabs": "reads what `make slabs` has run; test_slab_tables.py tests how",
    "sensitivity": "some forty billets; tests/sensitivity has smaller ones",
    "sensitivity_apart": "some thirty billets; tests/sensitivity has the derivatives",
    "stated_error": "ladders of five cases; tests/cli/test_cli_error.py has short ones",
    "throughput": "a sweep of 32 billets; tests/benchmarks/test_sweep_cost.py has its table",
    "plain_run": "commands beside those of an earlier version, which a clone has not",
    "verification": "tests/verification runs what it runs",
}
"""Imported alone, and why; `python -m benchmarks NAME --quick` runs them."""

SMALL: dict[str, dict[str, Any]] = {
    "liquid": {"FACTORS": (10.0,)},
    "before_shell": {"FEW": ((2.0, 0.5, 0.3),)},
    "coupling": {"CASES_TO_RUN": (("taper_1", (), 0.5),)},
    "meniscus": {"COARSE": (*billet_run.COARSE, 'casting.length="120 mm"')},
    "corner": {
        "CELLS": {"4": ("4", "4", "18", "22")},
        "KINDS": {mush: {"cells 4 mm": corner.SHORT} for mush in ("skeleton", "none")},
    },
    "billet_grid": {"LENGTH": "8 mm", "HALF": {"mesh": 0.9}},
    "windows": {"MOULDS": {"taper_0": (3.0, billet_run.mesh(3.0))}, "REFERENCE": 0.2},
    "optimum_noise": {"WINDOWS": {"0.2 s": {}}, "CHANGES": {"casting.length": "60 mm"}},
    "wall": {"PARTS": (wall_study.frictions, wall_study.factors), "FACTORS": (10, 1000)},
}
"""What is tried of the others, where even `--quick` is more than a test needs."""


@pytest.mark.parametrize("file", sorted((ROOT / "benchmarks").glob("*.py")), ids=lambda p: p.stem)
def test_module_is_imported(file: Path) -> None:
    """Every name that a module takes from another is there."""
    if file.stem in ("opponent", "duel", "plain_heat", "slab_opponent", "slab_duel"):
        pytest.importorskip("skfem")
    import_module("benchmarks" if file.stem == "__init__" else f"benchmarks.{file.stem}")
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        # Those within functions, which an import alone does not reach.
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.startswith("benchmarks")
        ):
            if node.module.endswith(("opponent", "plain_heat")):
                continue
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
    if name == "opponent":
        pytest.importorskip("skfem")
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


def test_help_runs_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        throughput.main(["--help"])
    assert end.value.code == 0
    assert "REPEATS" in capsys.readouterr().out
