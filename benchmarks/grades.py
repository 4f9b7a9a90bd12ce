"""From an analysis to a grade: uncertainty of freezing range, shell and taper.

Writes tables of docs/my_steel.md: the built-in diagram against assessed databases for 24 steels,
and the effect on billets and a slab of data that are from memory of their source. The environment
variable `DATABASE` names the file of [PovodenKaradeniz2016], `DATABASE_MF` that of [Frichtl2024],
neither of which is part of castfem; without them their values in docs/data are kept.
`tools/env.sh calphad` installs pycalphad.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from scipy.optimize import bisect

import castfem
from benchmarks.report import Output
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.model import Case, load_case
from castfem.model.shipped_cases import find
from castfem.physics.constitutive.hardening_laws import UnifiedSteel
from castfem.physics.materials.alloying import alloyed, regression_liquidus
from castfem.physics.materials.equilibria import Equilibria
from castfem.studies.optimisation.fidelity import at_level, idealised

CARBON = (0.04, 0.08, 0.10, 0.12, 0.15, 0.18, 0.25, 0.45)
OTHERS = ((0.0, 0.0), (0.6, 0.2), (1.4, 0.3))
"""Manganese and silicon, wt%."""
HOTTEST, COLDEST = 1830.0, 1600.0  # K, between which the steels freeze and become austenite
LIQUID, DELTA, GAMMA = 0, 1, 2
"""Indices of the phases in `equilibria.State.mass`."""
LIMITS = {"liquidus": "liquidus", "solidus": "solidus", "gamma": "γ from", "delta_end": "δ to"}
"""Compared temperatures: begin and end of freezing, and of the change to austenite."""
FILES = {"mc_fe": "DATABASE", "MF Steel": "DATABASE_MF"}
"""Environment variables with the files of the databases."""
COLUMNS = ("shell", "taper", "pool")
QUIET = ("output.figures=false", "output.fields=[]")
FREE: dict[str, Any] = {
    "mechanics.ferrostatic": "off",
    "mechanics.liquid": "fed",
    "mechanics.mush": "skeleton",
    "steel.composition": {"C": 0.12},
}
"""A strand without supports or pressure."""
TRACE = 1e-6  # mass fraction below which a phase counts as absent
SHARE = 10.0  # change of the data, per cent


def limits(file: Path, composition: Mapping[str, float]) -> tuple[list[float], float]:
    """Return the `LIMITS` by a database, K, and a solid fraction.

    The solid fraction is that in the middle between solidus and liquidus.
    """
    present = {element: share for element, share in composition.items() if share > 0.0}
    data = Equilibria(file, ["Fe", *present], ["LIQUID", "BCC_A2", "FCC_A1"])
    moles = data.moles(present)

    def mass(temperature: float, phase: int) -> float:
        return float(data.state(temperature, moles).mass[phase])

    def end(phase: int, share: float, cold: float, hot: float) -> float:
        def more(temperature: float) -> float:
            return 1.0 if mass(temperature, phase) > share else -1.0

        return float(bisect(more, cold, hot, xtol=0.02)) if more(cold) != more(hot) else hot

    solidus = end(LIQUID, TRACE, COLDEST, HOTTEST)
    liquidus = end(LIQUID, 1.0 - TRACE, solidus, HOTTEST)
    gamma = end(GAMMA, TRACE, COLDEST, HOTTEST)
    delta = end(DELTA, TRACE, COLDEST, min(gamma, HOTTEST))
    middle = 1.0 - mass(0.5 * (solidus + liquidus), LIQUID)
    return [liquidus, solidus, gamma, delta], middle


def diagram(files: Mapping[str, Path]) -> list[dict[str, Any]]:
    """Return the rows of `diagram_of`; each database is read once."""
    if files:
        import pycalphad

        with patch.object(pycalphad, "Database", cache(pycalphad.Database)):
            return diagram_of(files)
    return diagram_of(files)


def diagram_of(files: Mapping[str, Path]) -> list[dict[str, Any]]:
    """Compare the built-in diagram with the databases in `files` and in docs/data."""
    stored = {(r["C"], r["Mn"], r["database"]): r for r in Output().rows("grades_diagram")}
    rows = []
    for name in FILES:
        for manganese, silicon in OTHERS:
            for carbon in CARBON:
                composition = {"C": carbon, "Mn": manganese, "Si": silicon}
                if name in files:
                    found, middle = limits(files[name], composition)
                elif row := stored.get((carbon, manganese, name)):
                    found = [row[f"{key}_database"] + ZERO_CELSIUS for key in LIMITS]
                    middle = row["solid_database"]
                else:
                    continue
                rows.append(compared(name, composition, found, middle))
    return rows


def compared(
    name: str, composition: Mapping[str, float], found: Sequence[float], middle: float
) -> dict[str, Any]:
    """Return a row with the limits by a database and by the diagram."""
    steel = alloyed(composition)
    gamma = steel.liquidus if steel.gamma_start is None else steel.gamma_start
    end = gamma if steel.gamma_end is None else steel.gamma_end
    own = [steel.liquidus, steel.solidus, gamma, end]
    row: dict[str, Any] = {**composition, "database": name}
    for key, ours, theirs in zip(LIMITS, own, found, strict=True):
        row |= {f"{key}_database": theirs - ZERO_CELSIUS, key: ours - ZERO_CELSIUS}
    row["solid_database"] = middle
    row["solid"] = 1.0 - float(steel.phases(0.5 * (found[0] + found[1])).liquid)
    row["liquidus_regression"] = regression_liquidus(composition) - ZERO_CELSIUS
    return row


def hirai_liquidus(carbon: float, manganese: float, silicon: float) -> float:
    """Return the liquidus by the formula of [Hirai1997], degC, from shares in wt%."""
    return 1538.0 - 55.0 * carbon - 80.0 * carbon**2 - 13.0 * silicon - 4.8 * manganese


def hirai_solidus(carbon: float, manganese: float, silicon: float) -> float:
    """Return the solidus by [Hirai1997], degC: of delta ferrite, peritectic or austenite."""
    drop = 20.5 * silicon + 6.5 * manganese
    if carbon <= 0.09:
        return 1538.0 - 478.0 * carbon - drop
    return (1495.0 if carbon <= 0.17 else 1527.0 - 187.5 * carbon) - drop


def published(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Compare the built-in diagram with published formulas for the steels of one database."""
    found = []
    for row in rows:
        if row["database"] == next(iter(FILES)):
            analysis = row["C"], row["Mn"], row["Si"]
            off = {"liquidus": hirai_liquidus(*analysis), "solidus": hirai_solidus(*analysis)}
            found.append({key: row[key] for key in ("C", "Mn", "Si")} | {
                f"{key}_{what}": value for key, formula in off.items()
                for what, value in (("formula", formula), ("off", formula - row[key]))
            })  # fmt: skip
    return found


def largest(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the largest differences of the diagram by database and manganese content."""
    found = []
    for name, manganese in dict.fromkeys((row["database"], row["Mn"]) for row in rows):
        mine = [r for r in rows if (r["database"], r["Mn"]) == (name, manganese)]
        worst = {key: max(abs(r[key] - r[f"{key}_database"]) for r in mine)
                 for key in (*LIMITS, "solid")}  # fmt: skip
        regression = max(abs(r["liquidus_regression"] - r["liquidus_database"]) for r in mine)
        found.append({"database": name, "Mn": manganese, "Si": mine[0]["Si"], "steels": len(mine),
                      **worst, "liquidus_regression": regression})  # fmt: skip
    return found


def billet(quick: bool) -> Case:
    """Return the billet of the thesis in its idealised mould."""
    length = ("casting.length=30 mm",) if quick else ()
    return at_level(load_case(find("billet125/idealised"), [*QUIET, *length]), "coarse")


def peritectic(quick: bool) -> Case:
    """Return the billet with computed properties, free to shrink in its idealised mould."""
    length = ("casting.length=30 mm",) if quick else ()
    changes = (*QUIET, "steel.diagram=assessed", *length)
    return at_level(
        idealised(load_case(find("billet180/peritectic"), changes)).with_(FREE), "coarse"
    )


def slab(quick: bool) -> Case:
    """Return the thermal case of the slab."""
    length = ("casting.length=1 m",) if quick else ()
    return at_level(load_case(find("slab1200/thermal"), [*QUIET, *length]), "coarse")


SHRINKS = {"shell_mid_face": "shell", "displacement_corner": "taper"}
"""Results of a billet by column; a taper has to follow the displacement of the corner."""
CASES: dict[str, tuple[Callable[[bool], Case], Mapping[str, str], tuple[str, ...]]] = {
    "billet125/idealised": (billet, SHRINKS, (
        "steel.conductivity", "steel.density", "steel.specific_heat", "steel.latent_heat",
        "law.strength",
    )),
    "billet180/peritectic": (peritectic, SHRINKS, (
        "steel.conductivity", "steel.density", "steel.thermal_expansion", "steel.youngs_modulus",
        "steel.poisson_ratio",
    )),
    "slab1200/thermal": (slab, {"metallurgical_length": "pool"}, (
        "steel.conductivity", "steel.density", "steel.emissivity",
    )),
}  # fmt: skip
"""Function that makes a shipped case, its results by column, and its varied data."""


def data(quick: bool) -> list[dict[str, Any]]:
    """Return the changes of shell, taper and pool by `SHARE` more of each datum, per cent."""
    rows = []
    for name, (make, of, parameters) in list(CASES.items())[: 1 if quick else None]:
        found = castfem.sensitivities(make(quick), to=list(parameters), of=list(of))
        slopes = {(row.name, row.parameter.name): row for row in found.rows()}
        for parameter in parameters:
            row: dict[str, Any] = {"case": name, "datum": parameter, **dict.fromkeys(COLUMNS)}
            row |= {key: SHARE * slopes[result, parameter].elasticity for result, key in of.items()}
            rows.append(row)
    return rows + ([] if quick else by_runs())


def by_runs() -> list[dict[str, Any]]:
    """Return the changes by flow stress of `kozlowski_zhu` and coherency, from repeated runs."""
    case, columns, more = peritectic(False), UnifiedSteel.own_columns, 1.0 + SHARE / 100.0
    later = case.with_({"mechanics.coherency": 0.75 * more})

    def scaled(law: UnifiedSteel, temperature: Array) -> list[Array]:
        return law.weakened(columns(law, temperature), np.full_like(temperature, more))

    def results(case: Case, method: Callable[..., list[Array]] = columns) -> Array:
        with patch.object(UnifiedSteel, "own_columns", method), castfem.run(case) as result:
            return np.array([result.summary.quantities[name].value for name in SHRINKS])

    before = results(case)
    changed = {"flow stress": results(case, scaled), "mechanics.coherency": results(later)}
    return [
        {
            "case": "billet180/peritectic", "datum": datum, **dict.fromkeys(COLUMNS),
            **dict(zip(SHRINKS.values(), 100.0 * (after / before - 1.0), strict=True)),
        }
        for datum, after in changed.items()
    ]  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Compare the diagram with databases and vary data that are from memory."""
    files = {name: Path(os.environ[key]) for name, key in FILES.items() if key in os.environ}
    output.csv("grades_diagram", diagram({} if quick else files))
    output.csv("grades_largest", largest(output.rows("grades_diagram")))
    output.csv("grades_published", published(output.rows("grades_diagram")))
    output.csv("grades_data", data(quick))
    show(output)


def show(output: Output) -> None:
    """Write the tables from the data."""
    page = Output(output.folder, "my_steel.md")
    rows = output.rows("grades_diagram")
    head: dict[str, Any] = {"database": "beside", "C": ("C", ".2f"), "Mn": ("Mn", ".1f")}
    for key, label in LIMITS.items():
        head |= {key: (f"{label} [°C]", ".1f"), f"{key}_database": ("database", ".1f")}
    head |= {"solid": ("solid, middle", ".3f"), "solid_database": ("database", ".3f")}
    page.table("grades diagram", rows, head)
    page.table("grades largest", output.rows("grades_largest"), {
        "database": "database", "Mn": ("Mn [wt%]", ".1f"), "Si": ("Si [wt%]", ".1f"),
        "steels": ("steels", ".0f"), "liquidus": ("liquidus [K]", ".1f"),
        "solidus": ("solidus [K]", ".1f"), "gamma": ("γ from [K]", ".1f"),
        "delta_end": ("δ to [K]", ".1f"), "solid": ("solid fraction", ".3f"),
        "liquidus_regression": ("liquidus by regression [K]", ".1f"),
    })  # fmt: skip
    page.table("grades published", output.rows("grades_published"), {
        "C": ("C [wt%]", ".2f"), "Mn": ("Mn [wt%]", ".1f"), "Si": ("Si [wt%]", ".1f"),
        "liquidus_formula": ("liquidus [°C]", ".1f"), "liquidus_off": ("less ours [K]", "+.1f"),
        "solidus_formula": ("solidus [°C]", ".1f"), "solidus_off": ("less ours [K]", "+.1f"),
    })  # fmt: skip
    page.table("grades data", output.rows("grades_data"), {
        "case": "case", "datum": "datum", "shell": ("shell, mid-face [%]", "+.1f"),
        "taper": ("taper that follows [%]", "+.1f"), "pool": ("metallurgical length [%]", "+.1f"),
    })  # fmt: skip
