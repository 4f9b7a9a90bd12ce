"""Keys of other tables that a shape of section does not know, and what becomes of inherited ones.

TOML has no null: what an extended file gives cannot be taken away.  So where a later layer (a
file that extends, `--set`, a script) gives another shape, keys of earlier layers that it does not
know are left out.  A key of the same layer, or a later one, was meant, and stays an error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from castfem.model.section import Section, Strip
from castfem.model.taper import PARTS

Keys = tuple[str, ...]


def unknown(shape: type[Section]) -> Iterator[Keys]:
    """Yield the keys beside [section] that a shape does not know, the taper's parts one by one."""
    if not shape.has_corner:
        yield "mesh", "corner_size"
    if shape is Strip:  # it has no mould at all
        return
    sizes = dict.fromkeys(size for kind in Section.kinds.values() for size in kind.mould_sizes)
    yield from (("mould", size) for size in sizes if size not in shape.mould_sizes)
    if shape.one_taper:
        yield from (("mould", "taper", part) for part in PARTS if part != "face")


def leave_out(
    before: Mapping[str, Any], after: dict[str, Any], inherited: Callable[[Keys], bool]
) -> tuple[str, ...]:
    """Take out of a document what a shape that has come does not know; return the dotted keys.

    Args:
        before: The tables of the earlier layers.
        after: The same with those of the new layer.
        inherited: Whether the value at a path of `after` comes from an earlier layer.
    """
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
