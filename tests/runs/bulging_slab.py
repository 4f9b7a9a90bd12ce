"""A slab whose wide faces bulge between three pairs of rolls, and the state of its rolls."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from runs.billet_runs import Kept
from small_case import small

from castfem.model import Case
from castfem.physics.contact.roll_support import RollSupportState
from castfem.runs.results.sample import Sample

ROLLS = (0.9, 1.1, 1.3)  # m
SLAB: dict[str, Any] = {
    "casting": {
        "speed": "1.2 m/min", "length": "1.35 m", "superheat": "20 K",
        "start": {"at": "mould_exit"},
    },
    "section.width": "400 mm",
    "section.height": "100 mm",
    "section.corner_radius": "0 mm",
    "section.symmetry": "half",
    "mesh": {"surface_size": "8 mm", "face_size": "40 mm", "core_size": "12 mm"},
    "cooling": [
        {"name": "mould", "to": "850 mm", "surface": [
            {"law": "contact", "coefficient": "1200 W/(m^2 K)", "wall": "160 degC"}]},
        {"name": "spray", "surface": [
            {"law": "convection", "coefficient": "400 W/(m^2 K)", "ambient": "25 degC"}]},
    ],
    "machine": {"rolls": {
        "position": [f"{place} m" for place in ROLLS],
        "diameter": ["120 mm"] * 3,
        "aperture": ["100 mm", "99.8 mm", "99.7 mm"],
    }},
    "mechanics": {"law": "kozlowski_zhu_signed", "bulging": "creep"},
    "coupling": {"interval": "50 mm"},
    "thermal": {"time": {"step": "0.5 s"}},
    "output": {"figures": False, "fields": []},
    "reference": [],
}  # fmt: skip


def slab(**changes: object) -> Case:
    """Return a slab of 400 x 100 mm on three pairs of rolls; `a__b=c` replaces the value of a.b."""
    replaced = {key.replace("__", "."): value for key, value in changes.items()}
    table = deepcopy(SLAB) | replaced
    return small({key: value for key, value in table.items() if value is not None})


def rolls_of(sample: Sample) -> RollSupportState:
    mechanical = sample.state.mechanical
    return next(one for one in mechanical.interactions if isinstance(one, RollSupportState))


def below(kept: Kept, position: float) -> Sample:
    """Return the first sample below a position, m."""
    return next(s for s in kept.samples if s.position > position + 1e-6)
