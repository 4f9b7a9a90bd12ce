"""The table [quality]: crack indexes, end of the liquid core, soft reduction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from castfem.base.named_columns import Columns, grid_of, rows_of
from castfem.base.quantities import Kind, Length, Notation
from castfem.base.table_notation import schema_of_columns
from castfem.model.base import TableModel, written

if TYPE_CHECKING:
    from castfem.physics.materials.ductility import Ductility


@dataclass(frozen=True, slots=True)
class Range(Notation):
    """Annotation of a field that takes a range: its lower and upper ends."""

    kind: Kind  #: quantity of both ends
    example: str  #: example of a range in a case file

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


STRAIN_RATE = Kind("1/s", "1/s", above=0.0, label="rate of strain", sample="1e-3 1/s")
AREA = Kind("1", above=0.0, most=0.99, label="reduction of area", sample="40 percent")
_BY_STRAIN, _BY_AREA = "critical_strain", "reduction_of_area"
_COLUMNS = Columns(
    {"temperature": TEMPERATURE, "strain_rate": STRAIN_RATE, _BY_STRAIN: STRAIN, _BY_AREA: AREA},
    {"temperature": "temperature_unit", "strain_rate": "strain_rate_unit"},
    "table of ductility",
    f"temperature [degC], strain_rate [1/s], and {_BY_STRAIN} or {_BY_AREA} [percent]",
    optional=(_BY_STRAIN, _BY_AREA),
)


@dataclass(frozen=True, slots=True)
class DuctilityTable(Notation):
    """Annotation of a field that takes the ductility of a grade: a CSV file, or columns."""

    takes: str = 'CSV file `{ file = "ductility.csv" }`, or its columns'

    def read(self, given: object) -> Ductility | None:
        """Return the table, or raise ValueError."""
        if given is None:
            return None
        from castfem.physics.materials.ductility import Ductility

        if isinstance(given, Ductility):
            return given
        if not isinstance(given, Mapping):
            fix = f'{{ file = "ductility.csv" }} with {_COLUMNS.header}'
            raise ValueError(f"a table is needed, {fix}")
        return _COLUMNS.read_by_name(given, _ductility)

    def write(self, value: Ductility | None) -> Any:
        """Return what reads back to the same table."""
        if value is None:
            return None
        rows = rows_of((value.temperatures, value.rates, value.strains))
        kinds = list(_COLUMNS.kinds.items())[:3]
        return {n: [kind.write(row[i]) for row in rows] for i, (n, kind) in enumerate(kinds)}

    def json_schema(self) -> dict[str, Any]:
        """See `Notation.json_schema`."""
        ways = [
            way
            for value in (_BY_STRAIN, _BY_AREA)
            for way in schema_of_columns(
                ("temperature", "strain_rate", value), tuple(_COLUMNS.units.values())
            )
        ]
        return {"anyOf": ways, "description": "ductility of a grade, from a file"}


def _ductility(columns: dict[str, list[Any]], places: Sequence[str]) -> Ductility:
    """Return the table from rows of temperature and rate in any order."""
    import numpy as np

    from castfem.physics.materials.ductility import Ductility, fracture_strain

    if (_BY_STRAIN in columns) == (_BY_AREA in columns):
        raise ValueError(f"give one of the columns {_BY_STRAIN} and {_BY_AREA}")
    strain = columns.get(_BY_STRAIN)
    values = np.array(strain) if strain else fracture_strain(np.array(columns[_BY_AREA]))
    rows = np.column_stack([columns["temperature"], columns["strain_rate"], values])
    kinds = tuple(_COLUMNS.kinds.values())
    found = Ductility(*grid_of(rows, places, kinds, "temperature and rate"))
    if len(found.temperatures) < 2:
        raise ValueError("at least two temperatures are needed")
    return found


FEEDING = 0.4
"""Solid fraction above which liquid must be drawn between the crystals [Clyne1981]."""
Criterion = Literal["won", "clyne_davies", "rdg"]


class Feeding(TableModel):
    """Feeding of the mushy zone, for the criterion "rdg"."""

    viscosity: Annotated[float, Kind("Pa s", "Pa s", above=0.0)] = written("6.3e-3 Pa s")
    """viscosity of the liquid between the crystals"""
    shrinkage: Annotated[float, Kind("1", above=0.0)] | None = Field(None, examples=["4 percent"])
    """relative loss of volume on freezing; left out: from the densities at solidus and liquidus"""
    arm_spacing: Length | None = Field(None, examples=["120 um"])
    """secondary dendrite arm spacing; left out: from carbon content and cooling rate [Won2001]"""
    cavitation: Annotated[float, Kind("Pa", "kPa", above=0.0)] = written("2 kPa")
    """pressure drop at which the liquid cavitates"""


class CriticalStrain(TableModel):
    """Critical strain of the brittle range, factor/(rate^m width^n), for the criterion "won"."""

    factor: Annotated[float, Kind("1", above=0.0)] = 0.02821
    """factor, for a rate in 1/s and a width of the range in K [Won2000]"""
    rate_exponent: Annotated[float, Kind("1", least=0.0)] = 0.3131
    """exponent m of the strain rate; with both exponents 0 the factor is the critical strain itself
    """
    range_exponent: Annotated[float, Kind("1", least=0.0)] = 0.8638
    """exponent n of the width of the range"""


class Quality(TableModel):
    """Quality criteria: crack indexes, end of the liquid core, soft reduction."""

    band: Annotated[tuple[float, float], TEMPERATURES] = written(["800 degC", "950 degC"])  # type: ignore[arg-type]
    """temperature range of low ductility, for I1 and I2"""
    brittle: Annotated[tuple[float, float], SOLID_FRACTIONS] = written([0.9, 0.99])  # type: ignore[arg-type]
    """solid fractions between which the mushy zone is brittle, for `brittle_strain`"""
    critical_strain: Annotated[float, STRAIN] | None = Field(None, examples=["0.4 percent"])
    """strain in the brittle range at which the steel cracks; left out: strains are not related to
    one"""
    soft_reduction: Annotated[tuple[float, float], SOLID_FRACTIONS] = written([0.3, 0.7])  # type: ignore[arg-type]
    """solid fractions on the centre line between which soft reduction counteracts segregation"""
    hot_tearing: tuple[Criterion, ...] | None = Field(None, examples=[["won", "clyne_davies"]])
    """hot tearing criteria evaluated in the brittle range over the whole section
    (docs/hot_tearing.md); left out: none"""
    won: CriticalStrain | None = None
    """critical strain for the criterion "won"; left out: that of the paper"""
    rdg: Feeding | None = None
    """feeding of the mushy zone for the criterion "rdg"; left out: its defaults"""
    ductility: Annotated[Any, DuctilityTable()] = Field(None, examples=[{"file": "ductility.csv"}])
    """critical strain of the grade over temperature and strain rate, with which the strain of the
    surface is compared; left out: `band` alone tells where the steel is brittle"""
