"""A matrix of some of the nodes alone, which DOLFINx assembles into like into that of all."""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
from dolfinx import fem

from castfem.base.types import Flags, Indices


def matrix_of_nodes(
    whole: PETSc.Mat, space: fem.FunctionSpace, nodes: Flags
) -> tuple[PETSc.Mat, Indices]:
    """What a matrix has among some nodes (collective).

    What is added for other nodes by their local numbers is left out.

    Args:
        whole: Square, assembled, on `space`; every entry that there may be has its place.
        space: Blocked.
        nodes: Whether each local node belongs, ghosts included, the same on every rank.

    Returns:
        The matrix, and the degrees of freedom of this rank's own that it is for, in its order.
    """
    size, own = space.dofmap.bs, space.dofmap.index_map.size_local
    mine = np.flatnonzero(nodes[:own])
    first = space.mesh.comm.exscan(len(mine)) or 0
    number = fem.Function(space).x
    number.array.reshape(-1, size)[mine] = first + np.arange(len(mine))[:, None]
    number.scatter_forward()
    found = np.where(nodes, number.array.reshape(-1, size)[:, 0], -1).astype(PETSc.IntType)
    start = space.dofmap.index_map.local_range[0]
    kept = PETSc.IS().createBlock(size, (start + mine).astype(PETSc.IntType), comm=whole.comm)
    part = whole.createSubMatrix(kept, kept)
    numbers = PETSc.LGMap().create(found, bsize=size, comm=whole.comm)
    part.setLGMap(numbers, numbers)
    kept.destroy()
    numbers.destroy()
    return part, (mine[:, None] * size + np.arange(size)).ravel()
