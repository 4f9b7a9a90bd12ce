"""Bending against straightening: what hardening remembers, and what the radii of the rolls do.

An outer fibre of the strand, at one temperature, goes through bender and straightener of the
demonstration caster by several laws, and so does cases/slab1200/slab.toml on coarse cells (7.5 mm,
windows of 100 mm, elastic bulges), by its own rolls and by some whose straightening ends harder.
The radii that the thesis tells are those of both. Into results/benchmarks/slab_reversal (what is
finished there is not repeated). Writes two tables of docs/slab_thesis.md.
"""

from __future__ import annotations

import csv
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.report import ROOT, Output, table
from benchmarks.slab_bending import found
from benchmarks.slab_error import CASES, QUIET, Setting
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array
from castfem.model import load_case
from castfem.model.build_machine import build_machine
from castfem.physics.constitutive import load_elasticity, load_law
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.hardening_laws import Hardening
from castfem.physics.constitutive.uniaxial import pull
from castfem.physics.machine import Machine
from castfem.runs.output.history import read_history

FOLDER = ROOT / "results" / "benchmarks" / "slab_reversal"
KEYS = (*QUIET, *Setting(7.5, 100.0).changes, "mechanics.bulging=elastic", "casting.length=17.2 m")
HALF = 0.11  # m: from the middle of the strand to its faces
CARBON = 0.1  # wt%
AT = 810.0 + ZERO_CELSIUS  # K: where I1 is largest in bending and in straightening
FORGETS = 100.0  # s; the arc takes 508
STEPS = 1600  # from the bender to the end of the straightener
BENDER, STRAIGHTENER = (8, 15), (49, 57)
ARC, FIRST_UNBENT = 8006.0, 8400.0  # mm, radii of the thesis: of the arc, and at #50
POWER = 3.0  # of the harder end
RADII = "radius_extrados [mm]"
CASTERS = ("as shipped", "harder at the end")


@dataclass(frozen=True)
class Memory:
    """A law, and what it remembers of strain.

    Attributes:
        name: In the tables. law: As shipped. forgets: Time in which hardening recovers, s.
    """

    name: str
    law: str
    forgets: float | None = None

    @property
    def folder(self) -> str:
        """Of its runs and its file."""
        return self.law if self.forgets is None else f"{self.law}_forgets"

    def made(self) -> Law:
        """The law of a material point."""
        law = load_law(self.law, load_elasticity("elastic_steel"), carbon=CARBON)
        if self.forgets is None:
            return law
        assert isinstance(law, Hardening)
        return replace(law, recovery_time=partial(np.full_like, fill_value=self.forgets))

    def key(self, folder: Path) -> str:
        """The key of a case; a law that forgets gets a file in `folder`."""
        if self.forgets is None:
            return f"mechanics.law={self.law}"
        import castfem.physics.constitutive.parameters as shipped

        source = Path(shipped.__file__).parent / "data" / f"{self.law}.toml"
        head, mark, data = source.read_text(encoding="utf-8").partition("[data]")
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / f"{self.folder}.toml"
        path.write_text(f'{head}recovery_time = "{self.forgets:g} s"\n\n{mark}{data}')
        return f"mechanics.law={path}"


SIGNED = Memory("signed strain, as shipped", "kozlowski_zhu_signed")
ACCUMULATED = Memory("accumulated", "kozlowski_zhu")
MEMORIES = (
    SIGNED,
    Memory(f"accumulated, forgotten within {FORGETS:g} s", ACCUMULATED.law, FORGETS),
    Memory(f"signed strain, forgotten within {FORGETS:g} s", SIGNED.law, FORGETS),
    ACCUMULATED,
    Memory("accumulated, Norton-Hoff fit (163)", "norton_hoff_kozlowski"),
)
RUNS = (*((one, CASTERS[0]) for one in MEMORIES), *((o, CASTERS[1]) for o in (SIGNED, ACCUMULATED)))


def harder(folder: Path) -> Path:
    """The demonstration caster with a straightening that ends harder, in a file of `folder`.

    1/R at #49, #50 and #57 stay; in between its share that is lost is a x + (1 - a) x^3 instead of
    x^1.47, x from 0 at #49 to 1 at #57.
    """
    lines = (CASES / "rolls.csv").read_text(encoding="utf-8").splitlines()
    first = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    rows = [[cell.strip() for cell in row] for row in csv.reader(lines[first:])]
    at, least = rows[0].index(RADII), 1.0 / (STRAIGHTENER[1] - STRAIGHTENER[0])
    linear = (1.0 - ARC / FIRST_UNBENT - least**POWER) / (least - least**POWER)
    for roll in range(STRAIGHTENER[0] + 2, STRAIGHTENER[1]):
        x = (roll - STRAIGHTENER[0]) * least
        rows[roll][at] = f"{ARC / (1.0 - linear * x - (1.0 - linear) * x**POWER):.3f}"
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "rolls_harder.csv"
    path.write_text("\n".join(", ".join(row) for row in rows) + "\n", encoding="utf-8")
    return path


def caster(name: str, folder: Path) -> tuple[Machine, Array]:
    """A caster, and the positions of its rolls, m."""
    keys = () if name == CASTERS[0] else (f"machine.rolls={harder(folder)}",)
    case = load_case(CASES / "slab.toml", keys)
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    return build_machine(case), np.array([pair.position for pair in rolls.pairs])


def rates(machine: Machine, places: Array) -> tuple[float, float]:
    """Largest rate of strain of the outer fibres in bender and straightener, 1/s, axis centred."""
    times = [machine.time_at(float(place)) for place in places]
    bent = np.array([machine.curvature(float(place), "centreline") for place in places])
    strains = np.abs(HALF * np.diff(bent) / np.diff(times))
    bender, straightener = (
        float(strains[low - 1 : high - 1].max()) for low, high in (BENDER, STRAIGHTENER)
    )
    return bender, straightener


def fibres(
    law: Law, machine: Machine, places: Array, kelvin: float = AT, steps: int = STEPS
) -> tuple[float, float]:
    """Stress of the extrados' fibre as it leaves the bender, of the intrados' the straightener, Pa.

    Both begin unstrained at the bender, at one temperature, and the neutral axis is in the middle.
    """
    ends = [float(places[roll - 1]) for roll in (*BENDER, STRAIGHTENER[1])]
    times = np.linspace(machine.time_at(ends[0]), machine.time_at(ends[2]), steps + 1)
    times = np.sort(np.append(times, machine.time_at(ends[1])))
    bent = [HALF * machine.curvature(machine.position(t), "centreline") for t in times.tolist()]
    strain = np.outer(bent, [1.0, -1.0])
    stress = pull(law, times - times[0], strain, np.full_like(strain, kelvin)).axial_stress
    left = int(np.searchsorted(times, machine.time_at(ends[1])))
    return float(stress[left, 0]), float(stress[-1, 1])


def main(output: Output, quick: bool) -> None:
    """Fibres by every law, then the slabs."""
    folder = output.folder if quick else FOLDER
    rows: list[dict[str, Any]] = []
    for memory, name in RUNS:
        machine, places = caster(name, folder)
        bending, straightening = fibres(memory.made(), machine, places)
        rate = rates(machine, places)
        row: dict[str, Any] = {"name": memory.name, "caster": name}
        row |= {"fibre_bending": bending / 1e6, "fibre_straightening": straightening / 1e6}
        row |= {"rate_bending": 1e5 * rate[0], "rate_straightening": 1e5 * rate[1]}
        rows.append(row | ({} if quick else _run(memory, name, places)))
        print(f"  {rows[-1]}", flush=True)
        output.csv("slab_reversal", rows)
    show(output)


def _run(memory: Memory, name: str, places: Array) -> dict[str, Any]:
    """What a slab has in bender and straightener."""
    folder, rolls = FOLDER / memory.folder, tuple[str, ...]()
    if name != CASTERS[0]:
        folder, rolls = FOLDER / f"{memory.folder}_harder", (f"machine.rolls={harder(FOLDER)}",)
    summary, failure = finished_run(
        load_case(CASES / "slab.toml", (*KEYS, memory.key(FOLDER), *rolls)), folder
    )
    if failure:
        raise RuntimeError(f"{memory.name}, {name}: {failure}")
    row = found(read_history(folder / "history.csv"), summary, places)
    names = [f"{phase}_{what}" for what in ("I1", "I1_place", "I2", "I2_place", "stress", "warm")
             for phase in ("bending", "straightening")]  # fmt: skip
    return {n: row[n] for n in names}


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("slab_reversal")
    if not rows:
        return
    head = {
        "name": "hardening", "fibre_bending": "bending, MPa",
        "fibre_straightening": "straightening, MPa", "ratio": "straightening over bending",
    }  # fmt: skip
    own = [row for row in rows if row["caster"] == CASTERS[0]]
    told = [r | {"ratio": r["fibre_straightening"] / r["fibre_bending"]} for r in own]
    forms = {"fibre_bending": ".1f", "fibre_straightening": ".1f", "ratio": ".2f"}
    output.insert("slab fibres", table(told, head, forms))
    if "bending_I1" not in rows[0]:
        return
    head = {
        "name": "hardening", "caster": "straightening", "bending_I1": "I1 bending, MPa",
        "straightening_I1": "I1 straightening", "bending_I2": "I2 bending, 1e-5 1/s",
        "straightening_I2": "I2 straightening", "bending_stress": "corner bending, MPa",
        "straightening_stress": "corner straightening",
    }  # fmt: skip
    thesis = {"name": "thesis", "caster": "", "bending_I1": 26.7, "straightening_I1": 41.1,
              "bending_I2": 18.0, "straightening_I2": 22.0}  # fmt: skip
    forms = dict.fromkeys(head, ".1f")
    output.insert("slab reversal", table([*rows, thesis], head, forms))
