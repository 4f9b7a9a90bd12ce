"""Name and composition of the steel from several layers: the later one decides.

TOML has no null: what an extended file gives cannot be taken away.  So a steel that is named in a
later layer (a file that extends, `--set`, a script) does away with an inherited composition, unless
it is computed from one and states none itself; and a composition that comes later does away with
an inherited steel that is not computed from one, unless that is a file of the user's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from castfem.base.errors import InputError

Keys = tuple[str, ...]
COMPUTED = "plain_carbon"
"""The set taken for a composition that comes after a steel that is not computed from one."""


def settle(
    before: Mapping[str, Any], after: dict[str, Any], inherited: Callable[[Keys], bool]
) -> str:
    """Let the new one of name and composition replace the inherited other; return what was done.

    Args:
        before: The tables of the earlier layers.
        after: The same with those of the new layer; its table [steel] is changed.
        inherited: Whether the value at a path of `after` comes from an earlier layer.
    """
    old, steel = before.get("steel"), after.get("steel")
    if not isinstance(old, Mapping) or not isinstance(steel, dict):
        return ""
    name, amounts = steel.get("name"), steel.get("composition")
    if not isinstance(name, str) or not isinstance(amounts, dict):
        return ""
    kept = [element for element in amounts if inherited(("steel", "composition", element))]
    new = len(kept) < len(amounts)
    if name != old.get("name") and not inherited(("steel", "name")):
        return _without(steel, kept, name) if kept and not _needs_amounts(name) else ""
    if not new or old.get("name") != name or _is_computed(name) is not False:
        return ""
    if name.endswith(".toml"):
        return ""  # somebody's own numbers are not thrown away: it is refused, with the mend
    steel["name"] = COMPUTED
    return f'"{name}" is not computed from a composition; "{COMPUTED}" is taken for the new one'


def _without(steel: dict[str, Any], kept: list[str], name: str) -> str:
    """Take the inherited amounts out of the table [steel]; return what was done."""
    listed = ", ".join(f"{element} = {steel['composition'][element]}" for element in kept)
    for element in kept:
        del steel["composition"][element]
    if not steel["composition"]:
        del steel["composition"]
    return f'"{name}" has its own numbers: the inherited composition ({listed}) is left out'


def _is_computed(name: str) -> bool | None:
    """Whether a steel is computed from a composition; None if it cannot be read, told later."""
    given = _given(name)
    return None if given is None else bool(given.get("from_composition"))


def _needs_amounts(name: str) -> bool:
    """Whether a steel is computed from a composition that it does not state itself."""
    given = _given(name)
    return given is None or (bool(given.get("from_composition")) and not given.get("composition"))


def _given(name: str) -> dict[str, Any] | None:
    from castfem.physics.materials.library import given_steel

    try:
        return given_steel(name)
    except InputError:
        return None
