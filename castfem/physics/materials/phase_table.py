"""Tables of phases and heat of a steel over temperature, from a thermodynamic database.

`castfem.physics.materials.calphad` computes it; a run stores it beside its case as CSV. The first
lines of the file, "# name: value", give its origin. The rows follow with rising temperature: a
repeated temperature is a jump, its colder side first. Values are linear between the rows.

`PhaseTable` has the interface of the built-in iron-carbon diagram, on which conductivity, density
and contraction depend. These distinguish liquid, delta ferrite and austenite: as in the diagram,
ferrite below austenite (alpha), carbides and other phases count as austenite in
`PhaseTable.phases`, with the total carbon of all of them. `PhaseTable.fraction` distinguishes them.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array, Indices
from castfem.physics.materials.iron_carbon import Phases, Side

FRACTIONS = ("liquid", "delta", "gamma", "alpha", "carbides", "others")
CARBON = ("carbon_liquid", "carbon_delta", "carbon_gamma")
HEAT = ("enthalpy", "specific_heat")
UNITS = {
    "temperature": "degC", "enthalpy": "J/kg", "specific_heat": "J/(kg K)",
    **dict.fromkeys(FRACTIONS, "1"), **dict.fromkeys(CARBON, "wt%"),
}  # fmt: skip
HEADER = ("database", "version", "sha256", "licence", "composition", "freezing", "phases", "by")
FORMAT = "castfem phases 1"


@dataclass(frozen=True, slots=True)
class Scheil:
    """Freezing without diffusion in the solid, except of carbon."""

    #: mass fraction of liquid at which the path ends: the rest freezes at that temperature
    end: float = 0.01
    #: whether carbon is in equilibrium between liquid and solid (back diffusion); otherwise it
    #: stays
    carbon_diffuses: bool = True

    def __str__(self) -> str:
        """The text in the header of a table."""
        carbon = "diffuses" if self.carbon_diffuses else "stays"
        return f"Scheil to {self.end:g} liquid, carbon {carbon}"


@dataclass(frozen=True, slots=True)
class Request:
    """Request of a case for a database."""

    file: str  #: a database (.tdb), or a table that was computed from one (.csv)
    #: names of phases in the database; empty for the usual ones of steel
    phases: tuple[str, ...] = ()
    scheil: Scheil | None = None  #: None for equilibrium

    @property
    def freezing(self) -> str:
        """Kind of freezing in the header of a table."""
        return "equilibrium" if self.scheil is None else str(self.scheil)


def written(composition: Mapping[str, float]) -> str:
    """A composition in wt% as in the header of a table, "C 0.17, Mn 0.8"."""
    return ", ".join(f"{e} {w:g}" for e, w in sorted(composition.items()) if w > 0.0)


@dataclass(frozen=True, eq=False)
class PhaseTable:
    """Mass fractions, carbon and heat over temperature.

    Raises:
        ValueError: The columns do not form such a table.
    """

    #: origin of the table, see `HEADER`; may contain `outside`, contents beyond the stated range of
    #: the database
    header: Mapping[str, str]
    temperature: Array  #: rows (n,), K, rising; a repeated temperature is a jump
    #: `FRACTIONS` (sum 1), `CARBON` (wt%, NaN where the phase is absent), and `HEAT` (J/kg, 0 in
    #: the first row; J/(kg K), without transformations), (n,) each. `carbon_gamma` is that of all
    #: solid except delta ferrite
    columns: Mapping[str, Array]

    def __post_init__(self) -> None:
        for text in self._faults():
            raise ValueError(text)

    def _faults(self) -> list[str]:
        t, step = self.temperature, np.diff(self.temperature)
        shares = np.array([self.columns[name] for name in FRACTIONS])
        heat = np.array([self.columns[name] for name in HEAT])
        faults = [f'its header has no "{name}"' for name in HEADER if name not in self.header]
        if len(t) < 2 or not (np.isfinite(t).all() and np.isfinite(heat).all()):
            return [
                *faults,
                "it needs two rows at least, with temperature, enthalpy, specific heat",
            ]
        if step.min() < 0.0 or (len(t) > 2 and (step[1:] + step[:-1]).min() <= 0.0):
            faults.append("its temperatures must increase; one may appear twice, at a jump")
        if not (shares.min() >= 0.0 and np.abs(shares.sum(axis=0) - 1.0).max() < 1e-4):
            faults.append("the fractions of its phases must lie between 0 and 1 and sum to 1")
        if not (np.diff(heat[0]).min() > 0.0 and heat[1].min() > 0.0):
            faults.append(
                "its enthalpy must increase with temperature, its specific heat be positive"
            )
        liquid = shares[0]
        if not (liquid[0] == 0.0 and liquid[-1] == 1.0):
            faults.append("it must go from solid in the first row to liquid in the last")
        return faults

    @property
    def source(self) -> str:
        """Origin of the table, one line."""
        h = self.header
        return f"{h['database']}, version {h['version']}, {h['freezing']}; {h['licence']}"

    @cached_property
    def carbon(self) -> float:
        """Carbon content of the steel, wt%."""
        amounts = dict(one.split() for one in self.header["composition"].split(", ") if one)
        return float(amounts.get("C", 0.0))

    @cached_property
    def liquidus(self) -> float:
        """Temperature at which the last solid melts on heating, K."""
        return float(self.temperature[self.columns["liquid"] >= 1.0][0])

    @cached_property
    def solidus(self) -> float:
        """Temperature below which no liquid is left, K."""
        return float(self.temperature[self.columns["liquid"] <= 0.0][-1])

    @cached_property
    def gamma_start(self) -> float | None:
        """Temperature at which delta begins to turn to gamma on cooling, K; None without either."""
        both = self.columns["delta"].any() and self.columns["gamma"].any()
        return float(self.temperature[self.columns["gamma"] > 0.0][-1]) if both else None

    @cached_property
    def gamma_end(self) -> float | None:
        """Temperature below which no delta is left, K; None if there is none, or if it stays."""
        delta = self.columns["delta"]
        left = not delta.any() or delta[0] > 0.0
        return None if left else float(self.temperature[np.flatnonzero(delta)[0] - 1])

    @cached_property
    def reactions(self) -> tuple[float, ...]:
        """Temperatures at which the fractions jump, K."""
        return tuple(map(float, self.temperature[1:][np.diff(self.temperature) == 0.0]))

    @cached_property
    def kinks(self) -> tuple[float, ...]:
        """Temperatures at which a phase appears or vanishes, K, increasing."""
        there = np.array([self.columns[name] > 0.0 for name in FRACTIONS])
        between = there[:, 1:] | there[:, :-1]
        changes = self.temperature[1:-1][(between[:, 1:] != between[:, :-1]).any(axis=0)]
        return tuple(sorted({*map(float, changes), *self.reactions}))

    @cached_property
    def _rest(self) -> Array:
        """Fraction of the phases that count as austenite in `phases`."""
        return np.sum([self.columns[name] for name in FRACTIONS[2:]], axis=0)

    def _at(self, temperature: npt.ArrayLike, side: Side) -> tuple[Indices, Array]:
        """Row below each temperature, and relative position up to the next, 0 to 1 inside."""
        t, rows = np.asarray(temperature, float), self.temperature
        below = np.searchsorted(rows, t, "right" if side == "above" else "left") - 1
        below = np.clip(below, 0, len(rows) - 2)
        return below, (t - rows[below]) / (rows[below + 1] - rows[below])

    def value(self, name: str, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """A column at temperatures in K (any shape), in its unit.

        Beyond the rows the enthalpy continues with its last slopes; all else is constant.
        """
        below, place = self._at(temperature, side)
        if name != "enthalpy":
            place = np.clip(place, 0.0, 1.0)
        column = self._rest if name == "rest" else self.columns[name]
        with np.errstate(invalid="ignore"):
            return np.asarray(column[below] + place * (column[below + 1] - column[below]))

    def fraction(self, name: str, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Mass fraction of one of `FRACTIONS` at temperatures in K (any shape)."""
        return self.value(name, temperature, side)

    def phases(self, temperature: npt.ArrayLike, side: Side = "above") -> Phases:
        """See `IronCarbon`; phases other than liquid and delta ferrite count as austenite."""
        parts = [self.value(name, temperature, side) for name in ("liquid", "delta", "rest")]
        carbon = [
            np.where(part > 0.0, self.value(name, temperature, side), np.nan)
            for part, name in zip(parts, CARBON, strict=True)
        ]
        return Phases(*parts, *carbon)

    def to_text(self) -> str:
        """The table as CSV."""
        names = ("temperature", *HEAT, *FRACTIONS, *CARBON)
        lines = [f"# {FORMAT}", *(f"# {key}: {value}" for key, value in self.header.items())]
        lines.append(",".join(f"{name} [{UNITS[name]}]" for name in names))
        columns = {"temperature": self.temperature - ZERO_CELSIUS, **self.columns}
        for row in zip(*(columns[name] for name in names), strict=True):
            cells = ("" if np.isnan(value) else f"{value:.9g}" for value in row)
            lines.append(",".join(cells))
        return "\n".join(lines) + "\n"


def read(text: str) -> PhaseTable:
    """Read a table written by `PhaseTable.to_text`.

    Raises:
        ValueError: It is not a table, or has been changed.
    """
    lines = text.splitlines()
    if not lines or lines[0] != f"# {FORMAT}":
        raise ValueError(f'is not a table of phases; its first line must be "# {FORMAT}"')
    notes = [line[2:].partition(": ") for line in lines[1:] if line.startswith("# ")]
    header = {key: value for key, _, value in notes}
    head, *rows = csv.reader(io.StringIO("\n".join(line for line in lines if line[:1] != "#")))
    names = [cell.partition(" [")[0] for cell in head]
    if [f"{name} [{UNITS.get(name)}]" for name in names] != head or set(names) != set(UNITS):
        raise ValueError("the names or units of its columns have been changed")
    try:
        cells = np.array([[float(cell or "nan") for cell in row] for row in rows], float)
        columns = dict(zip(names, cells.T, strict=True))
    except ValueError:
        raise ValueError("a row is incomplete or has a cell that is not a number") from None
    temperature = columns.pop("temperature") + ZERO_CELSIUS
    return PhaseTable(MappingProxyType(header), temperature, MappingProxyType(columns))


@dataclass(frozen=True, slots=True)
class TableCurve:
    """A column of a table of phases as a property of the steel."""

    table: PhaseTable
    name: str  #: name of the column
    curved: bool = True
    span: tuple[float, float] = (0.0, np.inf)

    @property
    def kinks(self) -> tuple[float, ...]:
        """Kinks of the phases."""
        return self.table.kinks

    @property
    def jumps(self) -> tuple[float, ...]:
        """Jumps of the phases."""
        return self.table.reactions

    def __call__(self, temperature: npt.ArrayLike, side: Side = "above") -> Array:
        """Values at temperatures in K."""
        return self.table.value(self.name, temperature, side)
