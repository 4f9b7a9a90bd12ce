"""Single entries of an inherited array, changed by their names: `[cooling.spray] to = "6 m"`.

In a zone the keys of its heat laws may stand beside its own, where one law alone has them, or in a
table with the name of the law, `[cooling.spray.radiation]`, as behind `--set`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from castfem.base.messages import dotted
from castfem.model.dotted_keys import no_entry, step_into

Keys = tuple[str | int, ...]
Merge = Callable[[dict[str, Any], dict[str, Any], Keys], None]
_LAWS = "surface"  # of a zone


def are_named(value: Any) -> bool:
    """Return whether a value is an array of tables that have names."""
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(entry, dict) for entry in value)
        and any("name" in entry for entry in value)
    )


def change(array: list[Any], given: Mapping[str, Any], path: Keys, merge: Merge) -> list[str]:
    """Change entries of an array; return what is wrong, a line each.

    Args:
        array: Of tables, at `path` of the case.
        given: By the name or the index of an entry the keys that change in it.
        path: Of the array.
        merge: Merges a table into another one at a path.
    """
    problems: list[str] = []
    for name, keys in given.items():
        index = step_into(array, str(name))
        if not isinstance(index, int):
            problems.append(f"{dotted((*path, name))}: {no_entry(array, path, str(name))}")
        elif not isinstance(keys, dict):
            problems.append(
                f"{dotted((*path, name))}: keys of this entry are needed, such as "
                f"[{dotted((*path, name))}] and a line for each"
            )
        else:
            problems += _change_entry(array[index], keys, (*path, index), str(name), merge)
    return problems


def _change_entry(
    entry: dict[str, Any], keys: dict[str, Any], path: Keys, name: str, merge: Merge
) -> Iterator[str]:
    laws = entry.get(_LAWS)
    if not isinstance(laws, list):
        merge(entry, keys, path)
        return
    own: dict[str, Any] = {}
    for key, value in keys.items():
        table = isinstance(value, dict)
        named = [
            i for i, law in enumerate(laws) if table and key in (law.get("law"), law.get("name"))
        ]
        having = [i for i, law in enumerate(laws) if key in law and key not in entry]
        meant = named or having
        if len(meant) > 1:
            words = ", ".join(str(laws[i].get("name") or laws[i].get("law", i)) for i in meant)
            yield (
                f"{name}.{key}: several heat laws of this zone are meant ({words}); give their "
                f"tables anew, [[cooling.{name}.{_LAWS}]]"
            )
        elif meant:
            inner = value if named else {key: value}
            merge(laws[meant[0]], inner, (*path, _LAWS, meant[0]))
        else:
            own[key] = value
    merge(entry, own, path)
