"""What holds a strand in its mould: the penalty's factor, friction, cells at the wall, springs.

Writes tables of docs/contact.md and docs/mechanics.md. All runs are shipped billets, in memory.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from time import process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.billet_run import CASES, COARSE, NAMES, QUIET, touch
from benchmarks.report import Output, table
from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.build.simulation import build
from castfem.physics.mechanics import problem as mechanical_problem
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import MechanicalSample, Sample
from castfem.runs.results.summary import summarise


@dataclass
class Noted:
    """Sits where a recorder does, and keeps what the mechanics read at every window.

    Attributes:
        mechanics: One sample a window. seconds: Of processor time.
        newton: Mechanical iterations. cut: Windows that were cut back.
        values: Of the summary's quantities at the end.
    """

    mechanics: list[MechanicalSample] = field(default_factory=list)
    seconds: float = 0.0
    newton: int = 0
    cut: int = 0
    values: dict[str, float] = field(default_factory=dict)

    def step(self, run: RunState, sample: Sample) -> None:
        """Note a window."""
        if sample.mechanics is not None and sample.position > 0.0:
            self.mechanics.append(sample.mechanics)

    def contact(self, name: str) -> Array:
        """A number of the contact, or a pair, at every window."""
        return np.array([getattr(m.contact, name) for m in self.mechanics])


def run_case(mould: str, changes: Iterable[str]) -> Noted:
    """Run one billet with some keys changed."""
    simulation = build(load_case(CASES / f"{mould}.toml", (*QUIET, *changes)), MPI.COMM_SELF)
    found = Noted()
    one = TimeLoop(simulation, found)  # type: ignore[arg-type]
    start = process_time()
    one.run()
    found.seconds = process_time() - start
    found.newton, found.cut = one.run_state.counts.newton_mechanics, one.run_state.counts.cut_back
    found.values = {n: q.value for n, q in summarise(one.run_state, "finished").quantities.items()}
    simulation.destroy()
    keys = textwrap.shorten(" ".join(changes), 120, placeholder=" ...")
    print(f"  {mould} {keys}: {found.seconds:.1f} s", flush=True)
    return found


# The factor of the penalty.

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


def factors(output: Output, quick: bool) -> None:
    """Iterations and cuts by the factor, and how far the results are from the last."""
    studied = STUDIED[:2] if quick else STUDIED
    found = {
        f: [run_case(m, (*COARSE, *c, touch("penalty", f))) for m, c in studied] for f in FACTORS
    }
    last, rows = found[FACTORS[-1]], []

    def off(name: str, runs: list[Noted], moulds: slice) -> float:
        pairs = list(zip(runs, last, strict=True))[moulds]
        return max((abs(r.values[name] / b.values[name] - 1.0) for r, b in pairs), default=np.nan)

    for factor, runs in found.items():
        rows.append(
            {
                "factor": factor,
                "newton": sum(r.newton for r in runs) / sum(len(r.mechanics) for r in runs),
                "cut": sum(r.cut for r in runs),
                "heat_removed": off("heat_removed", runs, HOLD),
                "von_mises_max": off("von_mises_max", runs, HOLD),
                "heat_open": off("heat_removed", runs, OPENS),
                "peak_open": off("von_mises_max", runs, OPENS),
                "penetration": max(1e6 * r.contact("penetration").max() for r in runs),
            }
        )
    output.csv("contact_factor", rows)


def show_factors(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("contact_factor")
    head = {
        "factor": "factor", "newton": "Newton a window", "cut": "cut back",
        "heat_removed": "heat off by, four moulds", "von_mises_max": "peak stress",
        "heat_open": "heat off by, -3 %/m", "peak_open": "peak stress, -3 %/m",
        "penetration": "penetration, µm",
    }  # fmt: skip
    off_by = ("heat_removed", "von_mises_max", "heat_open", "peak_open", "penetration")
    forms = dict.fromkeys(off_by, ".1e")
    output.insert("contact factor", table(rows, head, {"newton": ".2f", **forms}))


# Laws of friction.

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


def frictions(output: Output, quick: bool) -> None:
    """Iterations and results by the law of friction."""
    rows = []
    for name, law in list(LAWS.items())[: 1 if quick else None]:
        for mould in ("taper_1", "taper_0"):
            found = run_case(mould, (*COARSE, f"mould.friction={{{law}}}"))
            values = found.values
            rows.append(
                {
                    "law": name,
                    "mould": NAMES[mould],
                    "newton": found.newton,
                    "cut": found.cut,
                    "heat": values["heat_removed_slice"] / 1e3,
                    "peak": values["von_mises_max"] / 1e6,
                    "pull": values["mould_pull"] / 1e3,
                }
            )
    output.csv("contact_friction", rows)


def show_frictions(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("contact_friction")
    head = {
        "law": "law (p0 = 10 MPa)", "mould": "mould", "newton": "Newton", "cut": "cut back",
        "heat": "heat [kJ]", "peak": "peak stress [MPa]", "pull": "withdrawal resistance [kN]",
    }  # fmt: skip
    forms = {"heat": ".1f", "peak": ".1f", "pull": ".2f"}
    output.insert("contact friction", table(rows, head, forms))


# Quadrilaterals and triangles.

SIZES = (1.2, 0.8, 0.5, 0.35, 0.2)
EARLY = ("casting.length=150 mm", "coupling.interval=0.1 s", "mechanics.liquid_stiffness=1e-5")


def cells(output: Output, quick: bool) -> None:
    """Force on a face from 1 to 2.5 s against the finest quadrilaterals, and what touches."""
    sizes = SIZES[:2] if quick else SIZES
    found: dict[tuple[str, float], Noted] = {}
    for cell in ("quadrilateral", "triangle"):
        for size in sizes:
            keys = [f"mesh.{k}_size={size} mm" for k in ("surface", "corner")]
            found[cell, size] = run_case("taper_1", (*EARLY, *keys, f"mesh.cell={cell}"))
    exact = found["quadrilateral", sizes[-1]].contact("force")[9:, 0]
    rows = []
    for size in sizes:
        row: dict[str, Any] = {"size": size}
        for cell in ("quadrilateral", "triangle"):
            off = found[cell, size].contact("force")[9:, 0] / exact - 1.0
            row[f"force_{cell}"] = 100.0 * float(np.sqrt(np.mean(off**2)))
            row[f"share_{cell}"] = float(found[cell, size].contact("share")[-1])
        rows.append(row)
    output.csv("contact_cells", rows)


def show_cells(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("contact_cells")
    head = {
        "size": "surface cells, mm",
        "force_quadrilateral": "force off by, %: quadrilaterals", "force_triangle": "triangles",
        "share_quadrilateral": "share that touches: quadrilaterals", "share_triangle": "triangles",
    }  # fmt: skip
    forms = {k: ".1f" if k.startswith("force") else ".2f" for k in head if k != "size"}
    output.insert("contact cells", table(rows, head, forms))


# Springs beside the wall.

LAW = '{{law="contact", on={}, coefficient="{} W/(m^2 K)", gap_conductivity="0.15 W/(m K)"{}}}'
WALL = ', wall="160 degC"'
WARM = '["wide_face_intrados","corner_intrados","narrow_face","corner_extrados"]'
COLD = '["wide_face_extrados"]'
# Liquid that runs to the wall would hold the strand as well: here points alone do, or springs.
HALF = (
    "mechanics.liquid=elastic", "mechanics.mush=geometric", "mechanics.ferrostatic=proportional",
    "section.symmetry=half", "mesh.surface_size=3 mm", "mesh.corner_size=3 mm",
    "mesh.face_size=10 mm", "mesh.core_size=14 mm", "coupling.interval=0.25 s",
    f"cooling.mould.surface=[{LAW.format(WARM, 1600, WALL)},{LAW.format(COLD, 1000, WALL)}]",
)  # fmt: skip
SPRINGS: tuple[float | None, ...] = (None, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11)


@contextmanager
def sprung(stiffness: float | None) -> Any:
    """Let a slice have springs of another stiffness, or points held rigidly."""
    shipped = mechanical_problem.SPRING
    mechanical_problem.SPRING = stiffness  # type: ignore[assignment]
    try:
        yield
    finally:
        mechanical_problem.SPRING = shipped


def springs(output: Output, quick: bool) -> None:
    """Half a billet cooled unequally in a mould, and one that touches nothing."""
    rows: list[dict[str, Any]] = []
    still: dict[str, float] = {}
    length, untouched = ("120 mm", "45 mm") if quick else ("180 mm", "90 mm")
    for stiffness in SPRINGS[:2] if quick else SPRINGS:
        with sprung(stiffness):
            held = run_case("taper_1", (f"casting.length={length}", *HALF))
            free = run_case("taper_minus_3", (f"casting.length={untouched}", *HALF))
        still = still or free.mechanics[-1].moved
        moved = free.mechanics[-1].moved
        rows.append(
            {
                "points": "held" if stiffness is None else f"{stiffness:g} E",
                "carried": max(abs(float(f)) for f in held.contact("force")[:, 1]),
                "wall": max(abs(float(f)) for f in held.contact("force")[:, 0]),
                "peak": held.mechanics[-1].peak / 1e6,
                "newton": held.newton,
                "drift": 1e6 * max(abs(moved[name] - still[name]) for name in still),
            }
        )
    output.csv("springs", rows)


def show_springs(output: Output) -> None:
    """The table, from the data."""
    rows = output.rows("springs")
    head = {
        "points": "points", "carried": "force they carry, N/m",
        "wall": "force of the wall across, N/m", "peak": "largest stress, MPa",
        "newton": "Newton iterations", "drift": "drift of the untouched strand, µm",
    }  # fmt: skip
    forms = {"carried": ".2g", "wall": ".2f", "peak": ".4f", "drift": ".1g"}
    replace(output, name="mechanics.md").insert("springs", table(rows, head, forms))


PARTS: Sequence[Any] = (springs, frictions, factors, cells)


def main(output: Output, quick: bool) -> None:
    """All of them."""
    for part in PARTS:
        part(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    show_springs(output)
    show_frictions(output)
    show_factors(output)
    show_cells(output)
