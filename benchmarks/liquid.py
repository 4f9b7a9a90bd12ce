"""What the liquid's numerical stiffness moves, and how far fed liquid gets without a wall.

A cell that freezes is part liquid, and needs some stiffness to be solved for.  Where liquid is fed
that is `STAND_IN` of `castfem.physics.mechanics.material_points` times its pressure, and counts in
that one layer of cells alone; where it is elastic all of the core has it.  Writes tables of
docs/mechanics.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from benchmarks.billet_run import COARSE, NAMES, QUIET, mesh, run
from benchmarks.billet_study import picked
from benchmarks.report import Output, table
from castfem.physics.mechanics import material_points

FACTORS = (10.0, 30.0, 300.0)
STIFFNESSES = (1e-2, 1e-7)
ELASTIC = (1e-2, 1e-3, 1e-5, 1e-7)
AS_THESIS = (
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
)  # fmt: skip
SIZES = (2.0, 1.2, 0.8, 0.5)  # of cells at the surface, mm
SMALL_STRAIN = "mechanics.strain=small"  # of the case; an elastic core this soft wants small strain


@dataclass(frozen=True)
class Liquid:
    """One kind of liquid in one mould.

    Attributes:
        mould: Whose. model: "fed" or "elastic". what: What is varied, in words.
        factor: Of the stand-in over the pressure. changes: Keys.
    """

    mould: str
    model: str
    what: str
    factor: float = material_points.STAND_IN
    changes: tuple[str, ...] = ()


def liquids() -> Iterator[Liquid]:
    """All that is run, a mould after the other."""
    for mould in ("taper_1", "taper_0", "taper_minus_1"):
        for factor in FACTORS:
            yield Liquid(mould, "fed", f"stand-in {factor:g} p", factor)
        if mould != "taper_minus_1":
            for value in STIFFNESSES:
                keys = (f"mechanics.liquid_stiffness={value:g}",)
                yield Liquid(mould, "fed", f"liquid_stiffness {value:g}", changes=keys)
        if mould == "taper_0":
            yield from _elastic(mould)
    yield Liquid("taper_minus_3", "fed", f"stand-in {material_points.STAND_IN:g} p")
    yield from _elastic("taper_minus_3")


def _elastic(mould: str) -> Iterator[Liquid]:
    for value in ELASTIC:
        keys = (*AS_THESIS, SMALL_STRAIN, f"mechanics.liquid_stiffness={value:g}")
        yield Liquid(mould, "elastic", f"liquid_stiffness {value:g}", changes=keys)


@contextmanager
def standing_in(factor: float) -> Iterator[None]:
    """Let fed liquid have a stand-in of another stiffness."""
    shipped = material_points.STAND_IN
    material_points.STAND_IN = factor
    try:
        yield
    finally:
        material_points.STAND_IN = shipped


def without_wall(output: Output, quick: bool) -> None:
    """Where the ideal mould, which presses on nothing, loses a strand whose liquid is fed."""
    fed = ("mechanics.liquid=fed", "mechanics.ferrostatic=full")
    rows = []
    for size in SIZES[:1] if quick else SIZES:
        found = run("idealised", (*QUIET, *mesh(size), *fed), 300.0)
        position = 1e3 * found.values["position"]
        rows.append({"size": size, "position": position, "ends": found.failure})
    output.csv("liquid_without_wall", rows)


def main(output: Output, quick: bool) -> None:
    """Each liquid in its moulds, on coarse cells."""
    rows: list[dict[str, Any]] = []
    for one in list(liquids())[: 2 if quick else None]:
        with standing_in(one.factor):
            found = run(one.mould, (*QUIET, *COARSE, *one.changes), 300.0)
        names = {"mould": NAMES[one.mould], "liquid": one.model, "varied": one.what}
        rows.append({**names, **picked(found)})
    output.csv("liquid", rows)
    without_wall(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    head = {
        "mould": "mould", "liquid": "liquid", "varied": "varied",
        "heat_removed_slice": "heat [kJ]",
        "shell_mid_face": "shell, mid-face [mm]", "shell_corner": "shell, corner [mm]",
        "surface_temperature_mid_face": "surface, mid-face [°C]",
        "surface_temperature_corner": "surface, corner [°C]",
        "von_mises_max": "peak stress [MPa]", "gap_max": "gap [mm]",
    }  # fmt: skip
    forms = dict.fromkeys(("heat_removed_slice", "shell_mid_face", "shell_corner"), ".2f")
    forms |= {
        "surface_temperature_mid_face": ".1f", "surface_temperature_corner": ".1f",
        "von_mises_max": ".2f", "gap_max": ".3f",
    }  # fmt: skip
    lines = []
    for row in output.rows("liquid"):
        if row["failure"]:
            where, _, why = row["failure"].partition(" (")
            why = why.partition(": ")[2].partition("; ")[0].rpartition(": ")[2]
            row = {k: row[k] for k in ("mould", "liquid", "varied")}
            row["varied"] += f": ends {where}, {why.partition(' at ')[0]}"
        lines.append(row)
    output.insert("liquid", table(lines, head, forms))
    head = {"size": "surface cells, mm", "position": "last good state, mm below the meniscus"}
    rows = output.rows("liquid_without_wall")
    output.insert("liquid without a wall", table(rows, head, {"position": ".0f"}))
