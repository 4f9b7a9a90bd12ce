"""The slab without and with defects of its machine, compared with the thesis.

Reads the finished runs of `make slabs` in results/slab1200; nothing is run. The thesis' values are
the references of the cases. Writes tables of docs/slab_thesis.md.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.report import ROOT, Columns, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.machine.stations import Stations
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary
from castfem.runs.output.surface_maps import SurfaceMaps

RUNS = ROOT / "results" / "slab1200"
CASES = {
    "reference": "in order", "locked_48": "#48 locked", "locked_48_52": "#48, #52 locked",
    "misaligned_48": "#48 off 2 mm", "warm_edges": "warm edges", "nozzles_47_52": "nozzles 66 %",
}  # fmt: skip
IMPOSED = "imposed_axis"
BASE = {"nozzles_47_52": "warm_edges"}  # case to compare with, if not the reference
SHARES = {"I1": 1e-6, "I2": 1e5}  # MPa, 1e-5 1/s
FACES = ("intrados", "extrados")
BENDER, STRAIGHTENER = (8, 15), (50, 57)  # rolls; from #49 to #50 a misaligned #48 bends, too
DEFECT = (47, 50)  # rolls between which a misaligned #48 bends the strand
SPRAYED = (47, 52)  # rolls between which nozzles have less water
_SLACK = 1e-6  # m


def main(output: Output, quick: bool) -> None:
    """Read the runs; unfinished ones are reported and left out."""
    del quick  # nothing is run
    rows = [one for name in CASES if (one := _case(RUNS / name)) is not None]
    thickness = {row["case"]: row["thickness"] for row in rows}
    for row in rows:
        base = thickness.get(BASE.get(row["case"], "reference"))
        row["thicker"] = None if base is None else 100.0 * (row["thickness"] / base - 1.0)
        if row["case"] == "warm_edges":  # it has another start temperature
            row["thicker"] = None
    if rows:
        output.csv("slab_defects", rows)
    if imposed := _imposed(RUNS / IMPOSED):
        output.csv("slab_imposed_axis", [imposed])
    show(output)


def _imposed(folder: Path) -> dict[str, Any]:
    """Return stretch of the strand by a neutral axis on the faces, %, and largest force, kN."""
    summary = _finished(folder)
    if summary is None:
        return {}
    history, stations = read_history(folder / "history.csv"), _stations(folder)
    force = history["axial_force"].to_numpy()
    at = int(np.abs(force).argmax())
    near = stations.nearest(float(history["position"].iloc[at]))
    assert near is not None and history.attrs["units"]["axial_force"] == "kN"
    stretched = 100.0 * summary.quantities["axial_strain"].value
    total = 2.0 * force[at]  # the run is that of half the slab
    return {"case": folder.name, "stretched": stretched, "force": total, "roll": near + 1}


def _stations(folder: Path) -> Stations:
    return Stations.of_columns(**SurfaceMaps(folder).heading.caster())


def _finished(folder: Path) -> Summary | None:
    summary = Summary.load(folder) if folder.is_dir() else None
    if summary is None or summary.status != "finished":
        print(f"{folder}: not finished, left out (make slabs)")
        return None
    return summary


def _case(folder: Path) -> dict[str, Any] | None:
    """Return the results of one run and the thesis' values; None if it has not finished."""
    summary = _finished(folder)
    if summary is None:
        return None
    thesis = {c.reference.quantity: c.reference.value for c in summary.references}
    maps, stations = SurfaceMaps(folder), _stations(folder)
    history = read_history(folder / "history.csv")
    row: dict[str, Any] = {"case": folder.name}
    for phase in ("bending", "straightening"):
        for index, share in SHARES.items():
            name = f"{phase}_{index}_max"
            row[f"{phase}_{index}"] = share * summary.quantities[name].value
            theirs = thesis.get(name)
            row[f"{phase}_{index}_thesis"] = None if theirs is None else share * theirs
        row |= _worst(maps, stations, phase)
    for index, share in SHARES.items():
        theirs = thesis.get(f"way_{index}_max")
        row[f"way_{index}"] = share * summary.quantities[f"way_{index}_max"].value
        row[f"way_{index}_thesis"] = None if theirs is None else share * theirs
    row |= _between(maps, stations, DEFECT)
    row["thickness"] = summary.quantities["slice_thickness_centre"].value
    row |= _corners(history, stations)
    return row | _surface(maps, stations) | _effort(history, stations)


def _worst(maps: SurfaceMaps, stations: Stations, phase: str) -> dict[str, Any]:
    """Return where I1 is largest in a phase: position on the surface, roll, temperature, degC."""
    line = maps.heading.line
    rows = np.flatnonzero([stations.phase(float(p)) == phase for p in maps.position])
    values = maps["I1"][rows]
    i, vertex = np.unravel_index(int(np.argmax(values)), values.shape)
    row = rows[i]
    near = stations.nearest(float(maps.position[row]))
    assert near is not None
    return {
        f"{phase}_place": line.words(int(vertex)),
        f"{phase}_roll": near + 1,
        f"{phase}_warm": float(maps["temperature"][row, vertex]) - ZERO_CELSIUS,
    }


def _rows_between(maps: SurfaceMaps, stations: Stations, rolls: tuple[int, int]) -> Any:
    """Return a mask of the rows of the maps between two rolls, counted from 1."""
    assert stations.rolls is not None
    low, high = (stations.rolls.pairs[roll - 1].position for roll in rolls)
    return (maps.position > low + _SLACK) & (maps.position < high + _SLACK)


def _between(maps: SurfaceMaps, stations: Stations, rolls: tuple[int, int]) -> dict[str, float]:
    """Return the largest indexes of each wide face between two rolls."""
    line, rows = maps.heading.line, _rows_between(maps, stations, rolls)
    found = {}
    for face in FACES:
        vertices = np.flatnonzero(line.face == line.faces.index(face))
        for index, share in SHARES.items():
            largest = maps[index][rows][:, vertices].max(initial=0.0)
            found[f"defect_{face}_{index}"] = share * float(largest)
    return found


def _surface(maps: SurfaceMaps, stations: Stations) -> dict[str, float]:
    """Return mean temperatures from #47 to #52 and the share of wide faces within the band."""
    line, rows = maps.heading.line, _rows_between(maps, stations, SPRAYED)
    low, high = maps.heading.band
    found = {}
    for face in FACES:
        vertices = np.flatnonzero(line.face == line.faces.index(face))
        kelvin = maps["temperature"][rows][:, vertices]
        middle = np.argmin(np.abs(line.place[vertices, 0]))
        found[f"warm_{face}"] = float(kelvin[:, middle].mean()) - ZERO_CELSIUS
        found[f"band_{face}"] = 100.0 * float(((kelvin > low) & (kelvin < high)).mean())
    return found


def _corners(history: pd.DataFrame, stations: Stations) -> dict[str, float]:
    """Return largest axial stresses of the stretched corner: bending, near #48, straightening.

    The stress is taken at any temperature, unlike the index, and its temperature is returned.
    """
    assert stations.rolls is not None
    position, pairs = history["position"].to_numpy(), stations.rolls.pairs
    found = {}
    for name, rolls, corner in (
        ("bending", BENDER, "corner_extrados"),
        ("straightening", STRAIGHTENER, "corner_intrados"),
        ("defect", DEFECT, "corner_extrados"),
    ):
        low, high = (pairs[roll - 1].position for roll in rolls)
        rows = np.flatnonzero((position > low + _SLACK) & (position < high + _SLACK))
        stress = history[f"axial_stress_{corner}"].to_numpy()[rows]
        at = rows[int(stress.argmax())]
        found[f"{name}_stress"] = float(stress.max())
        warm = history[f"surface_temperature_{corner}"].to_numpy()
        found[f"{name}_stress_warm"] = float(warm[at])
    return found


def _effort(history: pd.DataFrame, stations: Stations) -> dict[str, Any]:
    """Return the largest axial effort in the strand, kN, and its roll."""
    at = int(history["effort"].to_numpy().argmax())
    near = stations.nearest(float(history["position"].iloc[at]))
    assert near is not None
    unit = str(history.attrs["units"]["effort"])
    assert unit == "kN", unit
    return {"effort": float(history["effort"].iloc[at]), "effort_roll": near + 1}


def show(output: Output) -> None:
    """Write the tables from the data."""
    rows = [row | {"case": CASES[row["case"]]} for row in output.rows("slab_defects")]
    head = {"case": "largest in the band (thesis)"}
    indexes: dict[str, str] = {}
    for phase in ("bending", "straightening"):
        indexes |= {f"{phase}_I1": f"{phase}, I1, MPa", f"{phase}_I2": f"{phase}, I2, 1e-5 1/s"}
    indexes |= {"way_I1": "anywhere, I1, MPa", "way_I2": "anywhere, I2, 1e-5 1/s"}
    lines = [row | {name: _beside(row, name) for name in indexes} for row in rows]
    output.table("slab defects", lines, head | indexes)
    places: Columns = {
        "case": "", "straightening_place": "worst place of straightening (I1)",
        "straightening_roll": "at roll", "straightening_warm": ("its temperature, °C", ".0f"),
        "thicker": ("slice thicker than in order, %", "+.3f"),
        "effort": ("largest effort, kN", ".0f"), "effort_roll": "at roll",
    }  # fmt: skip
    output.table("slab places", rows, places)
    parts = {"bending": "bending, extrados", "defect": "#47 to #50, extrados",
             "straightening": "straightening, intrados"}  # fmt: skip
    corners: dict[str, Any] = {"case": "at the stretched corner"}
    for name, words in parts.items():
        corners[f"{name}_stress"] = f"{words}, MPa", ".1f"
        corners[f"{name}_stress_warm"] = "at, °C", ".0f"
    output.table("slab corners", rows, corners)
    below: dict[str, Any] = {"case": "below #47"}
    for face in FACES:
        below |= {
            f"defect_{face}_I1": (f"{face}, I1 to #50, MPa", ".1f"),
            f"defect_{face}_I2": (f"{face}, I2 to #50, 1e-5 1/s", ".1f"),
            f"warm_{face}": (f"{face}, mid-face to #52, °C", ".0f"),
            f"band_{face}": (f"{face}, share in the band to #52, %", ".0f"),
        }
    output.table("slab locally", rows, below)


def _beside(row: dict[str, Any], name: str) -> str:
    """Return a value as text, followed by that of the thesis in brackets if it has one."""
    theirs = row[f"{name}_thesis"]
    return f"{row[name]:.1f}" + ("" if theirs is None else f" ({theirs:.1f})")
