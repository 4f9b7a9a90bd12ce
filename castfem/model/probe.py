"""The array of tables [[output.probe]]: points of the section whose temperature is recorded."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from castfem.base.errors import InputError, choices
from castfem.base.quantities import Distance, Kind, Length
from castfem.base.types import Array
from castfem.base.units import nearest
from castfem.model.base import TableModel

if TYPE_CHECKING:
    from castfem.model.section import Section

Coordinate = Annotated[float, Kind("m", "mm")]


class Probe(TableModel):
    """A recorded point of the steel, like a thermocouple; given by x and y, or by a depth."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")
    """name of the probe and of its file, probes/NAME.csv"""
    x: Coordinate | None = Field(None, examples=["30 mm"])
    """coordinate on the undeformed section, from its middle"""
    y: Coordinate | None = Field(None, examples=["57.5 mm"])
    """likewise, with x"""
    under: str | None = Field(None, examples=["mid_face"])
    """place of the surface below which the probe lies, instead of x and y: mid_face, narrow_face,
    corner ... as in the columns of history.csv"""
    depth: Distance | None = Field(None, examples=["5 mm"])
    """depth below that place"""

    def place(self, lines: Mapping[str, tuple[Any, Any]]) -> Array:
        """Return its position on the undeformed section, x and y in m.

        Args:
            lines: For each place of the surface the two ends of the line from there inwards.

        Raises:
            InputError: The section has no such place, or is not as deep there.
        """
        if self.under is None:
            return np.array([self.x, self.y], dtype=float)
        if self.under not in lines:
            raise InputError(
                f'output.probe "{self.name}": under: no place "{self.under}" on this section; '
                f"allowed: {choices(list(lines))}{nearest(self.under, lines)}"
            )
        start, end = (np.asarray(at, float) for at in lines[self.under])
        length, depth = float(np.linalg.norm(end - start)), self.depth or 0.0
        if depth > length:
            raise InputError(
                f'output.probe "{self.name}": depth ({1e3 * depth:g} mm) is beyond the inner end '
                f"of the line there, at {1e3 * length:g} mm"
            )
        return np.asarray(start + depth / length * (end - start))


def outside(section: Section, name: str, place: Array) -> InputError:
    """Return the error for a probe outside the section."""
    x, y = 1e3 * place
    part = getattr(section, "symmetry", "whole")
    mirrored = part != "whole" and min(x, y) < 0.0
    fix = f"; the modelled part is a {part}: give its mirror image" if mirrored else ""
    round_ = ", whose corners are round" if getattr(section, "corner_radius", None) else ""
    return InputError(
        f'output.probe "{name}": x = {x:g}, y = {y:g} mm lies outside the section{round_}{fix}; '
        "under and depth, instead of x and y, place it below the surface"
    )


class Pyrometer(TableModel):
    """A fixed position at which the surface temperature of each passing slice is recorded."""

    name: str = Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,99}$")
    """its name in pyrometers.csv"""
    at: Length = Field(examples=["18.5 m"])
    """position, from the meniscus"""
    on: str = Field("mid_face", examples=["mid_face"])
    """place of the surface: mid_face, narrow_face, corner ... as in the columns of history.csv"""
