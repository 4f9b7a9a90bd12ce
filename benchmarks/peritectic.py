"""Peritectic steel beside others: what it contracts by, the taper it needs, how its shell flows.

Writes tables of docs/materials.md, laws.md and coupling.md, and a figure. The free contraction of
steels, told apart in what cools and what turns from delta ferrite to austenite; the taper that
follows three of them, as they shrink freely in the mould of `billet180/peritectic`; that case by
diagram and by law; its corner by cells and superheat, to see what it needs to converge; and the
flow stress of steel with both phases.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from scipy.optimize import brentq

from benchmarks.corner import cells
from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.libraries import own_style
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.shipped_cases import find
from castfem.physics.constitutive.flow_curves import Austenite, DeltaFerrite
from castfem.physics.materials import Steel, load_steel
from castfem.runs.output.fields import Fields
from castfem.studies.accuracy.estimate import estimate
from castfem.studies.accuracy.sizes import DEFAULT
from castfem.studies.optimisation.fidelity import at_level, idealised

CASE = "billet180/peritectic"
CARBON = (0.05, 0.10, 0.12, 0.15, 0.17, 0.25)
"""Of the steels whose free contraction is told, wt%."""
BILLETS = (0.05, 0.12, 0.25)
"""Of those that are cast."""
COLD = 1200.0 + ZERO_CELSIUS
NEAR = 25.0  # K below the solidus
ZONES = {"0 to 40 mm": (0.0, 0.04), "40 to 300 mm": (0.04, 0.3), "300 to 800 mm": (0.3, 0.8)}
"""Along the mould, m: where tapers are told."""
FREE = {
    "mechanics.ferrostatic": "off",
    "mechanics.liquid": "fed",
    "mechanics.mush": "skeleton",
}
"""A strand that nothing holds or presses, in its idealised mould."""
VARIED: dict[str, tuple[str, ...]] = {
    "coarse": (),
    "default": (),
    "cells 1 mm": cells("1"),
    "cells 0.5 mm": cells("0.5"),
    "0.35 mm deep": ("mesh.surface_size=0.35 mm",),
    "windows 0.05 s": ("coupling.interval=0.05 s",),
}
"""Numerics with which the case is run: `--accuracy`, or keys."""
RUNS = {
    ("pascon", "kozlowski_zhu"): ("coarse", "default"),
    ("assessed", "kozlowski_zhu"): (*VARIED,),
    ("assessed", "kozlowski_zhu_mixed"): ("coarse", "default", "cells 1 mm", "cells 0.5 mm"),
}
"""Diagrams and laws with which it is run, each with the numerics."""
CORNER = {
    "cells 1 mm": cells("1"),
    "cells 0.7 mm": cells("0.7"),
    "cells 0.5 mm": cells("0.5"),
    "cells 0.35 mm": cells("0.35"),
    "cells 0.7 mm, 0.35 mm deep": (*cells("0.7"), "mesh.surface_size=0.35 mm"),
    "superheat 27 K": (*cells("0.7"), "casting.superheat=27 K"),
    "superheat 29 K": (*cells("0.7"), "casting.superheat=29 K"),
}
"""With which the corner is followed; the superheats with cells of 0.7 mm."""
CORNERS = {
    ("assessed", "kozlowski_zhu"): (*CORNER,),
    ("assessed", "kozlowski_zhu_mixed"): tuple(k for k in CORNER if k != "cells 0.35 mm"),
    ("pascon", "kozlowski_zhu"): ("cells 1 mm", "cells 0.7 mm", "cells 0.5 mm"),
}
"""Which of them with which diagram and law."""
FOLLOWED = (0.04, 0.2)
"""Where it is looked at, m: after the first skin has shrunk, and when the shell grows again."""
BESIDE = 0.007
"""A place beside the corner, m along the surface."""
RESULTS = {
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "gap_corner": ("gap, corner [mm]", ".3f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "hotter_than_data": ("hotter than the law's data [%]", ".0f"),
}
"""What is told of it at the mould's exit: heading and format."""
FLOW = {"temperature": 1480.0 + ZERO_CELSIUS, "carbon": 0.12, "strain": 0.01, "rate": 1e-3}
"""Where flow stresses are compared: K, wt%, 1, 1/s."""
SHARES = (0.0, 0.05, 0.1, 0.11, 0.25, 0.5, 0.75, 1.0)
"""Of delta ferrite."""
THRESHOLD = 0.1  # of it, from which `kozlowski_zhu` has delta ferrite alone
LEVEL = "coarse"
WIDTH = 180.0  # mm, of the case
COLOURS = ("#0072b2", "#c1272d", "#2e8b57")  # of the billets
QUIET = ("output.figures=false", "output.fields=[]")
ROWS = 5.0  # K between the rows of a table of expansion


def contraction(carbon: float) -> dict[str, Any]:
    """Free contraction of a steel from its solidus on, per cent."""
    steel = load_steel("plain_carbon", composition={"C": carbon})
    assert steel.diagram is not None
    start, end = steel.diagram.gamma_start, steel.diagram.gamma_end
    assert start is not None and end is not None
    at = np.array([COLD, steel.solidus - NEAR])
    total = -100.0 * steel.thermal_strain(at)
    by_phase = np.abs(100.0 * steel.transformation_strain(at))
    top = min(start, steel.solidus)
    return {
        "carbon": carbon, "solidus": steel.solidus - ZERO_CELSIUS,
        "gamma_start": top - ZERO_CELSIUS, "gamma_end": min(end, top) - ZERO_CELSIUS,
        "total": total[0], "thermal": total[0] - by_phase[0], "by_phase": by_phase[0],
        "near": total[1], "near_by_phase": by_phase[1],
    }  # fmt: skip


def cooling_alone(steel: Steel) -> dict[str, Any]:
    """The expansion of a steel whose phases cool and do not turn, as a material file has it."""
    celsius = np.arange(20.0, steel.solidus - ZERO_CELSIUS, ROWS)

    def length(t: Array) -> Array:
        return np.log1p(steel.thermal_strain(t) - steel.transformation_strain(t))

    kelvin = celsius + ZERO_CELSIUS
    warm = np.minimum(kelvin + 0.5, steel.solidus)
    slope = (length(warm) - length(kelvin - 0.5)) / (warm - kelvin + 0.5)
    return {
        "coefficient": "differential", "temperature": celsius.tolist(),
        "temperature_unit": "degC", "value": slope.tolist(), "unit": "1/K",
    }  # fmt: skip


def free_billet(carbon: float, phases: bool, changes: tuple[str, ...] = ()) -> Case:
    """A strand that shrinks freely, with what its phases contract by or without."""
    case = idealised(load_case(find(CASE), (*QUIET, "steel.diagram=assessed", *changes)))
    free: dict[str, Any] = {**FREE, "steel.composition": {"C": carbon}}
    if not phases:
        steel = load_steel("plain_carbon", composition={"C": carbon})
        free["steel.overrides"] = {"thermal_expansion": cooling_alone(steel)}
    return at_level(case.with_(free), LEVEL)


def closing(output: Output, quick: bool) -> list[dict[str, Any]]:
    """By steel and place along the mould how much narrower the strand is, thermal and by phase.

    A face of the strand is as long as its two corners are apart: sqrt(2) times what a corner moves
    along its diagonal. The strand with its whole contraction less one whose phases cool only is
    what the phases do.
    """
    rows = []
    for carbon in BILLETS[: 2 if quick else None]:
        width = {}
        for phases in (True, False):
            case = free_billet(carbon, phases, ("casting.length=30 mm",) if quick else ())
            name = f"free_{carbon:g}_{'whole' if phases else 'cooling'}"
            history = finished_run(case, folder(output, quick) / name).history
            lost = -np.sqrt(2.0) * history["displacement_corner"].to_numpy()
            position = history["position"].to_numpy()
            places = np.linspace(0.0, position[-1], 81)
            width[phases] = np.interp(places, position, lost - lost[0])
        rows += [
            {"carbon": carbon, "position": z, "lost": whole, "thermal": thermal}
            for z, whole, thermal in zip(places, width[True], width[False], strict=True)
        ]
    return rows


def folder(output: Output, quick: bool) -> Path:
    """Where runs lie, so that those that have finished are not made again."""
    return (output.folder if quick else ROOT / "results") / "peritectic"


def cast(output: Output, quick: bool) -> list[dict[str, Any]]:
    """The shipped case by diagram and law: what it has at the mould's exit."""
    rows = []
    asked = [(*which, kind) for which, kinds in RUNS.items() for kind in kinds]
    for diagram, law, kind in asked[: 1 if quick else None]:
        changes = [*QUIET, f"steel.diagram={diagram}", f"mechanics.law={law}", *VARIED[kind]]
        changes += ["casting.length=30 mm"] if quick else []
        case = at_level(load_case(find(CASE), changes), LEVEL if kind == LEVEL else DEFAULT)
        run = folder(output, quick) / f"{diagram}_{law}_{kind.replace(' ', '_')}"
        found = finished_run(case, run).summary.quantities
        values = {name: found[name].shown if name in found else None for name in RESULTS}
        rows.append({"diagram": diagram, "law": law, "varied": kind, **values})
    return rows


def stated(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """The error of the corner's shell that `castfem error` estimates from three of the meshes."""
    shell = {row["varied"]: row["shell_corner"] for row in rows if row["diagram"] == "assessed"
             and row["law"] == "kozlowski_zhu"}  # fmt: skip
    sizes = {"cells 1 mm": 1.0 / 0.7, "default": 1.0, "cells 0.5 mm": 0.5 / 0.7}
    if not sizes.keys() <= shell.keys():
        return [{"mesh": "default", "shell_corner": None, "error": None}]
    error = estimate({size: shell[kind] for kind, size in sizes.items()}).error
    return [{"mesh": "default", "shell_corner": shell["default"], "error": error}]


def corner(output: Output, quick: bool) -> list[dict[str, Any]]:
    """Gap at the corner and beside it, and heat, by diagram, law and what is varied."""
    rows = []
    asked = [(*which, kind) for which, kinds in CORNERS.items() for kind in kinds]
    for diagram, law, kind in asked[: 1 if quick else None]:
        changes = [*QUIET, f"steel.diagram={diagram}", f"mechanics.law={law}", *CORNER[kind]]
        changes += [f"casting.length={FOLLOWED[not quick]} m", "output.every=0.5 s"]
        case = load_case(find(CASE), [*changes, 'output.fields=["gap"]'])
        name = f"corner_{diagram}_{law}_{kind.replace(' ', '_').replace(',', '')}"
        run = folder(output, quick) / name
        history = finished_run(case, run).history
        for place in FOLLOWED[: 1 if quick else None]:
            at = {name: float(np.interp(place, history["position"], history[name]))
                  for name in ("heat_removed", "shell_corner")}  # fmt: skip
            rows.append({
                "diagram": diagram, "law": law, "varied": kind, "position": 1e3 * place,
                **gaps(run, place, case.section.corner_radius), "heat": 1e-6 * at["heat_removed"],
                "shell_corner": at["shell_corner"],
            })  # fmt: skip
    return rows


def gaps(run: Path, place: float, radius: float) -> dict[str, float]:
    """Depth of the outermost cells at mid-face, gap at the corner and beside it, mm."""
    with Fields(run) as fields:
        index = int(np.argmin(np.abs(np.asarray(fields.positions) - place)))
        gap, points = fields.values("gap", index), np.asarray(fields.points)[:, :2]
    depths = np.sort(5e-4 * WIDTH - points[np.abs(points[:, 1]) < 1e-9, 0])
    x, y = (points - (5e-4 * WIDTH - radius)).T
    arc = radius * (np.pi / 4 - np.arctan2(np.maximum(y, 0.0), x))
    along = np.where(y < 0.0, radius * np.pi / 4 - y, arc)
    face = np.flatnonzero(np.isfinite(gap) & (x >= y - 1e-9))  # from the corner to the x axis
    order = face[np.argsort(along[face])]
    found = 1e3 * np.interp((0.0, BESIDE), along[order], gap[order])
    return {"depth": 1e3 * depths[2], "gap_corner": found[0], "gap_beside": found[1]}


def tapers(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Mean tapers that follow each steel along the parts of the mould, per cent per metre."""
    found = []
    for carbon in dict.fromkeys(row["carbon"] for row in rows):
        mine = [row for row in rows if row["carbon"] == carbon]
        position = [row["position"] for row in mine]
        taper: dict[str, Any] = {"carbon": carbon}
        for zone, (start, end) in ZONES.items():
            for name in ("lost", "thermal"):
                first, last = np.interp((start, end), position, [row[name] for row in mine])
                taper[f"{name} {zone}"] = 100.0 * (last - first) / WIDTH / (end - start)
            by_phase = taper[f"lost {zone}"] - taper[f"thermal {zone}"]
            taper[f"by_phase {zone}"] = round(by_phase, 2) + 0.0  # no -0
        found.append(taper)
    return found


@own_style()
def draw(output: Output) -> None:
    """How much narrower each strand grows along the mould, and the taper that follows it."""
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    along, bars = figure.subplots(1, 2)
    rows, found = output.rows("peritectic_width"), output.rows("peritectic_taper")
    for number, (taper, colour) in enumerate(zip(found, COLOURS, strict=False)):
        mine = [row for row in rows if row["carbon"] == taper["carbon"]]
        z = [1e3 * row["position"] for row in mine]
        whole, thermal = ([row[name] for row in mine] for name in ("lost", "thermal"))
        along.plot(z, whole, color=colour, label=f"{taper['carbon']:g} % C")
        along.plot(z, thermal, "--", color=colour)
        along.fill_between(z, thermal, whole, color=colour, alpha=0.2, lw=0.0)
        for place, zone in enumerate(ZONES):
            at = place + (number - 0.5 * (len(found) - 1)) * 0.28
            thermal_part, phase_part = taper[f"thermal {zone}"], taper[f"by_phase {zone}"]
            bars.bar(at, thermal_part, 0.25, color=colour)
            bars.bar(at, phase_part, 0.25, bottom=thermal_part, color=colour, alpha=0.35)
    along.plot([], [], "--", color="0.4", label="thermal part")
    along.set_xlabel("below the meniscus [mm]")
    along.set_ylabel("width lost [mm]")
    along.legend(loc="lower right", frameon=False)
    bars.set_xticks(range(len(ZONES)), [*ZONES])
    bars.set_ylabel("taper [%/m], pale: by phase")
    output.figure("peritectic_taper", figure)


def flow(share: float) -> dict[str, float]:
    """Stress of steel at a share of delta ferrite, MPa, by the sets and with equal stresses.

    Equal stresses in both phases, whose rates then add up by fraction, are the lower bound of a
    mixture, equal strains the upper one.
    """
    gamma, delta = (f.at(np.array([FLOW["temperature"]]), FLOW["carbon"])
                    for f in (Austenite, DeltaFerrite))  # fmt: skip
    strain, rate = FLOW["strain"], FLOW["rate"]
    by_gamma, by_delta = (float(f.stress(strain, rate)[0]) for f in (gamma, delta))
    back = float(gamma.stress(strain, 1e-300)[0])

    def too_slow(stress: float) -> float:
        viscous = max(stress - back, 0.0)
        by_austenite = float(np.exp(gamma.ln_rate[0]) * viscous ** gamma.stress_exponent[0])
        by_ferrite = rate * (stress / by_delta) ** delta.stress_exponent[0]
        return rate - (1.0 - share) * by_austenite - share * by_ferrite

    equal = float(brentq(too_slow, 0.5 * by_delta, 1.01 * by_gamma))
    return {
        "share": share, "mixed": 1e-6 * ((1.0 - share) * by_gamma + share * by_delta),
        "switched": 1e-6 * (by_delta if share > THRESHOLD else by_gamma),
        "equal_stress": 1e-6 * equal,
        "rate_ratio_thousand": 1e-3 * (by_gamma / by_delta) ** delta.stress_exponent[0],
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Contract the steels, let three shrink freely in the mould, cast one by diagram and law."""
    output.csv("contraction", [contraction(carbon) for carbon in CARBON])
    output.csv("phase_flow", [flow(share) for share in SHARES])
    output.csv("peritectic_width", closing(output, quick))
    output.csv("peritectic_taper", tapers(output.rows("peritectic_width")))
    draw(output)
    output.csv("peritectic_laws", cast(output, quick))
    output.csv("peritectic_error", stated(output.rows("peritectic_laws")))
    output.csv("peritectic_corner", corner(output, quick))
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    output.table("contraction", output.rows("contraction"), {
        "carbon": ("C [wt%]", ".2f"), "solidus": ("solidus [°C]", ".1f"),
        "gamma_start": ("δ → γ in the solid from [°C]", ".1f"), "gamma_end": ("to [°C]", ".1f"),
        "total": ("solidus to 1200 °C [%]", ".3f"), "thermal": ("thermal", ".3f"),
        "by_phase": ("by phase", ".3f"), "near": ("in the first 25 K [%]", ".3f"),
        "near_by_phase": ("by phase", ".3f"),
    })  # fmt: skip
    head: dict[str, Any] = {"carbon": ("C [wt%]", ".2f")}
    for zone in ZONES:
        names = {"lost": f"taper, {zone} [%/m]", "thermal": "thermal", "by_phase": "by phase"}
        head |= {f"{key} {zone}": (name, ".2f") for key, name in names.items()}
    output.table("peritectic taper", output.rows("peritectic_taper"), head)
    Output(output.folder, "laws.md").table("phase flow", output.rows("phase_flow"), {
        "share": ("δ ferrite in the solid", ".2f"), "switched": ("`kozlowski_zhu`", ".2f"),
        "equal_stress": ("equal stress in both", ".2f"),
        "mixed": ("`kozlowski_zhu_mixed`: equal strain", ".2f"),
    })  # fmt: skip
    columns = {"diagram": "`diagram`", "law": "`law`", "varied": "numerics", **RESULTS}
    coupling = Output(output.folder, "coupling.md")
    coupling.table("peritectic laws", output.rows("peritectic_laws"), columns)
    coupling.table("peritectic corner", output.rows("peritectic_corner"), {
        "diagram": "`diagram`", "law": "`law`", "varied": "cells or superheat",
        "depth": ("cells, deep [mm]", ".2f"), "position": ("at [mm]", ".0f"),
        "gap_corner": ("gap, corner [mm]", ".2f"),
        "gap_beside": ("gap 7 mm beside it [mm]", ".2f"), "heat": ("heat removed [MJ/m]", ".2f"),
        "shell_corner": ("shell, corner [mm]", ".2f"),
    })  # fmt: skip
