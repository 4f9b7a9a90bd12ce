"""Commands and arguments of click, with castfem's additions to help and completion.

click's help lists arguments only since version 8.5. Completion covers commands and options, case
names and keys of --set; the shell scripts are click's. Only what a case file needs is imported
here.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.shell_completion import CompletionItem, get_completion_class

from castfem.base.errors import InputError
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
    """An argument with a line in the help; all arguments of castfem are required."""

    def __init__(self, *args: Any, help: str, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.help = help

    def get_help_record(self, ctx: click.Context) -> tuple[str, str]:
        """Name and description."""
        return self.human_readable_name, f"{self.help}  [required]"


class Command(click.Command):
    """A command whose help lists its arguments before its options."""

    def format_arguments(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write nothing: click calls this only since 8.5, but `format_options` always."""

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one section for the arguments and one for the options."""
        for title, kind in (("Arguments", click.Argument), ("Options", click.Option)):
            found = [p.get_help_record(ctx) for p in self.get_params(ctx) if isinstance(p, kind)]
            if rows := [row for row in found if row is not None]:
                with formatter.section(title):
                    formatter.write_dl(rows)


class Group(click.Group):
    """The commands in the order in which they were added, each with its whole description."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of the commands."""
        return list(self.commands)

    def resolve_command(self, ctx: click.Context, args: list[str]) -> Any:
        """Return the command that is called; for an unknown one raise an error with the nearest."""
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
        """Write the exit statuses, and where examples are."""
        with formatter.section("Exit status"):
            formatter.write_dl([(str(status), meaning) for status, meaning in EXIT.items()])
        formatter.write_paragraph()
        formatter.write_text("castfem COMMAND --help shows an example of the command.")

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command and return its value.

        Raises:
            click.Abort: After an interrupt or end of file, its cause. click would print an empty
                line first.
        """
        try:
            return super().invoke(ctx)
        except (KeyboardInterrupt, EOFError) as error:
            raise click.Abort from error


def command(example: str) -> Callable[[Callable[..., Any]], Command]:
    """Return a decorator that makes a function a command.

    The command has the name of the function and its docstring as help. An integer it returns is the
    exit status.
    """
    return click.command(cls=Command, epilog=f"\b\nExample: castfem {example}\n{_STATUS}")


VARIABLE = "_CASTFEM_COMPLETE"
"""Environment variable read by click: what a shell asks for, such as "bash_complete"."""
# click's script, {click}, and a function that the shell calls instead of click's: no blank is added
# after the sign between key and value. fish does this by itself.
_SCRIPTS = {
    "bash": """\
{click}
_castfem_keys() {
    _castfem_completion "$@"
    [[ $COMPREPLY == *= ]] && compopt -o nospace
}
complete -o nosort -F _castfem_keys castfem
""",
    # Inside a function, click's script registers its function without calling it.
    "zsh": """\
#compdef castfem
() {
{click}
}
_castfem_keys() {
    compadd() {
        [[ $completions[1] == *= ]] && set -- -S '' "$@"
        builtin compadd "$@"
    }
    _castfem_completion "$@"
    unfunction compadd
}
compdef _castfem_keys castfem
[[ $zsh_eval_context[-1] == loadautofunc ]] && _castfem_keys "$@"
""",
    "fish": "{click}",
}


def script(shell: str, app: click.Command) -> str:
    """Return the completion script of a shell."""
    if shell not in _SCRIPTS:
        raise InputError(f"{shell}: no such shell; there are {', '.join(_SCRIPTS)}")
    found = get_completion_class(shell)
    assert found is not None
    source = found(app, {}, "castfem", VARIABLE).source()
    return _SCRIPTS[shell].replace("{click}", source.strip())


class CaseName(click.ParamType):
    """Name of a case; completed by shipped cases and files."""

    name = "case"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Case files and shipped cases with this prefix; if there are none, any file."""
        from castfem.model import shipped_cases

        beside = Path().glob(f"{incomplete}*.toml") if "/" not in incomplete else ()
        names = [name for name in shipped_cases.shipped() if name.startswith(incomplete)]
        found = [CompletionItem(name) for name in (*map(str, beside), *names)]
        return found or [CompletionItem(incomplete, type="file")]


class Assignment(click.ParamType):
    """Key and value of --set; completed by the keys of the case on the command line."""

    name = "assignment"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Keys with this prefix, each with its sign.

        Keys of zones with a blank in their name are left out: they would be two words.
        """
        from castfem.model import document, shipped_cases
        from castfem.model.case import Case
        from castfem.model.key_names import all_keys

        data = {}
        # An option still without a value leaves the words before it unchanged.
        if name := ctx.params.get("case") or next(iter(ctx.args), None):
            try:
                data = document.read(shipped_cases.find(name)).data
            except InputError:
                return []
        known = dict.fromkeys(f"{key}=" for key in all_keys(Case, data) if " " not in key)
        return [CompletionItem(key) for key in known if key.startswith(incomplete)]
