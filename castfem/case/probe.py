"""The array of tables [[output.probe]]: points of the section that are followed."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from castfem.case.base import TableModel
from castfem.values.quantities import Distance, Kind

Coordinate = Annotated[float, Kind("m", "mm")]


class Probe(TableModel):
    """A point of the steel that is followed, as a thermocouple would; x and y, or a depth."""

    name: str = Field(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]*$",
        description="name of the probe and of its file, probes/NAME.csv",
    )
    x: Coordinate | None = Field(
        None, description="place on the undeformed section, from its middle", examples=["30 mm"]
    )
    y: Coordinate | None = Field(None, description="likewise, with x", examples=["57.5 mm"])
    under: str | None = Field(
        None,
        description="place of the surface below which it lies, instead of x and y: mid_face, "
        "narrow_face, corner ... as in the columns of history.csv",
        examples=["mid_face"],
    )
    depth: Distance | None = Field(
        None, description="how deep below it, with under", examples=["5 mm"]
    )
