"""A synthetic result folder of a run with mechanics and a mould, see `synthetic_run`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from synthetic_run import COLUMNS, HALF, LIQUIDUS, SOLIDUS, rectangle, rows, summary, temperature

from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import History
from castfem.runs.output.xdmf import FieldWriter

LOST, REGAINED = 0.12, 0.36  # m; where the corner leaves the wall, and touches it again
MECHANICS = [
    ("newton_mechanics", "-"),
    ("von_mises_max", "MPa"),
    *((f"von_mises_{p}", "MPa") for p in ("mid_face", "corner")),
    *((f"displacement_{p}", "mm") for p in ("mid_face", "corner")),
    *((f"size_{p}", "mm") for p in ("mid_face", "corner")),
    ("axial_strain", "-"),
    ("axial_force", "kN"),
    ("force_error", "-"),
    *((f"gap_{p}", "mm") for p in ("mid_face", "corner")),
    ("gap_max", "mm"),
    *((f"contact_pressure_{p}", "MPa") for p in ("mid_face", "corner")),
    ("contact_pressure_max", "MPa"),
    ("penetration", "um"),
    ("contact_share", "percent"),
    ("friction_force", "kN/m"),
    ("friction_pull", "kN"),
]


def strained(row: dict[str, float]) -> dict[str, float]:
    """Add the columns of a strand in a mould to a row of the history."""
    z = row["position"]
    reach = 5.0 * min(z - LOST, REGAINED - z)
    gap = max(0.0, reach)
    return row | {
        "newton_mechanics": 3.0,
        "von_mises_max": 20.0 * z,
        "von_mises_mid_face": 6.0 * z,
        "von_mises_corner": 18.0 * z,
        "displacement_mid_face": 0.3 * z,
        "displacement_corner": -0.4 * z,
        "size_mid_face": 125.0 + 0.6 * z,
        "size_corner": 172.6 - 0.8 * z,
        "axial_strain": -5e-3 * z,
        "axial_force": 1e-12,
        "force_error": 1e-10 * z,
        "gap_mid_face": 0.0,
        "gap_corner": reach,
        "gap_max": 1.1 * gap,
        "contact_pressure_mid_face": 0.1 * z,
        "contact_pressure_corner": 0.0 if gap else 0.2 * z,
        "contact_pressure_max": 0.1 * z if gap else 0.2 * z,
        "penetration": 0.01,
        "contact_share": 80.0 if gap else 100.0,
        "friction_force": 0.0,
        "friction_pull": 0.0,
    }


def moved_points(points: np.ndarray, time: float) -> np.ndarray:
    """Return (n, 2) [m]: 0.3 mm outwards at the right, 0.6 mm inwards at the top, at 10 s."""
    return time / 10.0 * np.column_stack([3e-4 * points[:, 0], -6e-4 * points[:, 1]]) / HALF


def write_strained(
    path: Path,
    *,
    cell: str = "quadrilateral",
    order: int = 1,
    part: str = "quarter",
    tensor: bool = False,
    last: float = 10.0,
) -> Path:
    """Write a run with mechanics and a mould; its stress is uniform, 2 MPa after 10 s."""
    points, cells = rectangle(12, 12, HALF, HALF, cell, order, power=1.7)
    if part == "whole":
        points = points - 0.5 * HALF
    if part == "half":
        points = points - [0.0, 0.5 * HALF]
    facts = {"solidus": SOLIDUS, "liquidus": LIQUIDUS, "symmetry": part}
    with OutputFolder(path) as folder:
        folder.begin("title = 'x'\n")
        with (
            History(folder / "history.csv", [*COLUMNS, *MECHANICS]) as history,
            FieldWriter(path, points, cells, cell, order, attributes=facts) as fields,
        ):
            for row in rows(30):
                history.append(strained(row))
            for time in np.linspace(0.0, last, 6):
                stress = np.zeros((len(points), 4))
                stress[:, 2] = -2e5 * time
                fields_now = {
                    "temperature": temperature(np.abs(points) * (1 + (part == "whole")), time),
                    "displacement": moved_points(points, time),
                    "stress" if tensor else "von_mises": stress if tensor else -stress[:, 2],
                }
                fields.write(time, 0.06 * time, fields_now)
        folder.write_summary(summary())
        folder.finish(wall_time={"time loop": 1.0})
    return path
