"""How keys, values and lists of names are worded in messages."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

Path = tuple[str | int, ...]


def dotted(path: Path) -> str:
    """Return the path as users write it: cooling.0.surface.1.law."""
    return ".".join(str(part) for part in path)


def shown(value: object) -> str:
    """Return a value as it stands in a TOML file, shortened."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        text = f'"{value}"'
    elif isinstance(value, Mapping):
        text = "{ " + ", ".join(f"{k} = {shown(v)}" for k, v in value.items()) + " }"
    elif isinstance(value, Sequence):
        text = "[" + ", ".join(shown(v) for v in value) + "]"
    else:
        text = str(value)
    return text if len(text) <= 60 else text[:56] + " ..."


def choices(names: Iterable[object]) -> str:
    """Return names as a list in a sentence."""
    return ", ".join(str(name) for name in names)
