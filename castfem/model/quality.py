"""The table [quality]: by what the strand is judged, its crack indexes and the end of its pool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Field

from castfem.base.quantities import Kind, Notation
from castfem.model.base import TableModel, written

if TYPE_CHECKING:
    from castfem.model.case import Case


@dataclass(frozen=True, slots=True)
class Range(Notation):
    """Annotation of a field that takes a range: its lower and its upper end."""

    kind: Kind  #: of both ends
    example: str  #: a range as it may be written

    def described(self, example: object = None) -> str:
        """See `Notation.described`."""
        return f"range of {self.kind.name}: lower and upper end"

    def read(self, given: object) -> tuple[float, float]:
        """Return both ends in SI, or raise ValueError."""
        if isinstance(given, str) or not isinstance(given, Sequence) or len(given) != 2:
            raise ValueError(f"a range is its lower and its upper end, such as {self.example}")
        low, high = (self.kind.read(end) for end in given)
        if not low < high:
            raise ValueError(f"[{given[0]}, {given[1]}]: the lower end comes first")
        return low, high

    def write(self, value: tuple[float, float]) -> list[str | float]:
        """Return what reads back to the same range."""
        return [self.kind.write(end) for end in value]

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        return {
            "type": "array",
            "items": self.kind.json_schema(),
            "minItems": 2,
            "maxItems": 2,
        }


TEMPERATURE = Kind("K", "degC", sample="800 degC", label="temperature")
SOLID_FRACTION = Kind("1", least=0.0, most=1.0, label="solid fraction", sample="0.9")
TEMPERATURES = Range(TEMPERATURE, '["800 degC", "950 degC"]')
SOLID_FRACTIONS = Range(SOLID_FRACTION, "[0.9, 0.99]")
STRAIN = Kind("1", above=0.0, label="strain", sample="0.004")


class Quality(TableModel):
    """By what the strand is judged: crack indexes, end of the pool, soft reduction."""

    band: Annotated[tuple[float, float], TEMPERATURES] = written(["800 degC", "950 degC"])  # type: ignore[arg-type]
    """temperatures between which the steel has little ductility, of I1 and I2"""
    brittle: Annotated[tuple[float, float], SOLID_FRACTIONS] = written([0.9, 0.99])  # type: ignore[arg-type]
    """solid fractions between which the mushy zone tears, of `brittle_strain`"""
    critical_strain: Annotated[float, STRAIN] | None = Field(None, examples=["0.4 percent"])
    """strain in the brittle range from which on the steel tears; left out: none is known, and no
    share of it is told"""
    soft_reduction: Annotated[tuple[float, float], SOLID_FRACTIONS] = written([0.3, 0.7])  # type: ignore[arg-type]
    """solid fractions on the centre line between which reduction closes segregation"""


def band_of(case: Case) -> tuple[float, float]:
    """Temperatures between which the steel of a case has little ductility, K."""
    return (case.quality or Quality.model_validate({})).band
