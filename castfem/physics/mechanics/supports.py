"""Supports and surface loads of the slice in its plane."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.fem.section import Section

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class PrescribedDisplacement:
    """A displacement component prescribed on boundary groups."""

    on: tuple[str, ...]  #: groups; a name matches all groups that begin with it
    component: int  #: 0 for x, 1 for y
    #: function of positions (n, 2), m, and time, s, that returns displacements (n,), m; None for
    #: zero
    value: Callable[[Array, float], Array] | None = None


@dataclass(frozen=True, slots=True)
class Traction:
    """A force per undeformed area on boundary groups: (x, y) in Pa, over time."""

    on: tuple[str, ...]
    value: Callable[[float], Place]


@dataclass(frozen=True, slots=True)
class SurfacePressure:
    """A pressure on boundary groups, over time, Pa; it follows the surface at large strain."""

    on: tuple[str, ...]
    value: Callable[[float], float]


def symmetry_supports(groups: tuple[str, ...]) -> list[PrescribedDisplacement]:
    """The lines of symmetry: no displacement across them."""
    lines = (("symmetry_x", 0), ("symmetry_y", 1))
    return [
        PrescribedDisplacement((name,), i)
        for name, i in lines
        if any(g.startswith(name) for g in groups)
    ]


# Component and place ("low", "mid" or "high" of the section's extent along x and y) of points that
# together restrain all rigid body motions. In the middle of faces, where symmetric loads do not
# move them.
PINS: tuple[tuple[int, tuple[str, str]], ...] = (
    (0, ("mid", "high")),
    (0, ("mid", "low")),
    (1, ("high", "mid")),
)
SPRING = 1e-7  # stiffness of a spring over the largest Young's modulus, see docs/mechanics.md


class Springs:
    """Weak springs between points of the slice and their positions at the start of the step.

    Args:
        dofs: Degrees of freedom of this rank (k,).
        share: Stiffness over the largest Young's modulus in the section.

    """

    def __init__(self, dofs: npt.NDArray[np.int64], share: float) -> None:
        self.dofs, self.share, self._stiffness = dofs, share, 0.0
        self._old: Array = np.zeros(len(dofs))

    def begin(self, old: Array, young: float) -> None:
        """Prepare a step from displacements `old` (owned, ...), m, with Young's modulus `young`."""
        self._old, self._stiffness = old[self.dofs], self.share * young

    def force(self, local: Array) -> Array:
        """Forces of the springs (k,), N/m."""
        return np.asarray(self._stiffness * (local[self.dofs] - self._old))

    def force_change(self, local: Array, young: Array, moved: Array) -> Array:
        """Derivative of `force` (k, n), N/m.

        Args:
            local: Local unknowns.
            young: Derivative of the modulus (n,), Pa.
            moved: Derivative of the motion of the points relative to the start (k, n), m.
        """
        drawn = np.outer(local[self.dofs] - self._old, self.share * young)
        return np.asarray(drawn + self._stiffness * moved)

    def add_to(self, matrix: PETSc.Mat) -> None:
        """Add their stiffness to that of the slice (collective)."""
        for row in self.dofs:
            matrix.setValueLocal(row, row, self._stiffness, addv=PETSc.InsertMode.ADD_VALUES)
        matrix.assemble()


class Constraints:
    """All supports of a section except a wall.

    Points are fixed in addition, as few as possible, if `held` leaves the section a rigid body
    motion. They carry no force while the loads are in equilibrium. If a wall supports the section
    the loads are not, and the points get springs instead: these pull each back to its position at
    the start of the step, so weakly that they matter only where the wall does not act.

    Args:
        section: The distributed section.
        space: Space of the displacement.
        held: Prescribed displacements on groups.
        pin: Fix points in addition.
        springs: Use springs of this relative stiffness instead; None for fixed points.
        borne: Places (n, 2), m, whose displacement in directions (n, 2) is always restrained by
            something else.

    Attributes:
        conditions: Boundary conditions for DOLFINx' assembly.
        fixed: Prescribed degrees of freedom of this rank (k,). free: 0 at those and at prescribed
            ghosts, 1 elsewhere (n,).
        prescribed: `fixed` and, in a step, those of deep liquid. every: Conditions for both.
        springs: Springs at points, if the section needs any. dofs: Prescribed or with a spring.
        moving: Whether any prescribed displacement is ever nonzero.

    Raises:
        InputError: A group does not exist.
    """

    def __init__(
        self,
        section: Section,
        space: fem.FunctionSpace,
        held: list[PrescribedDisplacement],
        pin: bool = True,
        springs: float | None = None,
        borne: tuple[Array, Array] | None = None,
    ) -> None:
        self._comm = section.comm
        self.conditions: list[fem.DirichletBC] = []
        self._parts: list[tuple[fem.Function, list[Array], Array, PrescribedDisplacement]] = []
        section.mesh.topology.create_connectivity(1, 2)
        section.mesh.topology.create_connectivity(0, 2)
        single = [space.sub(i).collapse()[0] for i in range(2)]
        for one in held:
            self._hold(space, single[one.component], 1, _facets(section, one.on), one)
        owned = space.dofmap.index_map.size_local * space.dofmap.bs
        sprung: list[npt.NDArray[np.int32]] = [np.zeros(0, np.int32)]
        for component, vertices in self._missing(section, borne) if pin else []:
            if springs is None:
                self._hold(
                    space, single[component], 0, vertices, PrescribedDisplacement((), component)
                )
            else:
                parts = (space.sub(component), single[component])
                sprung.append(fem.locate_dofs_topological(parts, 0, vertices)[0])
        self.springs: Springs | None = None
        if springs is not None and len(sprung) > 1:
            self.springs = Springs(_sorted(sprung, owned), springs)
        found = [np.zeros(0, np.int32), *(c.dof_indices()[0] for c in self.conditions)]
        self.fixed = _sorted(found, owned)
        ghosts = space.dofmap.index_map.num_ghosts * space.dofmap.bs
        self.free = np.ones(owned + ghosts)
        self.free[np.concatenate(found)] = 0.0
        self.dofs = self.fixed
        if self.springs is not None:
            self.dofs = np.union1d(self.fixed, self.springs.dofs)
        self.moving = any(one.value is not None for *_, one in self._parts)
        self.prescribed, self.every = self.fixed, self.conditions

    def hold_too(self, dofs: npt.NDArray[np.int64], condition: fem.DirichletBC) -> None:
        """Prescribe further degrees of freedom `dofs` of this rank from now on."""
        self.prescribed = np.union1d(self.fixed, dofs)
        self.every = [*self.conditions, condition]

    def spread(self, component: int) -> float:
        """Distance, along a component, of the places where it is prescribed, m (collective)."""
        held = [at[:, component] for _, _, at, one in self._parts if one.component == component]
        places = np.concatenate([np.zeros(0), *held])
        ends = [places.max(initial=-np.inf), -places.min(initial=np.inf)]
        return max(float(reductions.largest_of(self._comm, ends).sum()), 0.0)

    def _hold(
        self,
        space: fem.FunctionSpace,
        single: fem.FunctionSpace,
        dimension: int,
        entities: npt.NDArray[np.int32],
        held: PrescribedDisplacement,
    ) -> None:
        part = space.sub(held.component)
        dofs = fem.locate_dofs_topological((part, single), dimension, entities)
        value = fem.Function(single)
        self.conditions.append(fem.dirichletbc(value, dofs, part))
        positions = single.tabulate_dof_coordinates()[dofs[1], :2]
        self._parts.append((value, list(dofs), positions, held))

    def _missing(
        self, section: Section, borne: tuple[Array, Array] | None
    ) -> list[tuple[int, npt.NDArray[np.int32]]]:
        """Component and local vertex of the points that restrain what the conditions leave free."""
        points = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2]
        low = np.array([reductions.smallest(section.comm, v) for v in points.T])
        high = np.array([reductions.largest(section.comm, v) for v in points.T])
        size, found = float((high - low).max()), []

        def rigid_motions(component: int, places: Array) -> Array:
            """Values of two translations and a rotation there, (n, 3)."""
            x, y = ((places - 0.5 * (low + high)) / size).T
            one, none = np.ones_like(x), np.zeros_like(x)
            return np.column_stack([one, none, -y] if component == 0 else [none, one, x])

        rows = [rigid_motions(h.component, places) for _, _, places, h in self._parts]
        if borne is not None:
            x, y = borne[1].T[:, :, None]
            rows.append(x * rigid_motions(0, borne[0]) + y * rigid_motions(1, borne[0]))
        here = np.linalg.qr(np.concatenate([np.zeros((0, 3)), *rows]), mode="r")
        _, strength, basis = np.linalg.svd(np.concatenate(section.comm.allgather(here)))
        nothing = 1e-6  # relative to a motion
        basis = basis[: int((strength > nothing * strength.max(initial=0.0)).sum())]
        for component, where in PINS:
            share = np.array([{"low": 0.0, "mid": 0.5, "high": 1.0}[w] for w in where])
            place = _nearest(section.comm, points, low + share * (high - low), size)
            row = rigid_motions(component, np.array([place]))[0]
            row -= basis.T @ (basis @ row)
            if (left := float(np.linalg.norm(row))) > nothing:
                basis = np.vstack([basis, row / left])
                found.append((component, _vertex_at(section, place, size)))
        return found

    def set(self, time: float, target: Array) -> None:
        """Write the prescribed displacements at `time` (s) to the local array `target`."""
        for value, dofs, positions, held in self._parts:
            if held.value is not None:
                value.x.array[dofs[1]] = held.value(positions, time)
            target[dofs[0]] = value.x.array[dofs[1]]


def _facets(section: Section, names: tuple[str, ...]) -> npt.NDArray[np.int32]:
    """Local facets of groups."""
    found = [section.facet_tags.find(tag) for tag in section.required(names)]
    return np.unique(np.concatenate(found)).astype(np.int32)


def _sorted(dofs: list[npt.NDArray[np.int32]], owned: int) -> npt.NDArray[np.int64]:
    """Unique values of several lists that are below `owned`."""
    every = np.unique(np.concatenate(dofs)).astype(np.int64)
    return every[every < owned]


def _nearest(comm: MPI.Comm, points: Array, goal: Array, size: float) -> Place:
    """The point (n, 2) of all ranks nearest to a goal, equal for any number of ranks."""
    best = (np.inf, 0.0, 0.0)
    if len(points):
        distance = np.round(np.linalg.norm(points - goal, axis=1) / size, 9)
        order = np.lexsort((points[:, 1], points[:, 0], distance))[0]
        best = (float(distance[order]), float(points[order, 0]), float(points[order, 1]))
    _, x, y = min(comm.allgather(best))
    return x, y


def _vertex_at(section: Section, place: Place, size: float) -> npt.NDArray[np.int32]:
    """Local vertex at a place of a section of some size, if this rank has it."""

    def here(points: Array) -> npt.NDArray[np.bool_]:
        near = np.hypot(points[0] - place[0], points[1] - place[1]) < 1e-9 * size
        return np.asarray(near, dtype=np.bool_)

    return np.asarray(dmesh.locate_entities(section.mesh, 0, here), dtype=np.int32)


@dataclass(frozen=True, slots=True)
class SurfaceLoads:
    """Surface loads, and the constants that hold their values."""

    #: tags of the groups, constant and time history of each traction
    tractions: list[tuple[tuple[int, ...], fem.Constant, Traction]]
    #: the same for each pressure
    pressures: list[tuple[tuple[int, ...], fem.Constant, SurfacePressure]]
    measure: ufl.Measure  #: perimeter measure with the boundary tags
    #: pressure at the vertices of liquid that is supported from outside; None if there is none
    liquid: fem.Function | None

    @classmethod
    def on(
        cls, section: Section, loads: list[Traction | SurfacePressure], liquid: bool
    ) -> SurfaceLoads:
        """Set up the loads; with `liquid` the surface is supported where it is liquid."""
        mesh = section.mesh
        measure = ufl.Measure(
            "ds",
            domain=mesh,
            subdomain_data=section.facet_tags,
            metadata={"quadrature_rule": "default", "quadrature_degree": 5},
        )
        held = fem.Function(section.vertex_space) if liquid else None
        found = cls([], [], measure, held)
        for load in loads:
            tags = tuple(section.required(load.on))
            if isinstance(load, Traction):
                found.tractions.append((tags, fem.Constant(mesh, np.zeros(2)), load))
            else:
                found.pressures.append((tags, fem.Constant(mesh, np.float64(0.0)), load))
        return found

    def set(self, time: float) -> None:
        """Set the loads at `time` (s)."""
        for _, constant, traction in self.tractions:
            constant.value[:] = traction.value(time)
        for _, scalar, pressure in self.pressures:
            scalar.value = pressure.value(time)

    def pressing(self, section: Section) -> list[tuple[tuple[int, ...], Any]]:
        """Tags and value of each pressure on the surface."""
        found: list[tuple[tuple[int, ...], Any]] = [(tags, p) for tags, p, _ in self.pressures]
        if self.liquid is not None:
            found.append((tuple(section.matching(section.outer_groups)), self.liquid))
        return found
