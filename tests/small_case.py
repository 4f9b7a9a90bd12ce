"""A case that runs in a fraction of a second: a coarse quarter billet, temperatures alone."""

from __future__ import annotations

from pathlib import Path

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


def write_small(folder: Path, name: str = "small.toml") -> Path:
    """Write the case into a folder."""
    path = folder / name
    path.write_text(SMALL)
    return path
