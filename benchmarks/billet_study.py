"""The billet of thesis V.2 in its moulds: beside the thesis, how it moves with its inputs, its error.

Writes docs/billet.md. All runs are those of `cases/billet125`, marched in memory, one at a time.
"""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time
from typing import Any

from mpi4py import MPI

import numpy as np

from benchmarks.report import ROOT, Output, table
from castfem.case import load_case
from castfem.errors import CastfemError
from castfem.march import March
from castfem.measure import Reading
from castfem.output.summary import from_si
from castfem.report import quantities
from castfem.scene import build_scene

CASES = ROOT / "cases" / "billet125"
MOULDS = ("idealised", "taper_3", "taper_1", "taper_0", "taper_minus_1", "taper_minus_3")
NAMES = dict(zip(MOULDS, ("idealised", "+3 %/m", "+1 %/m", "0 %/m", "-1 %/m", "-3 %/m"), strict=True))
PATIENCE = 60.0  # s of wall time, after which a run is given up

SHOWN = {
    "heat_removed_slice": ("heat [kJ]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_mid_face": ("surface, mid-face [°C]", ".0f"),
    "surface_temperature_corner": ("surface, corner [°C]", ".0f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "von_mises_mid_face": ("stress, mid-face [MPa]", ".2f"),
    "size_mid_face": ("width [mm]", ".3f"),
    "size_corner": ("diagonal [mm]", ".3f"),
}
"""Quantities of the tables: heading and format."""

# Where a trend is wanted, not a digit.
COARSE = (
    "mesh.surface_size=1.2 mm",
    "mesh.corner_size=1.2 mm",
    "mesh.face_size=8 mm",
    "mesh.core_size=12 mm",
    "coupling.interval=0.2 s",
)
QUIET = ("output.fields=[]", "output.figures=false", "output.checkpoint_every=0")


class Late(CastfemError):
    """A run has taken too long."""


@dataclass
class Listener:
    """Sits where a recorder does: looks at the clock and at every interval.

    Attributes:
        deadline: When to give up, s of `perf_counter`. penetration: Largest of all intervals, m.
        lost: Position where contact is first lost, m. unbalanced: Largest error of the forces.
    """

    deadline: float
    penetration: float = 0.0
    lost: float = np.nan
    unbalanced: float = 0.0

    def step(self, march: March, reading: Reading) -> None:
        """Look at a committed interval.

        Raises:
            Late: The time is over.
        """
        if perf_counter() > self.deadline:
            raise Late(f"given up at {reading.time:.2f} s")
        strained = reading.mechanics
        if strained is None or strained.balance is None:
            return
        self.unbalanced = max(self.unbalanced, strained.balance.forces_error)
        if strained.contact is not None:
            self.penetration = max(self.penetration, strained.contact.penetration)
            if np.isnan(self.lost) and strained.contact.gap > 1e-6:
                self.lost = reading.position


@dataclass(frozen=True)
class Found:
    """One run.

    Attributes:
        values: Results at the exit of the mould by name, in the units of the tables.
        seconds: Processor time of the march. cells: Of the mesh.
        failure: Why it has not come to its end, empty if it has.
        cut: Intervals that were tried in vain. newton: Mechanical iterations.
    """

    values: Mapping[str, float]
    seconds: float
    cells: int
    failure: str = ""
    cut: int = 0
    newton: int = 0


def run(mould: str, changes: Iterable[str] = ()) -> Found:
    """March one billet with some keys changed."""
    case = load_case(CASES / f"{mould}.toml", (*QUIET, *changes))
    scene = build_scene(case, MPI.COMM_SELF)
    listener = Listener(perf_counter() + PATIENCE)
    march = March(scene, listener)  # type: ignore[arg-type]
    start, failure = process_time(), ""
    try:
        march.run()
    except CastfemError as error:
        failure = str(error)
    seconds = process_time() - start
    assert march.reading is not None
    values = {n: from_si(q.value, q.unit) for n, q in quantities(march, march.reading).items()}
    values |= {"penetration": 1e6 * listener.penetration, "unbalanced": listener.unbalanced}
    values["lost"] = 1e3 * listener.lost
    cells = scene.section.mesh.topology.index_map(2).size_global
    iterations = 0 if scene.mechanics is None else scene.mechanics.problem.iterations
    scene.destroy()
    found = Found(values, seconds, cells, failure, march.counts.cut_back, iterations)
    print(f"  {mould} {' '.join(changes)}: {seconds:.1f} s {failure}", flush=True)
    return found


# (a) The six moulds.


def thesis(mould: str) -> dict[str, float]:
    """The numbers of the thesis that its case holds, in the units of the tables."""
    found = {}
    for reference in load_case(CASES / f"{mould}.toml").reference:
        found[reference.quantity] = from_si(reference.si, reference.unit)
    return found


MORE = {
    "share": ("heat, % of idealised", ".1f"),
    "gap_max": ("largest gap [mm]", ".3f"),
    "lost": ("contact lost from [mm]", ".0f"),
    "contact_share": ("surface in contact [%]", ".0f"),
    "contact_pressure_max": ("highest contact pressure [MPa]", ".2f"),
    "axial_strain": ("axial strain [%]", ".3f"),
    "penetration": ("largest penetration [µm]", ".3f"),
    "newton": ("Newton iterations an interval", ".1f"),
    "seconds": ("processor time [s]", ".0f"),
}


def moulds(output: Output, changes: Sequence[str]) -> None:
    """The six moulds at the shipped defaults, beside the thesis."""
    found = {name: run(name, changes) for name in MOULDS}
    rows = []
    for name, one in found.items():
        values = dict(one.values)
        values["share"] = 100.0 * values["heat_removed"] / found["idealised"].values["heat_removed"]
        values["axial_strain"] = 100.0 * values["axial_strain"]
        values |= {"newton": one.newton / 100.0, "seconds": one.seconds}
        rows.append({"mould": NAMES[name], **{k: values.get(k) for k in (*SHOWN, *MORE)}})
    output.csv("billet_moulds", rows)
    expected = {name: thesis(name) for name in MOULDS}
    written = {"taper_1": "8 to 10", "taper_3": "10 to 12"}
    lines = []
    for key, (label, form) in {**SHOWN, **MORE}.items():
        cells: dict[str, Any] = {"what": label}
        for name, row in zip(MOULDS, rows, strict=True):
            ours = row[key]
            text = "" if ours is None or not np.isfinite(ours) else format(ours, form)
            theirs = expected[name].get(key)
            if theirs is not None:
                said = format(theirs, ".4g" if key not in ("size_corner",) else ".2f")
                if key == "heat_removed_slice" and name != "idealised":
                    said = ("< " if name == "taper_0" else "> ") + said
                if key == "von_mises_mid_face":
                    said = written[name]
                text += f" ({said})"
            cells[name] = text
        lines.append(cells)
    output.insert("billet moulds", table(lines, {"what": "at the exit of the mould", **NAMES}, {}))


# (b) What the numbers hang on.


@dataclass(frozen=True)
class Variant:
    """A change of the inputs.

    Attributes:
        label: What is changed. changes: Keys. moulds: To which it applies; all if empty.
        liquid: Whether it is about what is not solid yet.
    """

    label: str
    changes: tuple[str, ...]
    moulds: tuple[str, ...] = ()
    liquid: bool = False


def softer(factor: float, folder: Path) -> str:
    """A file with Young's modulus of the shipped set times `factor`."""
    text = (ROOT / "castfem" / "laws" / "data" / "elastic_steel.toml").read_text(encoding="utf-8")
    young, poisson = text.split("[poisson]")

    def scaled(match: re.Match[str]) -> str:
        numbers = [f"{factor * float(v):.6g}" for v in match[1].replace("\n", " ").split(",") if v.strip()]
        return f"value = [{', '.join(numbers)}]"

    path = folder / f"elastic_{factor:g}.toml"
    young = re.sub(r"(?<!temperature)\bvalue = \[(.*?)\]", scaled, young, flags=re.DOTALL)
    path.write_text(f"{young}[poisson]{poisson}", encoding="utf-8")
    return str(path)


ALPHA = "steel.overrides.thermal_expansion.value={} 1/K"
REAL = tuple(name for name in MOULDS if name != "idealised")


def variants(folder: Path) -> list[Variant]:
    """All changes of inputs."""
    h = "cooling.mould.surface.0.coefficient={} W/(m^2 K)"
    return [
        Variant("liquid 1e-5 as stiff as the solid", ("mechanics.liquid_stiffness=1e-5",), liquid=True),
        Variant("1e-4", ("mechanics.liquid_stiffness=1e-4",), liquid=True),
        Variant("1e-2", ("mechanics.liquid_stiffness=1e-2",), liquid=True),
        Variant("modulus of the mush linear in the solid", ("mechanics.mush=linear",), liquid=True),
        Variant("mush as soft as the liquid to 50 % solid", ("mechanics.coherency=0.5",), liquid=True),
        Variant("pressure full until all is solid", ("mechanics.ferrostatic=full",), liquid=True),
        Variant("pressure ends where anything is solid", ("mechanics.ferrostatic=none",), liquid=True),
        Variant("no ferrostatic pressure", ("mechanics.ferrostatic=off",), liquid=True),
        Variant("α = 15e-6 /K (thesis, VI)", (ALPHA.format("15e-6"),)),
        Variant("α = 22e-6 /K (austenite)", (ALPHA.format("22e-6"),)),
        Variant("E halved", (f"mechanics.elasticity={softer(0.5, folder)}",)),
        Variant("E doubled", (f"mechanics.elasticity={softer(2.0, folder)}",)),
        Variant("Norton-Hoff with softening (p1)", ("mechanics.law=norton_hoff_kozlowski_p1",)),
        Variant("law of Kozlowski and Zhu", ("mechanics.law=kozlowski_zhu",)),
        Variant(
            "steel computed from 0.42 % C",
            ("steel.name=plain_carbon", "steel.composition.C=0.42"),
        ),
        Variant("h - 20 %", (h.format(1280),)),
        Variant("h + 20 %", (h.format(1920),)),
        Variant("solidus 20 K lower", ('steel.overrides.solidus.value="1432 degC"',)),
        Variant("solidus 20 K higher", ('steel.overrides.solidus.value="1472 degC"',)),
        Variant("large strain", ("mechanics.strain=large",)),
        Variant("no heat of viscoplastic work", ("coupling.dissipation=0",)),
        Variant(
            "friction 0.3 (Coulomb)",
            ('mould.friction={law="coulomb", coefficient=0.3}',),
            REAL,
        ),
        Variant("gap conducts 0.3 W/(m K)", ("cooling.mould.surface.0.gap_conductivity=0.3 W/(m K)",), REAL),
    ]  # fmt: skip


STUDIED = ("idealised", "taper_1", "taper_0", "taper_minus_1")
LIQUID_ALONE = "taper_minus_1"  # where the wall goes away all hangs on how the strand follows it


def sensitivity(output: Output, quick: bool) -> None:
    """Change one input at a time, on a coarse mesh."""
    with tempfile.TemporaryDirectory() as name:
        chosen = variants(Path(name))
        for mould in STUDIED:
            base = run(mould, COARSE)
            rows = [{"input": "as shipped, coarse", **_picked(base)}]
            for one in chosen[:: 6 if quick else 1]:
                if one.moulds and mould not in one.moulds:
                    continue
                if mould == LIQUID_ALONE and not one.liquid:
                    continue
                found = run(mould, (*COARSE, *one.changes))
                rows.append({"input": one.label, **_picked(found)})
            output.csv(f"billet_inputs_{mould}", rows)
            output.insert(f"billet inputs {mould}", table(_changes(rows, "input"), _head("input", rows), {}))


def _picked(found: Found) -> dict[str, Any]:
    """Results of a run that are shown."""
    keys = (*SHOWN, "gap_max", "penetration")
    chosen: dict[str, Any] = {k: found.values.get(k) for k in keys}
    return {**chosen, "failure": found.failure, "seconds": found.seconds}


def _head(first: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    head = {first: first, **{k: label for k, (label, _) in SHOWN.items()}}
    if rows[0]["gap_max"] is not None:
        head["gap_max"] = "gap [mm]"
    return head


def _changes(rows: Sequence[Mapping[str, Any]], first: str) -> list[dict[str, Any]]:
    """The first row as it is, the others as differences to it; nothing where nothing moves."""
    forms = {**{k: form for k, (_, form) in SHOWN.items()}, "gap_max": ".3f"}
    lines = []
    for row in rows:
        cells: dict[str, Any] = {first: row[first]}
        for key, form in forms.items():
            value, base = row[key], rows[0][key]
            if value is None:
                continue
            if row is rows[0]:
                cells[key] = format(value, form)
            else:
                text = format(value - base, "+" + form)
                cells[key] = "" if not float(text) else text
        if row["failure"]:
            cells = {first: f"{row[first]}: {row['failure'][:60]}"}
        lines.append(cells)
    return lines


# (c) The error of the shipped default.


def mesh(size: float) -> tuple[str, ...]:
    """Cells of `size` mm at the surface, the others in proportion to those shipped."""
    scale = size / 0.8
    return (
        f"mesh.surface_size={size:g} mm",
        f"mesh.corner_size={size:g} mm",
        f"mesh.face_size={6 * scale:g} mm",
        f"mesh.core_size={8 * scale:g} mm",
    )


Choice = Callable[[Any], tuple[str, ...]]
CONVERGENCE: dict[str, tuple[tuple[Any, ...], Choice, Any]] = {
    "mesh [mm]": (
        (1.2, 0.8, 0.5, 0.35), lambda v: (*mesh(v), "coupling.interval=0.2 s"), 0.8,
    ),
    "interval [s]": (
        (0.4, 0.2, 0.1, 0.05, 0.025), lambda v: (*mesh(1.2), f"coupling.interval={v} s"), 0.1,
    ),
    "passes": (
        (1, 2, 5), lambda v: (*mesh(1.2), "coupling.interval=0.1 s", f"coupling.passes={v}"), 1,
    ),
    "penalty, factor": (
        (1, 10, 100, 1000), lambda v: (*COARSE, f'mould.contact={{method="penalty",factor={v}}}'), 10,
    ),
    "Nitsche, factor": (
        (1, 10, 100, 1000), lambda v: (*COARSE, f'mould.contact={{method="nitsche",factor={v}}}'), 10,
    ),
}  # fmt: skip
"""What is refined -> its values, the last the reference; keys of a value; the shipped one."""


def convergence(output: Output, quick: bool) -> None:
    """Refine one thing at a time, and add up what is left of each at the shipped default."""
    for mould in ("taper_1", "taper_0"):
        rows: list[dict[str, Any]] = []
        errors: dict[str, dict[str, Any]] = {}
        for name, (values, changes, shipped) in CONVERGENCE.items():
            tried = values[:2] if quick else values
            runs = {v: run(mould, changes(v)) for v in tried}
            rows += [{"refined": f"{name} = {v}", **_picked(r)} for v, r in runs.items()]
            last = runs[tried[-1]]
            if name != "Nitsche, factor" and shipped in runs:
                errors[name] = {k: abs(runs[shipped].values[k] - last.values[k]) for k in SHOWN}
        output.csv(f"billet_convergence_{mould}", rows)
        columns = {**_head("refined", rows), "penetration": "penetration [µm]", "seconds": "time [s]"}
        forms = {k: form for k, (_, form) in SHOWN.items()} | {"gap_max": ".3f", "seconds": ".0f"}
        output.insert(f"billet convergence {mould}", table(rows, columns, forms | {"penetration": ".4f"}))
        lines = [{"from": name, **error} for name, error in errors.items()]
        total = {k: sum(e[k] for e in errors.values()) for k in SHOWN}
        lines.append({"from": "together", **total})
        head = {"from": "error from", **{k: label for k, (label, _) in SHOWN.items()}}
        output.insert(f"billet error {mould}", table(lines, head, {k: ".2g" for k in SHOWN}))


def main(output: Output, quick: bool) -> None:
    """The six moulds, what their numbers hang on, and their error."""
    moulds(output, COARSE if quick else ())
    sensitivity(output, quick)
    convergence(output, quick)
