"""The hot mould: the two tubes of thesis V.2.4 and others, strand and mould together, and scale."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, COARSE, QUIET
from benchmarks.report import ROOT, Columns, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.stopwatch import peak_memory
from castfem.model import load_case
from castfem.model.mould_from_case import nominal_mould
from castfem.physics.mould.hot.model import HotMould, HotWall
from castfem.physics.mould.mould import Mould
from castfem.studies.mould_fit.coupled import (
    AGREEMENT,
    Turn,
    copper_of,
    drawing,
    flux_of,
    hot_mould_of,
    settings_of,
)
from castfem.studies.mould_fit.follow import follow

TUBE = ("mould.tube.thickness=10 mm", "mould.length=600 mm")
TUBES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("0 %/m", ()),
    ("+1 %/m", ("mould.taper=1 %/m",)),
    ("+1 %/m, wall of 15 mm", ("mould.taper=1 %/m", "mould.tube.thickness=15 mm")),
    ("+1 %/m, upper end clamped", ("mould.taper=1 %/m", "mould.tube.support=clamped")),
    ("+1 %/m, both ends held", ("mould.taper=1 %/m", "mould.tube.support=between")),
    ("+1 %/m, half the water's h", ("mould.taper=1 %/m",
                                    "mould.tube.water_coefficient=15000 W/(m^2 K)")),
    ("0 %/m, faces at 150 and 100 degC all round", ("mould.tube.hot_face=150 degC",
                                                    "mould.tube.water_side=100 degC")),
)  # fmt: skip
"""What is said of each tube, and what it differs in."""
TURNS = {
    "heat_removed_slice": ("heat [kJ]", 1e-3),
    "shell_mid_face": ("shell, mid-face [mm]", 1e3),
    "shell_corner": ("shell, corner [mm]", 1e3),
    "mould_gap_max": ("largest gap [mm]", 1e3),
    "mould_contact_least": ("least share in contact [%]", 1e2),
    "mould_mean_pressure_max": ("largest mean pressure [MPa]", 1e-6),
    "von_mises_max": ("peak stress [MPa]", 1e-6),
}
CELLS = ((1, 0.016), (2, 0.012), (2, 0.0075), (2, 0.005), (3, 0.004), (3, 0.0024))
"""Through the wall, and largest size along it, m."""
PROBE = "benchmarks.hot_mould"
PARTS = ("tubes", "turns", "scale")
_INNER = (0.1, 0.5)
"""Positions between which the ends of the tube are not felt, m."""


def sizes(found_hot: Mould, found_cold: Mould) -> dict[str, float]:
    """How much wider a mould is at work, mm: range of the width away from its ends, at the exit."""
    wider: dict[str, list[float]] = {"width": [], "diagonal": []}
    places = np.linspace(*_INNER, 41)
    for z in (*places, found_hot.length):
        hot, cold = found_hot.dimensions(float(z)), found_cold.dimensions(float(z))
        for name, values in wider.items():
            values.append(1e3 * (hot[name] - cold[name]))
    return {
        "width_least_mm": min(wider["width"][:-1]),
        "width_most_mm": max(wider["width"][:-1]),
        "width_exit_mm": wider["width"][-1],
        "diagonal_least_mm": min(wider["diagonal"][:-1]),
        "diagonal_most_mm": max(wider["diagonal"][:-1]),
    }


def tubes(output: Output, quick: bool) -> None:
    """The two tubes of V.2.4, heated by the billet in contact all round, and what else matters."""
    cells = ("mould.tube.cell_size=40 mm", "mould.tube.cells_across=1") if quick else ()
    short = ("thermal.time.step=1 s",) if quick else ()
    strand = follow(load_case(CASES / "thermal.toml", (*QUIET, *short)), MPI.COMM_SELF)
    rows = []
    for name, changes in TUBES[: 2 if quick else None]:
        case = load_case(CASES / "taper_0.toml", (*TUBE, *cells, *changes))
        assert case.mould is not None and case.mould.tube is not None
        mould = nominal_mould(case.mould, case.section)
        tube = HotMould(MPI.COMM_SELF, mould, copper_of(case.mould), settings_of(case.mould))
        given = case.mould.tube.hot_face is not None
        wall = tube.solve(None if given else flux_of(strand, mould))
        table_of_it = case.mould.model_copy(update={"condition": "working"})
        found = drawing(table_of_it, mould, wall)
        rows.append({"tube": name, **sizes(found.hot, found.cold), **_copper(wall)})
    output.csv("hot_mould_tubes", rows)


def _copper(wall: HotWall) -> dict[str, float]:
    return {
        "hottest_degC": wall.heated.hottest - ZERO_CELSIUS,
        "hottest_at_mm": 1e3
        * float(
            wall.displacement.positions[np.unravel_index(wall.hot.argmax(), wall.hot.shape)[0]]
        ),
        "water_side_degC": float(wall.outer.max()) - ZERO_CELSIUS,
        "von_mises_MPa": 1e-6 * wall.distorted.largest_stress,
        "longer_mm": 1e3 * wall.longer,
    }


def turns(output: Output, quick: bool) -> None:
    """The billet at +1 %/m in a mould that is drawn cold, going round with its copper."""
    cells = ("casting.length=60 mm", "mould.length=60 mm") if quick else ()
    fewer = ("mould.tube.cell_size=40 mm", "mould.tube.cells_across=1") if quick else ()
    case = load_case(CASES / "hot.toml", (*QUIET, *COARSE, *cells, *fewer))
    found = hot_mould_of(case, MPI.COMM_SELF, "hot", 2 if quick else AGREEMENT.most)
    assert case.mould is not None
    mould = nominal_mould(case.mould, case.section)
    output.csv("hot_mould_turns", [_row(i, turn) for i, turn in enumerate(found, start=1)])
    drawn = drawing(case.mould, mould, found[-1].wall)
    zones = []
    for name in ("width", "diagonal"):
        for state, shape in (("cold", drawn.cold), ("at work", drawn.hot)):
            ends = (shape.dimensions(z)[name] for z in (0.0, shape.length))
            start, end = ends
            zones.append(
                {
                    "dimension": f"{name}, {state}",
                    "inlet_mm": 1e3 * start,
                    "outlet_mm": 1e3 * end,
                    "taper_percent_m": 100.0 * (start - end) / (end * shape.length),
                }
            )
    output.csv("hot_mould_drawing", zones)


def _row(number: int, turn: Turn) -> dict[str, Any]:
    assert turn.strand is not None
    values = {name: factor * turn.strand.value(name) for name, (_, factor) in TURNS.items()}
    return {
        "turn": number,
        **values,
        "hottest_degC": turn.wall.heated.hottest - ZERO_CELSIUS,
        "moved_um": "" if turn.moved != turn.moved else 1e6 * turn.moved,
    }


def scale(output: Output, quick: bool) -> None:
    """Time and memory against unknowns, on one rank and on two."""
    rows: list[dict[str, Any]] = []
    for cells in CELLS[: 1 if quick else None]:
        for ranks in (1,) if quick else (1, 2):
            rows += list(_measured(*cells, ranks))
    output.csv("hot_mould_scale", rows)


def _measured(across: int, size: float, ranks: int) -> Iterator[dict[str, Any]]:
    """Run one tube in processes of its own, by each method that may be."""
    for method in ("direct", "multigrid"):
        words = [sys.executable, "-m", PROBE, str(across), str(size), method]
        launcher = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
        ended = subprocess.run(
            [*launcher, *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
        if ended.returncode == 0:
            yield json.loads(ended.stdout.splitlines()[-1])


def probe(across: int, size: float, method: str) -> dict[str, Any]:
    """Solve one tube on all ranks and measure it."""
    comm = MPI.COMM_WORLD
    changes = (
        f"mould.tube.cells_across={across}", f"mould.tube.cell_size={size} m",
        f"mould.tube.solver={method}", "mould.tube.flux=2 MW/m^2",
    )  # fmt: skip
    case = load_case(CASES / "taper_1.toml", (*TUBE, *changes))
    # Forms are compiled before the clock starts.
    small = load_case(CASES / "taper_1.toml", (*TUBE, "mould.tube.flux=2 MW/m^2",
                                               "mould.tube.cell_size=60 mm"))  # fmt: skip
    hot_mould_of(small, comm, "tube")
    comm.Barrier()
    start, used = perf_counter(), process_time()
    (turn,) = hot_mould_of(case, comm, "tube")
    seconds = comm.allreduce(perf_counter() - start, op=MPI.MAX)
    processor = comm.allreduce(process_time() - used, op=MPI.SUM)
    solved = turn.wall.distorted.solved
    return {
        "unknowns": solved.unknowns,
        "ranks": comm.size,
        "method": method,
        "heat_iterations": turn.wall.heated.solved.iterations,
        "iterations": solved.iterations,
        "seconds": seconds,
        "processor_seconds": processor,
        "memory_GB": 1e-9 * comm.allreduce(peak_memory(), op=MPI.SUM),
        "width_mm": 2e3 * float(turn.wall.displacement.at(0.3)[0, 0]),
        "width_exit_mm": 2e3 * float(turn.wall.displacement.at(0.6)[0, 0]),
        "stress_MPa": 1e-6 * turn.wall.distorted.largest_stress,
    }


def main(output: Output, quick: bool = False) -> None:
    """Run all parts."""
    for part in PARTS:
        globals()[part](output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    found = output.rows("hot_mould_tubes")
    for row in found:
        for name in ("width", "diagonal"):
            row[name] = f"{row[f'{name}_least_mm']:.3f} to {row[f'{name}_most_mm']:.3f}"
    head: Columns = {
        "tube": "tube", "width": "wider by [mm]", "width_exit_mm": ("at the exit [mm]", ".3f"),
        "diagonal": "diagonal [mm]", "hottest_degC": ("hottest [°C]", ".0f"),
        "hottest_at_mm": ("at [mm]", ".0f"), "water_side_degC": ("water side [°C]", ".0f"),
        "von_mises_MPa": ("stress [MPa]", ".0f"), "longer_mm": ("longer [mm]", ".2f"),
    }  # fmt: skip
    output.table("hot_mould_tubes", found, head)
    forms = {"mould_gap_max": ".3f", "mould_mean_pressure_max": ".3f"}
    head = {
        "turn": "iteration",
        **{name: (text, forms.get(name, ".2f")) for name, (text, _) in TURNS.items()},
        "hottest_degC": ("copper [°C]", ".0f"), "moved_um": ("wall moved [um]", ".1f"),
    }  # fmt: skip
    output.table("hot_mould_turns", output.rows("hot_mould_turns"), head)
    head = {
        "dimension": "dimension", "inlet_mm": ("at the meniscus [mm]", ".3f"),
        "outlet_mm": ("at the exit [mm]", ".3f"), "taper_percent_m": ("taper [%/m]", ".3f"),
    }  # fmt: skip
    output.table("hot_mould_drawing", output.rows("hot_mould_drawing"), head)
    head = {
        "unknowns": ("unknowns", ".0f"), "ranks": "ranks", "method": "method",
        "heat_iterations": "iterations, heat", "iterations": "iterations, displacement",
        "processor_seconds": ("processor time [s]", ".1f"), "memory_GB": ("memory [GB]", ".2f"),
        "width_mm": ("wider at 300 mm [mm]", ".4f"), "width_exit_mm": ("at the exit [mm]", ".4f"),
        "stress_MPa": ("stress [MPa]", ".1f"),
    }  # fmt: skip
    output.table("hot_mould_scale", output.rows("hot_mould_scale"), head)


if __name__ == "__main__":
    measured = probe(int(sys.argv[1]), float(sys.argv[2]), sys.argv[3])
    if MPI.COMM_WORLD.rank == 0:
        print(json.dumps(measured))
