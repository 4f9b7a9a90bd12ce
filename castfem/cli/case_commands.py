"""Commands that draw a case before its run, a steel, a law, or a strand in three dimensions.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, cast

import click

from castfem.base.errors import InputError, RunFailure
from castfem.base.units import nearest
from castfem.cli import options
from castfem.cli.command import Argument, command
from castfem.cli.options import (
    PATH,
    above_zero,
    case_and_target,
    case_name,
    file_for,
    folder,
    output,
    overrides,
)

_SOFTENINGS = ("positive", "free", "none")  # of `IdentifyOptions`


@command("mesh billet125/idealised")
@case_name
@output("Picture, or a folder for it; by default <name>_mesh.png.")
@overrides
@options.accuracy
def mesh(case: str, output: Path | None, overrides: tuple[str, ...], accuracy: str) -> None:
    """Draw the mesh of a case and print its counts and quality."""
    from castfem.cli.drawing import draw_mesh
    from castfem.cli.options import read_from
    from castfem.model.shipped_cases import find

    with read_from(find(case)):
        draw_mesh(*case_and_target(case, output, overrides, "mesh", accuracy))


@command("mould billet125/hot --hot")
@case_name
@output("Picture, or a folder for it; by default <name>_mould.png.")
@click.option(
    "--hot",
    is_flag=True,
    help="Thermal distortion of the copper tube [mould.tube], cold and at work.",
)
@click.option(
    "--coupled",
    is_flag=True,
    help="Like --hot, iterated with the strand in the hot mould until both agree.",
)
@overrides
@options.accuracy
def mould(
    case: str,
    output: Path | None,
    hot: bool,
    coupled: bool,
    overrides: tuple[str, ...],
    accuracy: str,
) -> None:
    """Print size and taper of a case's mould, and draw it; --hot, --coupled: cold and at work."""
    from castfem.cli.mould import draw_hot_mould, draw_mould

    if hot or coupled:
        loaded, target = case_and_target(case, output, overrides, "hot", accuracy)
        draw_hot_mould(loaded, target, case, coupled=coupled)
        return
    draw_mould(*case_and_target(case, output, overrides, "mould", accuracy), case)


@command("section billet125/idealised")
@case_name
@output("Picture, or a folder for it; by default <name>_section.png.")
@click.option(
    "--at",
    metavar="POSITION",
    help="Position of the required section; by default the end of the mould.",
)
@overrides
@options.accuracy
def section(
    case: str, output: Path | None, at: str | None, overrides: tuple[str, ...], accuracy: str
) -> None:
    """Find the outline at the meniscus that gives the case's section further down."""
    from castfem.cli.mould import find_outline

    find_outline(*case_and_target(case, output, overrides, "section", accuracy), case, at)


@command("machine slab1200/reference")
@case_name
@output("Picture, or a folder for it; by default <name>_machine.png.")
@click.option(
    "--run", type=PATH, help="Folder of a run, to show where it is solid and how the drives pulled."
)
@overrides
def machine(case: str, output: Path | None, run: Path | None, overrides: tuple[str, ...]) -> None:
    """Print the rolls of a case, and draw its caster."""
    from castfem.cli.machine import draw_machine

    draw_machine(*case_and_target(case, output, overrides, "machine"), case, run)


@command("material carbon_042")
@click.argument(
    "name", metavar="NAME", help="A shipped set, or a steel file (.toml).", cls=Argument
)
@output("Picture, or a folder for it; by default <name>.png.")
@click.option(
    "--composition", "-c", metavar="C=0.42", multiple=True, help="Weight percent of an element."
)
@click.option(
    "--database", type=PATH, metavar="FILE",
    help="Thermodynamic database (.tdb) for phases and heat, drawn beside those of the set.",
)  # fmt: skip
@click.option("--scheil", is_flag=True, help="With a database: freezing by Scheil.")
@click.option(
    "--segregated", is_flag=True,
    help="Freezing with microsegregation of the solutes, drawn beside equilibrium.",
)  # fmt: skip
def material(
    name: str,
    output: Path | None,
    composition: tuple[str, ...],
    database: Path | None,
    scheil: bool,
    segregated: bool,
) -> None:
    """Describe a steel and plot its properties."""
    from castfem.cli.drawing import draw_material

    target = file_for(output, f"{Path(name).stem}.png")
    draw_material(name, composition, target, database, scheil, segregated)


@command('strand results/slab1200/reference --every "50 mm"')
@folder("Folder of a run.")
@output("File; by default strand.vtu in DIR.")
@click.option(
    "--every",
    default="100 mm",
    metavar="LENGTH",
    help="Largest length of the cells along the strand.",
)
def strand(folder: Path, output: Path | None, every: str) -> None:
    """Write the slices of a run, stacked along its caster, for ParaView."""
    from castfem.model import load_case
    from castfem.model.machine import thickness_of
    from castfem.model.shipped_cases import CASE_NAME
    from castfem.physics.machine.side import Side
    from castfem.runs.output.folder import CASTER_NAME, STRAND_NAME
    from castfem.runs.output.stacked_slices import write_strand

    target, distance = file_for(output or folder, STRAND_NAME), above_zero("--every", every, "m")
    if not (folder / CASE_NAME).is_file():
        raise InputError(f"{folder}: holds no run of castfem (no {CASE_NAME})")
    if (folder / CASTER_NAME).is_file():
        fix = "caster.moments writes them for ParaView (docs/caster.md)"
        raise InputError(f"{folder}: is a caster of many slices; {fix}")
    case = load_case(folder / CASE_NAME)
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if rolls is None or thickness is None:
        raise InputError(
            f"{folder / CASE_NAME}: machine: the table is missing, so the strand is vertical: "
            "open fields.xdmf; or run the case with [machine] (docs/machine.md)"
        )
    if target.suffix != ".vtu":
        raise InputError(
            f"{target}: the strand is written as an unstructured VTK grid; "
            "choose a name that ends in .vtu"
        )
    side = Side(rolls, thickness, case.casting.length)
    points, cells = write_strand(folder, target, side, distance)
    print(f"{target}: {points} points, {cells} cells")


@command("identify curves.csv")
@click.argument(
    "data",
    metavar="DATA.csv",
    type=PATH,
    help="Tensile curves: temperature [..], strain rate [..], strain [..], stress [..].",
    cls=Argument,
)
@output("File of the law; by default DATA.toml.")
@click.option(
    "--degree",
    type=int,
    help="Degree of a polynomial fit over temperature; left out: each temperature separately.",
)
@click.option(
    "--softening",
    default="positive",
    help="Constraint on p1: positive (0 or more), free, or none (0).",
)
@click.option("--overwrite", is_flag=True, help="Replace an existing law and picture of this name.")
def identify(
    data: Path, output: Path | None, degree: int | None, softening: str, overwrite: bool
) -> None:
    """Fit the modified Norton-Hoff law (163) to tensile curves."""
    if softening not in _SOFTENINGS:
        near = nearest(softening, _SOFTENINGS)
        raise InputError(f"--softening '{softening}': one of {', '.join(_SOFTENINGS)}{near}")
    if degree is not None and degree < 0:
        raise InputError(f"--degree {degree}: a number from 0 on, or leave it out")
    target = output or Path(data.name).with_suffix(".toml")
    there = [p for p in (target, target.with_suffix(".png")) if p.exists() and not overwrite]
    if there:
        raise InputError(
            f"{there[0]}: exists already; choose another file with -o, or give --overwrite"
        )
    from castfem.base.atomic_files import write_text
    from castfem.studies.identification import fit

    asked = fit.IdentifyOptions(degree=degree, softening=cast(Any, softening))
    found = fit.identify(data, asked)
    try:
        write_text(target, found.to_toml())
    except RunFailure as error:
        raise InputError(str(error).partition(";")[0]) from None
    try:
        picture = found.plot(target.with_suffix(".png"))
    except OSError as error:
        raise InputError(f"{target}: cannot be drawn ({error.strerror})") from None
    print(found.report())
    print(f"law in {target}, drawn in {picture}")


COMMANDS = mesh, mould, section, machine, strand, material, identify
