"""Tables of an optimum as files: the sizes that a mould is made by, the front of two results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.atomic_files import write_csv
from castfem.base.constants import same_instant
from castfem.model.build_mould import build_mould

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.studies.optimisation.optimum import Front

MOULD_NAME, FRONT_NAME = "mould.csv", "front.csv"


def mould_table(case: Case, every: float = 0.05) -> tuple[list[str], list[list[float]]]:
    """Return headings and rows of a mould: distance from the meniscus and inner sizes, mm.

    The sizes are those of the mould at work, and beside them those of the workshop if it is given
    cold.

    Args:
        case: With a [mould].
        every: Distance between two rows, m; there is also one where a taper changes.
    """
    assert case.mould is not None
    mould = build_mould(case.mould, case.section)
    length = mould.length
    places = {float(z) for z in np.arange(0.0, length, every)}
    for knot in (*case.mould_knots(), length):
        places = {z for z in places if not same_instant(z, knot, length)} | {knot}
    names = list(mould.dimensions(0.0))
    ends = [mould.dimensions(z) for z in (0.0, 0.5 * length, length)]
    if "height" in names and all(abs(one["width"] - one["height"]) < 1e-12 for one in ends):
        names.remove("height")
    cold = [f"cold {name}" for name in names] if mould.expansion is not None else []
    rows = []
    for place in sorted(places):
        sizes = mould.dimensions(place)
        row = [place, *(sizes[name] for name in names)]
        if cold:
            made = mould.dimensions(place, as_made=True)
            row += [made[name] for name in names]
        rows.append([1e3 * value for value in row])
    return [f"{name} [mm]" for name in ("distance", *names, *cold)], rows


def write_mould_table(folder: Path, case: Case) -> Path:
    """Write the table as CSV and return its path."""
    head, rows = mould_table(case)
    path = folder / MOULD_NAME
    write_csv(path, [head, *([f"{value:.4f}" for value in row] for row in rows)])
    return path


def write_front(folder: Path, front: Front) -> Path:
    """Write the points as CSV, a row each, and return its path."""
    head = [one.heading(chosen=False) for one in (front.first, front.second)]
    rows = [[*front.keys, *head, front.price_heading(chosen=False), "run"]]
    for point in front.points:
        price = front.price(point)
        results = front.first.shown(point.first), front.second.shown(point.second)
        numbers = (f"{value:.9g}" for value in (*point.values, *results))
        rows.append([*numbers, "" if price is None else f"{price:.6g}", point.run])
    path = folder / FRONT_NAME
    write_csv(path, rows)
    return path
