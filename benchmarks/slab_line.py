"""What either code finds of the thermal slab on its way down the caster, to be compared."""

from __future__ import annotations

from dataclasses import dataclass

from castfem.base.types import Array


@dataclass(frozen=True, slots=True)
class SlabLine:
    """What a run gives at the end of each step, and what it took.

    Attributes:
        position: Below the meniscus (n,), m.
        mid_face: Surface of the intrados there, degC.
        corner: Likewise.
        heat: Removed from the whole section, MJ/m.
        vertices: Unknowns.
        newton: Newton iterations.
        seconds: Processor time.
    """

    position: Array
    mid_face: Array
    corner: Array
    heat: Array
    vertices: int
    newton: int
    seconds: float
