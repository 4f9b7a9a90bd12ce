"""What the penalty's factor and the law of friction change of a billet in its mould.

Writes tables of docs/contact.md. All runs are shipped billets, in memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.billet_run import COARSE, NAMES, Found, run, touch
from benchmarks.report import Output

FACTORS = (10, 30, 100, 300, 1000)
RUBBED = 'mould.friction={law="coulomb", coefficient=0.3}'
STUDIED: tuple[tuple[str, tuple[str, ...]], ...] = (
    *((m, ()) for m in ("taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")),
    ("taper_1", (RUBBED,)),
    ("taper_0", (RUBBED,)),
    ("taper_1", ("mechanics.strain=large",)),
    ("taper_0", ("mechanics.liquid_stiffness=1e-5",)),
    ("taper_1", ("mesh.cell=triangle",)),
)
HOLD, OPENS = slice(0, 4), slice(4, 5)  # of those: the moulds as shipped, and the one that opens
P0 = 'yield_stress="10 MPa"'
CAST = 'speed="3.6 m/min"'
LAWS = {
    "Coulomb 0.3": 'law="coulomb", coefficient=0.3',
    "the same, limited": f'law="limited", coefficient=0.3, {P0}',
    "Tresca, share 0.05": f'law="tresca", share=0.05, {P0}',
    "Tresca, share 0.3": f'law="tresca", share=0.3, {P0}',
    "viscous, 1 MPa beyond Coulomb 0.3": (
        f'law="viscous", coefficient=0.3, stress="1 MPa", {CAST}, {P0}'
    ),
    "lubricant, 20 kPa at the speed of casting": f'law="viscous", stress="20 kPa", {CAST}',
}


def factors(output: Output, quick: bool) -> None:
    """Iterations and cuts by the factor, and how far the results are from the last."""
    studied = STUDIED[:2] if quick else STUDIED
    found = {f: [run(m, (*COARSE, *c, touch("penalty", f))) for m, c in studied] for f in FACTORS}
    last, rows = found[FACTORS[-1]], []

    def off(name: str, runs: list[Found], moulds: slice) -> float:
        pairs = list(zip(runs, last, strict=True))[moulds]
        return max((abs(r.values[name] / b.values[name] - 1.0) for r, b in pairs), default=np.nan)

    for factor, runs in found.items():
        rows.append(
            {
                "factor": factor,
                "newton": sum(r.newton for r in runs) / sum(r.windows for r in runs),
                "cut": sum(r.cut for r in runs),
                "heat_removed": off("heat_removed", runs, HOLD),
                "von_mises_max": off("von_mises_max", runs, HOLD),
                "heat_open": off("heat_removed", runs, OPENS),
                "peak_open": off("von_mises_max", runs, OPENS),
                "penetration": max(r.values["penetration"] for r in runs),
            }
        )
    output.csv("contact_factor", rows)


def frictions(output: Output, quick: bool) -> None:
    """Iterations and results by the law of friction."""
    rows: list[dict[str, Any]] = []
    for name, law in list(LAWS.items())[: 1 if quick else None]:
        for mould in ("taper_1", "taper_0"):
            found = run(mould, (*COARSE, f"mould.friction={{{law}}}"))
            row = {"law": name, "mould": NAMES[mould], "newton": found.newton, "cut": found.cut}
            keys = {"heat": "heat_removed_slice", "peak": "von_mises_max", "pull": "mould_pull"}
            rows.append(row | {short: found.values[key] for short, key in keys.items()})
    output.csv("contact_friction", rows)


def main(output: Output, quick: bool) -> None:
    """Both of them."""
    factors(output, quick)
    frictions(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    head = {
        "factor": "factor", "newton": ("Newton a window", ".2f"), "cut": "cut back",
        "heat_removed": ("heat off by, four moulds", ".1e"),
        "von_mises_max": ("peak stress", ".1e"),
        "heat_open": ("heat off by, -3 %/m", ".1e"), "peak_open": ("peak stress, -3 %/m", ".1e"),
        "penetration": ("penetration, µm", ".1e"),
    }  # fmt: skip
    output.table("contact factor", output.rows("contact_factor"), head)
    head = {
        "law": "law (p0 = 10 MPa)", "mould": "mould", "newton": "Newton", "cut": "cut back",
        "heat": ("heat [kJ]", ".1f"), "peak": ("peak stress [MPa]", ".1f"),
        "pull": ("withdrawal resistance [kN]", ".2f"),
    }  # fmt: skip
    output.table("contact friction", output.rows("contact_friction"), head)
