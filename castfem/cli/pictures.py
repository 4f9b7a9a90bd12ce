"""The commands that draw what a case is made of, before it is run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from castfem.cli.options import CaseName, Overrides


def mesh(
    case: CaseName,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture; by default <name>_mesh.png.")
    ] = None,
    set_: Overrides = None,
) -> None:
    """Draw the mesh of a case and print its counts and quality."""
    from castfem.case import load_case
    from castfem.case.shipped_cases import find
    from castfem.cli.drawing import draw_mesh
    from castfem.cli.options import read_from

    path = find(case)
    with read_from(path):
        draw_mesh(load_case(path, set_ or ()), output or Path(f"{path.stem}_mesh.png"))


def mould(
    case: CaseName,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture; by default <name>_mould.png.")
    ] = None,
    hot: Annotated[
        bool, typer.Option("--hot", help="How heat distorts it: cold and at work, [mould.tube].")
    ] = False,
    coupled: Annotated[
        bool,
        typer.Option(
            "--coupled",
            help="As --hot, and again with the strand in the hot mould, until both agree.",
        ),
    ] = False,
    set_: Overrides = None,
) -> None:
    """Print size and taper of a case's mould, and draw it; --hot, --coupled: cold and at work."""
    from castfem.case import load_case
    from castfem.case.shipped_cases import find
    from castfem.cli.mould import draw_mould

    path = find(case)
    if hot or coupled:
        from castfem.cli.hot_mould import draw_hot_mould

        target = output or Path(f"{path.stem}_hot.png")
        draw_hot_mould(load_case(path, set_ or ()), target, case, coupled=coupled)
        return
    draw_mould(load_case(path, set_ or ()), output or Path(f"{path.stem}_mould.png"), case)


def section(
    case: CaseName,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture; by default <name>_section.png.")
    ] = None,
    at: Annotated[
        str | None, typer.Option("--at", help="Where; by default the end of the mould.")
    ] = None,
    set_: Overrides = None,
) -> None:
    """Find the outline at the meniscus whose strand has the case's section further down."""
    from castfem.case import load_case
    from castfem.case.shipped_cases import find
    from castfem.cli.section import find as find_outline

    path = find(case)
    target = output or Path(f"{path.stem}_section.png")
    find_outline(load_case(path, set_ or ()), target, case, at)


def machine(
    case: CaseName,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture; by default <name>_machine.png.")
    ] = None,
    run: Annotated[
        Path | None, typer.Option(help="Folder of a run: where it is solid, how drives pulled.")
    ] = None,
    set_: Overrides = None,
) -> None:
    """Print the rolls of a case, and draw its caster."""
    from castfem.case import load_case
    from castfem.case.shipped_cases import find
    from castfem.cli.machine import draw_machine

    path = find(case)
    target = output or Path(f"{path.stem}_machine.png")
    draw_machine(load_case(path, set_ or ()), target, case, run)


def material(
    name: Annotated[
        str, typer.Argument(metavar="NAME", help="A shipped set, or a steel file (.toml).")
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="Picture; by default <name>.png.")
    ] = None,
    composition: Annotated[
        list[str] | None,
        typer.Option("--composition", "-c", metavar="C=0.42", help="Weight percent of an element."),
    ] = None,
) -> None:
    """Describe a steel and plot its properties."""
    from castfem.cli.drawing import draw_material

    draw_material(name, composition or [], output)
