"""Tables of rolls: pairs from columns or a CSV file, and back."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from castfem.base.csv_files import UnreadableError, read_csv
from castfem.base.quantities import Kind
from castfem.base.units import nearest
from castfem.physics.machine.line import FACES, Face
from castfem.physics.machine.rolls import Pair, Rolls

STRAIGHT = "straight"
KINDS: dict[str, Kind] = {
    "position": Kind("m", "m", least=0.0),
    "diameter": Kind("m", "mm", above=0.0),
    "aperture": Kind("m", "mm", above=0.0),
    "radius": Kind("m", "m", above=0.0),
    "capacity": Kind("N", "kN", least=0.0, label="force", sample="120 kN"),
}
RADII = tuple(f"radius_{face}" for face in FACES)
COLUMNS = ("position", "diameter", "aperture", *RADII, "driven", "capacity", "side")
_OF_EDGE = ("position", "diameter", "aperture")  # columns of a pair at the narrow faces
_HEADER = "position [m], diameter [mm], aperture [mm], radius_extrados [m], driven, capacity [kN]"
_YES, _NO = ("yes", "true", "1"), ("no", "false", "0", "")


def read_rolls(given: Mapping[str, Any]) -> Rolls:
    """Return the rolls from a file, `{ file = "rolls.csv" }`, or from columns.

    Raises:
        ValueError: A file, a column or a cell is invalid; the message names file and row.
    """
    if "file" in given:
        if len(given) > 1:
            raise ValueError("a table with a file takes no other key")
        return _from_file(Path(str(given["file"])))
    columns = {key: value for key, value in given.items() if not key.endswith("_unit")}
    for name, cells in columns.items():
        if isinstance(cells, str) or not isinstance(cells, Sequence):
            raise ValueError(f"'{name}' must be a list of values")
    for key in given:
        if key.endswith("_unit") and key.removesuffix("_unit") not in columns:
            raise ValueError(f"unknown key '{key}'{nearest(key, columns)}")
    units = {name: str(given.get(f"{name}_unit", "")) for name in columns}
    count = len(next(iter(columns.values()), ()))
    return _from_columns(columns, units, ("",) * count)


def _from_file(path: Path) -> Rolls:
    try:
        file = read_csv(path)
    except UnreadableError as error:
        raise ValueError(f"'{path}': {error}") from None
    if not file.rows:
        raise ValueError(
            f"'{path}' has no rolls; it needs a header and one row per pair: {_HEADER}"
        )
    width = len(file.headings)
    for row in file.rows:
        if len(row.cells) != width:
            raise ValueError(
                f"'{path}' line {row.line}: {len(row.cells)} cells, the header has {width}; write "
                "an empty cell for a missing value"
            )
    names = [heading.name for heading in file.headings]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise ValueError(f"'{path}' line {file.line}: column '{twice}' appears twice")
    columns = {name: [row.cells[i] for row in file.rows] for i, name in enumerate(names)}
    units = {heading.name: heading.unit for heading in file.headings}
    places = tuple(f"'{path}' line {row.line}, " for row in file.rows)
    try:
        return _from_columns(columns, units, places)
    except _ColumnError as error:
        raise ValueError(f"'{path}' line {file.line}: {error}") from None


class _ColumnError(ValueError):
    """A whole column, not a row, is invalid."""


def _from_columns(
    columns: Mapping[str, Sequence[Any]], units: Mapping[str, str], places: tuple[str, ...]
) -> Rolls:
    """Return the rolls; `units` are those of plain numbers, `places` those of the rows."""
    radius = _known(columns, units)
    found: dict[bool, tuple[list[Pair], list[str]]] = {False: ([], []), True: ([], [])}
    for i, place in enumerate(places):
        cells = {name: (cells[i], units.get(name, "")) for name, cells in columns.items() if cells}
        try:
            edge = _at_edge(cells)
        except ValueError as error:
            raise ValueError(f"{place}row {i + 1}: {error}") from None
        pairs, named = found[edge]
        named.append(f"{place}{'edge ' if edge else ''}roll {len(pairs) + 1}")
        try:
            pairs.append(_pair(cells, radius))
        except ValueError as error:
            raise ValueError(f"{named[-1]}: {error}") from None
    face: Face = "extrados" if radius is None else FACES[RADII.index(radius)]
    (wide, wide_places), (narrow, narrow_places) = found[False], found[True]
    if not wide:
        raise ValueError("no rolls of the wide faces; rolls at the narrow faces need them")
    edges = Rolls(tuple(narrow), places=tuple(narrow_places)) if narrow else None
    return Rolls(tuple(wide), face, tuple(wide_places), edges)


def _at_edge(cells: Mapping[str, tuple[Any, str]]) -> bool:
    """Whether a row is a pair at the narrow faces, which has only a position and sizes."""
    side = str(cells["side"][0]).strip() if "side" in cells else ""
    if side not in ("", "wide", "narrow"):
        raise ValueError(f"side ({side}): wide, as without it, or narrow")
    if side != "narrow":
        return False
    for name, (cell, _) in cells.items():
        of_others = name not in (*_OF_EDGE, "side") and str(cell).strip().lower()
        if of_others and of_others not in (*_NO, STRAIGHT, "inf", "-"):
            raise ValueError(f"{name} ({cell}): of a roll at the narrow face; leave the cell empty")
    return True


def _known(columns: Mapping[str, Sequence[Any]], units: Mapping[str, str]) -> str | None:
    """Check names and units of the columns; return the name of the radius, None without one."""
    for name in columns:
        if name == "radius":
            raise _ColumnError(
                f"column 'radius': say which face it is for: {', '.join(RADII)} (a radius of the "
                "centreline taken for that of the extrados is half the thickness off)"
            )
        if name not in COLUMNS:
            raise _ColumnError(
                f"unknown column '{name}'; allowed: {', '.join(COLUMNS)}{nearest(name, COLUMNS)}"
            )
    for name in ("driven", "side"):
        if units.get(name):
            raise _ColumnError(
                f"column '{name}' holds words and has no unit; leave out {units[name]}"
            )
    for name in ("position", "diameter"):
        if name not in columns:
            raise _ColumnError(f"column '{name}' is missing; an example header: {_HEADER}")
    given = [name for name in RADII if name in columns]
    if len(given) > 1:
        raise _ColumnError(f"{' and '.join(given)}: give the radius of one face")
    lengths = {name: len(cells) for name, cells in columns.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{n} of {name}" for name, n in lengths.items())
        raise _ColumnError(f"columns differ in length: {listed}")
    if not lengths["position"]:
        raise _ColumnError("no rolls; a machine without rolls needs no [machine]")
    return given[0] if given else None


def _pair(cells: Mapping[str, tuple[Any, str]], radius: str | None) -> Pair:
    def quantity(name: str, kind: str = "") -> float:
        return _quantity(name, *cells[name], KINDS[kind or name])

    def given(name: str) -> bool:
        return name in cells and cells[name][0] not in ("", None)

    driven = _flag(cells["driven"][0]) if "driven" in cells else False
    if given("capacity") and not driven and quantity("capacity") > 0.0:
        raise ValueError("capacity: of a roll that is not driven; set driven to yes, or leave it")
    straight = radius is None or not given(radius) or cells[radius][0] in (STRAIGHT, "inf", "-")
    return Pair(
        quantity("position"),
        quantity("diameter"),
        math.inf if straight or radius is None else quantity(radius, "radius"),
        quantity("aperture") if given("aperture") else None,
        driven,
        quantity("capacity") if given("capacity") and driven else None,
    )


def _quantity(name: str, cell: Any, unit: str, kind: Kind) -> float:
    """Read a cell, in the unit of its column if it has none."""
    text = str(cell).strip()
    try:
        if not text:
            raise ValueError("is empty")
        try:
            bare = math.isfinite(float(text))
        except ValueError:
            bare = False
        if bare and not unit:
            raise ValueError(f"name the unit of the column, {name} [{kind.shown}]")
        return kind.read(f"{text} {unit}" if bare else text)
    except ValueError as error:
        raise ValueError(f"{name} ({text}): {error}") from None


def _flag(cell: Any) -> bool:
    text = str(cell).strip().lower()
    if text not in (*_YES, *_NO):
        raise ValueError(f"driven ({text}): yes or no")
    return text in _YES


def columns_of(rolls: Rolls) -> dict[str, Any]:
    """Return the columns from which `read_rolls` reads the same rolls, without their defects.

    A roll where the strand is bent the other way has no radius that a file may contain: left out.
    """
    narrow = () if rolls.edges is None else rolls.edges.pairs
    pairs, radius = (*rolls.pairs, *narrow), KINDS["radius"]
    found: dict[str, Any] = {
        name: [KINDS[name].write(getattr(pair, name)) for pair in pairs]
        for name in ("position", "diameter")
    }
    for name in ("aperture", "capacity"):
        values = [getattr(pair, name) for pair in pairs]
        if any(value is not None for value in values):
            found[name] = ["" if v is None else KINDS[name].write(v) for v in values]
    found[f"radius_{rolls.face}"] = [
        radius.write(pair.radius) if 0.0 < pair.radius < math.inf else STRAIGHT for pair in pairs
    ]
    if any(pair.driven for pair in pairs):
        found["driven"] = [pair.driven for pair in pairs]
    if narrow:
        found["side"] = ["wide"] * len(rolls.pairs) + ["narrow"] * len(narrow)
    return found
