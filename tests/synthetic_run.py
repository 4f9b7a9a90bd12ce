"""A synthetic result folder: a quarter billet cooled at both faces, by a closed form."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from scipy.special import erf

from castfem.base.shown_quantity import Quantity
from castfem.post.report.show import show
from castfem.runs.output.folder import OutputFolder
from castfem.runs.output.history import History
from castfem.runs.output.summary_file import Reference, Summary, Zone, compare
from castfem.runs.output.xdmf import FieldWriter

SOLIDUS, LIQUIDUS = 1725.15, 1775.65
SPEED, LENGTH, HALF = 0.06, 0.6, 0.0625
DIFFUSIVITY = 1.1e-6
POURED, WALL = 1815.65, 1430.0
COLUMNS = [
    ("time", "s"),
    ("position", "m"),
    ("step", "s"),
    ("newton", "-"),
    *((f"surface_temperature_{p}", "degC") for p in ("mid_face", "corner")),
    *((f"shell_{p}", "mm") for p in ("mid_face", "corner")),
    *((f"liquidus_depth_{p}", "mm") for p in ("mid_face", "corner")),
    *((f"heat_flux_{p}", "kW/m^2") for p in ("mid_face", "corner")),
    ("heat_rate", "kW/m"),
    ("heat_removed", "J/m"),
    ("energy_error", "-"),
    ("temperature_core", "degC"),
]


def rectangle(
    nx: int, ny: int, width: float, height: float, cell: str, order: int, power: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Points and cells, in DOLFINx node order, of a grid refined towards the far sides."""
    i, j = np.meshgrid(np.arange(nx * order + 1), np.arange(ny * order + 1))
    x = width * (1 - (1 - i.ravel() / (nx * order)) ** power)
    y = height * (1 - (1 - j.ravel() / (ny * order)) ** power)
    row = nx * order + 1
    first = (np.add.outer(np.arange(ny) * order * row, np.arange(nx) * order)).ravel()[:, None]
    quadrilateral = {
        1: [0, 1, row, row + 1],
        2: [0, 2, 2 * row, 2 * row + 2, 1, row, row + 2, 2 * row + 1, row + 1],
    }[order]
    if cell == "quadrilateral":
        return np.column_stack([x, y]), first + quadrilateral
    # basix: the edge i of a triangle lies opposite its vertex i
    lower = {1: [0, 1, row + 1], 2: [0, 2, 2 * row + 2, row + 2, row + 1, 1]}[order]
    upper = {1: [0, row + 1, row], 2: [0, 2 * row + 2, 2 * row, 2 * row + 1, row, row + 1]}[order]
    return np.column_stack([x, y]), np.vstack([first + lower, first + upper])


def temperature(points: np.ndarray, time: float) -> np.ndarray:
    """Return the product solution of a corner whose surface cools slowly [K]."""
    grown = 2 * np.sqrt(DIFFUSIVITY * (time + 0.02))
    wall = WALL + (POURED - WALL) * np.exp(-time / 3.0)
    depth = np.maximum(HALF - points, 0.0) + 1e-3
    return wall + (POURED - wall) * erf(depth[:, 0] / grown) * erf(depth[:, 1] / grown)


def depth_of(level: float, time: float, diagonal: bool) -> float:
    """Return the depth of an isotherm below mid-face, or along the diagonal of the corner [mm]."""
    s = np.linspace(0.0, HALF, 2000)
    line = np.column_stack([HALF - s, HALF - s if diagonal else np.zeros_like(s)])
    hot = np.flatnonzero(temperature(line, time) >= level)
    return 1e3 * s[hot[0] if len(hot) else -1] * (np.sqrt(2) if diagonal else 1.0)


def rows(count: int, until: float = LENGTH / SPEED) -> list[dict[str, float]]:
    """Return the rows of history.csv."""
    found, removed, before = [], 0.0, 0.0
    ends = np.array([[HALF, 0.0], [HALF, HALF], [0.0, 0.0]])
    for time in until * (np.arange(count + 1) / count) ** 1.5:
        face, corner, core = temperature(ends, time) - 273.15
        flux = 1.6 * (face - 160.0)
        removed += (time - before) * 0.5 * flux * 1e3
        row = {"time": time, "position": time * SPEED, "step": time - before, "newton": 3.0}
        row |= {"surface_temperature_mid_face": face, "surface_temperature_corner": corner}
        for name, level in (("shell", SOLIDUS), ("liquidus_depth", LIQUIDUS)):
            for probe in ("mid_face", "corner"):
                row[f"{name}_{probe}"] = depth_of(level, time, probe == "corner")
        row |= {"heat_flux_mid_face": flux, "heat_flux_corner": 1.6 * (corner - 160.0)}
        row |= {"heat_rate": 0.5 * flux, "heat_removed": removed, "temperature_core": core}
        row["energy_error"] = 1e-11 * np.sin(50 * time) ** 2
        row["newton"] = 2 + (time * 7) % 3 // 1
        if time == 0:
            row |= {"step": np.nan, "newton": np.nan, "energy_error": np.nan}
        found.append(row)
        before = time
    return found


def summary(status: str = "finished") -> Summary:
    """Return the summary of the synthetic run."""
    last = rows(40)[-1]
    quantities = {
        "solidus": Quantity(SOLIDUS, "degC", "solidus"),
        "liquidus": Quantity(LIQUIDUS, "degC", "liquidus"),
        "shell_mid_face": Quantity(last["shell_mid_face"] * 1e-3, "mm", "shell, mid-face"),
        "shell_corner": Quantity(last["shell_corner"] * 1e-3, "mm", "shell, corner diagonal"),
        "surface_temperature_mid_face": Quantity(
            last["surface_temperature_mid_face"] + 273.15, "degC", "surface, mid-face"
        ),
        "heat_removed_slice": Quantity(139.2e3, "kJ", "heat removed, 60 mm slice"),
        "metallurgical_length": Quantity(np.nan, "m", "metallurgical length"),
    }
    references = [
        Reference("shell_mid_face", 4.75e-3, "mm", "Pascon 2003, V.2.1"),
        Reference("shell_corner", 9.9e-3, "mm", "Pascon 2003, V.2.1"),
        Reference("surface_temperature_mid_face", 1515.15, "degC", "Pascon 2003, Fig. 97"),
        Reference("heat_removed_slice", 142.7e3, "kJ", "Pascon 2003, Fig. 99"),
    ]
    energy = {
        "removed": Quantity(2.38e6, "MJ/m", "heat removed"),
        "given": Quantity(2.38e6, "MJ/m", "enthalpy given off"),
        "error": Quantity(3.1e-12, "-", "relative error"),
    }
    return Summary(
        title="125 mm billet, idealised mould",
        status=status,
        quantities=quantities,
        references=compare(references, quantities),
        balances={"energy": energy},
        steps={"accepted": 412, "rejected": 3, "newton": 1204},
        wall_time={"mesh": 0.21, "time loop": 2.54},
        zones=(Zone("mould", 0.0, 0.6),),
        mould_exit=0.6,
    )


def write_run(path: Path, *, steps: int = 40, part: str = "quarter", finish: bool = True) -> Path:
    """Write all files of the run into a folder and return it."""
    points, cells = rectangle(20, 20, HALF, HALF, "quadrilateral", 1, power=1.7)
    facts = {"solidus": SOLIDUS, "liquidus": LIQUIDUS, "symmetry": part}
    with OutputFolder(path) as folder:
        folder.begin("title = 'x'\n", ranks=2)
        with (
            History(folder / "history.csv", COLUMNS) as history,
            FieldWriter(path, points, cells, "quadrilateral", 1, attributes=facts) as fields,
        ):
            for number, row in enumerate(rows(steps)):
                history.append(row)
                if number % 8 == 0:
                    now = temperature(points, row["time"])
                    fields.write(row["time"], row["position"], {"temperature": now})
        if finish:
            folder.write_summary(summary())
            folder.finish(wall_time={"mesh": 0.21, "time loop": 2.54}, memory_mb=412.3)
        else:
            folder.update(reached={"time": 3.2, "position": 0.192, "step": 20})
            folder.close()
    return path


def printed(folder: Path, width: int = 110, **options: Any) -> str:
    """Return the text that `castfem show` prints for a folder."""
    stream = io.StringIO()
    show(folder, Console(file=stream, width=width), **options)
    return stream.getvalue()
