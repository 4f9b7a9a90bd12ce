"""A tensile test of a constitutive law: the kind of case with a table [tensile]."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PlainValidator, WithJsonSchema

from castfem.base.errors import grouped
from castfem.base.quantities import Kind, Percent, Time
from castfem.base.table_notation import Curve
from castfem.base.tables import Table, Tabled
from castfem.model.base import Faults, TableModel, is_path, written
from castfem.model.casting import Reference
from castfem.model.checks.registry import check_test

TABLE = "tensile"
SAME = 1e-6  # K
_NOT_PHYSICS: Any = {"title": True, "output": True, "reference": True}


def _at_least_one(count: int) -> int:
    if count < 1:
        raise ValueError("must be at least 1")
    return count


def _named_or_table(value: Any) -> Any:
    if isinstance(value, str) or (isinstance(value, dict) and value):
        return value
    raise ValueError("must be the name of a set, a file, or a table with the keys of such a file")


Material = Annotated[
    str | dict[str, Any],
    PlainValidator(_named_or_table),
    WithJsonSchema({"type": ["string", "object"]}),
]
StrainRate = Annotated[float, Kind("1/s", "1/s", label="strain rate", sample="1e-3 1/s")]
Expansion = Annotated[float, Kind("1/K", "1/K", least=0.0)]
TemperatureOfTime = Annotated[Tabled, Curve(Kind("K", "degC"), "time")]
YoungOfTemperature = Annotated[
    Tabled,
    Curve(Kind("Pa", "GPa", above=0.0, label="Young's modulus", sample="20 GPa"), "temperature"),
]
PoissonOfTemperature = Annotated[
    Tabled,
    Curve(Kind("1", least=0.0, most=0.499, label="Poisson's ratio", sample="0.3"), "temperature"),
]


class Segment(TableModel):
    """A part of the test with a constant strain rate."""

    rate: StrainRate
    """axial strain rate; negative for compression or unloading, 0 for a hold"""
    duration: Time = Field(examples=["10 s"])
    """duration of the segment"""


class Tensile(TableModel):
    """A tensile test instead of a strand; besides it only title, references and `output.figures`.

    A bar with free sides is strained axially in segments of constant rate.
    """

    material: Material
    """constitutive law: a shipped set, a TOML file of your own, or the table [tensile.material]
    with the content of such a file (docs/laws.md)"""
    carbon: Percent | None = Field(None, examples=[0.1])
    """carbon content of the steel in weight percent, for laws that depend on it"""
    elasticity: str = "elastic_steel"
    """elastic law: a shipped set, or a TOML file of your own"""
    young: YoungOfTemperature | None = None
    """Young's modulus, instead of that of the set"""
    poisson: PoissonOfTemperature | None = None
    """Poisson's ratio, instead of that of the set"""
    temperature: TemperatureOfTime = Field(examples=["1100 degC"])
    """temperature of the bar; a table over time counts from the start, or from the start of each
    cycle"""
    expansion: Expansion = written("0 1/K")
    """mean thermal expansion coefficient from the start temperature; the segments give the total
    strain, and the law the rest after thermal strain"""
    steps: Annotated[int, AfterValidator(_at_least_one)] = Field(200, strict=True)
    """time steps in each segment"""
    segment: tuple[Segment, ...] = Field(min_length=1)
    """parts of the test, in order"""
    cycles: Annotated[int, AfterValidator(_at_least_one)] = Field(1, strict=True)
    """number of repetitions of the segments and the temperature"""


class TensileOutput(TableModel):
    """Output of a tensile test."""

    figures: bool = Field(True, strict=True)
    """draw the figure at the end of the run"""


class TensileCase(TableModel):
    """A case file with the table [tensile] instead of a strand."""

    title: str = Field(min_length=1)
    """one line that says what the case is"""
    tensile: Tensile
    output: TensileOutput = Field(default_factory=lambda: TensileOutput.model_validate({}))
    reference: tuple[Reference, ...] = ()

    def document(self) -> dict[str, Any]:
        """Return the case as the tables of a case file, every quantity with its unit."""
        tables = self.model_dump(mode="json", exclude_none=True)
        if not tables["reference"]:
            del tables["reference"]
        return tables

    def resolved_toml(self) -> str:
        """Return a case file without `extends` that reads back to an equal case."""
        import tomli_w

        return tomli_w.dumps(self.document())

    def physics_hash(self) -> str:
        """Return a hash of all input of the results; property files count by content."""
        physics = self.model_dump(mode="json", exclude_none=True, exclude=_NOT_PHYSICS)
        table = physics[TABLE]
        for key in ("material", "elasticity"):
            name = table[key]
            if isinstance(name, str) and is_path(name):
                path = Path(name)
                content = path.read_bytes() if path.is_file() else b""
                table[key] = hashlib.sha256(content).hexdigest()
        return hashlib.sha256(json.dumps(physics, sort_keys=True).encode()).hexdigest()[:16]


@check_test("tensile")
def _too_many(case: TensileCase, table: Tensile) -> Faults:
    """Report more steps than a test could ever finish."""
    count = table.steps * table.cycles * len(table.segment)
    most = 1_000_000  # some ten minutes
    if count > most:
        key = "cycles" if table.cycles > table.steps else "steps"
        fix = f"at most {grouped(most)}: give fewer"
        yield key, f"({getattr(table, key)}) makes {grouped(count)} steps of the test; {fix}"


@check_test("tensile")
def _comes_back(case: TensileCase, table: Tensile) -> Faults:
    """Report a temperature that differs at the end of a cycle from its start."""
    if table.cycles == 1 or not isinstance(table.temperature, Table):
        return
    end = sum(part.duration for part in table.segment)
    change = table.temperature(end) - table.temperature(0.0)
    if abs(change) > SAME:
        fix = f"with cycles = {table.cycles} it must come back"
        yield "temperature", f"ends a cycle of {end:g} s {change:+.4g} K from where it began; {fix}"
