"""The billet through 20 m of a caster: effect of the size of the cells in the core.

In the mould the core is liquid and its cells hardly matter, but where it closes depends on them.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.accuracy import default_settings
from benchmarks.billet import CASE, LENGTHS, Settings, time_table
from benchmarks.report import Output
from castfem.model import from_document, load_case
from castfem.model.build.simulation import build
from castfem.runs.loop import TimeLoop

LENGTH = 20.0  # m
PLACES = (3.0, 6.0, 10.0, 15.0)  # m below the meniscus
CORES = (8.0, 4.0, 2.0)  # mm


def advance(settings: Settings) -> dict[str, Any]:
    """Run the billet down the caster; return results at `PLACES` and where the core closes."""
    document = load_case(CASE).document()
    document["casting"]["length"] = f"{LENGTH:g} m"
    mesh = {n: getattr(settings, n) for n in LENGTHS}
    document["mesh"] = {"cell": settings.cell} | {
        n: f"{v:.17g} mm" for n, v in mesh.items() if v is not None
    }
    document["thermal"]["time"] = time_table(settings)
    document["thermal"]["solver"] = settings.solver
    document["output"] = {"fields": []}
    # The run stops exactly at the position of a reference number and keeps the results there.
    number = {"quantity": "surface_temperature_mid_face", "value": "0 degC", "source": "-"}
    document["reference"] = [number | {"at": f"{place:g} m"} for place in PLACES]
    simulation = build(from_document(document, "caster"), MPI.COMM_SELF)
    try:
        run = TimeLoop(simulation)
        start = perf_counter()
        run.run()
        wall = perf_counter() - start
        closed = run.run_state.sampler.metallurgical_length
        samples = [run.run_state.snapshots[p] for p in PLACES]
        vertices = simulation.section.owned
    finally:
        simulation.destroy()
    return {
        "vertices": vertices,
        "steps": run.run_state.counts.steps,
        "closed_m": closed if closed is not None else float("nan"),
        **{
            name: np.array([s[f"{name}"].value for s in samples])
            for name in ("surface_temperature_mid_face", "surface_temperature_corner")
        },
        "shell": np.array(
            [s["shell_mid_face"].value for s in samples if s["position"].value < 7.0]
        ),
        "seconds": wall,
    }


def main(output: Output, quick: bool = False) -> None:
    """Compare core sizes with a fine mesh; write table and CSV."""
    base = default_settings()
    core = 2.0 if quick else 1.0
    finest = {"face_size": core, "core_size": core, "step": None, "tolerance": 1.0}
    fine = advance(replace(base, surface_depth=8.0, **finest))
    rows = []
    for size in (8.0,) if quick else CORES:
        found = advance(replace(base, face_size=size, core_size=size))
        rows.append(
            {
                "core_size_mm": size,
                "vertices": found["vertices"],
                "steps": found["steps"],
                "closed_m": found["closed_m"],
                "closed_error_mm": 1e3 * (found["closed_m"] - fine["closed_m"]),
                **{
                    f"{short}_error_K": float(np.abs(found[name] - fine[name]).max())
                    for short, name in (
                        ("mid_face", "surface_temperature_mid_face"),
                        ("corner", "surface_temperature_corner"),
                    )
                },
                "shell_error_mm": float(1e3 * np.abs(found["shell"] - fine["shell"]).max()),
                "seconds": found["seconds"],
            }
        )
    rows.append(
        {
            "core_size_mm": core,
            "vertices": fine["vertices"],
            "steps": fine["steps"],
            "closed_m": fine["closed_m"],
        }
    )
    output.csv("caster", rows)
    show(output)


def show(output: Output) -> None:
    """Write the table from the data."""
    head = {
        "core_size_mm": "core and face size [mm]", "vertices": "vertices", "steps": "steps",
        "closed_m": ("core closes at [m]", ".3f"), "closed_error_mm": ("error [mm]", "+.0f"),
        "mid_face_error_K": ("mid-face [K]", ".2f"), "corner_error_K": ("corner [K]", ".2f"),
        "shell_error_mm": ("shell [mm]", ".2f"), "seconds": ("time loop [s]", ".2f"),
    }  # fmt: skip
    output.table("caster", output.rows("caster"), head)
