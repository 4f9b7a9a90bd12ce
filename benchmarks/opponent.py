"""The billet as a plain script on scikit-fem, as somebody who knows that library would write it.

It takes nothing of castfem but a name for arrays.  Quarter of a 125 mm billet, sharp corners, h =
1600 W/m2K against 160 degC for 10 s, constants of a 0.42 %C steel, solid fraction linear between
solidus and liquidus. The mesh is a tensor grid of its own, graded to the surface; any other mesh
may be handed in.

Two ways to write the enthalpy balance, both in temperature, both conserving heat:

* `lumped`: nodal enthalpies with a row-sum mass matrix.  Conductivity and h are constant here, so
  the stiffness is assembled once and a Newton step only changes a diagonal.
* `consistent`: enthalpy at the quadrature points, residual and Jacobian assembled by scikit-fem in
  every Newton step; what the library's examples do with nonlinear problems.

Newton's method and the time schemes are those of `plain_heat`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix, diags
from skfem import BilinearForm, FacetBasis, LinearForm, MeshQuad, MeshTri

from benchmarks.plain_heat import HeatBalance, element_of, graded, laplacian, march, mass
from castfem.base.types import Array

RHO, C, K, LATENT = 7400.0, 700.0, 30.0, 270e3
SOLIDUS, LIQUIDUS, START = 1452.0, 1502.5, 1542.5  # degC
H_MOULD, T_MOULD = 1600.0, 160.0
HALF, END = 0.0625, 10.0  # m, s
RC, RC_MUSH = RHO * C, RHO * (C + LATENT / (LIQUIDUS - SOLIDUS))


def enthalpy(t: Array) -> Array:
    """H(T), J/m3, zero at the liquidus."""
    mush = np.clip(t, SOLIDUS, LIQUIDUS)
    return RC * (t - mush) + RC_MUSH * (mush - LIQUIDUS)


def capacity(t: Array) -> Array:
    """dH/dT, J/m3K."""
    return np.where((t > SOLIDUS) & (t < LIQUIDUS), RC_MUSH, RC)


def tensor_mesh(fine: float, keep: float, coarse: float) -> MeshQuad:
    """Quadrilaterals of the sharp-cornered quarter; lengths in m."""
    line = graded(fine, keep, coarse, HALF)
    return MeshQuad.init_tensor(line, line)


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


class Billet(HeatBalance):
    """Matrices of the problem, assembled once.

    Args:
        mesh: Mesh of the quarter [0, HALF]^2.
        form: "lumped" or "consistent". linear: "splu" or "cg".
        surface: Which boundary facets are cooled, of their midpoints (2, n); default: the two
            outer sides.
    """

    def __init__(
        self,
        mesh: MeshQuad | MeshTri,
        form: str = "lumped",
        linear: str = "splu",
        surface: Callable[[Array], Array] | None = None,
    ) -> None:
        super().__init__(mesh, linear, RC)
        outer = surface or (lambda x: (x[0] > HALF - 1e-9) | (x[1] > HALF - 1e-9))
        cooled = mesh.facets_satisfying(outer, True)
        cooling = mass.assemble(FacetBasis(mesh, element_of(mesh), facets=cooled, intorder=2))
        self.lumped = form == "lumped"
        if self.lumped:
            cooling = diags(np.asarray(cooling.sum(axis=1)).ravel())
        self.ambient = H_MOULD * T_MOULD * np.asarray(cooling.sum(axis=1)).ravel()
        self.stiffness = csc_matrix(K * laplacian.assemble(self.basis) + H_MOULD * cooling)
        self.stiffness.sort_indices()
        points = mesh.p
        self.mid_face = int(np.argmin(points[0] - points[1]))
        self.corner = int(np.argmax(points[0] + points[1]))

    def stored(self, t: Array) -> Array:
        """Enthalpy tested by every node, J/m."""
        if self.lumped:
            return np.asarray(self.area * enthalpy(t))

        @LinearForm
        def form(v: Any, w: Any) -> Any:
            return enthalpy(w["t"]) * v

        return np.asarray(form.assemble(self.basis, t=self.basis.interpolate(t)))

    def flow(self, t: Array, time: float) -> Array:
        """Heat that leaves every node, W/m."""
        del time  # the mould is the same all the way
        return np.asarray(self.stiffness @ t - self.ambient)

    def jacobian(self, t: Array, tau: float, time: float) -> csc_matrix:
        """d(stored)/dT + tau * stiffness."""
        del time
        if self.lumped:
            return self.with_diagonal(self.stiffness * tau, self.area * capacity(t))

        @BilinearForm
        def form(u: Any, v: Any, w: Any) -> Any:
            return capacity(w["t"]) * u * v

        stored = form.assemble(self.basis, t=self.basis.interpolate(t))
        return csc_matrix(stored + tau * self.stiffness)


def advance(billet: Billet, scheme: str = "sdirk2", step: float = 0.1, every: float = 0.5) -> Run:
    """Take the billet to END with even steps; results at multiples of `every`.

    Args:
        billet: The problem.
        scheme: "backward_euler", "bdf2" or "sdirk2".
        step: Step, s; a whole number of them makes `every`.
        every: Interval of results, s.
    """
    each, steps = round(every / step), round(END / step)
    poured = np.full(len(billet.area), START)
    first, found = float(billet.stored(poured).sum()), []
    billet.newton = 0
    start = perf_counter()
    instants = (n * step for n in range(1, steps + 1))
    for n, (time, t, s) in enumerate(march(billet, poured, instants, scheme), 1):
        if n % each == 0:
            removed = 4e-6 * (first - float(s.sum()))
            found.append((time, t[billet.mid_face], t[billet.corner], removed))
    wall = perf_counter() - start
    return Run(*np.array(found).T, len(poured), billet.newton, wall)


if __name__ == "__main__":
    run = advance(Billet(tensor_mesh(0.4e-3, 10e-3, 8e-3)), step=0.25)
    print(f"surface at 10 s: mid-face {run.mid_face[-1]:.2f}, corner {run.corner[-1]:.2f} degC")
    print(f"heat removed {run.heat[-1]:.4f} MJ/m; {run.vertices} unknowns, {run.wall:.2f} s")
