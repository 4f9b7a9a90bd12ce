"""Completion of the command line: commands and options, names of cases, keys of --set.

The shells' own parts are click's. Nothing is imported here that a case file does not need.
"""

from __future__ import annotations

import os
from pathlib import Path

import click
from click.shell_completion import CompletionItem, ShellComplete, get_completion_class

from castfem.errors import InputError

VARIABLE = "_CASTFEM_COMPLETE"
"""Of the environment: what a shell asks for, such as "bash_complete"."""
SHELLS = ("bash", "zsh", "fish")
# A key is followed by its value: no blank behind its sign (fish leaves it out by itself).
_BASH = ("COMPREPLY+=($value)", "COMPREPLY+=($value); [[ $value == *= ]] && compopt -o nospace")
_ZSH = (
    "compadd -U -V unsorted -a completions",
    """[[ "${completions[1]}" == *= ]] && compadd -U -S '' -V unsorted -a completions \\
            || compadd -U -V unsorted -a completions""",
)


def answer() -> int:
    """Print what the shell asks for by the variable of the environment; return the exit status."""
    shell, _, what = os.environ[VARIABLE].partition("_")
    if shell not in SHELLS or what != "complete":
        return InputError.exit_status
    click.echo(_of(shell).complete())
    return 0


def script(shell: str) -> str:
    """The part of a shell, to be put where the shell finds it.

    Raises:
        InputError: There is none for this shell.
    """
    if shell not in SHELLS:
        raise InputError(f"{shell}: no such shell; there are {', '.join(SHELLS)}")
    text = _of(shell).source()
    return text.replace(*_BASH).replace(*_ZSH)


def _of(shell: str) -> ShellComplete:
    import typer

    from castfem.cli.app import app

    found = get_completion_class(shell)
    assert found is not None
    return found(typer.main.get_command(app), {}, "castfem", VARIABLE)


class CaseName(click.ParamType):
    """Name of a case; completed by those that are shipped, and by files."""

    name = "case"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Case files beside, and shipped cases, that begin so; without one, any file."""
        from castfem.case import shipped_cases

        beside = Path().glob(f"{incomplete}*.toml") if "/" not in incomplete else ()
        names = [name for name in shipped_cases.shipped() if name.startswith(incomplete)]
        found = [CompletionItem(name) for name in (*map(str, beside), *names)]
        return found or [CompletionItem(incomplete, type="file")]


class Assignment(click.ParamType):
    """Key and value of --set; completed by the keys of the case on the line."""

    name = "assignment"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Keys that begin so, each with its sign.

        Those of zones with a blank in their name are left out: they would be two words.
        """
        from castfem.case import document, shipped_cases
        from castfem.case.key_names import all_keys
        from castfem.case.model import Case

        data = {}
        # An option without its value yet leaves the words before it where they are.
        if name := ctx.params.get("case") or next(iter(ctx.args), None):
            try:
                data = document.read(shipped_cases.find(name)).data
            except InputError:
                return []
        known = dict.fromkeys(f"{key}=" for key in all_keys(Case, data) if " " not in key)
        return [CompletionItem(key) for key in known if key.startswith(incomplete)]
