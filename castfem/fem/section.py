"""The section's distributed mesh; transfer of nodal and cell values to and from rank 0."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from castfem.base.errors import InputError
from castfem.base.types import Array, Flags, Indices
from castfem.fem import compat

if TYPE_CHECKING:
    from castfem.meshes import SectionMesh


class Section:
    """A `SectionMesh`, held by rank 0, as a DOLFINx mesh with tagged boundary groups.

    Nodal values have two numberings: by the degrees of freedom of a rank (`vertex_space`), and by
    the nodes of the `SectionMesh` (files, checkpoints), which do not depend on the number of ranks.

    Args:
        comm: Communicator; the constructor is collective.
        source: The mesh on rank 0; ignored (may be None) elsewhere.

    Attributes:
        mesh: DOLFINx mesh. facet_tags: tags of the boundary groups, by position in `groups`.
        vertex_space: First-order Lagrange space, one value per vertex.
        groups: Names of the boundary groups. probes: Lines inward from the surface.
        multiplicity: Number of copies of the modelled part in the whole section.
        owned: Number of this rank's own vertices. cells: Number of its own cells.
        compiled: Names of the forms compiled on it.
    """

    def __init__(self, comm: MPI.Comm, source: SectionMesh | None) -> None:
        self.comm, self.source = comm, source
        root = comm.rank == 0
        if root:
            assert source is not None
        head = (
            (source.cell, source.order, source.groups, source.probes, source.multiplicity,
             source.facets, source.facet_group, len(source.points))
            if root and source is not None
            else None
        )  # fmt: skip
        cell, order, groups, probes, multiplicity, facets, facet_group, n_nodes = comm.bcast(head)
        self.cell, self.order, self.groups = cell, order, tuple(groups)
        self.probes, self.multiplicity, self.n_nodes = probes, multiplicity, n_nodes
        per_cell = {("triangle", 1): 3, ("triangle", 2): 6}.get((cell, order), (order + 1) ** 2)
        if root and source is not None:
            points, cells = np.ascontiguousarray(source.points), source.cells.astype(np.int64)
            parts = self._ranks_of_cells(source)
        else:
            points, cells = np.zeros((0, 2)), np.zeros((0, per_cell), np.int64)
            parts = np.zeros(0, np.int32)
        self.mesh = compat.create_mesh(comm, cells, points, cell, order, parts)
        self.vertex_space = fem.functionspace(self.mesh, ("Lagrange", 1))
        self.cells = int(self.mesh.topology.index_map(2).size_local)
        self._number_nodes()
        self.facet_tags = self._tag(facets, facet_group)
        self.compiled: list[str] = []

    def _ranks_of_cells(self, source: SectionMesh) -> npt.NDArray[np.int32]:
        """Rank of each cell (m,)."""
        outer = [i for i, name in enumerate(self.groups) if name in self.outer_groups]
        at_surface = np.zeros(len(source.points), dtype=bool)
        at_surface[source.facets[np.isin(source.facet_group, outer)]] = True
        rim = at_surface[source.cells].any(axis=1)
        return straight_cuts(source.points, source.cells, rim, self.comm.size)

    def compile(self, name: str, form: ufl.Form) -> fem.Form:
        """Compile `form`, recording `name` for the run's record."""
        self.compiled.append(name)
        return compat.compile_form(form)

    def compile_on_cells(self, name: str, form: ufl.Form) -> compat.CellForm:
        """Compile a form that is to be integrated over some of the cells."""
        self.compiled.append(name)
        return compat.CellForm(self.mesh, form)

    def _number_nodes(self) -> None:
        """Find the input node of each vertex and of each degree of freedom of `vertex_space`."""
        corners = 3 if self.cell == "triangle" else 4
        nodes = compat.geometry_dofmap(self.mesh)[:, :corners]
        original = np.asarray(self.mesh.geometry.input_global_indices)
        dofs = np.asarray(self.vertex_space.dofmap.list)[:, :corners]
        index_map = self.vertex_space.dofmap.index_map
        self.owned = index_map.size_local
        self._node_of_dof = np.full(self.owned + index_map.num_ghosts, -1, np.int64)
        self._node_of_dof[dofs] = original[nodes]
        self.mesh.topology.create_connectivity(2, 0)
        cell_vertices = self.mesh.topology.connectivity(2, 0)
        assert cell_vertices is not None
        vertices = cell_vertices.array.reshape(-1, corners)
        self._node_of_vertex = np.full(int(vertices.max(initial=-1)) + 1, -1, np.int64)
        self._node_of_vertex[vertices] = original[nodes]
        self.node_of_owned = self._node_of_dof[: self.owned]
        self._all_nodes = self.comm.gather(self.node_of_owned)

    def _tag(self, facets: npt.NDArray[np.int64], group: npt.NDArray[np.int32]) -> dmesh.MeshTags:
        """Tag the local boundary facets by the pair of input vertices they join."""
        topology = self.mesh.topology
        topology.create_connectivity(1, 2)
        topology.create_connectivity(1, 0)
        local = dmesh.exterior_facet_indices(topology)
        joined = topology.connectivity(1, 0)
        assert joined is not None
        pairs = np.array([joined.links(f) for f in local], dtype=np.int64).reshape(-1, 2)
        key = self.n_nodes  # two sorted vertices as one number
        low, high = np.sort(facets, axis=1).T
        known = low * key + high
        by_number = np.argsort(known)
        low, high = np.sort(self._node_of_vertex[pairs], axis=1).T
        place = np.searchsorted(known[by_number], low * key + high)
        values = np.asarray(group)[by_number][place].astype(np.int32)
        order = np.argsort(local)
        return dmesh.meshtags(self.mesh, 1, local[order], values[order])

    def matching(self, names: list[str] | tuple[str, ...]) -> list[int]:
        """Tags of the groups whose names begin with one of `names`."""
        return [i for i, g in enumerate(self.groups) if any(g.startswith(n) for n in names)]

    def required(self, names: list[str] | tuple[str, ...]) -> list[int]:
        """Like `matching`, for names each of which must match a group.

        Raises:
            InputError: Lists the names that match none.
        """
        problems = [
            f'"{name}": no such boundary group; there are {", ".join(self.groups)}'
            for name in names
            if not self.matching([name])
        ]
        if problems or not names:
            raise InputError(problems or "no boundary group is named")
        return self.matching(names)

    @property
    def outer_groups(self) -> tuple[str, ...]:
        """Groups on the strand's surface: all except the symmetry lines."""
        return tuple(g for g in self.groups if not g.startswith("symmetry"))

    def gather(self, owned: Array) -> Array | None:
        """Vertex values (owned,) of all ranks as (n_nodes,) on rank 0, None elsewhere.

        Nodes that are not vertices (second-order geometry) get the mean of the vertices around
        them.
        """
        pieces = self.comm.gather(np.ascontiguousarray(owned))
        if pieces is None or self.source is None or self._all_nodes is None:
            return None
        values = np.zeros(self.n_nodes)
        for nodes, piece in zip(self._all_nodes, pieces, strict=True):
            values[nodes] = piece
        if self.order == 2:
            for node, around in _MIDDLE[self.cell].items():
                near = values[self.source.cells[:, list(around)]]
                values[self.source.cells[:, node]] = near.mean(axis=1)
        return values

    def scatter(self, values: Array | None) -> Array:
        """Inverse of `gather`: owned vertex values (owned,) from rank 0's (n_nodes,)."""
        everything = self.comm.bcast(values)
        return np.asarray(everything[self.node_of_owned], dtype=np.float64)


# Vertices on both sides of a second-order node, in DOLFINx order.
_MIDDLE: dict[str, dict[int, tuple[int, ...]]] = {
    "triangle": {3: (1, 2), 4: (0, 2), 5: (0, 1)},
    "quadrilateral": {4: (0, 1), 5: (0, 2), 6: (1, 3), 7: (2, 3), 8: (0, 1, 2, 3)},
}


class Cellwise:
    """Values by cell on rank 0, numbered as in the input mesh for any number of ranks.

    Checkpoints store stress, state and displacement like this: values at a cell's points and nodes,
    in the order of the reference cell.
    """

    def __init__(self, section: Section) -> None:
        self.comm = section.comm
        owned = section.mesh.topology.index_map(2).size_local
        self.cells = np.asarray(section.mesh.topology.original_cell_index)[:owned]
        self._all = self.comm.gather(self.cells)

    def gather(self, values: Array) -> Array | None:
        """Values (own cells, ...) of all ranks as (cells, ...) on rank 0, None elsewhere."""
        pieces = self.comm.gather(np.ascontiguousarray(values))
        if pieces is None or self._all is None:
            return None
        whole = np.zeros((sum(len(c) for c in self._all), *values.shape[1:]))
        for cells, piece in zip(self._all, pieces, strict=True):
            whole[cells] = piece
        return whole

    def scatter(self, values: Array | None) -> Array:
        """Inverse of `gather`."""
        return np.ascontiguousarray(self.comm.bcast(values)[self.cells])


DIRECTIONS = np.array([(0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (1.0, -1.0)])


def straight_cuts(points: Array, cells: Indices, rim: Flags, ranks: int) -> npt.NDArray[np.int32]:
    """Rank of each cell (m,) by recursive bisection of the section.

    Where deep liquid is left out of the equations, the cells near the surface cause the work. A
    graph partitioner gives all ranks the same number of cells, but of two ranks for half a slab one
    gets the narrow face and thus half as many rim cells again as the other.

    Each cut has, among several directions, the one with the most even rim and few shared nodes.

    Args:
        points: Coordinates of the vertices (n, 2), m.
        cells: Nodes of each cell (m, k).
        rim: Whether a cell is at the surface (m,).
        ranks: Number of ranks.
    """
    found = np.zeros(len(cells), np.int32)
    middles = points[cells].mean(axis=1)
    waiting: list[tuple[Indices, range]] = [(np.arange(len(cells)), range(ranks))]
    while waiting:
        some, those = waiting.pop()
        if len(those) == 1:
            found[some] = those[0]
            continue
        half = len(those) // 2
        share = half / len(those)
        cuts = [_cut(middles[some] @ direction, share) for direction in DIRECTIONS]
        one = min(cuts, key=lambda cut: _cost(cells[some], rim[some], cut, share))
        waiting += [(some[one], those[:half]), (some[~one], those[half:])]
    return found


def _cut(places: Array, share: float) -> Flags:
    """Flags of the first cells by position, a given share of all."""
    first = np.zeros(len(places), bool)
    # Rounded, m: cells of one row have the same position.
    order = np.argsort(np.round(places, 9), kind="stable")
    first[order[: round(share * len(places))]] = True
    return first


def _cost(cells: Indices, rim: Flags, first: Flags, share: float) -> float:
    """Cost of a cut in cells: an uneven rim, and nodes on both sides."""
    uneven = abs(int(rim[first].sum()) - share * int(rim.sum()))
    layers = 6  # cells across a shell's thickness, whose work is attributed to a rim cell
    return layers * uneven + len(np.intersect1d(cells[first], cells[~first]))
