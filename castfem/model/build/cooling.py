"""Build the surface cooling over time from the cooling zones of a case.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import replace
from functools import cached_property
from itertools import chain
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.base.types import Array
from castfem.fem import reductions
from castfem.model.cooling import Contact, over_temperature
from castfem.model.heat_law import Extent, HeatLaw, Surroundings
from castfem.model.water import Supply, steel_per_length
from castfem.physics.machine.machine import OverTime
from castfem.physics.thermal import flux_laws
from castfem.physics.thermal.boundary import Cooling, Patch, Surface
from castfem.physics.thermal.mould_flux import heat_to_mould

if TYPE_CHECKING:
    from castfem.fem.section import Section
    from castfem.model import Case
    from castfem.model.build.secondary import SecondaryCooling
    from castfem.physics.machine import Machine
    from castfem.physics.materials import Steel
    from castfem.physics.mechanics.surface_gap import SurfaceGap


Row = tuple[list[int], flux_laws.SurfaceLaw]


class Zones:
    """Cooling along the machine as the slice meets it over time.

    Args:
        case: Sound case.
        machine: Positions and times of the slice.
        steel: Steel, with the emissivity if the case has none.
        surface: Perimeter shares of the section's boundary groups.
        beside: Zones of another slice whose case differs only in speed, superheat, water and start.

    Raises:
        InputError: If a law names a boundary group the section does not have, or radiation needs an
            emissivity the steel does not give.
    """

    def __init__(
        self,
        case: Case,
        machine: Machine,
        steel: Steel,
        surface: Surface,
        beside: Zones | None = None,
    ) -> None:
        self.spans = case.zones()
        self.starts = [machine.time_at(span.start) for span in self.spans]
        self._end = machine.time_at(self.spans[-1].end)
        self._surface, self._beside = surface, beside
        #: assigns gaps to vertices, some of which have two; only with a mould
        self.sides: SurfaceGap | None = None
        self._case = case
        wall = wall_over_time(case, machine)
        self._around = Surroundings(
            steel, machine, wall, water=case.water, clock=case.casting.clock
        )
        self._coolings = [self._make(i) for i in range(len(self.spans))]
        tags = [t for span in self.spans for names, _ in span.laws for t in self._tags(names)]
        self._secondary: SecondaryCooling | None
        known = None if beside is None else beside._secondary
        self._secondary = self._below(case, machine, steel, known)
        if self._secondary is not None:
            tags += surface.section.matching(surface.section.outer_groups)
        self._cooled = surface.patch(tags) if tags else None

    def _below(
        self, case: Case, machine: Machine, steel: Steel, beside: SecondaryCooling | None
    ) -> SecondaryCooling | None:
        """Replace the last span by roll-to-roll cooling; None without it."""
        if not self.spans[-1].roll_to_roll:
            return None
        from castfem.model.build.secondary import SecondaryCooling

        start = self.spans[-1].start
        found = SecondaryCooling(case, machine, steel, self._surface, start, beside=beside)
        self.starts[-1:] = [machine.time_at(position) for position in found.positions]
        self._coolings[-1:] = found.coolings
        return found

    @property
    def surface(self) -> Surface:
        """Perimeter shares of the section's boundary groups."""
        return self._surface

    def name(self, index: int) -> str:
        """Name of the cooling of a zone."""
        return self.spans[min(max(index, 0), len(self.spans) - 1)].name

    @property
    def changes(self) -> list[float]:
        """Times at which the cooling changes, s: the zone boundaries and the kinks of tables."""
        times = list(self.starts[1:])
        for span in self.spans:
            for _, law in span.laws:
                times += law.milestones(self._around)
        if self._secondary is not None:
            times += self._secondary.changes
        wall = self._around.wall
        return times + (list(wall.kinks) if isinstance(wall, OverTime) else [])

    def set_gap(self, gap: Array) -> None:
        """Let heat cross these gaps from now on, as `SurfaceGap.crossed` gives them, m."""
        for cooling in self._coolings:
            cooling.laws = [
                (
                    patch,
                    self._across(law, gap, patch) if isinstance(law, flux_laws.Contact) else law,
                )
                for patch, law in cooling.laws
            ]

    def _across(self, law: flux_laws.Contact, gap: Array, patch: Patch) -> flux_laws.Contact:
        """A law across the gaps of a patch; corners have two gaps."""
        if self.sides is None or not len(self.sides.corners):
            return law.across(gap[patch.dofs])
        both = np.stack([gap[patch.dofs], gap[self.sides.second[patch.dofs]]])
        return law.across(both, self.sides.first[patch.dofs])

    def follow_shape(self) -> None:
        """Apply the cooling to the current shape of the surface (collective)."""
        self._surface.follow_shape()

    def flux_across(self, gap: Array, temperature: Array, time: float) -> Array:
        """Heat flux at the owned vertices (owned,), W/m2, for the given gaps.

        Args:
            gap: Gaps as for `set_gap`, m.
            temperature: Temperatures (owned,), K.
            time: Time that selects the zone, s.
        """
        flux = np.zeros_like(temperature)
        for patch, law in self._coolings[self.index(time)].laws:
            if isinstance(law, flux_laws.Contact) and law.follows:
                across = self._across(law, gap, patch)
                flux[patch.dofs] += across.flux(temperature[patch.dofs], time)[0]
        return flux

    @property
    def has_given_heat(self) -> bool:
        """Whether the flux of each contact is given and independent of surface temperature."""
        laws = [law for span in self.spans for _, law in span.laws if isinstance(law, Contact)]
        return bool(laws) and all(
            law.flux is not None and over_temperature(law.flux) is None for law in laws
        )

    def heat_asked(self, end: float) -> float:
        """Heat that given fluxes of contact would take by the time `end` (s) without a gap, J/m.

        Total of the whole strand (collective).
        """
        asked = 0.0
        for i, (span, start) in enumerate(zip(self.spans, self.starts, strict=False)):
            until = min(end, self._around.machine.time_at(span.end))
            for names, law in span.laws if start < until else ():
                if not isinstance(law, Contact) or law.flux is None:
                    continue
                tags = self._tags(names)
                around = self._seen(i, law, tags)
                kinks = law.kinks(law.flux, around)
                flux, length = law.scaled(law.flux, around), self._length(self._surface.patch(tags))
                asked += length * heat_to_mould(flux, lambda _: 1.0, (start, until), kinks)
        return asked

    def index(self, time: float) -> int:
        """Zone of a step that starts at `time` (s)."""
        tiny = 1e-9 * max(time, 1e-3)
        return max(bisect_right(self.starts, time + tiny) - 1, 0)

    def cooling(self, index: int) -> Cooling:
        """The cooling of one zone."""
        return self._coolings[index]

    def ambient_range(self) -> tuple[float, float]:
        """Lowest and highest temperature the cooling can drive the strand to, K."""
        low, high, _ = self._ambient
        return low, high

    @cached_property
    def _ambient(self) -> tuple[float, float, bool]:
        """Like `ambient_range`, and whether it is constant in time and so fits other slices."""
        if self._beside is not None and self._beside._ambient[2]:
            return self._beside._ambient
        times = {*self.starts, *self.changes, self._end}  # circuits change at the same times
        # With roll-to-roll cooling the ambient temperatures are constant in time.
        count = len(self.spans) - (self._secondary is not None)
        above = [[c.ambient_range(t) for t in times] for c in self._coolings[:count]]
        below = [c.ambient_range(self._end) for c in self._coolings[count:]]
        ranges = [*chain.from_iterable(above), *below]
        steady = all(len(set(one)) == 1 for one in above)
        return min(low for low, _ in ranges), max(high for _, high in ranges), steady

    def perimeter_share(self) -> Array:
        """Share of the cooled perimeter that belongs to each owned vertex (owned,), m."""
        share = np.zeros(self._surface.section.owned)
        if self._cooled is not None:
            share[self._cooled.dofs] = self._cooled.weights
        return share

    def perimeter(self) -> float:
        """Current perimeter of the whole strand, m (collective); of a strip its cooled end."""
        groups = self._tags(self._case.section.cooled_groups())
        return self._length(self._surface.patch(groups))

    def _length(self, patch: Patch) -> float:
        """Perimeter of a part of the surface, on the whole strand, m (collective)."""
        section = self._surface.section
        modelled = reductions.total(section.comm, float(patch.weights.sum()))
        return section.multiplicity * modelled

    def surface_vertices(self) -> npt.NDArray[np.int64]:
        """Owned vertices on the strand's surface, cooled or not."""
        return self._surface.whole().dofs

    def _tags(self, names: tuple[str, ...]) -> list[int]:
        section = self._surface.section
        return [t for t in section.matching(names) if section.groups[t] in section.outer_groups]

    def _seen(self, index: int, law: HeatLaw, tags: list[int]) -> Surroundings:
        """Data that a law on the groups `tags` in a zone may request (collective)."""
        if not law.asks_extent:
            return self._around
        zone, length = self._case.cooling[index], self._case.casting.length
        end = length if zone.to is None else zone.to
        extent = Extent(self.spans[index].start, end, self._length(self._surface.patch(tags)))
        around = self._around
        supply = water_supply(self._case, around.steel, self._surface.section)
        return replace(around, extent=extent, supply=supply)

    def _make(self, index: int) -> Cooling:
        span = self.spans[index]
        cooling = Cooling([], [])
        section = self._surface.section
        rows: list[Row] = []
        crossing: set[int] = set()
        for names, law in span.laws:
            tags = self._tags(names)
            if not tags:
                raise InputError(
                    f"cooling zone '{span.name}': no boundary group is named {', '.join(names)}; "
                    f"this section has {', '.join(section.outer_groups)}"
                )
            made = law.build(self._seen(index, law, tags))
            if isinstance(made, flux_laws.PrescribedTemperature):
                cooling.prescribed.append((self._surface.patch(tags), made))
            elif not isinstance(made, flux_laws.SurfaceLaw):
                raise TypeError(
                    f"{type(made).__name__} is not a flux law; derive it from SurfaceLaw"
                )
            else:
                crossing |= {len(rows)} if law.crosses_gap else set()
                rows.append((tags, made))
        for tags, made in across_gaps(rows, crossing):
            cooling.laws.append((self._surface.patch(tags), made))
        return cooling


def across_gaps(rows: list[Row], crossing: set[int]) -> list[Row]:
    """The laws of a zone; those that cross a gap are added to the contact with that gap, (35)-(36).

    Args:
        rows: Tags of boundary groups, and the law that holds on them.
        crossing: Rows of the laws that cross the gap of a contact law on the same group; of two
            contact laws there, the first has the gap.
    """
    found: list[Row] = []
    met: set[int] = set()
    for tags, law in rows:
        if not isinstance(law, flux_laws.Contact):
            continue
        parts: dict[tuple[int, ...], list[int]] = {}
        for tag in tags:
            here = [] if tag in met else [i for i in sorted(crossing) if tag in rows[i][0]]
            parts.setdefault(tuple(here), []).append(tag)
        met |= set(tags)
        for numbers, part in parts.items():
            found.append((part, replace(law, beside=tuple(_crosses(rows[i][1]) for i in numbers))))
    for i, (tags, law) in enumerate(rows):
        free = [tag for tag in tags if tag not in met] if i in crossing else tags
        if free and not isinstance(law, flux_laws.Contact):
            found.append((free, law))
    return found


def _crosses(law: flux_laws.SurfaceLaw) -> flux_laws.Convection | flux_laws.Radiation:
    assert isinstance(law, flux_laws.Convection | flux_laws.Radiation)
    return law


def wall_over_time(case: Case, machine: Machine) -> float | OverTime | None:
    """Temperature of the mould wall as the slice passes it, K, over time; None if not given."""
    given = None if case.mould is None else case.mould.wall_temperature
    return OverTime(given, machine) if isinstance(given, Table) else given


def water_supply(case: Case, steel: Steel, section: Section) -> Supply:
    """Return the conversion of water per mass of steel, or of shares, into flows (collective)."""
    casting = case.casting
    mass = None if section.source is None else steel_per_length(section.source, steel)
    return Supply(section.comm.bcast(mass), casting.travel, case.water, casting.clock)
