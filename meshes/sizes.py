"""The named lengths that grade a mesh, and the checks every builder makes on its parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from castfem.meshes.assemble import MULTIPLICITY
from castfem.meshes.grading import SizeLaw, size_law

MOST_CELLS = 2_000_000
"""A mesh of more cells is refused: a slice of a strand needs far fewer."""

SMALLEST_RADIUS = 1e-5
"""A radius below this, m, is refused."""

CELLS = ("quadrilateral", "triangle")


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of cells, m."""

    surface_size: float  #: size normal to the surface, at it
    core_size: float  #: size in the core
    corner_size: float  #: size along the surface, on convex corners; by default `surface_size`
    face_size: float  #: size along the surface, mid-face; by default `core_size`
    surface_depth: float  #: depth over which the sizes at the surface are kept
    #: Depth at which the core size is reached; by default the half thickness. The sizes in between
    #: form a geometric progression whose ratio is at most 1.3.
    core_depth: float

    def inward(self, coarse: float | None = None) -> SizeLaw:
        """Law from the surface inwards, up to `coarse` (by default the core size)."""
        coarse = self.core_size if coarse is None else coarse
        return size_law(self.surface_size, coarse, self.surface_depth, self.core_depth)

    def along(self, coarse: float | None = None) -> SizeLaw:
        """Law along the surface from a corner, up to `coarse` (by default the face size)."""
        coarse = self.face_size if coarse is None else coarse
        return size_law(self.corner_size, coarse, self.surface_depth, self.core_depth)


def check_sizes(
    half_thickness: float,
    longest: float,
    *,
    surface_size: float,
    core_size: float,
    corner_size: float | None = None,
    face_size: float | None = None,
    surface_depth: float = 0.0,
    core_depth: float | None = None,
) -> Sizes:
    """Fill in the defaults and refuse sizes that cannot be meshed.

    Args:
        half_thickness: Half the smallest thickness of the section, m: limits sizes and depths.
        longest: Half the largest dimension of the section, m: limits the size along faces.
        surface_size: See `Sizes`.
        core_size: See `Sizes`.
        corner_size: See `Sizes`.
        face_size: See `Sizes`.
        surface_depth: See `Sizes`.
        core_depth: See `Sizes`.

    Raises:
        ValueError: A size is not positive, larger than the section, or in the wrong order.
    """
    corner = surface_size if corner_size is None else corner_size
    face = core_size if face_size is None else face_size
    depth = half_thickness if core_depth is None else core_depth
    check_length("surface_size", surface_size, half_thickness, "half the thickness")
    check_length("core_size", core_size, longest, "half the section")
    check_length("corner_size", corner, longest, "half the section")
    check_length("face_size", face, longest, "half the section")
    check_length("core_depth", depth, longest, "half the section")
    if surface_depth != 0.0:
        check_length("surface_depth", surface_depth, depth, "core_depth")
    for low, small, high, large in (
        ("surface_size", surface_size, "core_size", core_size),
        ("corner_size", corner, "face_size", face),
    ):
        if small > large * (1.0 + 1e-12):
            raise ValueError(
                f"{low} ({_mm(small)}) is larger than {high} ({_mm(large)}): cells grow from the "
                f"surface to the core and from the corner to the middle of a face; raise {high} "
                f"or lower {low}"
            )
    return Sizes(surface_size, core_size, corner, face, float(surface_depth), depth)


def check_length(
    name: str, value: object, most: float = math.inf, what: str = "", zero: bool = False
) -> float:
    """Return a length, m, if it is a finite positive number not above `most`.

    Raises:
        ValueError: It is not; the message names it, its value and what is allowed.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise ValueError(f"{name} must be a length in metres, not {value!r}")
    least = "0 or more" if zero else "more than 0"
    if not math.isfinite(value) or value < 0.0 or (value == 0.0 and not zero):
        raise ValueError(f"{name} = {_mm(value)} is impossible: it must be {least}")
    if value > most * (1.0 + 1e-12):
        raise ValueError(
            f"{name} = {_mm(value)} is larger than {what} ({_mm(most)}): choose at most that"
        )
    return float(value)


def check_radius(name: str, value: object) -> float:
    """Return a radius, m, if it can be meshed.

    Raises:
        ValueError: It is not a positive length or too small.
    """
    radius = check_length(name, value)
    if radius < SMALLEST_RADIUS:
        raise ValueError(
            f"{name} = {_mm(radius)} is too small to mesh: choose at least {_mm(SMALLEST_RADIUS)}"
            + (", or 0 for a sharp corner" if name == "corner_radius" else "")
        )
    return radius


def check_choices(cell: str, order: int, symmetry: str | None) -> None:
    """Refuse unknown kinds of cell, orders and symmetries.

    Raises:
        ValueError: Names the parameter and the choices.
    """
    if cell not in CELLS:
        raise ValueError(f"cell = {cell!r} is unknown: choose one of {', '.join(CELLS)}")
    if order not in (1, 2) or isinstance(order, bool):
        raise ValueError(f"order = {order!r} is not available: choose 1 or 2")
    if symmetry is not None and symmetry not in MULTIPLICITY:
        raise ValueError(
            f"symmetry = {symmetry!r} is unknown: choose one of {', '.join(MULTIPLICITY)}"
        )


def check_count(cells: float, quarters: int = 1) -> None:
    """Refuse a mesh of too many cells before it is built.

    Args:
        cells: Cells of the quarter (an estimate will do).
        quarters: How many quarters are modelled.

    Raises:
        ValueError: There are more than `MOST_CELLS`.
    """
    if cells * quarters > MOST_CELLS:
        raise ValueError(
            f"the sizes ask for about {cells * quarters:.3g} cells, more than {MOST_CELLS:.3g}: "
            "raise surface_size, corner_size, face_size or core_size"
        )


def _mm(value: float) -> str:
    return f"{1e3 * value:.6g} mm"
