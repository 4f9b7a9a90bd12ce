"""Cases that run in a fraction of a second: a coarse quarter billet and a strip, without stress."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from castfem.model import Case

SMALL = """
title = "coarse billet"

[casting]
speed = "3.6 m/min"
length = "60 mm"
superheat = "40 K"

[steel]
name = "carbon_042"

[section]
shape = "rectangle"
width = "100 mm"
height = "100 mm"
corner_radius = "5 mm"
symmetry = "quarter"

[mesh]
surface_size = "4 mm"
corner_size = "4 mm"
face_size = "10 mm"
core_size = "12 mm"

[[cooling]]
name = "mould"

[[cooling.surface]]
law = "contact"
coefficient = "1600 W/(m^2 K)"
wall = "160 degC"

[thermal.time]
step = "50 ms"

[output]
every = "0.5 s"
figures = false

[[reference]]
quantity = "surface_temperature_mid_face"
value = "1400 degC"
source = "somebody"
"""


STRIP = """
title = "strip that is cooled at one end"

[casting]
speed = "1 m/min"
length = "10 mm"
temperature = "1520 degC"

[steel]
name = "carbon_042"

[section]
shape = "strip"
length = "10 mm"
width = "2 mm"

[mesh]
surface_size = "1 mm"
core_size = "2 mm"

[[cooling]]
name = "chill"

[[cooling.surface]]
law = "flux"
value = "1 MW/m^2"

[output]
figures = false
"""


def write_small(folder: Path, name: str = "small.toml") -> Path:
    """Write the billet into a folder."""
    path = folder / name
    path.write_text(SMALL)
    return path


def small(changes: Mapping[str, Any] | None = None) -> Case:
    """Return the billet, changed: dotted key to its new value."""
    return _changed(SMALL, changes or {})


def strip(changes: Mapping[str, Any] | None = None) -> Case:
    """Return the strip, changed: dotted key to its new value."""
    return _changed(STRIP, changes or {})


def _changed(text: str, changes: Mapping[str, Any]) -> Case:
    from castfem.model.load import from_document

    data = tomllib.loads(text)
    for key, value in changes.items():
        *tables, last = key.split(".")
        place: Any = data
        for name in tables:
            place = place[int(name)] if name.isdigit() else place.setdefault(name, {})
        place[last] = value
    return from_document(data)
