"""The distributed mesh of a tube, its faces by name, and gathering of nodal values."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from castfem.base.types import Array, Indices
from castfem.fem import compat

if TYPE_CHECKING:
    from castfem.meshes.tube import TubeMesh

FACES = ("inner", "outer", "symmetry_y", "symmetry_x", "top", "bottom", "collar")
"""Faces of the block: across the wall, around it (y = 0 first, then x = 0), along it; the collar is
the inner wall above the meniscus."""


class Tube:
    """A quarter of a tube.

    Args:
        comm: Communicator; the constructor is collective.
        source: The mesh on rank 0; ignored (may be None) elsewhere.
        degree: Degree of the unknowns, 1 or 2; at least the order of the mesh.

    Attributes:
        comm: Communicator.
        mesh: DOLFINx mesh.
        facet_tags: Tags of the faces, by index in `FACES`.
        shape: Numbers of nodes of the mesh across the wall, around it, along it.
        scalars: Space of temperatures and properties.
        vectors: Space of displacements.
    """

    def __init__(self, comm: MPI.Comm, source: TubeMesh | None) -> None:
        self.comm, self.degree = comm, 2
        head = None if source is None else (source.order, source.shape, source.meniscus)
        order, shape, self._meniscus = comm.bcast(head)
        self.shape: tuple[int, int, int] = shape
        if comm.rank == 0 and source is not None:
            points, cells = np.ascontiguousarray(source.points), source.cells
        else:
            points, cells = np.zeros((0, 3)), np.zeros((0, (order + 1) ** 3), np.int64)
        self.mesh = compat.create_mesh(comm, cells, points, "hexahedron", order)
        self.scalars = fem.functionspace(self.mesh, ("Lagrange", self.degree))
        self.vectors = fem.functionspace(self.mesh, ("Lagrange", self.degree, (3,)))
        geometry = compat.geometry_dofmap(self.mesh).astype(np.int64)
        original = np.asarray(self.mesh.geometry.input_global_indices)
        dofs = np.asarray(self.scalars.dofmap.list)
        shared = min(geometry.shape[1], dofs.shape[1])
        index_map = self.scalars.dofmap.index_map
        self.owned = int(index_map.size_local)
        # Nodes of the cells' geometry are in the order of the unknowns of the same degree.
        self.node_of_dof = np.full(self.owned + index_map.num_ghosts, -1, np.int64)
        self.node_of_dof[dofs[:, :shared]] = original[geometry[:, :shared]]
        self.facet_tags = self._tag(geometry, original)

    @cached_property
    def unknowns(self) -> int:
        """Total number of unknowns of the displacement."""
        return 3 * int(self.scalars.dofmap.index_map.size_global)

    @cached_property
    def first_node(self) -> Array:
        """Position of the mesh's first node (3,), m; the first call is collective."""
        (mine,) = np.nonzero(self.node_of_dof[: self.owned] == 0)
        places = self.comm.allgather(self.scalars.tabulate_dof_coordinates()[mine])
        return np.concatenate(places)[0]

    @cached_property
    def dx(self) -> ufl.Measure:
        """Volume measure."""
        return ufl.Measure("dx", domain=self.mesh, metadata={"quadrature_degree": 2 * self.degree})

    def surface(self, name: str) -> ufl.Measure:
        """Surface measure of a face."""
        rule = {"quadrature_degree": 2 * self.degree + 2}
        ds = ufl.Measure("ds", domain=self.mesh, subdomain_data=self.facet_tags, metadata=rule)
        return ds(FACES.index(name))

    def facets(self, name: str) -> npt.NDArray[np.int32]:
        """Local facets of a face."""
        return np.asarray(self.facet_tags.find(FACES.index(name)))

    def function(self, values: Array | float | None = None) -> fem.Function:
        """Return a scalar function from nodal values (nodes,) known on all ranks, or a constant."""
        found = fem.Function(self.scalars)
        if values is not None and np.ndim(values):
            found.x.array[:] = np.asarray(values)[self.node_of_dof]
        elif values is not None:
            found.x.array[:] = values
        return found

    def gather(self, owned: Array) -> Array | None:
        """Nodal values (nodes, ...) on rank 0 from the owned ones (owned, ...) (collective)."""
        nodes = self.comm.gather(self.node_of_dof[: self.owned])
        pieces = self.comm.gather(np.ascontiguousarray(owned))
        if nodes is None or pieces is None:
            return None
        whole = np.full((int(np.prod(self.shape)), *owned.shape[1:]), np.nan)
        for number, piece in zip(nodes, pieces, strict=True):
            known = number >= 0
            whole[number[known]] = piece[known]
        return whole

    def _tag(self, geometry: Indices, original: Indices) -> dmesh.MeshTags:
        """Tag boundary facets by the position of their vertices in the block."""
        topology = self.mesh.topology
        topology.create_connectivity(3, 0)
        topology.create_connectivity(2, 3)
        topology.create_connectivity(2, 0)
        cell_vertices, joined = topology.connectivity(3, 0), topology.connectivity(2, 0)
        assert cell_vertices is not None and joined is not None
        vertices = cell_vertices.array.reshape(-1, 8)
        node = np.full(int(vertices.max(initial=-1)) + 1, -1, np.int64)
        node[vertices] = original[geometry[:, :8]]
        facets = dmesh.exterior_facet_indices(topology)
        corners = node[np.array([joined.links(f) for f in facets], np.int64).reshape(-1, 4)]
        across, around, along = self.shape
        places = corners % across, corners // across % around, corners // (across * around)
        tag = np.full(len(facets), -1, np.int32)
        for axis, (place, count) in enumerate(zip(places, (across, around, along), strict=True)):
            tag[(place == 0).all(axis=1)] = 2 * axis
            tag[(place == count - 1).all(axis=1)] = 2 * axis + 1
        above = (tag == 0) & (places[2] <= self._meniscus).all(axis=1)
        tag[above] = FACES.index("collar")
        order = np.argsort(facets)
        return dmesh.meshtags(self.mesh, 2, facets[order], tag[order])
