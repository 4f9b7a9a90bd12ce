"""Writes docs/commands.md, the reference page of the commands, from their help.

    python -m castfem.cli.reference_page docs/commands.md

updates it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import click

from castfem.base.atomic_files import write_text
from castfem.cli.app import app
from castfem.cli.command import EXIT

_HEAD = """\
# Commands

What each command takes; `castfem COMMAND -h` prints the same. This page is written by
`python -m castfem.cli.reference_page docs/commands.md`. A case is a file, or the name of a shipped
one (`castfem cases`).
Equation numbers are those of [Pascon2003](references.md).
"""
_TABLE = "\n| exit status | |\n|---|---|\n"


def markdown_page() -> str:
    """The page."""
    rows = "".join(f"| {status} | {meaning} |\n" for status, meaning in EXIT.items())
    sections = (_section(name, command) for name, command in app.commands.items())
    return "".join([_HEAD, _TABLE, rows, *sections])


def _section(name: str, command: click.Command) -> str:
    arguments = [p for p in command.params if isinstance(p, click.Argument)]
    called = " ".join(["castfem", name, *map(_value, arguments)])
    rows = "".join(_row(p) for p in command.params if getattr(p, "help", None))
    head = f"\n## castfem {name}\n\n`{called}`\n\n{(command.help or '').strip()}\n"
    head += f"\n```sh\n{(command.epilog or '').splitlines()[1].removeprefix('Example: ')}\n```\n"
    return head + (f"\n| | |\n|---|---|\n{rows}" if rows else "")


def _row(parameter: click.Parameter) -> str:
    """A row: names of an option with its value, or an argument, and the description."""
    words = [f"`{_value(parameter)}`"]
    if isinstance(parameter, click.Option):
        if parameter.is_flag or parameter.count:
            words.clear()
        on = parameter.is_flag and parameter.default is True
        names = parameter.secondary_opts if on else parameter.opts
        words.insert(0, ", ".join(f"`{name}`" for name in names))
    about = re.sub(r"([|<>])", r"\\\1", str(getattr(parameter, "help", "")))
    needed = isinstance(parameter, click.Option) and parameter.required
    if isinstance(parameter, click.Option) and words[0].startswith("`--no-"):
        about = f"Do not {about[0].lower()}{about[1:]}"
    return f"| {' '.join(words)} | {about}{' Required.' * needed} |\n"


def _value(parameter: click.Parameter) -> str:
    """Placeholder of the value in a line of usage."""
    kind = {"integer": "NUMBER", "float": "NUMBER"}.get(parameter.type.name, "TEXT")
    kind = parameter.type.name.upper() if parameter.type.name in ("path", "file") else kind
    return parameter.metavar or (
        kind if isinstance(parameter, click.Option) else str(parameter.name).upper()
    )


if __name__ == "__main__":
    write_text(Path(sys.argv[1]), markdown_page())
