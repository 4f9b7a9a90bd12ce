"""What the plain scripts on scikit-fem have in common: Newton's method, linear systems, time steps.

A script gives the heat that its nodes store, the heat that leaves them, and the matrix of both; all
conserve heat, for what is differenced over a step is the enthalpy.

Time: backward Euler, BDF2 (first step backward Euler), or Alexander's SDIRK2.  Linear systems:
SuperLU as SciPy offers it, told that the matrix is symmetric and dominant; or conjugate gradients
with the diagonal as preconditioner.
"""

from __future__ import annotations

import warnings
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, cg, splu
from skfem import Basis, BilinearForm, ElementQuad1, ElementTriP1, MeshQuad, MeshTri
from skfem.helpers import dot, grad

from castfem.base.types import Array

GAMMA = 1.0 - 0.5**0.5
NEWTON, TOLERANCE = 40, 1e-6  # K


def graded(fine: float, keep: float, coarse: float, length: float, growth: float = 1.3) -> Array:
    """Coordinates from 0 to `length`, m: cells `fine` within `keep` of the end, then growing."""
    sizes, depth = [], 0.0
    while depth < length - 1e-12:
        size = fine if depth < keep - 1e-9 else min(sizes[-1] * growth, coarse)
        sizes.append(size)
        depth += size
    nodes = length - np.concatenate([[0.0], np.cumsum(sizes)])[::-1] * length / depth
    nodes[0] = 0.0
    return nodes


def mesh_from(points: Array, cells: npt.NDArray[np.int64]) -> MeshQuad | MeshTri:
    """A mesh somebody else made: points (n, 2), m, cells in cyclic order (m, 3) or (m, 4)."""
    kind = MeshTri if cells.shape[1] == 3 else MeshQuad
    return kind(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T))


def element_of(mesh: MeshQuad | MeshTri) -> ElementQuad1 | ElementTriP1:
    """The linear element of a mesh."""
    return ElementQuad1() if isinstance(mesh, MeshQuad) else ElementTriP1()


@BilinearForm
def laplacian(u: Any, v: Any, _: Any) -> Any:
    """Int grad u . grad v."""
    return dot(grad(u), grad(v))


@BilinearForm
def mass(u: Any, v: Any, _: Any) -> Any:
    """Int u v."""
    return u * v


class HeatBalance(ABC):
    """A section's heat balance over a step, for one unknown at each node.

    Args:
        mesh: Mesh of the section.
        linear: "splu" or "cg".
        capacity: Of a kelvin, J/m3K, by which what a balance leaves open becomes a temperature.
    """

    def __init__(self, mesh: MeshQuad | MeshTri, linear: str, capacity: float) -> None:
        self.basis, self.linear = Basis(mesh, element_of(mesh), intorder=2), linear
        self.area = np.asarray(mass.assemble(self.basis).sum(axis=1)).ravel()
        self.newton, self._capacity = 0, capacity
        self._diagonal: npt.NDArray[np.int64] | None = None

    @abstractmethod
    def stored(self, u: Array) -> Array:
        """Enthalpy tested by every node, J/m."""

    @abstractmethod
    def flow(self, u: Array, time: float) -> Array:
        """Heat that leaves every node, W/m."""

    @abstractmethod
    def jacobian(self, u: Array, tau: float, time: float) -> csc_matrix:
        """d(stored)/du + tau d(flow)/du."""

    def with_diagonal(self, a: csc_matrix, diagonal: Array) -> csc_matrix:
        """Add to the diagonal of a new matrix, always of one pattern; returns it."""
        if self._diagonal is None:
            columns = np.repeat(np.arange(a.shape[1]), np.diff(a.indptr))
            self._diagonal = np.flatnonzero(a.indices == columns)
        a.data[self._diagonal] += diagonal
        return a

    def _solve(self, a: csc_matrix, b: Array) -> Array:
        if self.linear == "cg":
            inverse = 1.0 / a.diagonal()
            n = len(b)
            x, _ = cg(a, b, rtol=1e-8, M=LinearOperator((n, n), matvec=lambda r: inverse * r))
            return np.asarray(x)
        lu = splu(
            a,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        return np.asarray(lu.solve(b))

    def stage(self, base: Array, guess: Array, tau: float, time: float) -> Array:
        """Solve stored(u) - base + tau flow(u) = 0 by Newton's method."""
        u = guess.copy()

        def residual(u: Array) -> Array:
            return self.stored(u) - base + tau * self.flow(u, time)

        r = residual(u)
        size = float(np.abs(r / self.area).max()) / self._capacity
        for _ in range(NEWTON):
            if size < TOLERANCE:
                return u
            change = self._solve(self.jacobian(u, tau, time), r)
            self.newton += 1
            scale = 1.0
            while True:  # halve the step while it does not help
                trial = u - scale * change
                r_trial = residual(trial)
                new = float(np.abs(r_trial / self.area).max()) / self._capacity
                if new < size or scale < 0.2:
                    break
                scale *= 0.5
            u, r, size = trial, r_trial, new
        warnings.warn(f"Newton stops at {size:.1e} K", stacklevel=2)
        return u


def march(
    problem: HeatBalance, u: Array, instants: Iterable[float], scheme: str
) -> Iterator[tuple[float, Array, Array]]:
    """Go from instant to instant; yield time, s, the unknowns and what the nodes store then, J/m.

    Args:
        problem: The heat balance.
        u: Where it begins.
        instants: Of the steps' ends, after the start at 0, s.
        scheme: "backward_euler", "bdf2" or "sdirk2".
    """
    time, before, u_old = 0.0, 0.0, u
    s_old = s = problem.stored(u)
    for then in instants:
        step = then - time
        more = step / before if before else 0.0  # of this step than of the one before
        rise = u - u_old
        if scheme == "sdirk2":
            tau = GAMMA * step
            u1 = problem.stage(s, u + GAMMA * more * rise, tau, time + tau)
            base = s + (1 - GAMMA) / GAMMA * (problem.stored(u1) - s)
            new = problem.stage(base, u1 + (1 - GAMMA) / GAMMA * (u1 - u), tau, then)
        elif scheme == "bdf2" and more:
            old, now = more**2 / (1 + 2 * more), (1 + more) / (1 + 2 * more)
            new = problem.stage((1 + old) * s - old * s_old, u + more * rise, now * step, then)
        else:
            new = problem.stage(s, u + more * rise, step, then)
        u_old, u, time, before = u, new, then, step
        s_old, s = s, problem.stored(u)
        yield time, u, s
