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

BENCHMARKS = {
    "verification": "benchmarks.verification",
    "accuracy": "benchmarks.accuracy",
    "caster": "benchmarks.caster",
    "jumps": "benchmarks.jumps",
    "latent_heat": "benchmarks.latent_heat",
    "opponent": "benchmarks.duel",
    "slab_opponent": "benchmarks.slab_duel",
    "costs": "benchmarks.costs",
    "weiner_boley": "benchmarks.weiner_boley",
    "mean_stress": "benchmarks.mean_stress",
    "mechanical_cost": "benchmarks.mechanical_cost",
    "billet": "benchmarks.billet_study",
    "billet_moved": "benchmarks.billet_moved",
    "meniscus": "benchmarks.meniscus",
    "billet_inputs": "benchmarks.billet_sensitivity",
    "billet_error": "benchmarks.billet_error",
    "billet_convergence": "benchmarks.billet_convergence",
    "billet_trade": "benchmarks.billet_trade",
    "billet_cost": "benchmarks.billet_cost",
    "faster": "benchmarks.faster",
    "coupling": "benchmarks.coupling",
    "windows": "benchmarks.windows",
    "corner_model": "benchmarks.corner_model",
    "corner": "benchmarks.corner",
    "billet_grid": "benchmarks.billet_grid",
    "wall": "benchmarks.wall_study",
    "before_shell": "benchmarks.before_shell",
    "liquid": "benchmarks.liquid",
    "order": "benchmarks.order",
    "optimum": "benchmarks.optimum",
    "optimum_noise": "benchmarks.optimum_noise",
    "optimum_holds": "benchmarks.optimum_holds",
    "optimum_interval": "benchmarks.optimum_interval",
    "optimum_gradients": "benchmarks.optimum_gradients",
    "optimum_fit": "benchmarks.optimum_fit",
    "optimum_methods": "benchmarks.optimum_methods",
    "optimum_time": "benchmarks.optimum_time",
    "bulging": "benchmarks.bulging",
    "strip_order": "benchmarks.strip_order",
    "strip_shell": "benchmarks.strip_shell",
    "strip_start": "benchmarks.strip_start",
    "hot_mould": "benchmarks.hot_mould",
    "section": "benchmarks.section_study",
    "lost_roll": "benchmarks.lost_roll",
    "creeping_plate": "benchmarks.creeping_plate",
    "shell3d": "benchmarks.shell3d",
    "moving_strip": "benchmarks.moving_strip",
    "slabs": "benchmarks.slabs",
    "slab_bending": "benchmarks.slab_bending",
    "slab_mould": "benchmarks.slab_mould",
    "slab_downstream": "benchmarks.slab_downstream",
    "slab_reversal": "benchmarks.slab_reversal",
    "slab_error": "benchmarks.slab_error",
    "slab_extremes": "benchmarks.slab_extremes",
    "slab_cells": "benchmarks.slab_cells",
    "slab_ranks": "benchmarks.slab_ranks",
    "slab_sprays": "benchmarks.slab_sprays",
    "stated_error": "benchmarks.stated_error",
    "throughput": "benchmarks.sweep_cost",
    "plain_run": "benchmarks.plain_run",
    "sensitivity": "benchmarks.sensitivity",
    "sensitivity_apart": "benchmarks.sensitivity_apart",
    "sensitivity_errors": "benchmarks.sensitivity_errors",
}
"""Names and modules, in the order in which they run; each has `main(output, quick)`."""
PAGES = {
    "verification": "verification.md",
    "weiner_boley": "benchmarks_mechanics.md",
    "mean_stress": "mechanics.md",
    "mechanical_cost": "benchmarks_mechanics.md",
    "billet": "billet.md",
    "billet_moved": "billet.md",
    "meniscus": "billet.md",
    "billet_inputs": "billet.md",
    "billet_error": "billet.md",
    "billet_convergence": "billet.md",
    "billet_trade": "billet.md",
    "billet_cost": "benchmarks_mechanics.md",
    "faster": "benchmarks_mechanics.md",
    "coupling": "coupling.md",
    "windows": "coupling.md",
    "corner_model": "coupling.md",
    "corner": "coupling.md",
    "billet_grid": "coupling.md",
    "wall": "contact.md",
    "before_shell": "mechanics.md",
    "liquid": "mechanics.md",
    "order": "coupling.md",
    "optimum": "mould_design.md",
    "optimum_noise": "mould_design.md",
    "optimum_holds": "mould_design.md",
    "optimum_interval": "mould_design.md",
    "optimum_gradients": "mould_design.md",
    "optimum_fit": "mould_design.md",
    "optimum_methods": "mould_design.md",
    "optimum_time": "mould_design.md",
    "bulging": "slab_bulging.md",
    "strip_order": "slab_bulging.md",
    "strip_shell": "slab_bulging.md",
    "strip_start": "slab_bulging.md",
    "hot_mould": "hot_mould.md",
    "section": "mould.md",
    "lost_roll": "slab_bulging.md",
    "creeping_plate": "slab_limits.md",
    "shell3d": "slab_bulging.md",
    "moving_strip": "slab_bulging.md",
    "slabs": "slab_thesis.md",
    "slab_bending": "slab_bending.md",
    "slab_mould": "slab_heat.md",
    "slab_downstream": "slab_heat.md",
    "slab_reversal": "slab_thesis.md",
    "slab_error": "slab_error.md",
    "slab_extremes": "slab_limits.md",
    "slab_cells": "slab_error.md",
    "slab_ranks": "slab_error.md",
    "slab_sprays": "slab_heat.md",
    "stated_error": "accuracy.md",
    "throughput": "scripting.md",
    "sensitivity": "sensitivity.md",
    "sensitivity_apart": "sensitivity.md",
    "sensitivity_errors": "sensitivity.md",
}
"""Pages of those whose tables do not stand in the first."""


def parse() -> argparse.Namespace:
    """The command line."""
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
    """Make all that the pages quote anew from the data in `folder`; nothing is run."""
    for name, module in BENCHMARKS.items():
        import_module(module).show(Output(folder, PAGES.get(name, PAGE.name)))
    quoted.rewrite(folder)


def main() -> None:
    """Run what was asked for."""
    given = parse()
    folder = given.output or (ROOT / "results" / "benchmarks" if given.quick else PAGE.parent)
    for name in given.names or BENCHMARKS:
        if name == "tables":
            tables(folder)
            continue
        start = perf_counter()
        output = Output(folder, PAGES.get(name, PAGE.name))
        if name == "reference":
            from benchmarks import reference

            reference.main(output)
        else:
            import_module(BENCHMARKS[name]).main(output, given.quick)
        print(f"{name}: {perf_counter() - start:.0f} s", flush=True)
    if folder == PAGE.parent:
        quoted.rewrite(folder)
        print(*quoted.wrong(folder), sep="\n")
    print(f"results in {folder}")


if __name__ == "__main__":
    main()
