"""A case that is cooled from roll to roll: a coarse half of a small slab between five rolls."""

from __future__ import annotations

import copy
from typing import Any

from small_case import small

from castfem.model import Case

SECONDARY: dict[str, Any] = {
    "ambient": "60 degC",
    "emissivity": 0.8,
    "run_off": "150 W/(m^2 K)",
    "contact": {"angle": "20 deg", "coefficient": "1200 W/(m^2 K)", "temperature": "150 degC"},
    "nozzle": [
        {"name": "flat", "angle": "120 deg", "angle_along": "20 deg", "correlation": "nozaki"}
    ],
    "circuit": [
        {
            "name": "all", "on": ["wide_face"], "rolls": [1, 5], "nozzle": "flat",
            "across": ["0 mm"], "stand_off": "100 mm", "flow": "20 L/min",
        }
    ],
}  # fmt: skip
ROLLED = {
    "title": "small slab from roll to roll",
    "section": {"shape": "rectangle", "width": "160 mm", "height": "60 mm", "symmetry": "half"},
    "mesh": {"surface_size": "5 mm", "core_size": "10 mm", "face_size": "20 mm"},
    "casting": {"speed": "1.5 m/min", "length": "1.2 m", "superheat": "20 K"},
    "machine": {
        "first": "300 mm",
        "segment": [{"rolls": 5, "pitch": "200 mm", "diameter": "120 mm"}],
    },
    "cooling.0.to": "250 mm",
    "secondary": SECONDARY,
    "thermal.time": {"step": "250 ms"},
    "output": {"figures": False, "fields": []},
    "reference": [],
}


def rolled(**changes: Any) -> Case:
    """Return the case of the slab; `a__b=c` replaces the value of a.b."""
    document = ROLLED | {key.replace("__", "."): value for key, value in changes.items()}
    return small(copy.deepcopy(document))


def secondary(**changes: Any) -> dict[str, Any]:
    """Return [secondary] of the slab with some keys replaced."""
    return {k: v for k, v in (SECONDARY | changes).items() if v is not None}


def circuit(**changes: Any) -> dict[str, Any]:
    """Return the circuit of the slab with some keys replaced."""
    return SECONDARY["circuit"][0] | changes
