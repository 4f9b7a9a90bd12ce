"""`castfem strand`: the stacked slices of a run along its caster, for ParaView."""

from __future__ import annotations

from pathlib import Path

from castfem.base.errors import InputError
from castfem.cli.options import above_zero
from castfem.model import load_case
from castfem.model.machine import thickness_of
from castfem.runs.output.folder import CASE_NAME


def write(folder: Path, target: Path, every: str) -> None:
    """Write the strand of a run as one file, and say where.

    Args:
        folder: Of the run.
        target: The file.
        every: Distance of its rows of cells along the strand, with unit.

    Raises:
        InputError: The folder holds no run of a strand between rolls, or `every` is no length.
        RunFailure: The file cannot be written.
    """
    from castfem.physics.machine.side import Side
    from castfem.runs.output.stacked_slices import write_strand

    distance = above_zero("--every", every, "m")
    if not (folder / CASE_NAME).is_file():
        raise InputError(f"{folder}: holds no run of castfem (no {CASE_NAME})")
    case = load_case(folder / CASE_NAME)
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if rolls is None or thickness is None:
        raise InputError(
            f"{folder / CASE_NAME}: machine: the table is missing, the strand goes straight down: "
            "open fields.xdmf; or run the case with [machine] (docs/machine.md)"
        )
    if target.suffix != ".vtu":
        raise InputError(f"{target}: the strand is an unstructured grid of VTK; end it in .vtu")
    points, cells = write_strand(
        folder, target, Side(rolls, thickness, case.casting.length), distance
    )
    print(f"{target}: {points} points, {cells} cells")
