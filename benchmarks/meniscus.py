"""What a billet's beginning does: liquid of one temperature, met by the wall, or with a profile.

Writes a table of docs/billet.md.
"""

from __future__ import annotations

from typing import Any

from benchmarks.billet_run import COARSE, SHOWN, run
from benchmarks.billet_study import MORE
from benchmarks.report import Output, table

NEAR_SOLIDUS = '{depth=[0,2,8],depth_unit="mm",value=[1460,1502,1542],unit="degC"}'
BEGINNINGS: dict[str, tuple[str, ...]] = {
    "one temperature, as shipped": (),
    **{f"meniscus of {h} mm": (f"casting.start.meniscus={h} mm",) for h in (4, 8, 16)},
    "1460 °C at the surface, as poured from 8 mm on": (f"casting.start.profile={NEAR_SOLIDUS}",),
}
PLACES = ("first_solid", "closed_solid")
KEYS = tuple(SHOWN)


def main(output: Output, quick: bool) -> None:
    """The billet at +1 %/m to its mould's exit, begun in five ways."""
    rows: list[dict[str, Any]] = []
    for label, changes in list(BEGINNINGS.items())[:: 2 if quick else 1]:
        found = run("taper_1", (*changes, *(COARSE if quick else ())))
        rows.append({"start": label, **{k: found.values[k] for k in (*PLACES, *KEYS)}})
    output.csv("meniscus", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {"start": "start", **{k: MORE[k][0] for k in PLACES}}
    head |= {k: SHOWN[k][0] for k in KEYS}
    forms = dict.fromkeys(PLACES, ".0f") | {k: SHOWN[k][1] for k in KEYS}
    output.insert("meniscus", table(output.rows("meniscus"), head, forms))
