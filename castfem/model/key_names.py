"""Short names of keys, where a case leaves no doubt which key is meant.

`speed` is `casting.speed`. `cooling.mould.coefficient` is the key of the only heat law of the zone
that has it; `cooling.mould.contact.coefficient` and `cooling.mould.surface.0.coefficient` name the
law.

Single entries of an inherited array are changed by name: `[cooling.spray] to = "6 m"`. In a zone
the keys of its heat laws may be written beside its own if only one law has them, or in a table with
the name of the law, `[cooling.spray.radiation]`; `--set` works alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from pydantic.fields import FieldInfo

from castfem.base.errors import dotted
from castfem.base.units import nearest
from castfem.model.base import TableModel
from castfem.model.mould import EXAMPLES
from castfem.model.problems import NOT_MEANT, below, model_at, submodels


def value_at(data: Mapping[str, Any], key: str) -> Any:
    """Return the value at a dotted key, None if there is none."""
    place: Any = data
    for part in key.split("."):
        step = step_into(place, part.strip())
        if step is None or (isinstance(place, Mapping) and step not in place):
            return None
        place = place[step]
    return place


def lost(data: Mapping[str, Any], key: str) -> str:
    """Say why a dotted key leads to no array entry; "" if it names none."""
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
    """Say why `part` is not found in `place`."""
    where = dotted(path)
    if not isinstance(place, Sequence) or isinstance(place, str):
        example = EXAMPLES.get(str(path[-1])) if path[:-1] == ("mould",) else None
        fix = f"; give a table, such as {where} = {example}" if example else ""
        return f"{where} is a single value, it has no keys{fix}"
    names = [str(e["name"]) for e in place if isinstance(e, Mapping) and "name" in e]
    named = f" or the name of one ({', '.join(names)}{nearest(part, names)})" if names else ""
    return f"'{part}' is not an entry of {where}; give an index from 0 to {len(place) - 1}{named}"


Keys = tuple[str | int, ...]


def full_key(root: type[TableModel], data: Mapping[str, Any], key: str) -> str:
    """Return the dotted key that `key` stands for in a case.

    A key of the top level, or with dots, is returned as it is, known or not; if it omits or names
    the heat law of a zone, its index is put in. Any other name is looked up in all tables of the
    case, also in [output] if the file omits it, since all its keys have defaults. Keys at their
    default, or replaced by another one, count too.

    Raises:
        ValueError: No key has this name, or several have; the text lists the candidates.
    """
    if "." in key:
        return _with_law(root, data, [part.strip() for part in key.split(".")]) or key
    if key in root.model_fields:
        return key
    known = list(_keys(root, root, data, ()))
    meant = [path for path in known if path[-1] == key]
    if len(meant) == 1:
        return _written(data, meant[0])
    if meant:
        names = [_written(data, path) for path in meant]
        more = f" and {len(names) - 6} more" if len(names) > 6 else ""
        raise ValueError(f"may stand for {', '.join(names[:6])}{more}; write one in full")
    near = nearest(key, dict.fromkeys([*root.model_fields, *(str(path[-1]) for path in known)]))
    absent = [name for name in below(root, key) if name.partition(".")[0] not in NOT_MEANT]
    similar = absent or [_written(data, p) for p in known if near and f" {p[-1]}?" in near]
    if similar:
        near = f"; did you mean {' or '.join(similar[:3])}?"
    raise ValueError(f"no table of the case has a key of this name{near}")


def _with_law(root: type[TableModel], data: Mapping[str, Any], parts: list[str]) -> str:
    """Return a key of a zone with the omitted heat law; "" if it omits none."""
    zones = data.get("cooling")
    if parts[0] != "cooling" or len(parts) < 3 or not isinstance(zones, list):
        return ""
    index = step_into(zones, parts[1])
    if not isinstance(index, int):
        return ""
    zone, model = zones[index], model_at(root, ("cooling", index), data)
    laws = zone.get("surface") if isinstance(zone, Mapping) else None
    if model is None or parts[2] in model.model_fields or not isinstance(laws, list):
        return ""
    tags = [{e.get("name"), e.get("law")} if isinstance(e, Mapping) else set() for e in laws]
    meant, rest = [i for i, tag in enumerate(tags) if parts[2] in tag], parts[3:]
    if not (meant and rest):
        models = [model_at(root, ("cooling", index, "surface", i), data) for i in range(len(laws))]
        written = [i for i, e in enumerate(laws) if isinstance(e, Mapping) and parts[2] in e]
        having = [i for i, one in enumerate(models) if one and parts[2] in one.model_fields]
        meant, rest = written or having, parts[2:]
    if len(meant) > 1:
        words = ", ".join(str(laws[i].get("name") or laws[i].get("law", i)) for i in meant)
        fix = "put one before it, or surface and its number"
        raise ValueError(f"several heat laws of zone {parts[1]} have it ({words}); {fix}")
    return ".".join([*parts[:2], "surface", str(meant[0]), *rest]) if meant else ""


def all_keys(root: type[TableModel], data: Mapping[str, Any]) -> Iterator[str]:
    """Yield the dotted names of all keys of the tables of a case, whether written or not."""
    yield from (
        name for name in root.model_fields if not submodels(root.model_fields[name].annotation)
    )
    yield from (_written(data, path) for path in _keys(root, root, data, ()))


def _keys(
    root: type[TableModel], model: type[TableModel], data: Mapping[str, Any], path: Keys
) -> Iterator[Keys]:
    """Yield the paths of all keys in the table `model` at `path` and in the tables within it."""
    table: Any = data
    for part in path:
        table = table[part] if isinstance(part, int) else table.get(part, {})
    for name, field in model.model_fields.items():
        here, value = (*path, name), table.get(name)
        if here[0] in NOT_MEANT:
            continue
        if path:
            yield here
        if not submodels(field.annotation):
            if isinstance(value, Mapping) and "dict" in str(field.annotation):
                yield from ((*here, inner) for inner in value)
            continue
        if value is None:
            implied = _implied(field)
            # Optional tables of the top level ([mechanics], [mould]) that are left out are not in
            # the case.
            left_out = not path and field.default_factory is None
            idle = here == ("coupling",) and "mechanics" not in data
            if implied is not None and not left_out and not idle:
                yield from _keys(root, implied, data, here)
            continue
        entries = [(*here, i) for i in range(len(value))] if isinstance(value, list) else [here]
        for entry in entries:
            inner = model_at(root, entry, data)
            if inner is not None:
                yield from _keys(root, inner, data, entry)


def _implied(field: FieldInfo) -> type[TableModel] | None:
    """Return the table that a case has without writing it, because it consists of defaults."""
    models = submodels(field.annotation)
    if len(models) != 1 or (field.default_factory is None and field.default is not None):
        return None
    whole = not any(inner.is_required() for inner in models[0].model_fields.values())
    return models[0] if whole else None


def _written(data: Mapping[str, Any], path: Keys) -> str:
    """Return a path as users write it: array entries by name where they have one."""
    parts: list[str | int] = []
    place: Any = data
    for part in path:
        inner = place.get(part, {}) if isinstance(place, Mapping) else place[part]
        name = inner.get("name") if isinstance(part, int) and isinstance(inner, Mapping) else None
        alone = isinstance(name, str) and [e.get("name") for e in place].count(name) == 1
        parts.append(name if alone and name and "." not in name else part)
        place = inner
    return dotted(tuple(parts))


Merge = Callable[[dict[str, Any], dict[str, Any], Keys], None]
_LAWS = "surface"  # array of the heat laws of a zone


def are_named(value: Any) -> bool:
    """Return whether a value is an array of tables that have names."""
    return (
        isinstance(value, list)
        and bool(value)
        and all(isinstance(entry, dict) for entry in value)
        and any("name" in entry for entry in value)
    )


def change(array: list[Any], given: Mapping[str, Any], path: Keys, merge: Merge) -> list[str]:
    """Change entries of an array; return the faults, one line each.

    Args:
        array: Array of tables at `path` of the case.
        given: The changed keys, by name or index of the entry.
        path: Path of the array.
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
