"""`castfem machine`: the rolls of a case, what they do to the strand, and a picture of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.cli.drawing import check_picture, drawing, print_rows
from castfem.model import Case
from castfem.model.machine import thickness_of

if TYPE_CHECKING:
    from castfem.model.secondary import Secondary
    from castfem.physics.machine.line import Bent
    from castfem.physics.machine.rolls import Rolls
    from castfem.post.plots.machine import Spray


def draw_machine(case: Case, picture: Path, origin: str, run: Path | None = None) -> None:
    """Print the rolls of a case and draw its caster.

    Args:
        case: The case.
        picture: File of the picture.
        origin: What the user called the case, for messages.
        run: Folder of a run, for the place where the strand is solid, and for how the drives
            pulled where the resistance comes with a run.

    Raises:
        InputError: The case has no rolls, the run is none through its machine, or the picture
            cannot be written.
    """
    from castfem.cli.machine_run import ended
    from castfem.post.plots.machine import draw

    check_picture(picture)
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if rolls is None or thickness is None:
        raise InputError(
            f"{origin}: machine: the table is missing, the strand goes straight down; add "
            '[machine] with rolls = "rolls.csv" (docs/machine.md)'
        )
    found = None if run is None else ended(run, case)
    print_rows(machine_rows(rolls, thickness))
    if found is not None:
        solid = found.solid
        where = found if solid is None else f"at {solid:.4g} m, {_near(rolls, solid)}"
        print(f"solid throughout: {where} ({run})")
    print()
    print("\n".join(roll_lines(rolls, thickness)))
    if case.secondary is not None and case.secondary.circuit:
        print()
        print("\n".join(circuit_lines(case, case.secondary, rolls, thickness)))
    if case.machine is not None and case.machine.defect:
        print()
        print(f"defects: {'; '.join(str(one).rstrip(',') for one in case.machine.defect)}")
    with drawing(picture):
        draw(
            rolls, thickness, picture, mould_end=case.mould_exit(),
            marks=() if found is None else found.marks, sprays=_sprays(case), title=case.title,
        )  # fmt: skip
    if case.machine is not None and case.machine.extraction is not None:
        from castfem.cli.extraction import tell_of_drives

        tell_of_drives(case, rolls, picture, run)


def _sprays(case: Case) -> list[Spray]:
    """The sprays of the wide faces, as they are seen from the side."""
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


def circuit_lines(case: Case, table: Secondary, rolls: Rolls, thickness: float) -> list[str]:
    """Return the table of the circuits of water, at their largest flows, and their defects."""
    from castfem.cli.drawing import build_mesh
    from castfem.model.defects import Nozzles
    from castfem.model.water import PER_LITRE_AND_KG, Supply, steel_per_length
    from castfem.physics.machine.sprays import footprint, gap_below, longest_spray
    from castfem.physics.materials import load_steel

    steel = load_steel(
        case.steel.name, Path.cwd(), composition=case.steel.composition,
        overrides=case.steel.overrides,
    )  # fmt: skip
    mass = steel_per_length(build_mesh(case), steel)
    supply = Supply(mass, case.casting.travel, case.water, case.casting.clock)
    defects = () if case.machine is None else case.machine.defect or ()
    scaled = [defect for defect in defects if isinstance(defect, Nozzles)]
    head = (
        "circuit", "on", "rolls", "nozzles", "most flow [L/min]", "[L/kg]", "each [L/min]",
        "width [mm]",
        "length [mm]", "at most [mm]", "defect" if scaled else "",
    )  # fmt: skip
    rows = [head]
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
            )
        )
    return aligned(rows)


def _near(rolls: Rolls, position: float) -> str:
    """The roll above a position."""
    above = [i for i, pair in enumerate(rolls.pairs, 1) if pair.position <= position]
    return f"below roll {above[-1]}" if above else "above the first roll"


def machine_rows(rolls: Rolls, thickness: float) -> list[tuple[str, str]]:
    """Return label and value of what characterises a machine."""
    from castfem.physics.machine.phases import off_stretches, phases

    line, pairs = rolls.line(thickness), rolls.pairs
    drives = [pair for pair in pairs if pair.driven]
    driven = f", {len(drives)} of them driven" if drives else ""
    if drives and all(pair.capacity is not None for pair in drives):
        driven += f" with {1e-3 * sum(pair.capacity or 0.0 for pair in drives):.5g} kN in all"
    rows = [("pairs of rolls", f"{len(pairs)}{driven}")]
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
    rows.append(("liquid's height", _head(line, end)))
    return rows


def _head(line: Bent, end: float) -> str:
    """Height of the liquid at the last roll."""
    height = line.height(end)
    return f"{height:.4g} m at the last roll, {end:.4g} m along the strand"


def roll_lines(rolls: Rolls, thickness: float) -> list[str]:
    """Return the table of the rolls."""
    head = (
        "roll", "position [m]", "pitch [mm]", "diameter [mm]", "clear [mm]", "aperture [mm]",
        f"R {rolls.face} [m]", "angle [deg]", "height [m]", "drive [kN]",
        "defect" if any(pair.defect for pair in rolls.pairs) else "",
    )  # fmt: skip
    line, rows = rolls.line(thickness), [head]
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
            )
        )
    return aligned(rows)


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows of cells, each column as wide as its widest cell."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return [
        "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
