"""A case whose rolls bend and straighten the strand: coarse, solid, almost of one temperature."""

from __future__ import annotations

import copy
from typing import Any

from small_case import small

from castfem.model import Case

HALF = 0.05  # m: of the thickness
RADIUS = 5.0  # m: of the extrados
SEGMENT = {"rolls": 3, "pitch": "250 mm", "diameter": "120 mm"}
BENT = {
    "section.symmetry": "half",
    "section.corner_radius": "0 mm",
    "mesh": {"surface_size": "25 mm", "core_size": "25 mm"},
    "machine": {
        "first": "100 mm",
        "segment": [
            SEGMENT | {"rolls": 1},
            SEGMENT | {"rolls": 2, "radius": f"{RADIUS} m"},
            SEGMENT,
        ],
    },
    "mechanics": {"ferrostatic": "off", "liquid": "elastic"},
    "coupling": {"interval": "50 mm"},
    "output": {"figures": False, "fields": []},
    "cooling.0.surface": [
        {"law": "convection", "coefficient": "100 W/(m^2 K)", "ambient": "25 degC"}
    ],
    "cooling.0.name": "air",
    "casting": {"speed": "3.6 m/min", "length": "1.5 m", "temperature": "1200 degC"},
    "reference": [],
}


def bent(**changes: Any) -> Case:
    """A billet of 100 mm, 1.5 m through its rolls; `a__b=c` replaces what stands at a.b."""
    # A copy: what is replaced within a table must not stay in it.
    given = copy.deepcopy(BENT) | {key.replace("__", "."): value for key, value in changes.items()}
    return small(given)
