"""Hot tearing: critical strain of grades, error of coarse cells, and results of billets and a slab.

Writes the tables and figures of docs/hot_tearing.md. The strip is the alloy of the similarity
solution, in which the time to a solid fraction at a depth x is proportional to x^2. The
environment variable `DATABASE` names the file of [PovodenKaradeniz2016], with which the
microsegregation is compared; without it those rows are kept. `tools/env.sh calphad` installs
pycalphad.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

from mpi4py import MPI

import numpy as np
from scipy.optimize import brentq

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.build.simulation import build
from castfem.model.load import from_document
from castfem.model.shipped_cases import find
from castfem.physics.closed_forms.solidification import ThreeZones
from castfem.physics.materials import load_steel, microsegregation
from castfem.physics.materials.hot_tearing import WON, CriticalStrain, won_critical_strain
from castfem.physics.materials.microsegregation import SOLUTES, Segregation, segregated
from castfem.physics.materials.phase_table import Request, Scheil
from castfem.post.plots.maps import draw_depths
from castfem.post.plots.style import Abscissa, look
from castfem.runs.loop import TimeLoop
from castfem.runs.output.summary_file import Summary
from castfem.runs.output.surface_maps import DEPTHS, SurfaceMaps
from castfem.runs.results import hot_tearing_tracking as hot_tearing
from castfem.runs.results.crack_state import Tearing
from castfem.runs.results.thermal_quantities import temperature_at
from castfem.studies.accuracy.sizes import DEFAULT
from castfem.studies.optimisation.fidelity import at_level

CARBON = (0.05, 0.1, 0.12, 0.15, 0.17, 0.25, 0.42)
"""Carbon of the steels in the table of brittle ranges, wt%."""
PLANT = {"Mn": 0.8, "Si": 0.2, "P": 0.015, "S": 0.01}
"""Their other elements, wt%."""
SCHEIL_CARBON = (0.15, 0.25, 0.42)
"""Carbon of the steels that are also computed by Scheil, with only manganese and silicon, wt%."""
END = 0.005  # liquid fraction at which Scheil ends
RATES = (1e-4, 1e-3, 1e-2)  # 1/s
SIZES = (1.0, 0.5, 0.25)
"""Sizes of the cells of the strip, mm."""
BETWEEN = (9.9e-3, 14.1e-3)  # range of depths over which the strip is averaged, m
PERITECTIC = {"C": 0.15, **PLANT}
SHALLOW = (5.9e-3, 8.1e-3)  # range of depths of the strip of a peritectic steel, m
WINDOWS = (
    ("billet125/taper_1", "640 mm", "100 ms", "0.2 s"),
    ("billet125/taper_1", "640 mm", "50 ms", "0.1 s"),
    ("billet125/taper_1", "640 mm", "25 ms", "0.05 s"),
    ("slab1200/slab", "17.2 m", "50 mm", "100 mm"),
    ("slab1200/slab", "17.2 m", "25 mm", "50 mm"),
)
"""Case, its length, its coupling window, and the window at the coarse level, twice as long."""
EXACT = ThreeZones(30.0, 7200.0, 700.0, 272e3, 1273.15, 1723.15, 1773.15, 1813.15)
SEGREGATED = "billet180/peritectic, segregated"
CASES = {
    "billet125/taper_1": ("casting.length=700 mm", 'quality.rdg.shrinkage="4 percent"'),
    "billet180/peritectic": (),
    SEGREGATED: (
        'steel.diagram="segregated"', "steel.composition.P=0.015", "steel.composition.S=0.01",
    ),
    "slab1200/slab": ("casting.length=17.2 m", "mechanics.bulging.axial_strain=true"),
}  # fmt: skip
"""Cases and their changed keys."""
RUNS = (
    ("billet125/taper_1", "coarse"), ("billet125/taper_1", DEFAULT),
    ("billet180/peritectic", "coarse"), (SEGREGATED, "coarse"), ("slab1200/slab", "coarse"),
)  # fmt: skip
"""Cases and accuracy levels of their runs."""
CRITERIA = 'quality.hot_tearing=["won","clyne_davies","rdg"]'
DRAWN = ("billet125/taper_1", "slab1200/slab")
QUIET = ("output.figures=false", "output.fields=[]")
RESULTS = ("won_front", "won", "clyne_davies_front", "rdg_front")


def grades() -> list[dict[str, Any]]:
    """Return brittle ranges in equilibrium and with segregation, and critical strains, %."""
    rows = []
    for carbon in CARBON:
        composition, row = {"C": carbon, **PLANT}, {"carbon": carbon}
        for name in ("assessed", "segregated"):
            steel = load_steel("plain_carbon", composition=composition, overrides={"diagram": name})
            begins, ends = (temperature_at(steel, fraction) for fraction in (0.9, 0.99))
            row |= {f"{name} begins": begins - ZERO_CELSIUS, f"{name} width": begins - ends}
        critical = 100.0 * won_critical_strain(np.array(RATES), row["segregated width"])
        rows.append(row | {f"critical {r:g}": c for r, c in zip(RATES, critical, strict=True)})
    return rows


def from_memory() -> list[dict[str, Any]]:
    """Return the change of damage of a peritectic steel by 10 % more of each datum from memory, %.

    The strain rate is 0.001 1/s, the brittle range that with segregation.
    """
    own, rate = segregated(PERITECTIC).freezing, np.array([1e-3])

    def width(path: Segregation) -> float:
        return path.temperature(0.9) - path.temperature(0.99)

    def critical(path: Segregation, law: CriticalStrain = WON) -> float:
        return float(won_critical_strain(rate, width(path), law)[0])

    rows = []
    for name in ("factor", "rate_exponent", "range_exponent"):
        changed = critical(own, replace(WON, **{name: 1.1 * getattr(WON, name)}))
        rows.append({"datum": f"quality.won.{name}", "width": 0.0, "share": changed})
    phosphorus = SOLUTES["P"]
    for name in ("partition", "diffusion", "activation", "liquidus", "transformation"):
        datum = getattr(phosphorus, name)
        more = tuple(1.1 * x for x in datum) if isinstance(datum, tuple) else 1.1 * datum
        solutes = {**SOLUTES, "P": replace(phosphorus, **{name: more})}
        with patch.object(microsegregation, "SOLUTES", solutes):
            path = segregated(PERITECTIC).freezing
            by = 100.0 * (width(path) / width(own) - 1.0)
            rows.append({"datum": f"{name} of P", "width": by, "share": critical(path)})
    return [row | {"share": 100.0 * (critical(own) / row["share"] - 1.0)} for row in rows]


def compared_with_scheil(file: Path) -> list[dict[str, Any]]:
    """Return temperatures of solid fractions by microsegregation and by Scheil, degC.

    Rows also have the width of the brittle range by the database in equilibrium, K.
    """
    rows = []
    for carbon in SCHEIL_CARBON:
        composition = {"C": carbon, "Mn": PLANT["Mn"], "Si": PLANT["Si"]}
        request = Request(str(file), ("LIQUID", "BCC_A2", "FCC_A1"))
        row: dict[str, Any] = {"carbon": carbon}
        for name, changes in (
            ("segregated", {"diagram": "segregated"}),
            ("scheil", {"database": replace(request, scheil=Scheil(END))}),
            ("equilibrium", {"database": request}),
        ):
            steel = load_steel("plain_carbon", composition=composition, overrides=changes)
            for fraction in (0.4, 0.9, 0.99):
                row[f"{name} {fraction:g}"] = temperature_at(steel, fraction) - ZERO_CELSIUS
        row["equilibrium width"] = row["equilibrium 0.9"] - row["equilibrium 0.99"]
        rows.append(row)
    return rows


def peritectic_strip(size: float, diagram: str, quick: bool) -> float:
    """Return the Clyne-Davies ratio of a strip of peritectic steel with cells of `size` mm.

    castfem rejects the criterion for this steel in equilibrium; the check is disabled here.
    """
    cells = f"{size} mm"
    strip = {
        "title": "peritectic strip",
        "casting": {
            "speed": "1 m/min", "temperature": "1540 degC", "length": f"{0.05 if quick else 0.5} m",
        },
        "steel": {"name": "plain_carbon", "composition": PERITECTIC, "diagram": diagram},
        "section": {"shape": "strip", "length": "40 mm", "width": cells},
        "mesh": {"surface_size": cells, "core_size": cells},
        "cooling": [
            {"name": "chill",
             "surface": [{"law": "temperature", "on": ["surface"], "value": "1000 degC"}]},
        ],
        "thermal": {"time": {"step": "50 ms"}},
        "quality": {"hot_tearing": ["clyne_davies"]},
        "output": {"figures": False, "fields": []},
    }  # fmt: skip
    with patch.object(hot_tearing, "lacks", lambda *arguments: None):
        tearing, x = followed(from_document(strip))
    low, high = (0.0, np.inf) if quick else SHALLOW
    chosen = (x > low) & (x < high)
    return float(np.mean(tearing.clyne_davies()[chosen]))


def followed(case: Case) -> tuple[Tearing, Array]:
    """Run a strip; return its tearing and the depth of vertices, m (0 above the lower side)."""
    simulation = build(case, MPI.COMM_SELF)
    run = TimeLoop(simulation)
    run.run()
    x, y = simulation.section.vertex_space.tabulate_dof_coordinates()[:, :2].T
    simulation.destroy()
    assert run.run_state.sampler.quality is not None
    tearing = run.run_state.sampler.quality.state.tearing
    assert tearing is not None
    return tearing, np.where(np.abs(y) < 1e-9, x, 0.0)


def strip(size: float, quick: bool) -> dict[str, Any]:
    """Return the errors of the times of the strip with cells of `size` mm, per cent."""
    keys = [f"mesh.surface_size={size} mm", f"mesh.core_size={size} mm", f"section.width={size} mm"]
    keys += ["section.length=60 mm", f"casting.length={'0.05' if quick else '0.6'} m", *QUIET]
    case = load_case(
        find("verification/alloy_similarity"), [*keys, 'quality.hot_tearing=["clyne_davies"]']
    )
    tearing, x = followed(case)
    low, high = (0.0, np.inf) if quick else BETWEEN
    chosen = (x > low) & (x < high)

    def over(fraction: float) -> float:
        level = EXACT.liquidus - 50.0 * fraction

        def off(eta: float) -> float:
            return float(EXACT.temperature(np.array([2.0 * eta]), 1.0)[0]) - level

        return 0.25 / float(brentq(off, 1e-4, 1e-1)) ** 2

    feeds, begins, ends = (over(fraction) for fraction in (0.4, 0.9, 0.99))
    time = np.mean(tearing.history.vulnerable[chosen] / (x[chosen] ** 2 * (ends - begins)))
    ratio = np.mean(tearing.clyne_davies()[chosen]) * (begins - feeds) / (ends - begins)
    # Thickness of the brittle range at the middle of these depths: the distance of its ends.
    thickness = 1e3 * np.mean(BETWEEN) * (1.0 - (begins / ends) ** 0.5)
    return {
        "size": size, "in_range": thickness / size, "time": 100.0 * (time - 1.0),
        "ratio": 100.0 * (ratio - 1.0),
        "assessed": peritectic_strip(size, "assessed", quick),
        "segregated": peritectic_strip(size, "segregated", quick),
    }  # fmt: skip


def windows(folder: Path, quick: bool) -> list[dict[str, Any]]:
    """Compute damage by strain on coarse cells with windows of several lengths."""
    rows = []
    for name, length, window, coarse in WINDOWS[: 1 if quick else None]:
        cut = "50 mm" if quick else length
        keys = [*QUIET, *CASES[name], 'quality.hot_tearing=["won"]', f"casting.length={cut}"]
        keys = [key for key in keys if not key.startswith("quality.rdg")]
        keys += [f"coupling.interval={window}", "coupling.growth=1"]
        case = load_case(find(name), keys)
        place = f"windows_{name.partition('/')[0]}_{window.replace(' ', '')}"
        summary = finished_run(at_level(case, "coarse"), folder / place).summary
        found = summary.quantities["way_won_front_max"]
        where = found.label.partition("on the way, ")[2]
        rows.append({"case": name, "window": coarse, "won_front": found.shown, "where": where})
    return rows


def cast(name: str, level: str, folder: Path, quick: bool) -> Summary:
    """Run a case with all criteria."""
    short = ("casting.length=50 mm",) if quick else ()
    case = load_case(find(name.partition(",")[0]), [*QUIET, CRITERIA, *CASES[name], *short])
    return finished_run(at_level(case, level), folder).summary


def row_of(name: str, level: str, summary: Summary) -> dict[str, Any]:
    """Return the largest values of a run and their positions."""
    row: dict[str, Any] = {"case": name, "accuracy": level}
    for result in RESULTS:
        found = summary.quantities[f"way_{result}_max"]
        row |= {result: found.shown, f"{result}_where": found.label.partition("on the way, ")[2]}
    return row | {"share": summary.quantities["rdg_share"].shown}


@look()
def draw(output: Output, name: str, folder: Path, zones: Any) -> None:
    """Draw the maps of a run over depth."""
    maps = SurfaceMaps(folder, DEPTHS)
    picture = draw_depths(maps, Abscissa(maps.time, maps.position, zones))
    if picture is not None:
        output.figure(f"hot_tearing_{name.partition('/')[0]}", picture)


def main(output: Output, quick: bool) -> None:
    """Compute grades and strip, and do the runs that have not finished."""
    output.csv("hot_tearing_grades", grades())
    output.csv("hot_tearing_memory", from_memory())
    output.csv("hot_tearing_cells", [strip(s, quick) for s in (SIZES[:1] if quick else SIZES)])
    if not quick and (file := os.environ.get("DATABASE")):
        output.csv("hot_tearing_scheil", compared_with_scheil(Path(file)))
    base = (output.folder if quick else ROOT / "results") / "hot_tearing"
    output.csv("hot_tearing_windows", windows(base, quick))
    rows = []
    for name, level in RUNS[: 1 if quick else None]:
        folder = base / f"{name.replace('/', '_').replace(', ', '_')}_{level}"
        summary = cast(name, level, folder, quick)
        rows.append(row_of(name, level, summary))
        if name in DRAWN and level == "coarse":
            draw(output, name, folder, summary.zones)
        output.csv("hot_tearing", rows)
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    heads: dict[str, Any] = {
        "carbon": ("C [wt%]", ".2f"), "assessed begins": ("equilibrium: 0.9 solid at [°C]", ".1f"),
        "assessed width": ("to 0.99 [K]", ".1f"),
        "segregated begins": ("segregated: 0.9 solid at [°C]", ".1f"),
        "segregated width": ("to 0.99 [K]", ".1f"),
    }  # fmt: skip
    heads |= {f"critical {r:g}": (f"critical strain at {r:g} 1/s [%]", ".2f") for r in RATES}
    output.table("hot tearing grades", output.rows("hot_tearing_grades"), heads)
    output.table("hot tearing memory", output.rows("hot_tearing_memory"), {
        "datum": "10 % more of", "width": ("width of the range [%]", "+.1f"),
        "share": ("damage [%]", "+.1f"),
    })  # fmt: skip
    columns = {"carbon": ("C [wt%]", ".2f")}
    for fraction in ("0.4", "0.9", "0.99"):
        columns |= {
            f"segregated {fraction}": (f"{fraction} solid at [°C]", ".1f"),
            f"scheil {fraction}": ("by Scheil", ".1f"),
        }
    output.table("hot tearing scheil", output.rows("hot_tearing_scheil"), columns)
    output.table("hot tearing cells", output.rows("hot_tearing_cells"), {
        "size": ("cells [mm]", "g"), "in_range": ("of them in the range", ".1f"),
        "time": ("time in the range [%]", "+.1f"), "ratio": ("its ratio to the relief [%]", "+.1f"),
        "assessed": ("0.15 % C in equilibrium, ratio", ".2f"),
        "segregated": ("segregated", ".3f"),
    })  # fmt: skip
    output.table("hot tearing windows", output.rows("hot_tearing_windows"), {
        "case": "case", "window": "windows", "won_front": ("by strain, front [%]", ".2g"),
        "where": "where",
    })  # fmt: skip
    output.table("hot tearing runs", output.rows("hot_tearing"), {
        "case": "case", "accuracy": "accuracy",
        "won_front": ("by strain, front [%]", ".3g"), "won_front_where": "where",
        "won": ("at the surface [%]", ".3g"), "won_where": "where",
        "clyne_davies_front": ("by time", ".2f"), "clyne_davies_front_where": "where",
        "rdg_front": ("pressure drop [kPa]", ".3g"), "rdg_front_where": "where",
    })  # fmt: skip
