"""python -m benchmarks [NAME ...] [--quick] [--output FOLDER]."""

from __future__ import annotations

import argparse
import os
from importlib import import_module
from pathlib import Path
from time import perf_counter

os.environ.setdefault("OMP_NUM_THREADS", "1")

from benchmarks import quoted
from benchmarks.report import PAGE, ROOT, Output

STUDIES = {
    "verification": ("verification", "verification.md"),
    "accuracy": ("accuracy", "benchmarks.md"),
    "caster": ("caster", "benchmarks.md"),
    "costs": ("costs", "benchmarks.md"),
    "opponent": ("opponent", "benchmarks.md"),
    "billet": ("billet_study", "billet.md"),
    "billet_error": ("billet_error", "billet.md"),
    "billet_trade": ("billet_trade", "billet.md"),
    "billet_cost": ("billet_cost", "benchmarks_mechanics.md"),
    "billet_grid": ("billet_grid", "coupling.md"),
    "tolerance": ("tolerance", "mechanics.md"),
    "optimum_holds": ("optimum_holds", "mould_design.md"),
    "slabs": ("slabs", "slab_thesis.md"),
    "hot_tearing": ("hot_tearing", "hot_tearing.md"),
    "slab_error": ("slab_error", "slab_error.md"),
    "slab_cells": ("slab_cells", "slab_error.md"),
    "slab_sprays": ("slab_sprays", "slab_heat.md"),
    "whole_caster": ("whole_caster", "caster.md"),
    "caster_mechanics": ("caster_mechanics", "caster.md"),
    "caster_follow": ("caster_follow", "caster.md"),
    "caster_error": ("caster_error", "caster.md"),
    "stated_error": ("stated_error", "accuracy.md"),
    "throughput": ("sweep_cost", "scripting.md"),
    "sensitivity": ("sensitivity", "sensitivity.md"),
    "sensitivity_errors": ("sensitivity_errors", "sensitivity.md"),
    "systems": ("systems", "environment.md"),
    "grades": ("grades", "my_steel.md"),
}
"""Module of each benchmark and page with its tables, in the order in which they run.

`main(output, quick)` of a module runs the benchmark, `show(output)` writes its tables."""
BENCHMARKS = {name: f"benchmarks.{module}" for name, (module, _) in STUDIES.items()}
PAGES = {name: page for name, (_, page) in STUDIES.items()}


def parse() -> argparse.Namespace:
    """Parse the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks",
        description="Run the benchmarks; they write what docs/benchmarks*.md show.",
    )
    parser.add_argument(
        "names",
        nargs="*",
        choices=[[], *BENCHMARKS, "reference", "tables"],
        metavar="NAME",
        help=f"{', '.join(BENCHMARKS)} (all of them by default), or reference: the converged "
        "values anew, which takes minutes; tables: "
        "nothing is run, the pages are made anew from docs/data",
    )
    parser.add_argument(
        "--quick", action="store_true", help="few and short runs, into results/benchmarks"
    )
    parser.add_argument("--output", type=Path, help="folder instead of docs/")
    return parser.parse_args()


def tables(folder: Path) -> None:
    """Rewrite all tables and quoted numbers of the pages from the data in `folder`."""
    for name, module in BENCHMARKS.items():
        import_module(module).show(Output(folder, PAGES.get(name, PAGE.name)))
    quoted.rewrite(folder)


def main() -> None:
    """Run the requested benchmarks."""
    options = parse()
    folder = options.output or (ROOT / "results" / "benchmarks" if options.quick else PAGE.parent)
    for name in options.names or BENCHMARKS:
        if name == "tables":
            tables(folder)
            continue
        start = perf_counter()
        output = Output(folder, PAGES.get(name, PAGE.name))
        if name == "reference":
            from benchmarks import reference

            reference.main(output)
        else:
            import_module(BENCHMARKS[name]).main(output, options.quick)
        print(f"{name}: {perf_counter() - start:.0f} s", flush=True)
    if folder == PAGE.parent:
        quoted.rewrite(folder)
        print(*quoted.wrong(folder), sep="\n")
    print(f"results in {folder}")


if __name__ == "__main__":
    main()
