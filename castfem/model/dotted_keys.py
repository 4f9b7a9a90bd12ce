"""Dotted keys of a document: where they lead, and why one leads nowhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from castfem.base.messages import dotted
from castfem.base.units import nearest
from castfem.model.mould import EXAMPLES


def value_at(data: Mapping[str, Any], key: str) -> Any:
    """Return what stands under a dotted key, None where nothing does."""
    place: Any = data
    for part in key.split("."):
        step = step_into(place, part.strip())
        if step is None or (isinstance(place, Mapping) and step not in place):
            return None
        place = place[step]
    return place


def lost(data: Mapping[str, Any], key: str) -> str:
    """Say why a dotted key leads to no entry of an array; "" where it does not ask for one."""
    place: Any = data
    path: tuple[str | int, ...] = ()
    for part in key.split("."):
        step = step_into(place, part.strip())
        if step is None:
            return no_entry(place, path, part.strip())
        if isinstance(place, Mapping) and step not in place:
            return ""
        place, path = place[step], (*path, step)
    return ""


def step_into(place: Any, part: str) -> str | int | None:
    """Return the key or index that `part` means in a table or array, None if there is none."""
    if isinstance(place, Mapping):
        return part
    if not isinstance(place, Sequence) or isinstance(place, str):
        return None
    if part.isdigit():
        return int(part) if int(part) < len(place) else None
    for index, entry in enumerate(place):
        if isinstance(entry, Mapping) and entry.get("name") == part:
            return index
    return None


def no_entry(place: Any, path: tuple[str | int, ...], part: str) -> str:
    """Say why `part` leads nowhere in `place`."""
    where = dotted(path)
    if not isinstance(place, Sequence) or isinstance(place, str):
        example = EXAMPLES.get(str(path[-1])) if path[:-1] == ("mould",) else None
        mend = f"; give a table, such as {where} = {example}" if example else ""
        return f"{where} is a single value, it has no keys{mend}"
    names = [str(e["name"]) for e in place if isinstance(e, Mapping) and "name" in e]
    named = f" or the name of one ({', '.join(names)}{nearest(part, names)})" if names else ""
    return f"'{part}' is no entry of {where}; give an index from 0 to {len(place) - 1}{named}"
