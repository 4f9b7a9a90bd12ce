"""The billet as a plain script on scikit-fem, as somebody who knows that library would write it.

It imports nothing of castfem.  Quarter of a 125 mm billet, sharp corners, h = 1600 W/m2K against
160 degC for 10 s, constants of a 0.42 %C steel, solid fraction linear between solidus and liquidus.
The mesh is a tensor grid of its own, graded to the surface; any other mesh may be handed in.

Two ways to write the enthalpy balance, both in temperature, both conserving heat:

* `lumped`: nodal enthalpies with a row-sum mass matrix.  Conductivity and h are constant here, so
  the stiffness is assembled once and a Newton step only changes a diagonal.
* `consistent`: enthalpy at the quadrature points, residual and Jacobian assembled by scikit-fem in
  every Newton step; what the library's examples do with nonlinear problems.

Time: backward Euler, BDF2 (first step backward Euler), or Alexander's SDIRK2.  Linear systems:
SuperLU as SciPy offers it, told that the matrix is symmetric and dominant; or conjugate gradients
with the diagonal as preconditioner.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.sparse import csc_matrix, diags
from scipy.sparse.linalg import LinearOperator, cg, splu
from skfem import (
    Basis,
    BilinearForm,
    ElementQuad1,
    ElementTriP1,
    FacetBasis,
    LinearForm,
    MeshQuad,
    MeshTri,
)
from skfem.helpers import dot, grad

from castfem.values.types import Array

RHO, C, K, LATENT = 7400.0, 700.0, 30.0, 270e3
SOLIDUS, LIQUIDUS, START = 1452.0, 1502.5, 1542.5  # degC
H_MOULD, T_MOULD = 1600.0, 160.0
HALF, END = 0.0625, 10.0  # m, s
GAMMA = 1.0 - 0.5**0.5
NEWTON, TOLERANCE = 40, 1e-6  # K
RC, RC_MUSH = RHO * C, RHO * (C + LATENT / (LIQUIDUS - SOLIDUS))


def enthalpy(t: Array) -> Array:
    """H(T), J/m3, zero at the liquidus."""
    mush = np.clip(t, SOLIDUS, LIQUIDUS)
    return RC * (t - mush) + RC_MUSH * (mush - LIQUIDUS)


def capacity(t: Array) -> Array:
    """dH/dT, J/m3K."""
    return np.where((t > SOLIDUS) & (t < LIQUIDUS), RC_MUSH, RC)


def graded(fine: float, keep: float, coarse: float, growth: float = 1.3) -> Array:
    """Coordinates from 0 to HALF: `fine` cells within `keep` of the end, growing to `coarse`; m."""
    sizes, depth = [], 0.0
    while depth < HALF - 1e-12:
        size = fine if depth < keep - 1e-9 else min(sizes[-1] * growth, coarse)
        sizes.append(size)
        depth += size
    nodes = HALF - np.concatenate([[0.0], np.cumsum(sizes)])[::-1] * HALF / depth
    nodes[0] = 0.0
    return nodes


def tensor_mesh(fine: float, keep: float, coarse: float) -> MeshQuad:
    """Quadrilaterals of the sharp-cornered quarter; lengths in m."""
    line = graded(fine, keep, coarse)
    return MeshQuad.init_tensor(line, line)


def mesh_from(points: Array, cells: npt.NDArray[np.int64]) -> MeshQuad | MeshTri:
    """A mesh somebody else made: points (n, 2), m, cells in cyclic order (m, 3) or (m, 4)."""
    kind = MeshTri if cells.shape[1] == 3 else MeshQuad
    return kind(np.ascontiguousarray(points.T), np.ascontiguousarray(cells.T))


@dataclass(frozen=True, slots=True)
class Run:
    """What a run gives: surface temperatures, degC, heat of the whole section, MJ/m, and cost."""

    instants: Array
    mid_face: Array
    corner: Array
    heat: Array
    vertices: int
    newton: int
    wall: float


class Billet:
    """Matrices of the problem, assembled once.

    Args:
        mesh: Mesh of the quarter [0, HALF]^2.
        surface: Which boundary facets are cooled, of their midpoints (2, n); default: the two
            outer sides.
        form: "lumped" or "consistent". linear: "splu" or "cg".
    """

    def __init__(
        self,
        mesh: MeshQuad | MeshTri,
        form: str = "lumped",
        linear: str = "splu",
        surface: Callable[[Array], Array] | None = None,
    ) -> None:
        element = ElementQuad1() if isinstance(mesh, MeshQuad) else ElementTriP1()
        self.basis = Basis(mesh, element, intorder=2)
        outer = surface or (lambda x: (x[0] > HALF - 1e-9) | (x[1] > HALF - 1e-9))
        facets = FacetBasis(mesh, element, facets=mesh.facets_satisfying(outer, True), intorder=2)

        @BilinearForm
        def conduction(u: Any, v: Any, _: Any) -> Any:
            return K * dot(grad(u), grad(v))

        @BilinearForm
        def mass(u: Any, v: Any, _: Any) -> Any:
            return u * v

        self.lumped, self.linear = form == "lumped", linear
        cooling = mass.assemble(facets)
        if self.lumped:
            cooling = diags(np.asarray(cooling.sum(axis=1)).ravel())
        self.ambient = H_MOULD * T_MOULD * np.asarray(cooling.sum(axis=1)).ravel()
        self.stiffness = csc_matrix(conduction.assemble(self.basis) + H_MOULD * cooling)
        self.stiffness.sort_indices()
        self.area = np.asarray(mass.assemble(self.basis).sum(axis=1)).ravel()
        self._diagonal = self._places()
        self.newton = 0
        points = mesh.p
        self.mid_face = int(np.argmin(points[0] - points[1]))
        self.corner = int(np.argmax(points[0] + points[1]))

    def _places(self) -> npt.NDArray[np.int64]:
        """Where the diagonal stands in the stored values of the stiffness."""
        a = self.stiffness
        columns = np.repeat(np.arange(a.shape[1]), np.diff(a.indptr))
        return np.flatnonzero(a.indices == columns)

    def stored(self, t: Array) -> Array:
        """Enthalpy tested by every node, J/m."""
        if self.lumped:
            return np.asarray(self.area * enthalpy(t))

        @LinearForm
        def form(v: Any, w: Any) -> Any:
            return enthalpy(w["t"]) * v

        return np.asarray(form.assemble(self.basis, t=self.basis.interpolate(t)))

    def _jacobian(self, t: Array, tau: float) -> csc_matrix:
        """d(stored)/dT + tau * stiffness."""
        if self.lumped:
            a = self.stiffness * tau
            a.data[self._diagonal] += self.area * capacity(t)
            return a

        @BilinearForm
        def form(u: Any, v: Any, w: Any) -> Any:
            return capacity(w["t"]) * u * v

        mass = form.assemble(self.basis, t=self.basis.interpolate(t))
        return csc_matrix(mass + tau * self.stiffness)

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

    def stage(self, base: Array, guess: Array, tau: float) -> Array:
        """Solve stored(T) - base + tau (stiffness T - ambient) = 0 by Newton's method."""
        t = guess.copy()

        def residual(t: Array) -> Array:
            return self.stored(t) - base + tau * (self.stiffness @ t - self.ambient)

        r = residual(t)
        size = float(np.abs(r / self.area).max()) / RC
        for _ in range(NEWTON):
            if size < TOLERANCE:
                return t
            change = self._solve(self._jacobian(t, tau), r)
            self.newton += 1
            scale = 1.0
            while True:  # halve the step while it does not help
                trial = t - scale * change
                r_trial = residual(trial)
                new = float(np.abs(r_trial / self.area).max()) / RC
                if new < size or scale < 0.2:
                    break
                scale *= 0.5
            t, r, size = trial, r_trial, new
        warnings.warn(f"Newton stops at {size:.1e} K", stacklevel=2)
        return t


def advance(billet: Billet, scheme: str = "sdirk2", step: float = 0.1, every: float = 0.5) -> Run:
    """Take the billet to END with even steps; results at multiples of `every`.

    Args:
        billet: The problem.
        scheme: "backward_euler", "bdf2" or "sdirk2".
        step: Step, s; a whole number of them makes `every`.
        every: Interval of results, s.
    """
    each, steps = round(every / step), round(END / step)
    t = np.full(len(billet.area), START)
    s_old = s = billet.stored(t)
    first = float(s.sum())
    t_old, found = t, []
    billet.newton = 0
    start = perf_counter()
    for n in range(1, steps + 1):
        guess = 2 * t - t_old
        if scheme == "sdirk2":
            t1 = billet.stage(s, t + GAMMA * (t - t_old), GAMMA * step)
            s1 = billet.stored(t1)
            base = s + (1 - GAMMA) / GAMMA * (s1 - s)
            new = billet.stage(base, t1 + (1 - GAMMA) / GAMMA * (t1 - t), GAMMA * step)
        elif scheme == "bdf2" and n > 1:
            new = billet.stage((4 * s - s_old) / 3, guess, 2 / 3 * step)
        else:
            new = billet.stage(s, guess, step)
        t_old, t = t, new
        s_old, s = s, billet.stored(t)
        if n % each == 0:
            removed = 4e-6 * (first - float(s.sum()))
            found.append((n * step, t[billet.mid_face], t[billet.corner], removed))
    wall = perf_counter() - start
    return Run(*np.array(found).T, len(t), billet.newton, wall)


if __name__ == "__main__":
    run = advance(Billet(tensor_mesh(0.4e-3, 10e-3, 8e-3)), step=0.25)
    print(f"surface at 10 s: mid-face {run.mid_face[-1]:.2f}, corner {run.corner[-1]:.2f} degC")
    print(f"heat removed {run.heat[-1]:.4f} MJ/m; {run.vertices} unknowns, {run.wall:.2f} s")
