"""Blocks and walls for the tests of contact."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from mechanics import setups

from castfem.base.types import Array
from castfem.meshes import SectionMesh
from castfem.physics.contact.settings import Contact
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure, Traction
from castfem.physics.mould import Contour
from castfem.physics.mould.wall import GapFunction

PLANE_STRAIN = PlainPlanes(free=())


class LineWall:
    """A straight wall: one of its points and the angle of its normal (rad) over the position."""

    def __init__(self, point: Any, slope: Any = lambda z: 0.0, axis: int = 1) -> None:
        self.point, self.slope, self.axis = point, slope, axis

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        angle = self.slope(position)
        n = np.array([np.sin(angle), np.cos(angle)])
        if self.axis == 0:
            n = n[::-1]
        facing = normals @ n
        gap = np.where(facing > 1e-9, ((self.point(position) - points) @ n), np.inf)
        gap = gap / np.where(facing > 1e-9, facing, 1.0)
        return GapFunction(gap, np.where((facing > 1e-9)[:, None], n, normals))

    def temperature(self, position: float) -> float:
        return 400.0


class ContourWall:
    """A wall with the same segments at all positions."""

    def __init__(self, *segments: Any) -> None:
        self.contour = Contour(list(segments))

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        return self.contour.gap_function(points, normals)

    def temperature(self, position: float) -> float:
        return 400.0


def tapered_block(
    method: str,
    length: float = 1.0,
    stress: float = 1.0,
    cell: str = "quadrilateral",
    cells: int = 10,
    options: dict[str, Any] | None = None,
    **settings: Any,
) -> setups.SliceSetup:
    """Set up an elastic block of 20 x 20 mm into which a wall is pushed by 0.05 mm.

    The wall is tapered by 0.04 mm. Results are in multiples of `length` (m) and `stress` (Pa);
    `settings` changes the contact.
    """
    width, push, taper = 20e-3 / length, 0.05e-3 / length, 0.04e-3 / length
    # Rollers under the foot; sideways only the middle of the top is fixed.
    groups = ("left", "symmetry_y", "right", "top")
    mesh = setups.mapped(cells, cells, setups.box(width, width), cell, groups=groups)
    angle = -np.arctan(taper / width)
    wall = LineWall(lambda z: np.array([0.0, width - push * z]), lambda z: angle)
    contact = Contact(wall, ("top",), lambda time: time, method=method, **settings)
    return setups.SliceSetup(
        mesh,
        law=setups.elastic(40e9 / stress, 0.3),
        settings={"planes": PLANE_STRAIN, "interactions": (contact,)},
        options=options or {},
    )


class TwoWalls:
    """Two straight walls to the right of and above a corner, rotated by a small angle."""

    def __init__(self, corner: tuple[float, float], turn: float) -> None:
        self.corner, self.turn = np.array(corner), turn

    def gap_function(self, points: Array, normals: Array, position: float) -> GapFunction:
        c, s = np.cos(self.turn), np.sin(self.turn)
        right = normals[:, 0] > normals[:, 1]
        n = np.where(right[:, None], [c, s], [-s, c])
        # Through the middle of the side, so that half of the side penetrates the wall.
        foot = np.where(right[:, None], self.corner * [1.0, 0.5], self.corner * [0.5, 1.0])
        return GapFunction(
            np.einsum("ni,ni->n", foot - points, n) / np.einsum("ni,ni->n", n, normals), n
        )

    def temperature(self, position: float) -> float:
        return 400.0


FOOT = LineWall(lambda z: np.zeros(2), lambda z: np.pi)


def drawn_block(
    mesh: SectionMesh, contact: Contact, pressure: float, free: tuple[str, ...], large: bool = False
) -> setups.SliceSetup:
    """Set up a block of 40 GPa (groups left, foot, right, top) pressed on a wall along the strand.

    The strand is withdrawn along the wall, which gives axial friction.
    """
    return setups.SliceSetup(
        mesh,
        setups.elastic(40e9, 0.0),
        settings={
            "planes": PlainPlanes(free),
            "held": (PrescribedDisplacement(("left",), 0),),
            "loads": (SurfacePressure(("top",), lambda t: pressure),),
            "pin": False,
            "interactions": (contact,),
            "large_strain": large,
        },
        tolerance=1e-10,
    )


def dragged_block(
    mesh: SectionMesh,
    law: Any,
    contact: Contact,
    pressure: float,
    top: Callable[[float], float],
    shear: Callable[[float], float],
) -> setups.SliceSetup:
    """Set up a block (groups left, foot, right, top) pressed on a wall and dragged by its top.

    Its sides carry `shear` (Pa) over time: without lateral contraction the shear is uniform.
    """
    return setups.SliceSetup(
        mesh,
        law,
        settings={
            "planes": PLANE_STRAIN,
            "held": (PrescribedDisplacement(("top",), 0, lambda x, t: np.full(len(x), top(t))),),
            "loads": (
                SurfacePressure(("top",), lambda t: pressure),
                Traction(("right",), lambda t: (0.0, shear(t))),
                Traction(("left",), lambda t: (0.0, -shear(t))),
            ),
            "pin": False,
            "interactions": (contact,),
        },
        tolerance=1e-10,
    )
