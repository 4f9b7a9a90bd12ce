"""What the first slivers of solid do to the axial strain: by windows, cells and friction.

Fed liquid forgets, and cells that are mostly liquid give way; neither may make the strand longer.
Writes a table of docs/mechanics.md.
"""

from __future__ import annotations

from typing import Any

from benchmarks.billet_run import QUIET
from benchmarks.report import Output, table
from benchmarks.wall_study import run_case

# Cells at the surface, mm; coupling window, s; Coulomb's coefficient.
RUNS = (
    *((0.8, 0.05, 0.0), (0.8, 0.1, 0.0), (0.8, 0.5, 0.0), (2.0, 0.1, 0.0), (0.4, 0.1, 0.0)),
    *((0.8, 0.05, 0.3), (0.8, 0.1, 0.3), (2.0, 0.1, 0.3), (0.4, 0.1, 0.3)),
)
FEW = ((2.0, 0.5, 0.0), (2.0, 0.5, 0.3))


def main(output: Output, quick: bool) -> None:
    """The billet at +1 %/m to its mould's exit."""
    rows: list[dict[str, Any]] = []
    for size, window, coefficient in FEW if quick else RUNS:
        law = f'mould.friction={{law="coulomb", coefficient={coefficient}}}'
        changes = [*QUIET, f"mesh.surface_size={size} mm", f"mesh.corner_size={size} mm"]
        changes += ["mesh.face_size=8 mm", "mesh.core_size=10 mm", f"coupling.interval={window} s"]
        found = run_case("taper_1", [*changes, *([law] if coefficient else [])])
        strains = [sample.strain for sample in found.mechanics]
        # Without friction no force is left along the strand but what holds the planes.
        forces = [abs(s.balance.axial[0]) for s in found.mechanics if s.balance is not None]
        rows.append(
            {
                "size": size, "window": window, "friction": coefficient,
                "longest": 100.0 * max(0.0, *strains), "end": 100.0 * strains[-1],
                "held": None if coefficient else max(forces),
                "peak": found.values["von_mises_max"] / 1e6,
            }
        )  # fmt: skip
    output.csv("before_shell", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "size": "surface cells, mm", "window": "window, s", "friction": "friction",
        "longest": "axial strain, % at most", "end": "at the end", "held": "what holds, N",
        "peak": "peak stress, MPa",
    }  # fmt: skip
    forms = {"longest": ".4f", "end": ".4f", "held": ".2f", "peak": ".2f"}
    output.insert("before the shell", table(output.rows("before_shell"), head, forms))
