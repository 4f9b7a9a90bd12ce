"""Completion of the command line: commands and options, names of cases, keys of --set.

The shells' own parts are click's. Nothing is imported here that a case file does not need.
"""

from __future__ import annotations

from pathlib import Path

import click
from click.shell_completion import CompletionItem, get_completion_class

from castfem.base.errors import InputError

VARIABLE = "_CASTFEM_COMPLETE"
"""Of the environment: what a shell asks for, such as "bash_complete"; click reads it."""
# click's script, {click}, and a function that the shell calls in place of click's: a key is
# followed by its value, so no blank is put behind its sign. fish leaves it out by itself.
_SCRIPTS = {
    "bash": """\
{click}
_castfem_keys() {
    _castfem_completion "$@"
    [[ $COMPREPLY == *= ]] && compopt -o nospace
}
complete -o nosort -F _castfem_keys castfem
""",
    # Inside a function, click's script registers its function and does not call it.
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


def script(shell: str) -> str:
    """The part of a shell, to be put where the shell finds it."""
    if shell not in _SCRIPTS:
        raise InputError(f"{shell}: no such shell; there are {', '.join(_SCRIPTS)}")
    from castfem.cli.app import app

    found = get_completion_class(shell)
    assert found is not None
    source = found(app, {}, "castfem", VARIABLE).source()
    return _SCRIPTS[shell].replace("{click}", source.strip())


class CaseName(click.ParamType):
    """Name of a case; completed by those that are shipped, and by files."""

    name = "case"

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Case files beside, and shipped cases, that begin so; without one, any file."""
        from castfem.model import shipped_cases

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
        from castfem.model import document, shipped_cases
        from castfem.model.case import Case
        from castfem.model.key_names import all_keys

        data = {}
        # An option without its value yet leaves the words before it where they are.
        if name := ctx.params.get("case") or next(iter(ctx.args), None):
            try:
                data = document.read(shipped_cases.find(name)).data
            except InputError:
                return []
        known = dict.fromkeys(f"{key}=" for key in all_keys(Case, data) if " " not in key)
        return [CompletionItem(key) for key in known if key.startswith(incomplete)]
