"""Changes of a case by a later layer: an extending file, `--set` or a script.

TOML has no null, so a later layer cannot remove keys of an extended file. Hence these rules.

Steel: a later name removes an inherited composition, unless the named steel is computed from one
and states none itself; a later composition replaces an inherited steel that is not computed from
one, unless that is a file of the user's.

Shape: where a later layer changes the shape of the section, keys of earlier layers that the new
shape does not have are dropped. Such a key in the same or a later layer remains an error.

References: a reference whose case was changed after it was written is marked, since its number
belongs to the unchanged case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from castfem.base import units
from castfem.base.constants import EXACT
from castfem.base.errors import InputError
from castfem.model.section import Section, Strip
from castfem.model.taper import PARTS

Keys = tuple[str, ...]
COMPUTED = "plain_carbon"
"""Steel set used when a composition replaces a steel that is not computed from one."""


def settle(
    before: Mapping[str, Any], after: dict[str, Any], inherited: Callable[[Keys], bool]
) -> str:
    """Let a new steel name or composition replace the inherited other; return what was done.

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
        return ""  # a user's own numbers are not dropped silently: refused, with the fix
    steel["name"] = COMPUTED
    return f'"{name}" is not computed from a composition; "{COMPUTED}" is taken for the new one'


def _without(steel: dict[str, Any], kept: list[str], name: str) -> str:
    """Remove the inherited composition from the table [steel]; return what was done."""
    listed = ", ".join(f"{element} = {steel['composition'][element]}" for element in kept)
    for element in kept:
        del steel["composition"][element]
    if not steel["composition"]:
        del steel["composition"]
    return f'"{name}" has its own numbers: the inherited composition ({listed}) is left out'


def _is_computed(name: str) -> bool | None:
    """Whether a steel is computed from a composition; None if it cannot be read."""
    given = _given(name)
    return None if given is None else bool(given.get("from_composition"))


def _needs_amounts(name: str) -> bool:
    """Whether a steel is computed from a composition that its file does not give."""
    given = _given(name)
    return given is None or (bool(given.get("from_composition")) and not given.get("composition"))


def _given(name: str) -> dict[str, Any] | None:
    from castfem.physics.materials.library import given_steel

    try:
        return given_steel(name)
    except InputError:
        return None


def unknown(shape: type[Section]) -> Iterator[Keys]:
    """Yield the keys outside [section] that a shape does not have, by part of a taper."""
    if not shape.has_corner:
        yield "mesh", "corner_size"
    if shape is Strip:  # no mould at all
        return
    sizes = dict.fromkeys(size for kind in Section.kinds.values() for size in kind.mould_sizes)
    yield from (("mould", size) for size in sizes if size not in shape.mould_sizes)
    if shape.one_taper:
        yield from (("mould", "taper", part) for part in PARTS if part != "face")


def leave_out(
    before: Mapping[str, Any], after: dict[str, Any], inherited: Callable[[Keys], bool]
) -> tuple[str, ...]:
    """Remove from a document what the new shape does not have; return the dotted keys."""
    name = _shape(after)
    shape = Section.kinds.get(name or "")
    if shape is None or name == _shape(before):
        return ()
    dropped = []
    for path in unknown(shape):
        *above, key = path
        tables = [after]
        for part in above:
            inner = tables[-1].get(part)
            if not isinstance(inner, dict):
                break
            tables.append(inner)
        if len(tables) == len(path) and key in tables[-1] and inherited(path):
            del tables[-1][key]
            if len(tables) > 2 and not tables[-1]:
                del tables[-2][above[-1]]
            dropped.append(".".join(path))
    return tuple(dropped)


def _shape(data: Mapping[str, Any]) -> str | None:
    section = data.get("section")
    shape = section.get("shape") if isinstance(section, Mapping) else None
    return shape if isinstance(shape, str) else None


# Tables and keys that change no result, or only its numerical accuracy.
_NO_PHYSICS = (
    ("title",),
    ("output",),
    ("reference",),
    ("verification",),
    ("optimise",),
    ("mesh",),
    ("thermal",),
    ("coupling",),
    ("section", "symmetry"),
    ("mould", "contact"),
    ("mechanics", "solver"),
    ("tensile", "steps"),
)
_LENGTH = ("casting", "length")  # matters where a number holds "at the end"


def mark(before: Mapping[str, Any], after: dict[str, Any]) -> None:
    """Mark in the references of a document the keys changed since they were written."""
    known = before.get("reference")
    entries = after.get("reference")
    if not isinstance(known, list) or not isinstance(entries, list):
        return
    keys = [path for path in _changed(before, after, ()) if not _is_numerical(path)]
    for entry in entries:
        if not isinstance(entry, dict) or entry not in known:
            continue
        those = [".".join(path) for path in keys if path != _LENGTH or "at" not in entry]
        if those:
            entry["changed"] = list(dict.fromkeys([*entry.get("changed", ()), *those]))


def _is_numerical(path: tuple[str, ...]) -> bool:
    return any(path[: len(start)] == start for start in _NO_PHYSICS)


def _changed(one: Any, other: Any, path: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
    """Paths of the values that differ; array entries by name, or else by index."""
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        for key in dict.fromkeys([*one, *other]):
            yield from _changed(one.get(key), other.get(key), (*path, str(key)))
    elif _is_array(one) and _is_array(other) and len(one) == len(other):
        for index, (left, right) in enumerate(zip(one, other, strict=True)):
            name = right.get("name", index) if isinstance(right, Mapping) else index
            yield from _changed(left, right, (*path, str(name)))
    elif not _same(one, other):
        yield path


def _is_array(value: Any) -> bool:
    return isinstance(value, Sequence) and not isinstance(value, str)


def _same(one: Any, other: Any) -> bool:
    """Whether two values are equal, in whatever units they are written."""
    if one == other or not (isinstance(one, str) and isinstance(other, str)):
        return bool(one == other)
    try:
        (left, unit), (right, its) = units.parse_any(one), units.parse_any(other)
    except ValueError:
        return False
    return unit == its and abs(left - right) <= EXACT * abs(right)
