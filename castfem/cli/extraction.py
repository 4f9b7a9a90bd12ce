"""What `castfem machine` says of the drives: how they share what the rolls resist."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.types import Array
from castfem.cli.drawing import drawing
from castfem.cli.machine import aligned
from castfem.cli.machine_run import drives_of
from castfem.model import Case
from castfem.model.build_machine import capacities, known_resistance
from castfem.post.plots.extraction import draw

if TYPE_CHECKING:
    from castfem.physics.machine.rolls import Rolls


def tell_of_drives(case: Case, rolls: Rolls, picture: Path, run: Path | None = None) -> None:
    """Print how the drives share the resistance; draw it, where it is known before a run.

    Args:
        case: With [machine.extraction].
        rolls: Its rolls.
        picture: File of the caster's picture; that of the drives stands beside it.
        run: Folder of a run through them, of which a coupled resistance is told.

    Raises:
        InputError: The picture cannot be written, or the run's history not be read.
        StrandStopsError: The drives are weaker than the rolls.
    """
    assert case.machine is not None and case.machine.extraction is not None
    known = known_resistance(case.machine.extraction, case.machine)
    print()
    if known is None:
        found = None if run is None else drives_of(run, rolls)
        if found is None:
            print("resistance: coupled, from the forces of a run; --run DIR tells of its drives")
        else:
            print(f"drives as the slice of {run} met them")
            print("\n".join(drive_lines(rolls, capacities(rolls), *found)))
        return
    effort, drive, total = known.shares.effort, known.shares.drive, float(known.steps.sum())
    print("\n".join(drive_lines(rolls, known.capacities, effort, drive, total)))
    with drawing(beside := picture.with_stem(f"{picture.stem}_extraction")):
        draw(rolls, known, beside, case.title)


def drive_lines(
    rolls: Rolls, most: Array, effort: Array, drive: Array, resistance: float, to: float = math.inf
) -> list[str]:
    """Return the table of the drives: what comes to each, what it takes, what it has left.

    Args:
        rolls: The pairs.
        most: What they can pull (n,), N: 0 of one that is not driven, inf if not known.
        effort: In the strand as it comes to each (n,), N; nan where that is not known.
        drive: What each pulls with (n,), N; nan likewise.
        resistance: Of all rolls, N.
        to: Position down to which it is, m.
    """
    head = ("drive", "position [m]", "effort [kN]", "pulls [kN]", "has left [kN]")
    rows: list[Sequence[str]] = [head]
    for i, pair in enumerate(rolls.pairs):
        if most[i] > 0.0:
            forces = (effort[i], drive[i], most[i] - drive[i])
            cells = [f"{1e-3 * force:.2f}" if math.isfinite(force) else "" for force in forces]
            rows.append((f"#{i + 1}", f"{pair.position:.3f}", *cells))
    could = float(most.sum())
    drawn = "" if math.isinf(could) else f", the drives could take {1e-3 * could:.5g} kN"
    down = f"down to {to:.4g} m " if to < rolls.pairs[-1].position else ""
    lines = [*aligned(rows), f"{down}the rolls resist with {1e-3 * resistance:.5g} kN{drawn}"]
    if np.isfinite(effort).any():
        at = int(np.nanargmax(effort))
        lines.append(f"largest effort in the strand: {1e-3 * effort[at]:.4g} kN, at roll {at + 1}")
    return lines
