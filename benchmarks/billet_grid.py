"""Corner of ordinary billets in their moulds: carbon, size, heat law and taper varied together.

Writes a table of docs/coupling.md: how far `--accuracy coarse` is from the default, and whether a
run fails that finer cells let through.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from statistics import median
from typing import Any

import castfem
from benchmarks.billet_run import CASES
from benchmarks.report import Output, table
from castfem.model import load_case
from castfem.studies.accuracy.sizes import changes, factors_of

CARBONS = ("0.05", "0.10", "0.12", "0.17", "0.25", "0.42", "0.80")
SPEEDS = {"100": "3 m/min", "130": "2.4 m/min", "180": "1.6 m/min", "240": "1.1 m/min"}
"""Casting speed of a billet of so many mm."""
LAWS = {"flux": 'flux="savage_pritchard"', "coefficient": 'coefficient="1100 W/(m^2 K)"'}
TAPERS = ("0.4", "0.8", "1.2", "1.6", "2.0")
LENGTH, MOULD = "120 mm", "500 mm"
LEVELS = ("coarse", "default")
RESULTS = {
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_corner": ("surface, corner [K]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".3f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
}
"""Columns of the history: heading and format of a difference."""


@dataclass(frozen=True, slots=True)
class Billet:
    """One of the grid: carbon in wt%, size in mm, word of the law, taper in %/m."""

    carbon: str
    size: str
    law: str
    taper: str

    def keys(self) -> tuple[str, ...]:
        """Assignments that make it of `billet180/peritectic`."""
        law = f'{{law="contact", {LAWS[self.law]}, wall="160 degC"'
        law += ', gap_conductivity="0.15 W/(m K)"}'
        return (
            f"steel.composition.C={self.carbon}",
            f"section.width={self.size} mm",
            f"section.height={self.size} mm",
            f"casting.speed={SPEEDS[self.size]}",
            f"casting.length={LENGTH}",
            f"cooling.mould.to={MOULD}",
            f"mould.length={MOULD}",
            f"cooling.mould.surface=[{law}]",
            f"mould.taper={self.taper} %/m",
            "output.figures=false",
        )


def grid() -> Iterator[Billet]:
    """Each carbon with two sizes; laws and tapers take turns."""
    for number, carbon in enumerate(CARBONS):
        for place, size in [*enumerate(SPEEDS)][number % 2 :: 2]:
            law = [*LAWS][(number + place // 2) % len(LAWS)]
            taper = TAPERS[(2 * number + place) % len(TAPERS)]
            yield Billet(carbon, size, law, taper)


def run(billet: Billet, level: str) -> dict[str, Any]:
    """Results at its end, or why it has none."""
    path = CASES.parent / "billet180" / "peritectic.toml"
    case = load_case(path, billet.keys())
    scaled = changes(case, factors_of(level)) if level != "default" else {}
    case = load_case(path, (*billet.keys(), *(f"{k}={v}" for k, v in scaled.items())))
    try:
        with castfem.run(case) as result:
            last = result.history.iloc[-1]
            found = {name: float(last[name]) for name in RESULTS}
    except castfem.RunFailure as failure:
        return {**dict.fromkeys(RESULTS, ""), "failure": str(failure).partition(";")[0]}
    return {**found, "failure": ""}


def main(output: Output, quick: bool) -> None:
    """All billets with both accuracies."""
    rows: list[dict[str, Any]] = []
    for billet in [*grid()][: 1 if quick else None]:
        for level in LEVELS:
            named = {
                "carbon": billet.carbon, "size": billet.size, "law": billet.law,
                "taper": billet.taper, "level": level,
            }  # fmt: skip
            rows.append({**named, **run(billet, level)})
            print(f"  {rows[-1]}", flush=True)
    output.csv("billet_grid", rows)
    show(output)


def differences(rows: list[dict[str, Any]], name: str) -> list[float]:
    """How far a result of the coarse run is from that of the default, by billet."""
    pairs = zip(rows[::2], rows[1::2], strict=True)
    return [
        abs(float(coarse[name]) - float(default[name]))
        for coarse, default in pairs
        if not (coarse["failure"] or default["failure"])
    ]


def show(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("billet_grid")
    found = []
    for name, (heading, form) in RESULTS.items():
        off = sorted(differences(rows, name))
        row = {"result": heading, "median": format(median(off), form)}
        row["nine of ten"] = format(off[int(0.9 * (len(off) - 1))], form)
        found.append(row | {"largest": format(off[-1], form)})
    head = {one: one for one in ("result", "median", "nine of ten", "largest")}
    output.insert("billet grid", table(found, head, {}))
