"""A case whose rolls bend and straighten the strand: coarse, solid, almost of one temperature."""

from __future__ import annotations

import copy
from typing import Any

from small_case import small

from castfem.model import Case

HALF = 0.05  # m: half of the thickness
RADIUS = 5.0  # m: radius of the extrados
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
    """Return a billet of 100 mm, 1.5 m through its rolls; `a__b=c` replaces the value of a.b."""
    # A copy: a value that is replaced in a nested table must not remain in BENT.
    document = copy.deepcopy(BENT) | {k.replace("__", "."): value for k, value in changes.items()}
    return small(document)
