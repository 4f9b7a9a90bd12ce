"""Faulty keys break no check of several keys: each is reported in one line."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import pytest

import castfem
from castfem.base.errors import InputError
from castfem.model.load import from_document

Path = tuple[str | int, ...]
LEFT_OUT = object()

VISCOUS: dict[str, Any] = {
    "law": "viscous", "stress": "20 kPa", "coefficient": 0.1, "yield_stress": "5 MPa",
    "speed": "50 mm/s", "exponent": 0.5,
}  # fmt: skip

FAULTS: list[tuple[str, Path, Any, str]] = [
    ("billet125/taper_1", ("mould", "friction"), {**VISCOUS, "stress": ""}, "friction.stress: "),
    ("slab1200/bulging", ("cooling", 0, "name"), LEFT_OUT, "cooling.0.name: is missing"),
    ("slab1200/bulging", ("cooling", 0, "surface"), "x", "cooling.0.surface .*must be a list"),
    ("slab1200/edges", ("secondary", "nozzle", 0, "table"), None, "or correlation is missing"),
    ("slab1200/edges", ("secondary", "circuit", 4, "flow"), None, "share is missing"),
    (
        "slab1200/imposed_axis", ("mechanics", "planes", "neutral_axis"), [1, 2],
        "neutral_axis: a single length is needed",
    ),
    ("slab1200/misaligned_48", ("machine", "rolls", "position", 6), "0 mm", "roll 7: position"),
]  # fmt: skip


def changed(document: dict[str, Any], path: Path, value: Any) -> dict[str, Any]:
    """Return a copy of a document with one value replaced or left out."""
    found = copy.deepcopy(document)
    table: Any = found
    for key in path[:-1]:
        table = table[key]
    if value is LEFT_OUT:
        del table[path[-1]]
    else:
        table[path[-1]] = value
    return found


def places(table: Any, above: Path = ()) -> Iterator[Path]:
    """Yield every key of a document, tables and lists included."""
    items = table.items() if isinstance(table, dict) else enumerate(table)
    for key, value in items:
        yield (*above, key)
        if isinstance(value, dict | list):
            yield from places(value, (*above, key))


@pytest.mark.parametrize(("name", "path", "value", "message"), FAULTS)
def test_fault_is_reported_in_one_line(name: str, path: Path, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        from_document(changed(castfem.load(name).document(), path, value))


def test_every_omitted_key_is_accepted_or_reported() -> None:
    document = castfem.load("billet125/taper_1").document()
    document["mould"]["friction"] = VISCOUS
    refused = 0
    for path in places(document):
        try:
            from_document(changed(document, path, LEFT_OUT))
        except InputError:
            refused += 1
    assert refused > 10
