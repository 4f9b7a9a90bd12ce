"""Build the secondary cooling of each face by position, and its changes in time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.model.build.cooling import water_supply
from castfem.model.heat_law import no_emissivity
from castfem.model.water import largest
from castfem.physics.machine.machine import over_time
from castfem.physics.machine.spray_layout import Kind, Row, Stretch, footprint
from castfem.physics.thermal.boundary import Cooling, Surface
from castfem.physics.thermal.flux_laws import Convection, Radiation, SurfaceLaw
from castfem.physics.thermal.spray_correlations import WATER_DENSITY
from castfem.physics.thermal.spray_flux import RollShare, Share, SprayWater, water_across

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.secondary import Circuit
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel


def rows_of(case: Case) -> tuple[Row, ...]:
    """Return the rows of nozzles of a sound case with [secondary]."""
    rolls = None if case.machine is None else case.machine.pairs()
    assert case.secondary is not None and rolls is not None
    rows = case.secondary.rows(rolls, case.section.height)  # type: ignore[attr-defined]
    for defect in case.machine.defect or ():  # type: ignore[union-attr]
        rows = defect.watered(rows)
    return rows


class SecondaryCooling:
    """Cooling from roll to roll.

    Args:
        case: Sound case with [secondary].
        machine: Positions and times of the slice.
        steel: Steel, with the emissivity if the case has none.
        surface: Perimeter shares of the section's boundary groups.
        start: Start of this cooling, from the meniscus, m.
        rows: Rows of nozzles; by default those of the case
            (`castfem.physics.machine.spray_layout.scale_water` changes the water of some).
        beside: Cooling of another slice, whose case differs only in speed, water and start: shared
            data.

    Attributes:
        positions: Positions where something changes, from `start` on, m.
        coolings: The cooling from each of these positions on.
    """

    def __init__(
        self,
        case: Case,
        machine: Machine,
        steel: Steel,
        surface: Surface,
        start: float,
        rows: tuple[Row, ...] | None = None,
        beside: SecondaryCooling | None = None,
    ) -> None:
        supply = water_supply(case, steel, surface.section)
        table = case.secondary
        assert table is not None
        self._table = table
        self.positions: list[float]
        self.coolings: list[Cooling]
        self._radiation, self._run_off = self._radiates(steel), None
        if table.run_off is not None:
            self._run_off = Convection(table.run_off, table.water_temperature)
        flows = {one.name: supply.flow(one) for one in table.circuit}
        self._most = {name: largest(flow) for name, flow in flows.items()}
        self._flows = {name: over_time(flow, machine) for name, flow in flows.items()}
        self._coefficients = {
            one.name: table.model_of(one).coefficient(table.water_temperature)
            for one in table.circuit
        }
        self._met: list[_Met]
        self._met = self._meets(case, machine, surface, rows) if beside is None else beside._met
        faces = [_Face(self, met) for met in self._met]
        places = [stretch.start for met in self._met for stretch in met.stretches]
        self.positions, self.coolings = [], []
        for position in _apart([start, *(p for p in places if start < p < case.casting.length)]):
            cooling = _cooling(surface, faces, position)
            if not self.coolings or not _same(cooling, self.coolings[-1]):
                self.positions.append(position)
                self.coolings.append(cooling)

    def _meets(
        self, case: Case, machine: Machine, surface: Surface, rows: tuple[Row, ...] | None
    ) -> list[_Met]:
        """Data of each boundary group along the machine; see `SecondaryCooling` for the rows."""
        table, rolls = self._table, None if case.machine is None else case.machine.pairs()
        assert rolls is not None
        rows = rows_of(case) if rows is None else rows
        circuits = {circuit.name: circuit for circuit in table.circuit}
        end = max(case.casting.length, table.contacts(rolls)[-1][1] + 1.0)
        found = []
        for name in surface.section.outer_groups:
            mine, met = table.on_face(name, rolls, rows, machine.inclination, end)
            tag = surface.section.groups.index(name)
            space, dofs = surface.section.vertex_space, surface.patch([tag]).dofs
            across = 0 if name.startswith("wide_face") else 1
            places = space.tabulate_dof_coordinates()[dofs, across]
            sprayed = {
                i: self._row(mine[i], circuits[mine[i].circuit], places)
                for i in {i for stretch in met for i in stretch.rows}
            }
            found.append(_Met(tag, met, sprayed))
        return found

    def _radiates(self, steel: Steel) -> Radiation:
        table = self._table
        if lack := no_emissivity(table.emissivity, steel):
            raise InputError(f"secondary: {lack}")
        emissivity = steel.emissivity if table.emissivity is None else table.emissivity
        return Radiation(emissivity, table.ambient)

    @property
    def changes(self) -> list[float]:
        """Times at which the slope of the water flow changes, s."""
        return [kink for flow in self._flows.values() for kink in flow.kinks]

    def roll_contact(
        self, length: float, pitch: Sequence[tuple[float, tuple[SurfaceLaw, ...]]]
    ) -> SurfaceLaw | None:
        """Heat to a roll along a length of contact, m; None without contact."""
        contact = self._table.contact
        if contact is None:
            return None
        if contact.share is None:
            assert contact.coefficient is not None and contact.temperature is not None
            return Convection(contact.coefficient, contact.temperature)
        along: dict[int, tuple[float, SurfaceLaw]] = {}
        for part, laws in pitch:
            for law in laws:
                along[id(law)] = (along.get(id(law), (0.0, law))[0] + part, law)
        return RollShare(contact.share, length, tuple(along.values()))

    def open_laws(self, kind: Kind, water: SurfaceLaw | None) -> tuple[SurfaceLaw, ...]:
        """The laws where the strand touches no roll."""
        found: list[SurfaceLaw] = [self._radiation]
        if kind == "run_off":
            assert self._run_off is not None
            found.append(self._run_off)
        return tuple(found) if water is None else (*found, water)

    def _row(self, row: Row, circuit: Circuit, places: Array) -> _SprayedRow:
        """Water of a row at places across its face (n,), m."""
        model = self._table.model_of(circuit)
        width = footprint(circuit.stand_off, model.angle)
        each = WATER_DENSITY * row.share / circuit.nozzles() / (row.end - row.start)
        water = each * water_across(places, circuit.across, width, model.edge)
        return _SprayedRow(circuit.name, water)

    def share(self, row: _SprayedRow) -> Share:
        """Share of a row in the water of its face, with its circuit's flow over time."""
        name = row.circuit
        return Share(row.water, self._flows[name], self._most[name], self._coefficients[name])

    @property
    def water_temperature(self) -> float:
        """Temperature of all water, K."""
        return self._table.water_temperature


@dataclass(frozen=True, slots=True)
class _SprayedRow:
    """A row of nozzles on one face, for any water flow."""

    circuit: str  #: name of its circuit
    water: Array  #: water on each vertex for a flow of 1 m3/s through the circuit (n,), kg/(m2 s)


@dataclass(frozen=True, slots=True)
class _Met:
    """Data of a boundary group along the machine, for any speed and water."""

    tag: int  #: tag of the group
    stretches: tuple[Stretch, ...]  #: from the meniscus down
    rows: Mapping[int, _SprayedRow]  #: rows of nozzles, by their number in the stretches


class _Face:
    """The laws of a boundary group on its way down the machine."""

    def __init__(self, cooling: SecondaryCooling, met: _Met) -> None:
        self.tag, stretches = met.tag, met.stretches
        self._starts = [stretch.start for stretch in stretches]
        shares = {i: cooling.share(row) for i, row in met.rows.items()}
        self._laws: list[tuple[SurfaceLaw, ...]] = []
        pitches: dict[int, list[tuple[float, tuple[SurfaceLaw, ...]]]] = {}
        for stretch in stretches:
            water = None
            if stretch.rows:
                water = SprayWater(
                    tuple(shares[i] for i in stretch.rows), cooling.water_temperature
                )
            laws = () if stretch.kind == "contact" else cooling.open_laws(stretch.kind, water)
            self._laws.append(laws)
            if stretch.kind != "contact":
                pitches.setdefault(stretch.gap, []).append((stretch.end - stretch.start, laws))
        last = max(stretch.gap for stretch in stretches)
        for i, stretch in enumerate(stretches):
            if stretch.kind == "contact":
                # The last roll has no pitch below it: it takes the share of the one above.
                pitch = pitches[stretch.gap if stretch.gap < last else max(last - 1, 0)]
                law = cooling.roll_contact(stretch.end - stretch.start, pitch)
                self._laws[i] = () if law is None else (law,)

    def laws_at(self, position: float) -> tuple[SurfaceLaw, ...]:
        """The laws from a position (m) on."""
        return self._laws[max(bisect_right(self._starts, position + ROUNDING) - 1, 0)]


def _cooling(surface: Surface, faces: Sequence[_Face], position: float) -> Cooling:
    """Cooling of all faces from a position (m) on; a law shared by several is evaluated once."""
    tags: dict[int, tuple[SurfaceLaw, list[int]]] = {}
    for face in faces:
        for law in face.laws_at(position):
            tags.setdefault(id(law), (law, []))[1].append(face.tag)
    return Cooling([(surface.patch(those), law) for law, those in tags.values()], [])


def _same(one: Cooling, other: Cooling) -> bool:
    if len(one.laws) != len(other.laws):
        return False
    pairs = zip(one.laws, other.laws, strict=True)
    return all(a is c and b is d for (a, b), (c, d) in pairs)


def _apart(places: list[float]) -> list[float]:
    """Sorted places, without duplicates by rounding."""
    found: list[float] = []
    for place in sorted(places):
        if not found or place - found[-1] > ROUNDING:
            found.append(place)
    return found
