"""Crack risk along the strand: worst places, reheating, largest roll load, solidification end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_quantity import from_si
from castfem.base.shown_units import plain_unit
from castfem.base.types import Array
from castfem.physics.machine.stations import Stations
from castfem.runs.output.summary_file import Summary
from castfem.runs.output.surface_maps import DEPTHS, IN_BAND, SurfaceMap, SurfaceMaps
from castfem.runs.results.numbers import small_rate
from castfem.runs.results.roll_load import heaviest_roll
from castfem.runs.results.run_case import case_with


@dataclass(frozen=True, slots=True)
class CrackLimits:
    """Which places of the maps are reported."""

    little: float = 0.05  #: least share of the largest value
    #: relative difference of values that count as equal: the maps have single precision
    equal: float = 1e-6
    along: float = 0.5  #: distance below which places count as one if no rolls are known, m
    ranks: int = 4  #: number of worst places per index
    warmed: float = 5.0  #: least temperature rise that counts as reheating, K
    share: float = 1e-3  #: least percentage reported, %
    small: float = 1e-2  #: rate from which a number is printed without an exponent, 1/s


LIMITS = CrackLimits()
Ranked = tuple[str, str, str, str]
"""Index, value with unit, how far below the worst, and place."""
_NOT_RANKED = ("temperature", "band_time")
# the other indexes are related to I2 and have their worst value at the same place
_COMPARED = ("I1", "I2")


@dataclass(frozen=True, slots=True)
class Maximum:
    """The largest value of an index on one face within one stretch of a phase."""

    value: float  #: in SI
    row: int  #: row of the maps
    vertex: int
    phase: str  #: bending, straightening, ...
    face: str  #: intrados, extrados, ...


@dataclass(frozen=True, slots=True)
class Reheat:
    """The largest temperature rise of a place of the surface on its way down."""

    rise: float  #: K
    vertex: int  #: vertex of the maps
    coldest: int  #: rows between which it rose
    warmest: int


@dataclass(frozen=True)
class CrackReport:
    """Evaluation of the maps of a run."""

    maps: SurfaceMaps  #: the maps
    stations: Stations  #: its rolls

    @classmethod
    def of(cls, maps: SurfaceMaps) -> CrackReport:
        """Make the report from maps, with the rolls they contain."""
        return cls(maps, Stations.of_columns(**maps.heading.caster()))

    def indexes(self) -> tuple[str, ...]:
        """Names of the indexes that have a worst place."""
        return tuple(name for name in self.maps.names() if name not in _NOT_RANKED)

    @cached_property
    def phases(self) -> list[str]:
        """Treatment of the strand at each row (bending, straightening, ...)."""
        return [self.stations.phase(float(position)) for position in self.maps.position]

    def maxima(self, name: str) -> list[Maximum]:
        """The largest value of each face within each stretch of a phase, in descending order.

        Zero values are omitted. A misaligned roll also bends and straightens: its stretches are
        separate from those of bender and straightener. A place beside a worse one on another face
        or stretch is omitted, as it is the same place.
        """
        values, line = self.maps[name], self.maps.heading.line
        phases = np.array(self.phases)
        ends = np.flatnonzero(phases[1:] != phases[:-1]) + 1
        found = []
        for rows in np.split(np.arange(len(phases)), ends):
            for face, label in enumerate(line.faces):
                vertices = np.flatnonzero(line.face == face)
                part = values[np.ix_(rows, vertices)]
                if part.size and part.max() > 0.0:
                    i, j = _peak(part, line.place[vertices])
                    place = int(rows[i]), int(vertices[j])
                    found.append(Maximum(float(part.max()), *place, str(phases[rows[0]]), label))
        found.sort(key=lambda one: -one.value)
        kept: list[Maximum] = []
        for one in found:
            if one.value >= LIMITS.little * found[0].value and not any(
                self._beside(one, worse) for worse in kept
            ):
                kept.append(one)
        return kept

    def _beside(self, one: Maximum, other: Maximum) -> bool:
        """Whether two places count as one: less than two pitches and half a thickness apart.

        A value that a vertex keeps from an earlier row also counts as the same place.
        """
        if one.vertex == other.vertex and one.value == other.value:
            return True
        line, position = self.maps.heading.line, self.maps.position
        along = abs(float(position[one.row] - position[other.row]))
        around = abs(float(line.way[one.vertex] - line.way[other.vertex]))
        pitches = 2.0 * self.stations.longest_pitch or LIMITS.along
        return along < pitches and around < 0.5 * (self.stations.thickness or LIMITS.along)

    def reheat(self, start: float = 0.0) -> Reheat | None:
        """The largest reheating below a position (m); None where nothing warms up by 5 K."""
        rows = np.flatnonzero(self.maps.position >= start)
        if not rows.size:
            return None
        kelvin = self.maps["temperature"][rows]
        rise = kelvin - np.minimum.accumulate(kelvin, axis=0)
        end, vertex = (int(i) for i in np.unravel_index(int(np.argmax(rise)), rise.shape))
        if rise[end, vertex] < LIMITS.warmed:
            return None
        begin = int(np.argmin(kelvin[: end + 1, vertex]))
        return Reheat(float(rise[end, vertex]), vertex, int(rows[begin]), int(rows[end]))

    def words(self, one: Maximum) -> str:
        """Place, position, roll and phase of a maximum, in words."""
        place = self.maps.heading.line.words(one.vertex)
        when, where = (float(v[one.row]) for v in (self.maps.time, self.maps.position))
        return f"{place}, {self.stations.words(where, when)}"

    def reheats(self) -> Iterator[tuple[str, str]]:
        """The largest reheating on the whole way and below the mould's first roll, with places."""
        places, line = self.maps.position, self.maps.heading.line
        seen = None
        first = None if self.stations.rolls is None else self.stations.rolls.pairs[0].position
        for start, name in ((0.0, "largest reheat"), (first, "largest reheat below roll 1")):
            found = None if start is None else self.reheat(start)
            if found is None or found == seen:
                continue
            seen = found
            way = f"from {places[found.coldest]:.2f} to {places[found.warmest]:.2f} m"
            yield f"{name}, {found.rise:.0f} K", f"{line.words(found.vertex)}, {way}"

    def ranking(self) -> Iterator[Ranked]:
        """Index, value with unit, how far below the worst, and place, in descending order."""
        for one in self.maps.heading.maps:
            ranked = self.maxima(one.name)[: LIMITS.ranks] if one.name in self.indexes() else []
            places = [(found.value, self.words(found)) for found in ranked]
            yield from _ranked(one, places)


def _ranked(one: SurfaceMap, places: Sequence[tuple[float, str]]) -> Iterator[Ranked]:
    """Ranked rows from the values (SI) of an index and their places, in descending order."""
    if one.shown == "percent" and places and from_si(places[0][0], one.shown) < LIMITS.share:
        return
    for rank, (value, where) in enumerate(places):
        less = f"{100.0 * (value / places[0][0] - 1.0):.0f} %" if rank else "worst"
        size = from_si(value, one.shown)
        is_rate = one.shown == "1/s" and abs(size) < LIMITS.small
        number = small_rate(size, ".3g") if is_rate else f"{size:.3g}"
        shown = f"{number} {plain_unit(one.shown)}".removesuffix(" -")
        yield one.name if not rank else "", shown, less, where


def depth_ranking(maps: SurfaceMaps) -> Iterator[Ranked]:
    """Like `CrackReport.ranking`, for maps over the depth: the worst value of each line.

    The place is the line, the depth, and the slice's position when the value was reached.
    """
    line, stations = maps.heading.line, Stations.of_columns(**maps.heading.caster())
    for one in maps.heading.maps[1:]:
        values, places = maps[one.name], []
        for face, label in enumerate(line.faces):
            vertices = np.flatnonzero(line.face == face)
            row, column = _peak(values[:, vertices], line.place[vertices])
            if (value := float(values[row, vertices[column]])) > 0.0:
                where, when = float(maps.position[row]), float(maps.time[row])
                deep = f"{label}, {1e3 * line.way[vertices[column]]:.3g} mm deep"
                places.append((value, f"{deep}, {stations.words(where, when)}"))
        places.sort(key=lambda one: -one[0])
        name = f"{one.name}, inside"
        yield from _ranked(replace(one, name=name), places[: LIMITS.ranks])


def _peak(values: Array, places: Array) -> tuple[int, int]:
    """Row and column of the largest of non-negative values (rows, places).

    Of equal values, as on a uniformly strained face, the earliest is taken, then the place (x, y)
    of largest x, then y, as in the summary.
    """
    equal = values >= (1.0 - LIMITS.equal) * values.max()
    row = int(np.argmax(equal.any(axis=1)))
    columns = np.flatnonzero(equal[row])
    x, y = places[columns].T
    return row, int(columns[np.lexsort((y, x))[-1]])


def pool_end(summary: Summary, stations: Stations) -> Iterator[tuple[str, str]]:
    """Solid fraction on the centre line with positions, and where soft reduction belongs."""
    for name, quantity in summary.quantities.items():
        if name.startswith("pool_end_fs"):
            where = stations.words(quantity.value) if quantity.value > 0.0 else "at the meniscus"
            yield quantity.label, where
    solid, end = (summary.quantities.get(name) for name in ("centre_solid_fraction", "position"))
    if "pool_end_fs100" not in summary.quantities and solid is not None and end is not None:
        yield (
            "end of the pool",
            f"not before the end of the run, {end.value:.2f} m: there the solid fraction is "
            f"{solid.value:.2g} on the centre line",
        )
    reduced = summary.quantities.get("soft_reduction")
    length = summary.quantities.get("soft_reduction_length")
    if length is not None and length.value > 0.0:
        words = f"{length.value:.2f} m, {length.label.partition(', ')[2]}"
        if reduced is not None:
            words += f"; the rolls take {1e3 * reduced.value:.2f} mm off there"
        yield "soft reduction", words


@dataclass(frozen=True, slots=True)
class CrackPlaces:
    """Evaluation of the maps of a run's surface."""

    #: index, value with unit, how far below the worst, and place, in descending order
    ranking: Sequence[Ranked]
    nowhere: str  #: why there is no ranking; empty otherwise
    #: subject and place of the largest roll load, reheating and the end of the liquid core
    others: Sequence[tuple[str, str]]
    title: str  #: title of `others`
    largest: Mapping[str, float] = field(default_factory=dict)  #: largest value of each index, SI

    @property
    def worst(self) -> Iterator[str]:
        """The worst places of I1 and I2, in words."""
        for name, value, _, where in self.ranking:
            if name in _COMPARED:
                yield f"{name} {value}, {where}"


def crack_places(folder: Path, summary: Summary | None) -> CrackPlaces | None:
    """Evaluate the maps of a run; None without maps."""
    if not SurfaceMaps.exist(folder):
        return None
    report = CrackReport.of(SurfaceMaps(folder))
    ranking = list(report.ranking())
    if SurfaceMaps.exist(folder, DEPTHS):
        ranking += depth_ranking(SurfaceMaps(folder, DEPTHS))
    low, high = (f"{end - ZERO_CELSIUS:.4g}" for end in report.maps.heading.band)
    nowhere = ""
    if report.indexes() and not ranking and report.maps[IN_BAND].any():
        nowhere = "nowhere so far: no index is above 0 (low ductility is between "
        nowhere += f"{low} and {high} degC)"
    elif report.indexes() and not ranking:
        nowhere = f"nowhere so far: the surface was never between {low} and {high} degC, "
        nowhere += "where ductility is low"
    rolls = [*heaviest_roll(folder, report.stations), *report.reheats()]
    pool = [] if summary is None else list(pool_end(summary, report.stations))
    title = "Rolls, reheat, end of the pool" if pool else "Rolls and reheat"
    largest = {name: float(report.maps[name].max()) for name in report.indexes()}
    return CrackPlaces(ranking, nowhere, [*rolls, *pool], title, largest)


def defects_of(folder: Path) -> str:
    """Defects of the machine of a run's case, in words; "" without any."""
    case = case_with(folder, "defect")
    found = None if case is None or case.machine is None else case.machine.defect
    return "; ".join(str(one).rstrip(",") for one in found or ())
