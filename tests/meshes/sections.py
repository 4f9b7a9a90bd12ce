"""Parameters of the sections that the tests mesh, lengths in m."""

from __future__ import annotations

from typing import Any

Parameters = dict[str, Any]

BILLET: Parameters = {
    "shape": "rectangle",
    "width": 0.125,
    "height": 0.125,
    "surface_size": 0.001,
    "corner_size": 0.001,
    "face_size": 0.006,
    "core_size": 0.008,
}
ROUNDED: Parameters = BILLET | {"corner_radius": 0.005}
SLAB: Parameters = BILLET | {
    "width": 0.6,
    "height": 0.22,
    "corner_radius": 0.004,
    "surface_size": 0.002,
    "corner_size": 0.002,
    "face_size": 0.02,
    "core_size": 0.015,
}
ROUND: Parameters = {
    "shape": "round",
    "diameter": 0.2,
    "surface_size": 0.002,
    "face_size": 0.006,
    "core_size": 0.01,
}
BEAM: Parameters = {
    "shape": "beam_blank",
    "width": 0.48,
    "height": 0.42,
    "web_thickness": 0.12,
    "flange_thickness": 0.09,
    "root_thickness": 0.12,
    "fillet_radius": 0.05,
    "shoulder_radius": 0.025,
    "corner_radius": 0.015,
    "surface_size": 0.003,
    "corner_size": 0.003,
    "face_size": 0.012,
    "core_size": 0.015,
}
STRIP: Parameters = {
    "shape": "strip",
    "length": 0.1,
    "width": 0.01,
    "surface_size": 0.001,
    "core_size": 0.004,
}

FAMILIES: dict[str, Parameters] = {
    "sharp": BILLET,
    "rounded": ROUNDED,
    "slab": SLAB,
    "round": ROUND,
    "beam": BEAM,
}
"""Sections with two planes of symmetry, by a short name."""
