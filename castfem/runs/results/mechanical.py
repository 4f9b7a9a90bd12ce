"""Samples the strained slice: stress, displacement of its surface, forces.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.fem.probes import LineProbes, Profile
from castfem.physics.constitutive.base import equivalent_strain, equivalent_stress
from castfem.physics.contact.summary import summary
from castfem.physics.mechanics.equilibrium_parts import StrainedSlice
from castfem.physics.mechanics.machine_bending import BentPlanes
from castfem.physics.mechanics.state import MechanicalResult, MechanicalState
from castfem.physics.mechanics.surface_gap import SurfaceGap
from castfem.runs.results.sample import SMOOTH_ORDER, MechanicalSample, SmoothPeak

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.physics.contact.state import ContactSummary


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits used in sampling the strained slice."""

    shell: float = 0.05  #: solid fraction of the section above which results of the shell are given
    #: tolerance on the start of the opposite probe, relative to its distance from the centre
    opposite: float = 1e-6
    gap: float = 1.0  #: largest gap, m; a larger value includes a vertex without a wall
    #: distance at vertices without a wall, for the interpolation, m
    no_wall: float = 1e6


LIMITS = Limits()


def opposite(starts: Mapping[str, tuple[float, float]], multiplicity: int) -> dict[str, str]:
    """Find the probe at the other end of the line through the start of each probe and the centre.

    Args:
        starts: Starts, on the surface, of the probes that end in the centre of the section, m.
        multiplicity: Number of modelled parts in the section: the missing parts are mirror images,
            in x for a half, in x and y for a quarter.

    Returns:
        By name of each probe the opposite one, or its mirror image; the probe itself if there is
        none, or if the other half is its mirror image.
    """
    places = np.array(list(starts.values())).reshape(-1, 2)
    ends = -places
    if multiplicity > 1:
        ends[:, 0] = np.abs(ends[:, 0])
    if multiplicity > 2:
        ends[:, 1] = np.abs(ends[:, 1])
    names, found = list(starts), {}
    for name, place, end in zip(names, places, ends, strict=True):
        off = np.linalg.norm(places - end, axis=1)
        nearest = int(np.argmin(off))
        there = off[nearest] <= LIMITS.opposite * np.linalg.norm(place)
        found[name] = names[nearest] if there else name
    return found


def with_vertices(
    comm: MPI.Comm, contact: ContactSummary, gap: Array, places: Array
) -> ContactSummary:
    """Contact with the largest gap over integration points and vertices (collective).

    The points of a facet lie inside it, so that at a corner, where the gap is largest, that of the
    vertex is larger.

    Args:
        comm: Communicator.
        contact: Contact at the integration points.
        gap: Gap at this rank's vertices of the surface (n,), m; inf without a wall.
        places: Their present positions (n, 2), m.
    """
    met = np.where(gap < LIMITS.gap, gap, -np.inf)
    widest, *where = reductions.peak(comm, met, places)
    return replace(contact, gap=widest, widest=np.array(where)) if widest > contact.gap else contact


class MechanicalSampler:
    """Takes samples of the strained slice.

    Args:
        strained: The slice. probes: Lines from its surface inwards.
        centred: Probes that end in the centre of the section.
        smooth: Whether to compute the smooth approximation of the largest stress.
    """

    def __init__(
        self,
        strained: StrainedSlice,
        probes: LineProbes,
        centred: tuple[str, ...],
        *,
        smooth: bool = False,
    ) -> None:
        self._smooth = smooth
        self.strained, self.probes = strained, probes
        self.section = strained.section
        starts = {name: probes.lines[name][0] for name in centred}
        self._opposite = opposite(starts, self.section.multiplicity)
        self._outward = {
            name: -np.subtract(end, start) / np.linalg.norm(np.subtract(end, start))
            for name, (start, end) in probes.lines.items()
        }
        wall = self._wall = self.strained.contact
        self._gap = None if wall is None else SurfaceGap(wall)
        coordinates = self.section.vertex_space.tabulate_dof_coordinates()
        self._vertex_places = coordinates[: self.section.owned, :2].copy()
        self._starts: sparse.csr_matrix | None = None

    def read(self, state: MechanicalState, result: MechanicalResult | None) -> MechanicalSample:
        """Sample the committed `state` (collective)."""
        points = self.strained.points
        recovered = points.recovered(state.stress)
        stress = equivalent_stress(recovered)
        places = points.deviator.position
        peak, *where = reductions.peak(self.section.comm, stress, places)
        vertices = points.moved(state.displacement, state.generalized_strains)
        fields = [vertices, points.at_vertices(stress)]
        at_vertices = None if self._gap is None else self._gap.at(state)
        if at_vertices is not None:
            fields.append(self._on_surface(np.minimum(at_vertices, LIMITS.no_wall)))
        starts = self.probes.starts(np.column_stack(fields))
        moved = {n: float(outward @ starts[n][:2]) for n, outward in self._outward.items()}
        contact = None
        gap = {n: float(values[3]) for n, values in starts.items() if len(values) > 3}
        if self._wall is not None and state.contact is not None:
            contact = summary(self._wall, state.contact, state.generalized_strains)
            assert at_vertices is not None and self._gap is not None
            there = (self._vertex_places + vertices)[self._gap.dofs]
            contact = with_vertices(self.section.comm, contact, at_vertices, there)
        return MechanicalSample(
            newton=0 if result is None else result.newton,
            flowing=0.0 if result is None else result.flowing,
            peak=peak,
            peak_at=(where[0], where[1]),
            surface_stress={n: float(values[2]) for n, values in starts.items()},
            moved=moved,
            across=self._across(moved),
            strain=float(state.generalized_strains[0]),
            gradients=(float(state.generalized_strains[1]), float(state.generalized_strains[2])),
            balance=None if result is None else result.balance,
            load=self._load(state),
            withdrawal_resistance=float(state.withdrawal_resistance[0]),
            contact=contact,
            gap={n: g if g < LIMITS.gap else np.nan for n, g in gap.items()},
            pressure=self._pressed(state),
            beyond=self._beyond(state),
            axial_stress=self._axial(recovered),
            bending=state.bending,
            bending_force=self.strained.slice.planes.bending_force(state.bending),
            smooth=smooth_peak(self.section.comm, stress, self.strained.points.deviator.volume)
            if self._smooth
            else None,
        )

    def _load(self, state: MechanicalState) -> float:
        """External axial force, N, including that of rolls and drives."""
        load = float(self.strained.slice.planes.load(state.time)[0])
        drawn = state.bending.withdrawal
        return load + (0.0 if drawn is None else drawn.force / self.section.multiplicity)

    def _beyond(self, state: MechanicalState) -> dict[str, float]:
        """Fraction of the solid beyond the data of its law, by kind (collective)."""
        law, points = self.strained.slice.law, self.strained.points
        if law.data is None:
            return {}
        heat = self.strained.at_points(state.temperature)[: points.deviator_points]
        solid, area = heat <= law.elasticity.solidity.solidus, points.deviator.volume
        beyond = law.data.beyond(heat, equivalent_strain(self.strain_rate(state)))
        parts = [area[solid & flags].sum() for flags in beyond.values()]
        whole, shell, *found = reductions.totals(
            self.section.comm, [area.sum(), area[solid].sum(), *parts]
        )
        if shell < LIMITS.shell * whole:
            return {}
        return {kind: float(part / shell) for kind, part in zip(beyond, found, strict=True)}

    def strain_rate(self, state: MechanicalState) -> Array:
        """Strain rate of the last step at the deviator's points, Mandel (n, 4), 1/s."""
        points, planes = self.strained.points, self.strained.slice.planes
        instant = 1e-3  # s: increment for the derivative of the generalized strains
        found = points.strain @ dof_values.with_ghosts(self.strained.space, state.rate)
        ends = []
        for time, scalars in (
            (state.time, state.scalars),
            (state.time - instant, state.scalars - instant * state.scalar_rate),
        ):
            offset, directions, _ = planes.at(time)
            ends.append(offset + directions @ scalars)
        return self._with_generalized_strains(found, np.asarray((ends[0] - ends[1]) / instant))

    def _axial(self, recovered: Array) -> dict[str, float]:
        """Axial stress at the start of each probe, Pa; empty without a bending machine."""
        if not isinstance(self.strained.slice.planes, BentPlanes):
            return {}
        starts = self.probes.starts(self.strained.points.at_vertices(recovered[:, 2])[:, None])
        return {name: float(values[0]) for name, values in starts.items()}

    def axial_at_vertices(self, state: MechanicalState) -> Array:
        """Axial stress at the owned vertices (owned,), Pa (collective)."""
        points = self.strained.points
        return points.at_vertices(points.recovered(state.stress)[:, 2])

    def _pressed(self, state: MechanicalState) -> dict[str, float]:
        """Contact pressure around the start of each probe, Pa; empty without a mould."""
        if self._wall is None or state.contact is None:
            return {}
        mean = self._wall.mean
        if self._starts is None:
            starts = np.array([start for start, _ in self.probes.lines.values()]).reshape(-1, 2)
            self._starts = mean.around(starts)
        pressure = self._starts @ mean.gathered(state.contact.pressure)
        return {name: float(p) for name, p in zip(self.probes.lines, pressure, strict=True)}

    def _across(self, moved: dict[str, float]) -> dict[str, float]:
        """Size of the section through the probes that end in its centre, m."""
        reach = {
            name: float(np.linalg.norm(self.probes.lines[name][0])) + moved[name]
            for name in self._opposite
        }
        return {name: reach[name] + reach[other] for name, other in self._opposite.items()}

    def displaced(self, profiles: dict[str, Profile], state: MechanicalState) -> dict[str, Profile]:
        """Profiles over the depth below the present surface (collective)."""
        moved = self.strained.points.moved(state.displacement, state.generalized_strains)
        along_x, along_y = (self.probes.along(np.ascontiguousarray(u)) for u in moved.T)
        found = {}
        for name, profile in profiles.items():
            n = self._outward[name]
            outward = n[0] * along_x[name] + n[1] * along_y[name]
            found[name] = replace(profile, depth=profile.depth + outward[0] - outward)
        return found

    def fields(self, state: MechanicalState, names: tuple[str, ...]) -> dict[str, Array]:
        """The mechanical fields among `names`, at the owned vertices (collective)."""
        points = self.strained.points
        found: dict[str, Array] = {}
        if "displacement" in names:
            found["displacement"] = points.moved(state.displacement, state.generalized_strains)
        if {"stress", "von_mises"} & set(names):
            recovered = points.recovered(state.stress)
            if "stress" in names:
                found["stress"] = points.at_vertices(recovered)
            if "von_mises" in names:
                found["von_mises"] = points.at_vertices(equivalent_stress(recovered))
        if "strain" in names:
            found["strain"] = points.at_vertices(self.strain(state))
        if "viscoplastic_strain" in names:
            flowed = self.strained.slice.law.strain(state.internal[: points.deviator_points])
            found["viscoplastic_strain"] = points.at_vertices(flowed)
        if "pressure" in names:
            found["pressure"] = self._pressure(state)
        if self._gap is not None and state.contact is not None:
            if "gap" in names:
                gap = self._gap.at(state)
                met = np.where(np.isfinite(gap), gap, np.nan)
                found["gap"] = self._on_surface(met, inside=np.nan)
            if "contact_pressure" in names:
                found["contact_pressure"] = self._on_surface(self._gap.mean(state.contact.pressure))
        return {name: in_components(found[name]) for name in names if name in found}

    def _on_surface(self, values: Array, inside: float = 0.0) -> Array:
        """Extend values at the surface vertices to all owned ones (owned,) by `inside`."""
        assert self._gap is not None
        found = np.full(self.section.owned, inside)
        found[self._gap.dofs] = values
        return found

    def _pressure(self, state: MechanicalState) -> Array:
        ferrostatic = self.strained.slice.ferrostatic
        if ferrostatic is None:
            return np.zeros(self.section.owned)
        return ferrostatic.pressure(state.temperature, state.time)

    def strain(self, state: MechanicalState) -> Array:
        """Strain (37) of the undeformed slice at the deviator's points, Mandel (n, 4)."""
        points = self.strained.points
        return self._with_generalized_strains(
            points.strain @ state.displacement, state.generalized_strains
        )

    def front_strain(self, before: MechanicalState, after: MechanicalState) -> Array | float:
        """Axial strain from bulges at the solidification front, at the deviator's points."""
        points = self.strained.points
        places = points.position[: points.deviator_points]
        found = self.strained.interactions.front_strain(before, after, places)
        return 0.0 if found is None else found

    def _with_generalized_strains(self, values: Array, generalized_strains: Array) -> Array:
        """Strain at all points, with the generalized strains at the deviator's points."""
        points = self.strained.points
        strain = values.reshape(-1, 4)[: points.deviator_points]
        x, y = points.deviator.position.T
        a0, a1, a2, across = generalized_strains
        strain[:, 1] += across
        strain[:, 2] += a0 + a1 * x + a2 * y
        return np.asarray(strain)


def smooth_peak(comm: MPI.Comm, stress: Array, area: Array) -> SmoothPeak:
    """Return the integrals of stress^32 and stress^31 (collective)."""
    peak = float(reductions.largest(comm, stress))
    if not peak > 0.0:
        return SmoothPeak(0.0, 0.0, 0.0)
    share = stress / peak
    weight = area * share ** (SMOOTH_ORDER - 1)
    above, below = reductions.totals(comm, [weight @ share, weight.sum()])
    return SmoothPeak(peak, float(above), float(below))


def in_components(values: Array) -> Array:
    """Convert Mandel tensors (n, 4) to [xx, yy, zz, xy]; return other arrays unchanged."""
    if values.ndim == 2 and values.shape[1] == 4:
        return values / np.array([1.0, 1.0, 1.0, 2.0**0.5])
    return values
