"""Values at points and along lines of the section, independent of the rank of the cells."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Protocol

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import geometry

from castfem.base.types import Array, Indices
from castfem.fem import compat, reductions
from castfem.fem.section import Section

SAMPLES = 401  # samples along a line, denser towards the surface


class Conducts(Protocol):
    """The conduction integral of a steel, theta = int k dT, and its inverse."""

    @property
    def even(self) -> bool:
        """Whether theta and temperature are proportional."""

    def conduction(self, temperature: Array, /) -> Array:
        """Theta, W/m, at temperatures in K."""

    def temperature(self, conduction: Array, /) -> Array:
        """Temperatures, K, of theta in W/m."""

    def __hash__(self) -> int:
        """Hash of the object: values at temperatures are cached."""


@dataclass(frozen=True, slots=True)
class Profile:
    """Temperature along one line."""

    depth: Array  #: distance below the surface (n,), m
    temperature: Array  #: (n,), K
    cell: Array | None = None  #: size along the line of the cell of each sample (n,), m
    #: quantity that is linear between the samples; None for the temperature itself
    conducts: Conducts | None = None
    theta: Array | None = None  #: theta at these temperatures, if known (n,), W/m

    def at_temperatures(self, temperature: Array) -> Profile:
        """The profile of the same line at other temperatures (n,), K."""
        return Profile(self.depth, temperature, self.cell, self.conducts)

    def cell_at(self, level: float) -> float:
        """Size of the cell in which `level` (K) is first crossed, m; NaN if it is not."""
        i = int((self.temperature >= level).argmax())
        return float(self.cell[i]) if i > 0 and self.cell is not None else np.nan

    def isotherm_depth(self, level: float) -> float:
        """Depth of the first crossing of `level` (K) from colder to hotter, m.

        0 if the surface is at or above the level, the whole length if all of the line is below.
        """
        hot = self.temperature >= level
        i = int(hot.argmax())
        if i == 0:
            return 0.0 if hot[0] else float(self.depth[-1])
        ends = self.temperature[i - 1 : i + 1]
        if self.conducts is None:
            (v0, v1), v = ends, level
        else:
            v = _theta(self.conducts, level)
            v0, v1 = (
                self.conducts.conduction(ends) if self.theta is None else self.theta[i - 1 : i + 1]
            )
        return float(self.depth[i - 1] + (v - v0) / (v1 - v0) * (self.depth[i] - self.depth[i - 1]))


@lru_cache(maxsize=64)  # solidus and liquidus are requested at each step
def _theta(conducts: Conducts, level: float) -> float:
    """The conduction integral at a temperature, W/m."""
    return float(conducts.conduction(np.array([level]))[0])


class LineProbes:
    """Samples vertex fields of a section along its probe lines.

    The interpolation is one sparse matrix, assembled once; a sample is one product and one small
    gather.

    Linear between vertices is the conduction integral that drives the heat flow, not the
    temperature. Where the conductivity jumps at the solidus, an isotherm from linear temperatures
    would be wrong by half a cell.

    Attributes:
        conducts: The conduction integral of the steel; None for fields that are linear.

    Raises:
        ValueError: If a line leaves the section.
    """

    def __init__(
        self, section: Section, lines: dict[str, tuple[Array, Array]] | None = None
    ) -> None:
        self.section = section
        self.conducts: Conducts | None = None
        self.lines = dict(section.probes if lines is None else lines)
        fraction = np.linspace(0.0, 1.0, SAMPLES) ** 2
        self.depth = {
            name: fraction * float(np.linalg.norm(np.subtract(end, start)))
            for name, (start, end) in self.lines.items()
        }
        inside = 1e-9  # fraction of the line by which the first and last sample are moved inwards
        inner = inside + (1 - 2 * inside) * fraction
        points = [
            np.asarray(start) + inner[:, None] * np.subtract(end, start)
            for start, end in self.lines.values()
        ]
        unit = [
            np.subtract(e, s) / np.linalg.norm(np.subtract(e, s)) for s, e in self.lines.values()
        ]
        self._along = np.repeat(np.array(unit).reshape(-1, 2), SAMPLES, axis=0)
        self._points = np.vstack(points) if points else np.zeros((0, 2))
        rows, columns, weights, sizes = locate(section, self._points, self._along)
        self._matrix = self._interpolation(rows, columns, weights)
        self._field, self._samples = self._matrix.createVecs()
        self._cells = dict(zip(self.lines, self._per_line(self._of_all(rows, sizes)), strict=True))

    def _interpolation(
        self, mine: Indices, columns: list[npt.NDArray[np.int32]], weights: list[Array]
    ) -> PETSc.Mat:
        """Matrix (samples x vertices) of shape function values."""
        section, comm = self.section, self.section.comm
        n = len(self._points)
        size = ((None, n), (section.owned, section.vertex_space.dofmap.index_map.size_global))
        matrix = PETSc.Mat().createAIJ(size, comm=comm)
        matrix.setPreallocationNNZ((4, 4))
        matrix.setOption(PETSc.Mat.Option.NEW_NONZERO_ALLOCATION_ERR, False)
        for row, cols, vals in zip(mine, columns, weights, strict=True):
            matrix.setValues([row], cols, vals)
        matrix.assemble()
        return matrix

    @cached_property
    def _starts(self) -> PointProbes:
        """Start points of the lines on the surface (collective on first use)."""
        return PointProbes(self.section, self._points[::SAMPLES])

    def _of_all(self, mine: Indices, values: Array) -> Array:
        """Values of the samples, each from its rank (n,)."""
        found = np.full(len(self._points), -np.inf)
        found[mine] = values
        return reductions.largest_of(self.section.comm, found)

    def _per_line(self, values: Array) -> list[Array]:
        """Values of all samples, line by line."""
        return list(values.reshape(len(self.lines), -1)) if self.lines else []

    def sample(self, owned: Array, conduction: Array | None = None) -> dict[str, Profile]:
        """Temperature profiles along every line, on every rank (collective).

        Args:
            owned: Temperature at the vertices (owned,), K.
            conduction: The conduction integral at the vertices, if known (owned,), W/m.
        """
        law = None if self.conducts is None or self.conducts.even else self.conducts
        if law is None:
            values, thetas = self._values(owned), None
            temperatures = self._per_line(values)
        else:
            values = self._values(law.conduction(owned) if conduction is None else conduction)
            temperatures, thetas = self._per_line(law.temperature(values)), self._per_line(values)
        return {
            name: Profile(
                self.depth[name], temperatures[i], self._cells[name], law,
                None if thetas is None else thetas[i],
            )
            for i, name in enumerate(self.lines)
        }  # fmt: skip

    def of_curve(self, conducts: Conducts | None) -> LineProbes:
        """The same lines for another steel; they share the interpolation: use the two in turn."""
        other = copy.copy(self)
        other.conducts = conducts
        return other

    def starts(self, owned: Array) -> dict[str, Array]:
        """Vertex fields (owned, k) at the start of every line (k,), on every rank: one message."""
        return dict(zip(self.lines, self._starts.at(owned), strict=True))

    def along(self, owned: Array) -> dict[str, Array]:
        """A vertex field (owned,) along every line, surface first, on every rank."""
        return dict(zip(self.lines, self._per_line(self._values(owned)), strict=True))

    def _values(self, owned: Array) -> Array:
        """A vertex field (owned,) at the samples of all lines, on every rank (collective)."""
        self._field.setArray(owned)
        self._matrix.mult(self._field, self._samples)
        local = self._samples.getArray().copy()
        comm = self.section.comm
        return local if comm.size == 1 else np.concatenate(comm.allgather(local))

    def destroy(self) -> None:
        """Free the PETSc objects."""
        for thing in (self._matrix, self._field, self._samples):
            thing.destroy()


class PointProbes:
    """Interpolates vertex fields at points of the section.

    Args:
        section: The section.
        points: Coordinates of the points (n, 2), m.

    Raises:
        ValueError: A point lies outside the section.
    """

    def __init__(self, section: Section, points: Array) -> None:
        from scipy import sparse  # slow to import, and most runs have no such points

        self._comm, n = section.comm, len(points)
        along = np.tile([1.0, 0.0], (n, 1))
        rows, columns, weights, _ = locate(section, points, along)
        start = section.vertex_space.dofmap.index_map.local_range[0]
        # A cell of one rank may have vertices of another: each rank takes its own columns.
        entries = [
            (row, column - start, weight)
            for part in section.comm.allgather(list(zip(rows, columns, weights, strict=True)))
            for row, found, values in part
            for column, weight in zip(found, values, strict=True)
            if 0 <= column - start < section.owned
        ]
        table = np.array(entries, float).reshape(-1, 3)
        places = (table[:, 0].astype(int), table[:, 1].astype(int))
        self._matrix = sparse.csr_matrix((table[:, 2], places), shape=(n, section.owned))

    def at(self, owned: Array) -> Array:
        """Vertex fields (owned, k) at the points (n, k), on every rank (collective)."""
        local = self._matrix @ owned
        return reductions.totals(self._comm, local.ravel()).reshape(local.shape)


def locate(
    section: Section, points: Array, along: Array
) -> tuple[Indices, list[npt.NDArray[np.int32]], list[Array], Array]:
    """The points on this rank; vertices, weights and size of the cell of each (collective).

    The vertices are global, the size is measured along a direction, m. Among all cells whose
    bounding box contains a point, on all ranks, the one is taken in which the point lies deepest: a
    point on an edge, or outside a face by rounding, gets the same cell on any number of ranks.

    Args:
        section: The section.
        points: Coordinates of the points (n, 2), m.
        along: Unit vectors of the directions (n, 2).

    Raises:
        ValueError: A point lies outside the section.
    """
    n = len(points)
    mesh, dofmap = section.mesh, section.vertex_space.dofmap
    best = np.full(n, np.inf)
    cells, shapes = np.full(n, -1), np.zeros((n, 3 if section.cell == "triangle" else 4))
    sizes = np.zeros(n)
    local = mesh.topology.index_map(2).size_local
    if local and n:
        tree = geometry.bb_tree(mesh, 2, entities=np.arange(local, dtype=np.int32), padding=1e-9)
        xyz = np.column_stack([points, np.zeros(n)])
        near = geometry.compute_collisions_points(tree, xyz)
        boxed, cell = np.repeat(np.arange(n), np.diff(near.offsets)), np.asarray(near.array)
        node_of, x = compat.geometry_dofmap(mesh), mesh.geometry.x[:, :2]
        cmap = compat.coordinate_map(mesh)
        xi = np.zeros((len(cell), 2))
        for one in np.unique(cell):
            here = np.flatnonzero(cell == one)
            xi[here] = cmap.pull_back(points[boxed[here]], np.ascontiguousarray(x[node_of[one]]))
        outside = _outside(section.cell, xi)
        order = np.lexsort((outside, boxed))  # for each point the deepest first
        found, first = np.unique(boxed[order], return_index=True)
        chosen = order[first]
        best[found], cells[found] = outside[chosen], cell[chosen]
        shapes[found] = _first_order_shapes(section.cell, xi[chosen])
        known: dict[tuple[float, ...], float] = {}  # many samples of a line are in one cell
        for i in found:
            place = (cells[i], *along[i])
            if place not in known:
                known[place] = np.ptp(np.ascontiguousarray(x[node_of[cells[i]]]) @ along[i])
            sizes[i] = known[place]
    rows = _won(section, points, best)
    columns = [
        dofmap.index_map.local_to_global(dofmap.cell_dofs(int(cells[i]))).astype(np.int32)
        for i in rows
    ]
    return rows, columns, [shapes[i] for i in rows], sizes[rows]


def _won(section: Section, points: Array, outside: Array) -> npt.NDArray[np.int64]:
    """The points that lie deepest in a cell of this rank; a tie goes to the lower rank."""
    comm = section.comm
    least = -reductions.largest_of(comm, -outside)
    # Fraction of a cell by which a sample may lie outside, at a curved face cut by straight cells.
    if (least > 1e-2).any():
        x, y = points[np.argmax(least)]
        raise ValueError(f"probe point ({x:g}, {y:g}) m lies outside the section")
    rank = np.where(outside <= least + 1e-12, comm.rank, comm.size).astype(float)
    return np.flatnonzero(-reductions.largest_of(comm, -rank) == comm.rank)


def _first_order_shapes(cell: str, xi: Array) -> Array:
    """First-order shape functions of the cell at reference points xi (n, 2)."""
    r, s = xi.T
    if cell == "triangle":
        return np.column_stack([1 - r - s, r, s])
    return np.column_stack([(1 - r) * (1 - s), r * (1 - s), (1 - r) * s, r * s])


def _outside(cell: str, xi: Array) -> Array:
    """Distance of reference points xi (n, 2) outside their cell (n,); negative inside."""
    r, s = xi.T
    far = [r + s - 1] if cell == "triangle" else [r - 1, s - 1]
    return np.asarray(np.max([-r, -s, *far], axis=0))
