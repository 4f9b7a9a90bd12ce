"""The commands that draw what a case is made of, before it is run."""

from __future__ import annotations

from pathlib import Path

import click

from castfem.cli.command import Argument, command
from castfem.cli.options import PATH, case_name, file_for, output, overrides


@command("mesh billet125/idealised")
@case_name
@output("Picture, or a folder for it; by default <name>_mesh.png.")
@overrides
def mesh(case: str, output: Path | None, overrides: tuple[str, ...]) -> None:
    """Draw the mesh of a case and print its counts and quality."""
    from castfem.cli.drawing import draw_mesh
    from castfem.cli.options import read_from
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    path = find(case)
    with read_from(path):
        draw_mesh(load_case(path, overrides), file_for(output, f"{path.stem}_mesh.png"))


@command("mould billet125/hot --hot")
@case_name
@output("Picture, or a folder for it; by default <name>_mould.png.")
@click.option("--hot", is_flag=True, help="How heat distorts it: cold and at work, [mould.tube].")
@click.option(
    "--coupled",
    is_flag=True,
    help="As --hot, and again with the strand in the hot mould, until both agree.",
)
@overrides
def mould(
    case: str, output: Path | None, hot: bool, coupled: bool, overrides: tuple[str, ...]
) -> None:
    """Print size and taper of a case's mould, and draw it; --hot, --coupled: cold and at work."""
    from castfem.cli.mould import draw_mould
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    path = find(case)
    if hot or coupled:
        from castfem.cli.hot_mould import draw_hot_mould

        target = file_for(output, f"{path.stem}_hot.png")
        draw_hot_mould(load_case(path, overrides), target, case, coupled=coupled)
        return
    draw_mould(load_case(path, overrides), file_for(output, f"{path.stem}_mould.png"), case)


@command("section billet125/idealised")
@case_name
@output("Picture, or a folder for it; by default <name>_section.png.")
@click.option("--at", help="Where; by default the end of the mould.")
@overrides
def section(case: str, output: Path | None, at: str | None, overrides: tuple[str, ...]) -> None:
    """Find the outline at the meniscus whose strand has the case's section further down."""
    from castfem.cli.section import find as find_outline
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    path = find(case)
    target = file_for(output, f"{path.stem}_section.png")
    find_outline(load_case(path, overrides), target, case, at)


@command("machine slab1200/reference")
@case_name
@output("Picture, or a folder for it; by default <name>_machine.png.")
@click.option("--run", type=PATH, help="Folder of a run: where it is solid, how drives pulled.")
@overrides
def machine(case: str, output: Path | None, run: Path | None, overrides: tuple[str, ...]) -> None:
    """Print the rolls of a case, and draw its caster."""
    from castfem.cli.machine import draw_machine
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    path = find(case)
    target = file_for(output, f"{path.stem}_machine.png")
    draw_machine(load_case(path, overrides), target, case, run)


@command("material carbon_042")
@click.argument(
    "name", metavar="NAME", help="A shipped set, or a steel file (.toml).", cls=Argument
)
@output("Picture, or a folder for it; by default <name>.png.")
@click.option(
    "--composition", "-c", metavar="C=0.42", multiple=True, help="Weight percent of an element."
)
def material(name: str, output: Path | None, composition: tuple[str, ...]) -> None:
    """Describe a steel and plot its properties."""
    from castfem.cli.drawing import draw_material

    draw_material(name, composition, file_for(output, f"{Path(name).stem}.png"))
