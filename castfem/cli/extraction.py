"""What `castfem machine` says of the drives: how they share a resistance that is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from castfem.case import Case
from castfem.case.build_extraction import known_resistance
from castfem.cli.drawing import drawing
from castfem.cli.machine import aligned
from castfem.plots.extraction import draw

if TYPE_CHECKING:
    from castfem.extraction.effort import KnownResistance
    from castfem.machine.rolls import Rolls


def tell_of_drives(case: Case, rolls: Rolls, picture: Path) -> None:
    """Print and draw how the drives share the resistance, where it is known before a run.

    Args:
        case: With [machine.extraction].
        rolls: Its rolls.
        picture: File of the caster's picture; that of the drives stands beside it.

    Raises:
        InputError: The picture cannot be written.
        StrandStopsError: The drives are weaker than the rolls.
    """
    assert case.machine is not None and case.machine.extraction is not None
    known = known_resistance(case.machine.extraction, case.machine)
    if known is None:
        print("\nresistance: coupled, from the forces of a run; its history has it")
        return
    print()
    print("\n".join(drive_lines(rolls, known)))
    with drawing(beside := picture.with_stem(f"{picture.stem}_extraction")):
        draw(rolls, known, beside, case.title)


def drive_lines(rolls: Rolls, known: KnownResistance) -> list[str]:
    """Return the table of the drives: what comes to each, what it takes, what it has left."""
    head = ("drive", "position [m]", "effort [kN]", "pulls [kN]", "has left [kN]")
    rows: list[Sequence[str]] = [head]
    shares = known.shares
    for i, pair in enumerate(rolls.pairs):
        if known.capacities[i] > 0.0:
            left = known.capacities[i] - shares.drive[i]
            forces = (shares.effort[i], shares.drive[i], left)
            cells = ["" if math.isinf(force) else f"{1e-3 * force:.2f}" for force in forces]
            rows.append((f"#{i + 1}", f"{pair.position:.3f}", *cells))
    sums = (float(known.steps.sum()), float(known.capacities.sum()))
    drawn = "" if math.isinf(sums[1]) else f", the drives could take {1e-3 * sums[1]:.5g} kN"
    most = int(np.argmax(shares.effort))
    return [
        *aligned(rows),
        f"the rolls resist with {1e-3 * sums[0]:.5g} kN{drawn}",
        f"largest effort in the strand: {1e-3 * shares.effort[most]:.4g} kN, at roll {most + 1}",
    ]
