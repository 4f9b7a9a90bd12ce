"""`castfem machine`: rolls, bending, water and drives of a case, with results of a run."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.table import Table, pairs, say
from castfem.base.types import Array
from castfem.base.units import factor_and_zero
from castfem.cli import parallel
from castfem.cli.drawing import check_picture, drawing
from castfem.model import Case, load_case
from castfem.model.machine import thickness_of
from castfem.model.machine_from_case import capacities, known_resistance
from castfem.model.shipped_cases import CASE_NAME
from castfem.physics.machine.rolls import Pair, Rolls
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    from castfem.model.secondary import Secondary
    from castfem.post.plots.machine import Spray


def draw_machine(case: Case, picture: Path, origin: str, run: Path | None = None) -> None:
    """Print the rolls of a case and draw its caster."""
    from castfem.post.plots.machine import draw

    check_picture(picture)
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if rolls is None or thickness is None:
        raise InputError(
            f"{origin}: machine: the table is missing, so the strand is vertical; add "
            '[machine] with rolls = "rolls.csv" (docs/machine.md)'
        )
    found = None if run is None else ended(run, case)
    out = parallel.console()
    say(out, pairs(machine_rows(rolls, thickness)))
    if found is not None:
        solid = found.solid
        above = 0 if solid is None else sum(pair.position <= solid for pair in rolls.pairs)
        near = f"below roll {above}" if above else "above the first roll"
        where = found if solid is None else f"at {solid:.4g} m, {near}"
        say(out, f"solid throughout: {where} ({run})")
    say(out, "", roll_table(rolls, thickness))
    if case.secondary is not None and case.secondary.circuit:
        say(out, "", circuit_table(case, case.secondary, rolls, thickness))
    if case.machine is not None and case.machine.defect:
        defects = "; ".join(str(one).rstrip(",") for one in case.machine.defect)
        say(out, "", f"defects: {defects}")
    with drawing(picture):
        draw(
            rolls, thickness, picture, mould_end=case.mould_exit(),
            marks=() if found is None else found.marks, sprays=_sprays(case), title=case.title,
        )  # fmt: skip
    if case.machine is not None and case.machine.extraction is not None:
        show_drives(case, rolls, picture, run)


def _sprays(case: Case) -> list[Spray]:
    """The sprays of the wide faces in side view."""
    from castfem.model.build.secondary import rows_of
    from castfem.post.plots.machine import Spray

    if case.secondary is None:
        return []
    circuits = {circuit.name: circuit for circuit in case.secondary.circuit}
    found = []
    for row in rows_of(case):
        circuit = circuits[row.circuit]
        for side in ("extrados", "intrados") if circuit.wide else ():
            if any(f"wide_face_{side}".startswith(name) for name in circuit.on):
                inside = side == "intrados"
                found.append(Spray(row.start, row.end, circuit.stand_off, inside, row.share != 1.0))
    return found


def circuit_table(case: Case, table: Secondary, rolls: Rolls, thickness: float) -> Table:
    """Return the table of the water circuits with their largest flows and their defects."""
    from castfem.cli.drawing import build_mesh
    from castfem.model.defects import Nozzles
    from castfem.model.water import PER_LITRE_AND_KG, Supply, steel_per_length
    from castfem.physics.machine.spray_layout import footprint, gap_below, longest_spray
    from castfem.physics.materials import load_steel

    steel = load_steel(
        case.steel.name, Path.cwd(), composition=case.steel.composition,
        overrides=case.steel.changes,
    )  # fmt: skip
    mass = steel_per_length(build_mesh(case), steel)
    supply = Supply(mass, case.casting.travel, case.water, case.casting.clock)
    defects = () if case.machine is None else case.machine.defect or ()
    scaled = [defect for defect in defects if isinstance(defect, Nozzles)]
    head = (
        "circuit", "on", "rolls", "nozzles", "most flow [L/min]", "[L/kg]", "each [L/min]",
        "width [mm]",
        "length [mm]", "at most [mm]", *(["defect"] if scaled else []),
    )  # fmt: skip
    rows = []
    for circuit in table.circuit:
        model, flow = table.model_of(circuit), 6e4 * supply.most(circuit)
        gaps = [gap_below(rolls, number, thickness) for number in range(*circuit.rolls)]
        free = min(longest_spray(g.clear, circuit.stand_off, g.diameter) for g in gaps) if (
            circuit.wide
        ) else None  # fmt: skip
        rows.append(
            (
                circuit.name,
                ", ".join(circuit.on),
                f"{circuit.rolls[0]} to {circuit.rolls[1]}",
                str(circuit.nozzles()),
                f"{flow:.4g}",
                f"{PER_LITRE_AND_KG * supply.specific(circuit):.3g}",
                f"{flow / circuit.nozzles():.3g}",
                f"{1e3 * footprint(circuit.stand_off, model.angle):.0f}",
                f"{1e3 * footprint(circuit.stand_off, model.angle_along):.1f}",
                "" if free is None else f"{1e3 * free:.1f}",
                ", ".join(one.water for one in scaled if one.circuit == circuit.name),
            )[: len(head)]
        )
    return Table(head, rows, words=(0, 1))


def machine_rows(rolls: Rolls, thickness: float) -> list[tuple[str, str]]:
    """Return labels and values that describe a machine."""
    from castfem.physics.machine.bending_zones import off_stretches, phases

    line, pairs = rolls.line(thickness), rolls.pairs
    drives = [pair for pair in pairs if pair.driven]
    driven = f", {len(drives)} of them driven" if drives else ""
    if drives and all(pair.capacity is not None for pair in drives):
        driven += f" with {1e-3 * sum(pair.capacity or 0.0 for pair in drives):.5g} kN in all"
    rows = [("pairs of rolls", f"{len(pairs)}{driven}")]
    if rolls.edges is not None:
        edges = rolls.edges.pairs
        text = f"{len(edges)} pairs, {edges[0].position:.4g} to {edges[-1].position:.4g} m"
        rows.append(("at the narrow faces", text))
    for phase in phases(rolls):
        first, last = pairs[phase.first], pairs[phase.last]
        text = f"{first.position:.4g} to {last.position:.4g} m, rolls {phase.first + 1} to "
        text += str(phase.last + 1)
        radius = last.radius if last.designed is None else last.designed
        if math.isfinite(radius):
            text += f", R = {radius:.4g} m of the {rolls.face} at its end"
        rows.append((phase.kind, text))
    for off in off_stretches(rolls):
        text = f"{pairs[off.first].position:.4g} to {pairs[off.last].position:.4g} m, rolls "
        rows.append((off.name, text + f"{off.first + 1} to {off.last + 1} bend the strand as well"))
    end = pairs[-1].position
    rows.append(("inclination", f"{math.degrees(line.inclination(end)):.5g} degrees at the end"))
    height = f"{line.height(end):.4g} m at the last roll, {end:.4g} m along the strand"
    rows.append(("liquid's height", height))
    return rows


def roll_table(rolls: Rolls, thickness: float) -> Table:
    """Return the table of the rolls."""
    head = (
        "roll", "position [m]", "pitch [mm]", "diameter [mm]", "clear [mm]", "aperture [mm]",
        f"R {rolls.face} [m]", "angle [deg]", "height [m]", "drive [kN]",
        *(["defect"] if any(pair.defect for pair in rolls.pairs) else []),
    )  # fmt: skip
    line, rows = rolls.line(thickness), []
    for i, pair in enumerate(rolls.pairs):
        pitch = pair.position - rolls.pairs[i - 1].position if i else None
        drive = "yes" if pair.capacity is None else f"{1e-3 * pair.capacity:.4g}"
        rows.append(
            (
                str(i + 1),
                f"{pair.position:.3f}",
                "" if pitch is None else f"{1e3 * pitch:.1f}",
                f"{1e3 * pair.diameter:g}",
                f"{1e3 * rolls.clearance(i, thickness):.1f}" if i else "",
                f"{1e3 * rolls.aperture(i, thickness):.1f}",
                "straight" if math.isinf(pair.radius) else f"{pair.radius:.3f}",
                f"{math.degrees(line.inclination(pair.position)):.2f}",
                f"{line.height(pair.position):.3f}",
                drive if pair.driven else "",
                pair.defect,
            )[: len(head)]
        )
    return Table(head, rows, words=())


def show_drives(case: Case, rolls: Rolls, picture: Path, run: Path | None = None) -> None:
    """Print how the drives share the resistance; draw it if it is known before a run."""
    from castfem.post.plots.machine import draw_drives

    assert case.machine is not None and case.machine.extraction is not None
    known = known_resistance(case.machine.extraction, case.machine)
    out = parallel.console()
    if known is None:
        found = None if run is None else drives_of(run, rolls)
        if found is None:
            say(out, "", "resistance: coupled, from the forces of a run (--run DIR)")
        else:
            say(out, "", f"drives as the slice of {run} met them")
            say(out, drive_table(rolls, capacities(rolls), *found))
        return
    effort, drive, total = known.shares.effort, known.shares.drive, float(known.steps.sum())
    say(out, "", drive_table(rolls, known.capacities, effort, drive, total))
    with drawing(beside := picture.with_stem(f"{picture.stem}_extraction")):
        draw_drives(rolls, known, beside, case.title)


def drive_table(
    rolls: Rolls, most: Array, effort: Array, drive: Array, resistance: float, to: float = math.inf
) -> Table:
    """Return the table of the drives: resistance at each, its force, and what is left.

    Args:
        rolls: The pairs.
        most: Their capacity (n,), N: 0 for a pair without a drive, inf if unknown.
        effort: Axial force in the strand at each (n,), N; nan if unknown.
        drive: Force of each (n,), N; nan if unknown.
        resistance: Total resistance of the rolls, N.
        to: Position to which the resistance is summed, m.
    """
    head = ("drive", "position [m]", "effort [kN]", "pulls [kN]", "has left [kN]")
    rows = []
    for i, pair in enumerate(rolls.pairs):
        if most[i] > 0.0:
            forces = (effort[i], drive[i], most[i] - drive[i])
            cells = [f"{1e-3 * force:.2f}" if math.isfinite(force) else "" for force in forces]
            rows.append((f"#{i + 1}", f"{pair.position:.3f}", *cells))
    could = float(most.sum())
    drawn = "" if math.isinf(could) else f", the drives could take {1e-3 * could:.5g} kN"
    down = f"down to {to:.4g} m " if to < rolls.pairs[-1].position else ""
    notes = [f"{down}the rolls resist with {1e-3 * resistance:.5g} kN{drawn}"]
    if np.isfinite(effort).any():
        at = int(np.nanargmax(effort))
        notes.append(f"largest effort in the strand: {1e-3 * effort[at]:.4g} kN, at roll {at + 1}")
    return Table(head, rows, words=(), notes=notes)


_DEFECTS = ("offset", "locked", "lost")
_SAME = ("position", "diameter", "aperture", *_DEFECTS, "radius", "driven", "capacity")


@dataclass(frozen=True, slots=True)
class Ended:
    """Solidification of the strand of a run."""

    to: float  #: position to which the strand was followed, m
    solid: float | None  #: position at which it is completely solid, m; None if it is not
    liquid: float | None  #: end of its liquid core (fs = 0), m; None if it does not end

    def __str__(self) -> str:
        """Description, without the position at which it is solid."""
        core = "liquid to there" if self.liquid is None else f"liquid to {self.liquid:.4g} m"
        return f"not down to {self.to:.4g} m, where the run ends; {core} (fs = 0)"

    @property
    def marks(self) -> tuple[tuple[float, str], ...]:
        """Positions, m, and labels for the picture."""
        if self.solid is not None:
            return ((self.solid, f"solid at {self.solid:.4g} m"),)
        core = () if self.liquid is None else ((self.liquid, f"liquid to {self.liquid:.4g} m"),)
        return (*core, (self.to, f"not solid at {self.to:.4g} m"))


def ended(run: Path, case: Case) -> Ended:
    """Return how far the strand of a run has solidified."""
    summary = Summary.load(run) if run.is_dir() else None
    if summary is None or not (run / CASE_NAME).is_file():
        raise InputError(f"--run {run}: holds no finished run")
    table = load_case(run / CASE_NAME).machine
    theirs, ours = (None if one is None else one.pairs() for one in (table, case.machine))
    if ours is not None and (what := _other(ours, theirs)):
        raise InputError(
            f"--run {run}: the run has another machine: {what}; give a run of this case"
        )
    solid, liquid = (
        None if one is None or math.isnan(one.value) else one.value
        for one in map(summary.quantities.get, ("metallurgical_length", "liquid_end"))
    )
    reached = summary.quantities.get("position")
    return Ended(case.casting.length if reached is None else reached.value, solid, liquid)


def _other(ours: Rolls, theirs: Rolls | None) -> str:
    """Description of how the machine of a run differs; "" if it does not."""
    if theirs is None:
        return "it has no rolls"
    if theirs.edges != ours.edges:
        return "it has other rolls at the narrow faces"
    counts = len(theirs.pairs), len(ours.pairs)
    if counts[0] != counts[1]:
        return f"it has {counts[0]} pairs of rolls, the case {counts[1]}"
    if theirs.face != ours.face:
        return f"its radii are those of the {theirs.face}, in the case of the {ours.face}"
    for key in _SAME:
        for i, (one, other) in enumerate(zip(theirs.pairs, ours.pairs, strict=True), 1):
            if _same(one, other, key):
                continue
            if key in _DEFECTS:
                now, then = (pair.defect or "in order" for pair in (other, one))
                return f"roll {i} is {then}, in the case {now}"
            return f"roll {i} has another {key}"
    return ""


def _same(one: Pair, other: Pair, key: str) -> bool:
    """Whether two pairs are equal, however they were written."""
    a, b = getattr(one, key), getattr(other, key)
    if a is None or b is None or math.isinf(a) or math.isinf(b):
        return bool(a == b)
    return math.isclose(a, b, rel_tol=ROUNDING, abs_tol=ROUNDING)


def drives_of(run: Path, rolls: Rolls) -> tuple[Array, Array, float, float] | None:
    """Return the axial force at each pair and the force of its drive, from the history of a run.

    A drive acts over the pitch below it: its force is known when the slice reaches the next pair
    that holds the strand.

    Returns:
        Axial force (n,) and drive force (n,) of the pairs, N, NaN where the run did not reach them,
        total resistance of the rolls, N, and the position to which it is known, m; None without it.
    """
    table = read_columns(run / HISTORY_NAME)
    names = ("effort", "drive_force", "roll_resistance")
    if not set(names) <= set(table.columns):
        return None
    units = table.attrs["units"]
    position, effort, drives, resistance = (
        (table[name] / factor_and_zero(si, units[name])[0]).astype(np.float64)
        for name, si in (("position", "m"), *((name, "N") for name in names))
    )
    there = list(rolls.there)
    places = np.array([rolls.pairs[i].position for i in there])
    ends = np.append(places, 2.0 * places[-1] - places[-2])
    beyond = position[-1] * (1.0 + ROUNDING)

    def at(values: Array, where: Array) -> Array:
        return np.where(where <= beyond, np.interp(where, position, values), math.nan)

    found = np.full((2, len(rolls.pairs)), math.nan)
    found[0, there] = at(effort, places)
    found[1, there] = np.diff(at(drives, ends))
    return found[0], found[1], float(resistance[-1]), float(position[-1])
