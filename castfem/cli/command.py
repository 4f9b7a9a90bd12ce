"""Commands and arguments of click, with what castfem adds to their help.

The help of click has no line for an argument before its version 8.5.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from castfem.base.units import nearest

EXIT = {
    0: "all went well",
    1: "the input cannot be used; nothing was run",
    2: "a run failed, a search found no answer, a file or a part of castfem is missing",
    130: "interrupted: Ctrl-C, SIGTERM, SIGHUP or SIGUSR1; what was done is on disk",
}
"""Each exit status and its meaning."""
_STATUS = "Exit status: 0 if all went well, 1 for bad input, 2 for a failure, 130 if interrupted."


class Argument(click.Argument):
    """An argument with a line in the help; all of castfem are required."""

    def __init__(self, *args: Any, help: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = help

    def get_help_record(self, ctx: click.Context) -> tuple[str, str]:
        """Name and description."""
        return self.human_readable_name, f"{self.help}  [required]"


class Command(click.Command):
    """A command whose help lists its arguments before its options."""

    def format_arguments(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write nothing: click calls this only from 8.5 on, and `format_options` always."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write a section for the arguments and one for the options."""
        for title, kind in (("Arguments", click.Argument), ("Options", click.Option)):
            found = [p.get_help_record(ctx) for p in self.get_params(ctx) if isinstance(p, kind)]
            if rows := [row for row in found if row is not None]:
                with formatter.section(title):
                    formatter.write_dl(rows)


class Group(click.Group):
    """The commands, in the order in which they were added; each with its whole description."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.commands)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Return the command that is called, or name the nearest one to what is none."""
        try:
            return super().resolve_command(ctx, args)
        except click.UsageError as error:
            near = nearest(args[0], self.commands)
            if near and "Did you mean" not in error.message:
                error.message += near.removeprefix(";").replace(" did", " Did", 1)
            raise

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the section of the commands."""
        with formatter.section("Commands"):
            formatter.write_dl([(name, one.help or "") for name, one in self.commands.items()])

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the exit status of all commands, and where their examples are."""
        with formatter.section("Exit status"):
            formatter.write_dl([(str(status), meaning) for status, meaning in EXIT.items()])
        formatter.write_paragraph()
        formatter.write_text("castfem COMMAND --help shows an example of the command.")

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command and return what it returns.

        Raises:
            click.Abort: Because of an interrupt or an end of a file, its cause. Click would print
                an empty line first.
        """
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, EOFError) as error:
            raise click.Abort from error


def command(example: str) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a command of a function.

    The command has the name of the function and its docstring as help. An integer that it returns
    is the exit status.
    """
    return click.command(cls=Command, epilog=f"\b\nExample: castfem {example}\n{_STATUS}")
