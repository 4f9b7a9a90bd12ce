"""A section that freezes, as a plain script on scikit-fem would solve it: the opponent of castfem.

Enthalpy is differenced over the step, mass is lumped, and the unknown is the conduction integral u
= int k dT: the stiffness is assembled once, the matrix stays symmetric, and a Newton step changes
only its diagonal.  Linear systems are solved by SciPy's conjugate gradients with the diagonal as
preconditioner, which was quicker than SuperLU on all meshes.  Time goes by BDF2 or by Alexander's
SDIRK2, in steps that somebody has chosen for the case.

Mesh, T(u), H(u) and the heat that leaves each vertex in each zone, over its temperature, are read
from castfem's set-up into tables, so that no law is evaluated in the time loop.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import LinearOperator, cg
from skfem import Basis, BilinearForm, ElementQuad1, MeshQuad
from skfem.helpers import dot, grad

from castfem.base.types import Array
from castfem.model.build.simulation import Simulation

GAMMA = 1.0 - 0.5**0.5
NEWTON, TOLERANCE = 40, 1e-6  # K
COLDEST, SPACING, COARSE = 300.0, 0.25, 5.0  # K: of the tables of the steel and of the fluxes


@BilinearForm
def laplacian(u: Any, v: Any, _: Any) -> Any:
    """Int grad u . grad v."""
    return dot(grad(u), grad(v))


@BilinearForm
def mass(u: Any, v: Any, _: Any) -> Any:
    """Int u v."""
    return u * v


class Script:
    """The heat balance of a section of quadrilaterals; numbers of its vertices are castfem's.

    Args:
        simulation: Set up, of a case with temperature alone and a constant casting speed.

    Attributes:
        poured: u of the steel as it is cast, W/m.
        changes: Instants at which the cooling changes, s.
        newton: Newton iterations since the start.
    """

    def __init__(self, simulation: Simulation) -> None:
        space = simulation.section.vertex_space
        cells = space.dofmap.list[:, [0, 1, 3, 2]]  # in cyclic order
        points = space.tabulate_dof_coordinates()[:, :2]
        basis = Basis(MeshQuad(points.T.copy(), cells.T.copy()), ElementQuad1(), intorder=2)
        self.area = np.asarray(mass.assemble(basis).sum(axis=1)).ravel()
        self._stiffness = csc_matrix(laplacian.assemble(basis))
        self._stiffness.sort_indices()
        columns = np.repeat(np.arange(len(points)), np.diff(self._stiffness.indptr))
        self._diagonal = np.flatnonzero(self._stiffness.indices == columns)
        curve, start = simulation.problem.curve, simulation.start_temperature
        kelvin = np.arange(COLDEST, start + 1.0, SPACING)
        if curve.lines() is not None:  # straight between its knots
            inner = (curve.knots > COLDEST) & (curve.knots < kelvin[-1])
            kelvin = np.concatenate([[COLDEST], curve.knots[inner], [kelvin[-1]]])
        self._kelvin, self._enthalpy = kelvin, curve.enthalpy(kelvin)
        self._u = curve.conduction(kelvin)
        self._slopes = np.diff([self._kelvin, self._enthalpy], axis=1) / np.diff(self._u)
        self._capacity = curve.reference_capacity
        self.poured, self.newton = float(curve.conduction(start)), 0
        zones = simulation.zones
        self.changes = [float(t) for t in zones.starts if t < simulation.case.casting.duration]
        cooled = [zones.cooling(number).laws for number in range(len(self.changes))]
        dofs = [patch.dofs for laws in cooled for patch, _ in laws]
        self._surface = np.unique(np.concatenate(dofs))
        self._columns = np.arange(len(self._surface))
        grid = np.arange(COLDEST, start + 2 * COARSE, COARSE)
        self._fluxes = []
        for begun, laws in zip(self.changes, cooled, strict=True):
            heat = np.zeros((len(grid), len(points)))
            for patch, law in laws:
                for row, t in zip(heat, grid, strict=True):
                    q, _ = law.flux(np.full(len(patch.dofs), t), begun)
                    row[patch.dofs] += patch.weights * q
            self._fluxes.append(heat[:, self._surface])

    def temperature(self, u: Array) -> Array:
        """T (n,), K."""
        return np.interp(u, self._u, self._kelvin)

    def stored(self, u: Array) -> Array:
        """Enthalpy of every vertex, J/m."""
        return np.asarray(self.area * np.interp(u, self._u, self._enthalpy))

    def _lost(self, u: Array, time: float) -> tuple[Array, Array]:
        """Heat that leaves the surface in the zone of a step that ends at `time`, W/m; d/dT."""
        zone = max(int(np.searchsorted(self.changes, time - 1e-6)) - 1, 0)
        flux, place = self._fluxes[zone], (self.temperature(u[self._surface]) - COLDEST) / COARSE
        i = place.astype(int)
        low, rise = flux[i, self._columns], np.diff(flux[[i, i + 1], self._columns], axis=0)[0]
        return low + (place - i) * rise, rise / COARSE

    def _residual(self, u: Array, base: Array, tau: float, time: float) -> tuple[Array, Array]:
        """Heat balance of every vertex, J/m, and the slope of the surface's heat."""
        lost, slope = self._lost(u, time)
        flow = np.asarray(self._stiffness @ u)
        flow[self._surface] += lost
        return self.stored(u) - base + tau * flow, slope

    def _change(self, u: Array, r: Array, slope: Array, tau: float) -> Array:
        """Newton's correction."""
        i = np.clip(np.searchsorted(self._u, u, side="right") - 1, 0, len(self._u) - 2)
        warmer, fuller = self._slopes[:, i]
        diagonal, matrix = self.area * fuller, self._stiffness * tau
        diagonal[self._surface] += tau * slope * warmer[self._surface]
        matrix.data[self._diagonal] += diagonal
        inverse, n = 1.0 / matrix.diagonal(), len(r)
        jacobi = LinearOperator((n, n), matvec=lambda x: inverse * x)
        return np.asarray(cg(matrix, r, rtol=1e-8, M=jacobi)[0])

    def _stage(self, base: Array, guess: Array, tau: float, time: float) -> Array:
        """Solve stored(u) - base + tau flow(u) = 0 by Newton's method, damped where it must be."""
        u = guess.copy()
        r, slope = self._residual(u, base, tau, time)
        size = float(np.abs(r / self.area).max()) / self._capacity
        for _ in range(NEWTON):
            if size < TOLERANCE:
                return u
            change, scale = self._change(u, r, slope, tau), 1.0
            self.newton += 1
            while True:
                trial = u - scale * change
                r, slope = self._residual(trial, base, tau, time)
                new = float(np.abs(r / self.area).max()) / self._capacity
                if new < size or scale < 0.2:
                    break
                scale *= 0.5
            u, size = trial, new
        warnings.warn(f"Newton stops at {size:.1e} K", stacklevel=2)
        return u

    def instants(self, end: float, largest: float, first: float | None) -> list[float]:
        """Ends of steps, s: even ones, or from each change on doubled from `first` to `largest`."""
        found = [0.0]
        for change in [*self.changes[1:], end]:
            left, sizes, step = change - found[-1], [], largest if first is None else first
            while sum(sizes) < left - 1e-9:
                sizes.append(step)
                step = min(2.0 * step, largest)
            found += (found[-1] + np.cumsum(sizes) * left / sum(sizes)).tolist()
        return found[1:]

    def march(self, instants: Iterable[float], scheme: str) -> Iterator[tuple[float, Array, Array]]:
        """Yield time, s, u and what the vertices store after each step; "bdf2" or "sdirk2"."""
        time, before, u = 0.0, 0.0, np.full(len(self.area), self.poured)
        s_old = s = self.stored(u)
        u_old = u
        for then in instants:
            step = then - time
            more = step / before if before else 0.0  # of this step than of the one before
            if scheme == "sdirk2":
                tau = GAMMA * step
                u1 = self._stage(s, u + GAMMA * more * (u - u_old), tau, then - step + tau)
                base = s + (1 - GAMMA) / GAMMA * (self.stored(u1) - s)
                new = self._stage(base, u1 + (1 - GAMMA) / GAMMA * (u1 - u), tau, then)
            else:  # of which the first step is backward Euler
                old, now = more**2 / (1 + 2 * more), (1 + more) / (1 + 2 * more)
                guess = u + more * (u - u_old)
                new = self._stage((1 + old) * s - old * s_old, guess, now * step, then)
            u_old, u, time, before = u, new, then, step
            s_old, s = s, self.stored(u)
            yield time, u, s
