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
STOP: dict[str, Any] = {
    "time": ["0 s", "1 s", "1.1 s", "2 s", "2.1 s", "4 s"],
    "speed": ["3.6 m/min", "3.6 m/min", "0 m/min", "0 m/min", "3.6 m/min", "3.6 m/min"],
    "superheat": None, "mould_heat": [1.0, 1.0, 0.9, 0.9, 1.0, 1.0], "event": None,
}  # fmt: skip
"""The strand stops for a second, and is withdrawn again."""
STRAINED: dict[str, Any] = {
    "mechanics": {"law": "norton_hoff_kozlowski"}, "mould": {"length": "100 mm"}, "mesh.order": 2,
    "cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)",
    "coupling": {"interval": "15 mm", "passes": 2},
    "caster.spacing": "60 mm", "casting.length": "100 mm",
}  # fmt: skip
"""Changes for the small billet with mechanics, in a mould that it leaves."""


def caster(
    changes: Mapping[str, Any] | None = None, plant: Mapping[str, Any] | None = None
) -> Case:
    """Return the small billet as a caster; `plant` replaces columns of PLANT, None removes one."""
    columns = {name: cells for name, cells in {**PLANT, **(plant or {})}.items() if cells}
    defaults = {
        "casting.length": "200 mm",
        "thermal.time": {"adaptive": {"tolerance": "1 K", "first": "20 ms"}},
        "reference": [],
        "caster": {"plant": columns, "spacing": "40 mm", "every": "0.5 s"},
    }
    return small({**defaults, **(changes or {})})
