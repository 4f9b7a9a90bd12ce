"""Reads tensile curves from a CSV file: temperature, strain rate, strain, stress per row.

The header names the columns, in any order, and their units:

    temperature [degC], strain rate [1/s], strain [percent], stress [MPa]

Lines that begin with # are skipped; a semicolon may separate the columns. Strain is the total axial
strain without thermal strain, stress the true axial stress.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from castfem.base.csv_files import Heading, UnreadableError, read_csv
from castfem.base.errors import InputError
from castfem.base.quantities import Kind
from castfem.base.types import Array
from castfem.base.units import nearest

Indices = npt.NDArray[np.intp]
COLUMNS = {
    "temperature": Kind("K", "degC", above=0.0),
    "strain rate": Kind("1/s", "1/s", above=0.0),
    "strain": Kind("1", label="strain", sample="0.01"),
    "stress": Kind("Pa", "MPa"),
}
HEADER = "temperature [degC], strain rate [1/s], strain [-], stress [MPa]"


@dataclass(frozen=True, slots=True)
class TensileData:
    """Points of tensile curves; all arrays are (n,)."""

    temperature: Array  #: temperatures, K; the mean for a group of tests
    rate: Array  #: strain rate, 1/s
    strain: Array  #: total axial strain
    stress: Array  #: axial stress, Pa
    name: str = "tensile curves"  #: their source

    @property
    def temperatures(self) -> Array:
        """Temperatures of the tests, increasing, K."""
        return np.unique(self.temperature)

    def select(self, chosen: Indices) -> TensileData:
        """Return the points with these indices."""
        return TensileData(
            self.temperature[chosen],
            self.rate[chosen],
            self.strain[chosen],
            self.stress[chosen],
            self.name,
        )

    def curves(self) -> list[Indices]:
        """Indices of the points of each curve (one temperature, one rate) by increasing strain."""
        groups = []
        for t in self.temperatures:
            here = np.flatnonzero(self.temperature == t)
            for rate in np.unique(self.rate[here]):
                one = here[self.rate[here] == rate]
                groups.append(one[np.argsort(self.strain[one], kind="stable")])
        return groups


def read_tensile(path: str | os.PathLike[str]) -> TensileData:
    """Read tensile curves."""
    source = Path(path)
    try:
        file = read_csv(source)
    except UnreadableError as error:
        raise InputError(f"{source}: {error}") from None
    if not file.headings:
        raise InputError(f"{source}: empty; its first line must be '{HEADER}'")
    places, units, problems = _header(f"{source}: line {file.line}", file.headings)
    if problems:
        raise InputError(problems)
    points = []
    for row in file.rows:
        try:
            points.append(_point(row.cells, places, units))
        except ValueError as error:
            problems.append(f"{source}: line {row.line}: {error}")
    listed = 10
    if len(problems) > listed:
        problems[listed:] = [f"{source}: {len(problems) - listed} more lines cannot be read"]
    if not problems and not points:
        problems.append(f"{source}: there is no row under the header")
    if problems:
        raise InputError(problems)
    temperature, rate, strain, stress = np.array(points).T
    # Tests within 1 K count as one temperature, within 2 % as one rate.
    return TensileData(
        _gathered(temperature, 1.0), np.exp(_gathered(np.log(rate), 0.02)),
        strain, stress, source.name,
    )  # fmt: skip


def _header(
    where: str, headings: tuple[Heading, ...]
) -> tuple[dict[str, int], dict[str, str], list[str]]:
    """Return index and unit of each column, and the faults of the header."""
    places: dict[str, int] = {}
    units: dict[str, str] = {}
    problems = []
    for place, heading in enumerate(headings):
        name = re.sub(r"[_\s]+", " ", heading.name).lower()
        if name not in COLUMNS:
            problems.append(
                f"{where}: unknown column '{heading.text}'; the columns are {HEADER}"
                f"{nearest(name, COLUMNS)}"
            )
        elif name in places:
            problems.append(f"{where}: the column '{name}' appears twice")
        else:
            places[name], units[name] = place, heading.unit
            problems += _unit_problem(where, name, units[name])
    missing = [name for name in COLUMNS if name not in places]
    if missing and not problems:
        problems.append(f"{where}: the column '{missing[0]}' is missing; the columns are {HEADER}")
    return places, units, problems


def _unit_problem(where: str, name: str, unit: str) -> list[str]:
    try:
        COLUMNS[name].read(_quantity("1", unit))
    except ValueError as error:
        return [f"{where}: column '{name}': {error}"]
    return []


def _quantity(cell: str, unit: str) -> str | float:
    return f"{cell} {unit}" if unit else float(cell)


def _point(cells: Sequence[str], places: dict[str, int], units: dict[str, str]) -> list[float]:
    """Return one row in SI, in the order of `COLUMNS`."""
    if len(cells) <= max(places.values()):
        raise ValueError(f"{len(cells)} cells, {len(places)} are needed")
    values = []
    for name, kind in COLUMNS.items():
        cell = cells[places[name]]
        try:
            number = float(cell)
        except ValueError:
            raise ValueError(f"{name} ('{cell}') is not a number") from None
        if not math.isfinite(number):
            raise ValueError(f"{name} ('{cell}') is not finite")
        try:
            values.append(kind.read(_quantity(repr(number), units[name])))
        except ValueError as error:
            raise ValueError(f"{name} ({cell}): {error}") from None
    return values


def _gathered(values: Array, apart: float) -> Array:
    """Return values in which neighbours closer than `apart` are replaced by their mean."""
    order = np.argsort(values, kind="stable")
    gaps = np.diff(values[order]) > apart
    group = np.concatenate([[0], np.cumsum(gaps)])
    means = np.bincount(group, values[order]) / np.bincount(group)
    gathered = np.empty_like(values)
    gathered[order] = np.round(means[group], 9)
    return gathered
