"""Rigid moulds: wall contours, taper along the mould, and the gap to them.

numpy only; the hot copper tube, which is a finite-element model, is `castfem.physics.mould.hot`.

Lengths in m, tapers in 1/m (1 %/m is 0.01), temperatures in K.

    mould = Mould(RectangleCavity(0.125, 0.125, 0.005), 0.6, same(Taper.single(0.01, 0.6)))
    gap = mould.gap_function(points, normals, position=0.3).gap
"""

from __future__ import annotations

from castfem.physics.mould.cavity import (
    Cavity,
    FreeCavity,
    RectangleCavity,
    RoundCavity,
    Sides,
    Tapers,
    circle,
    rectangle,
    same,
)
from castfem.physics.mould.contour import Contour
from castfem.physics.mould.displaced import DisplacedMould, WallDisplacement
from castfem.physics.mould.mould import Expansion, Mould, Zone
from castfem.physics.mould.segments import Circular, Parabolic, Segment, Straight
from castfem.physics.mould.taper import Displaced, Taper, TaperProfile, TaperSegment, taper_between
from castfem.physics.mould.wall import GapFunction, PlaneWall, Wall

__all__ = [
    "Cavity",
    "Circular",
    "Contour",
    "Displaced",
    "DisplacedMould",
    "Expansion",
    "FreeCavity",
    "GapFunction",
    "Mould",
    "Parabolic",
    "PlaneWall",
    "RectangleCavity",
    "RoundCavity",
    "Segment",
    "Sides",
    "Straight",
    "Taper",
    "TaperProfile",
    "TaperSegment",
    "Tapers",
    "Wall",
    "WallDisplacement",
    "Zone",
    "circle",
    "rectangle",
    "same",
    "taper_between",
]
