"""The section that comes out square (Fig. 121 of thesis V.3): how it is found, and run forward."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, COARSE, QUIET
from benchmarks.report import Output, table
from castfem.model import Case, load_case
from castfem.model.section import Rectangle
from castfem.model.wall_shape import WallShape
from castfem.studies.mould_fit.follow import Followed, follow
from castfem.studies.mould_fit.section import (
    Attempt,
    find_section,
    natural_wall,
    outline_of,
    sides_of_section,
)

TITLE = "125 mm billet, idealised mould"
FORWARD: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("idealised, as it was found", "idealised", COARSE),
    ("idealised, cells as shipped", "idealised", ()),
    ("in a wall of its natural shape, liquid fed", "tapered", COARSE),
    ("square section, idealised", "idealised", COARSE),
    ("square section, taper +1 %/m, liquid fed", "taper_1", COARSE),
)
"""Runs on the found section: what is said of each, its case, its cells."""


def main(output: Output, quick: bool = False) -> None:
    """Find the section of the billet, and run it forward in several ways."""
    short = ("casting.length=60 mm",) if quick else ()
    case = load_case(CASES / "idealised.toml", (*QUIET, *COARSE, *short))
    attempts = find_section(case, MPI.COMM_SELF, "idealised", 0.06 if quick else None)
    output.csv(
        "section_runs",
        [
            {
                "run": number,
                "worst_um": 1e6 * one.worst,
                "mid_face_mm": 1e3 * float(one.start.offset[0]),
                "corner_mm": 1e3 * float(np.interp(0.5, _share(one), one.start.offset)),
            }
            for number, one in enumerate(attempts, start=1)
        ],
    )
    rows = [
        _forward(name, load_case(CASES / f"{which}.toml", (*QUIET, *cells, *short)), attempts[-1])
        for name, which, cells in FORWARD[: 1 if quick else None]
    ]
    output.csv("section_forward", rows)
    _figure(output, case, attempts)
    show(output)


def _share(attempt: Attempt) -> Any:
    return attempt.start.ways / attempt.start.ways[-1]


def _forward(name: str, case: Case, found: Attempt) -> dict[str, Any]:
    """Run a case on the found section, or the square one, and measure what comes out."""
    assert isinstance(case.section, Rectangle)
    sides, start = sides_of_section(case.section), found.start
    changes: dict[str, Any] = {}
    if not name.startswith("square"):
        changes["section.bulge"] = {
            "way": start.ways.tolist(), "way_unit": "m",
            "value": start.offset.tolist(), "unit": "m",
        }  # fmt: skip
    if "natural" in name:
        changes["mould.displacement"] = WallShape().write(natural_wall(found, sides))
        changes["mould.length"] = f"{case.casting.length!r} m"
    strand = follow(case.with_(changes) if changes else case, MPI.COMM_SELF)
    end = outline_of(strand.outline[-1], strand.line.place, start, sides)
    return {
        "run": name,
        "worst_um": 1e6 * float(np.abs(end.offset).max()),
        "mid_face_um": 1e6 * float(end.offset[0]),
        **_values(strand),
    }


def _values(strand: Followed) -> dict[str, float]:
    return {
        "width_mm": 1e3 * strand.value("size_mid_face"),
        "diagonal_mm": 1e3 * strand.value("size_corner"),
        "heat_kJ": 1e-3 * strand.value("heat_removed_slice"),
        "von_mises_MPa": 1e-6 * strand.value("von_mises_max"),
    }


def _figure(output: Output, case: Case, attempts: list[Attempt]) -> None:
    from castfem.post.plots.section_shape import draw

    path = output.folder / "figures" / "section.png"
    path.parent.mkdir(parents=True, exist_ok=True)
    draw(attempts, sides_of_section(case.section), path, TITLE)  # type: ignore[arg-type]


def show(output: Output) -> None:
    """The tables, from the data."""
    if found := output.rows("section_runs"):
        headings = {"run": "run", "worst_um": "off the square at the exit [um]",
                    "mid_face_mm": "section at the meniscus, mid-face [mm]",
                    "corner_mm": "corner [mm]"}  # fmt: skip
        formats = {"worst_um": ".1f", "mid_face_mm": "+.4f", "corner_mm": "+.4f"}
        output.insert("section_runs", table(found, headings, formats))
    if found := output.rows("section_forward"):
        headings = {"run": "run", "worst_um": "off the square at the exit [um]",
                    "mid_face_um": "mid-face [um]", "width_mm": "width [mm]",
                    "diagonal_mm": "diagonal [mm]", "heat_kJ": "heat [kJ]",
                    "von_mises_MPa": "peak stress [MPa]"}  # fmt: skip
        formats = {"worst_um": ".1f", "mid_face_um": "+.1f", "width_mm": ".3f",
                   "diagonal_mm": ".3f", "heat_kJ": ".2f", "von_mises_MPa": ".2f"}  # fmt: skip
        output.insert("section_forward", table(found, headings, formats))
    print("section: tables")
