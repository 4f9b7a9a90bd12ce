"""What holds the slice in its plane and what presses on it: supports and surface loads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx import mesh as dmesh

from castfem import reductions
from castfem.errors import InputError
from castfem.section import Section

Array = npt.NDArray[np.float64]
Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Held:
    """A component of the displacement prescribed on boundary groups.

    Attributes:
        on: Groups; a name covers all that begin with it.
        component: 0 for x, 1 for y.
        value: From positions (n, 2), m, and time, s, to displacements (n,), m; None for zero.
    """

    on: tuple[str, ...]
    component: int
    value: Callable[[Array, float], Array] | None = None


@dataclass(frozen=True, slots=True)
class Traction:
    """A force per undeformed area on boundary groups: over time, (x, y) in Pa."""

    on: tuple[str, ...]
    value: Callable[[float], Place]


@dataclass(frozen=True, slots=True)
class SurfacePressure:
    """A pressure on boundary groups, over time, Pa; it follows the surface at large strain."""

    on: tuple[str, ...]
    value: Callable[[float], float]


def symmetry_supports(groups: tuple[str, ...]) -> list[Held]:
    """The lines of symmetry: no displacement across them."""
    lines = (("symmetry_x", 0), ("symmetry_y", 1))
    return [Held((name,), i) for name, i in lines if any(g.startswith(name) for g in groups)]


def rigid_pins(groups: tuple[str, ...]) -> list[tuple[int, tuple[str, str]]]:
    """Points to hold where symmetry leaves a motion as a rigid body.

    They lie in the middle of faces, where a symmetric load would not move them anyway, and carry no
    force as long as the loads are in equilibrium.

    Returns:
        Component and place: "low", "mid" or "high" of the section's extent along x and y.
    """
    mirrored = {
        line for line in ("x", "y") if any(g.startswith(f"symmetry_{line}") for g in groups)
    }
    if mirrored == {"x", "y"}:
        return []
    if mirrored == {"x"}:
        return [(1, ("high", "mid"))]
    if mirrored == {"y"}:
        return [(0, ("mid", "high"))]
    return [(0, ("mid", "high")), (0, ("mid", "low")), (1, ("high", "mid"))]


class Constraints:
    """All essential conditions of a section.

    Args:
        section: The distributed section.
        space: Space of the displacement.
        held: Conditions on groups.
        pins: Single points, see `rigid_pins`.

    Attributes:
        conditions: For DOLFINx' assembly.
        dofs: Constrained degrees of freedom that this rank owns (k,).
        moving: Whether any condition is not zero for ever.

    Raises:
        InputError: If a group does not exist.
    """

    def __init__(
        self,
        section: Section,
        space: fem.FunctionSpace,
        held: list[Held],
        pins: list[tuple[int, tuple[str, str]]],
    ) -> None:
        self.conditions: list[fem.DirichletBC] = []
        self._parts: list[tuple[fem.Function, list[Array], Array, Held]] = []
        section.mesh.topology.create_connectivity(1, 2)
        section.mesh.topology.create_connectivity(0, 2)
        single = [space.sub(i).collapse()[0] for i in range(2)]
        for one in held:
            facets = _facets(section, one.on)
            self._hold(space, single[one.component], 1, facets, one)
        for component, where in pins:
            vertices = _nearest_vertex(section, where)
            self._hold(space, single[component], 0, vertices, Held((), component))
        found: list[npt.NDArray[np.int32]] = [np.zeros(0, np.int32)]
        for condition in self.conditions:
            dofs, owned = condition.dof_indices()
            found.append(np.asarray(dofs[:owned]))
        self.dofs = np.unique(np.concatenate(found)).astype(np.int64)
        self.moving = any(one.value is not None for *_, one in self._parts)

    def _hold(
        self,
        space: fem.FunctionSpace,
        single: fem.FunctionSpace,
        dimension: int,
        entities: npt.NDArray[np.int32],
        held: Held,
    ) -> None:
        part = space.sub(held.component)
        dofs = fem.locate_dofs_topological((part, single), dimension, entities)
        value = fem.Function(single)
        self.conditions.append(fem.dirichletbc(value, dofs, part))
        positions = single.tabulate_dof_coordinates()[dofs[1], :2]
        self._parts.append((value, list(dofs), positions, held))

    def set(self, time: float, target: Array) -> None:
        """Put the prescribed displacements at `time` (s) into the local array `target`."""
        for value, dofs, positions, held in self._parts:
            if held.value is not None:
                value.x.array[dofs[1]] = held.value(positions, time)
            target[dofs[0]] = value.x.array[dofs[1]]


def _facets(section: Section, names: tuple[str, ...]) -> npt.NDArray[np.int32]:
    """Local facets of groups."""
    tags = section.matching(names)
    if not tags:
        raise InputError(
            f"{', '.join(names)}: no such boundary group; there are {', '.join(section.groups)}"
        )
    found = [section.facet_tags.find(tag) for tag in tags]
    return np.unique(np.concatenate(found)).astype(np.int32)


def _nearest_vertex(section: Section, where: tuple[str, str]) -> npt.NDArray[np.int32]:
    """The vertex nearest to a place of the section's bounding box, the same on all ranks."""
    points = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2]
    comm = section.comm
    low = [reductions.smallest(comm, v) for v in points.T]
    high = [reductions.largest(comm, v) for v in points.T]
    share = {"low": 0.0, "mid": 0.5, "high": 1.0}
    goal = [a + share[w] * (b - a) for a, b, w in zip(low, high, where, strict=True)]
    size = max(b - a for a, b in zip(low, high, strict=True))
    best = (np.inf, 0.0, 0.0)
    if len(points):
        distance = np.round(np.linalg.norm(points - goal, axis=1) / size, 9)
        order = np.lexsort((points[:, 1], points[:, 0], distance))[0]
        best = (float(distance[order]), float(points[order, 0]), float(points[order, 1]))
    _, x, y = min(comm.allgather(best))

    def here(place: Array) -> npt.NDArray[np.bool_]:
        near = np.hypot(place[0] - x, place[1] - y) < 1e-9 * size
        return np.asarray(near, dtype=np.bool_)

    return np.asarray(dmesh.locate_entities(section.mesh, 0, here), dtype=np.int32)
