"""Values and matrices of a rank's degrees of freedom: exchange with other ranks, evaluation.

A rank's own degrees of freedom come first, followed by those of other ranks that its cells touch
(ghosts).
"""

from __future__ import annotations

from petsc4py import PETSc

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from scipy import sparse

from castfem.base.types import Array, Flags, Indices


def owned_of(space: fem.FunctionSpace) -> int:
    """Number of this rank's own degrees of freedom."""
    return int(space.dofmap.index_map.size_local * space.dofmap.bs)


def with_ghosts(space: fem.FunctionSpace, owned: Array) -> Array:
    """Values of all local degrees of freedom from the owned ones of every rank (collective)."""
    if space.mesh.comm.size == 1:
        return np.array(owned, dtype=np.float64)
    vector = fem.Function(space).x
    vector.array[: owned_of(space)] = owned
    vector.scatter_forward()
    return np.array(vector.array)


def summed(space: fem.FunctionSpace, local: Array) -> Array:
    """Contributions of all ranks, ghosts included, at the owned degrees of freedom (collective)."""
    if space.mesh.comm.size == 1:
        return np.array(local, dtype=np.float64)
    vector = fem.Function(space).x
    vector.array[:] = local
    vector.scatter_reverse(la.InsertMode.add)
    return np.array(vector.array[: owned_of(space)])


def per_cell(space: fem.FunctionSpace) -> int:
    """Number of degrees of freedom of a cell."""
    return int(np.asarray(space.dofmap.list).shape[1] * space.dofmap.bs)


def dofs_of(space: fem.FunctionSpace, cells: Indices) -> npt.NDArray[np.int64]:
    """Local degrees of freedom of cells (cells, dofs), components of a node one after another."""
    size = space.dofmap.bs
    nodes = np.asarray(space.dofmap.list)[cells].astype(np.int64)
    return (nodes[:, :, None] * size + np.arange(size)).reshape(len(nodes), per_cell(space))


def operator(space: fem.FunctionSpace, cells: Indices, table: Array) -> sparse.csr_matrix:
    """Sparse matrix of values that depend linearly on a space's functions.

    Args:
        space: Space of the functions; the columns are this rank's degrees of freedom.
        cells: Cells of the values (n,); a cell may appear several times.
        table: Derivatives of each value by the degrees of freedom of its cell (n, values, dofs).

    Returns:
        Rows are the values of the first cell, then of the second...
    """
    index_map = space.dofmap.index_map
    columns = (index_map.size_local + index_map.num_ghosts) * space.dofmap.bs
    dofs = dofs_of(space, cells)
    if not table.size:
        return sparse.csr_matrix((0, columns))
    where = np.broadcast_to(dofs[:, None, :], table.shape)
    starts = np.arange(0, table.size + 1, dofs.shape[1])
    return sparse.csr_matrix(
        (table.ravel(), where.ravel(), starts), shape=(len(starts) - 1, columns)
    )


def matrix_of_nodes(
    whole: PETSc.Mat, space: fem.FunctionSpace, nodes: Flags
) -> tuple[PETSc.Mat, Indices]:
    """Submatrix for some nodes (collective).

    Entries added for other nodes by local numbers are ignored.

    Args:
        whole: Square, assembled, on `space`; its pattern contains every possible entry.
        space: Blocked space.
        nodes: Whether each local node, ghosts included, is selected; the same on every rank.

    Returns:
        The matrix, and this rank's own degrees of freedom that it covers, in its order.
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
