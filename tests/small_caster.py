"""A small caster through a slow-down: speed, superheat and heat of the mould change."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from small_case import small

if TYPE_CHECKING:
    from castfem.model import Case

PLANT: dict[str, Any] = {
    "time": ["0 s", "4 s", "5 s", "9 s"],
    "speed": ["3.6 m/min", "3.6 m/min", "1.2 m/min", "2 m/min"],
    "superheat": ["40 K", "40 K", "20 K", "20 K"],
    "mould_heat": [1.0, 1.0, 0.8, 0.8],
    "event": ["", "ladle change", "", ""],
}


def caster(
    changes: Mapping[str, Any] | None = None, plant: Mapping[str, Any] | None = None
) -> Case:
    """The small billet as a caster; columns of `plant` replace those above, None leaves one out."""
    columns = {name: cells for name, cells in {**PLANT, **(plant or {})}.items() if cells}
    usual = {
        "casting.length": "200 mm",
        "thermal.time": {"adaptive": {"tolerance": "1 K", "first": "20 ms"}},
        "reference": [],
        "caster": {"plant": columns, "spacing": "40 mm", "every": "0.5 s"},
    }
    return small({**usual, **(changes or {})})
