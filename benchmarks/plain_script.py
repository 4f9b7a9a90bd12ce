"""Solidification of a section by a plain script on scikit-fem, with which castfem is compared.

Enthalpy is differenced over the step, mass is lumped, and the unknown is the conduction integral u
= int k dT: the stiffness is assembled once, the matrix stays symmetric, and a Newton step changes
only its diagonal. Linear systems are solved by SciPy's conjugate gradients with the diagonal as
preconditioner, which was quicker than SuperLU on all meshes. The time scheme is BDF2 or Alexander's
SDIRK2, with steps chosen for the case.

Mesh, T(u), H(u) and the heat out of each vertex over its temperature in each zone are read from
castfem's set-up into tables, so that no law is evaluated in the time loop.
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
COLDEST, SPACING, COARSE = 300.0, 0.25, 5.0  # K: start of tables; steps for steel and fluxes


@BilinearForm
def laplacian(u: Any, v: Any, _: Any) -> Any:
    """Return the integrand grad u . grad v."""
    return dot(grad(u), grad(v))


@BilinearForm
def mass(u: Any, v: Any, _: Any) -> Any:
    """Return the integrand u v."""
    return u * v


class Script:
    """Heat balance of a section of quadrilaterals; vertices are numbered as in castfem.

    Args:
        simulation: Simulation of a thermal case with a constant casting speed.

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
        """Return T(u) (n,), K."""
        return np.interp(u, self._u, self._kelvin)

    def stored(self, u: Array) -> Array:
        """Return the enthalpy of every vertex, J/m."""
        return np.asarray(self.area * np.interp(u, self._u, self._enthalpy))

    def _lost(self, u: Array, time: float) -> tuple[Array, Array]:
        """Return heat out of the surface in a step that ends at `time`, W/m, and its slope d/dT."""
        zone = max(int(np.searchsorted(self.changes, time - 1e-6)) - 1, 0)
        flux, place = self._fluxes[zone], (self.temperature(u[self._surface]) - COLDEST) / COARSE
        i = place.astype(int)
        low, rise = flux[i, self._columns], np.diff(flux[[i, i + 1], self._columns], axis=0)[0]
        return low + (place - i) * rise, rise / COARSE

    def _residual(self, u: Array, base: Array, tau: float, time: float) -> tuple[Array, Array]:
        """Return the heat balance of every vertex, J/m, and the slope of the surface's heat."""
        lost, slope = self._lost(u, time)
        flow = np.asarray(self._stiffness @ u)
        flow[self._surface] += lost
        return self.stored(u) - base + tau * flow, slope

    def _change(self, u: Array, r: Array, slope: Array, tau: float) -> Array:
        """Return the correction of a Newton step."""
        i = np.clip(np.searchsorted(self._u, u, side="right") - 1, 0, len(self._u) - 2)
        warmer, fuller = self._slopes[:, i]
        diagonal, matrix = self.area * fuller, self._stiffness * tau
        diagonal[self._surface] += tau * slope * warmer[self._surface]
        matrix.data[self._diagonal] += diagonal
        inverse, n = 1.0 / matrix.diagonal(), len(r)
        jacobi = LinearOperator((n, n), matvec=lambda x: inverse * x)
        return np.asarray(cg(matrix, r, rtol=1e-8, M=jacobi)[0])

    def _stage(self, base: Array, guess: Array, tau: float, time: float) -> Array:
        """Solve stored(u) - base + tau flow(u) = 0 by Newton's method with damping."""
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
        """Return ends of steps, s: equal ones, or doubled from `first` after each change."""
        ends = [0.0]
        for change in [*self.changes[1:], end]:
            length, sizes, step = change - ends[-1], [], largest if first is None else first
            while sum(sizes) < length - 1e-9:
                sizes.append(step)
                step = min(2.0 * step, largest)
            ends += (ends[-1] + np.cumsum(sizes) * length / sum(sizes)).tolist()
        return ends[1:]

    def march(self, instants: Iterable[float], scheme: str) -> Iterator[tuple[float, Array, Array]]:
        """Yield time, s, u and stored heat after each step; `scheme` is "bdf2" or "sdirk2"."""
        time, before, u = 0.0, 0.0, np.full(len(self.area), self.poured)
        s_old = s = self.stored(u)
        u_old = u
        for then in instants:
            step = then - time
            more = step / before if before else 0.0  # ratio of this step to the previous one
            if scheme == "sdirk2":
                tau = GAMMA * step
                u1 = self._stage(s, u + GAMMA * more * (u - u_old), tau, then - step + tau)
                base = s + (1 - GAMMA) / GAMMA * (self.stored(u1) - s)
                new = self._stage(base, u1 + (1 - GAMMA) / GAMMA * (u1 - u), tau, then)
            else:  # the first step is backward Euler
                old, now = more**2 / (1 + 2 * more), (1 + more) / (1 + 2 * more)
                guess = u + more * (u - u_old)
                new = self._stage((1 + old) * s - old * s_old, guess, now * step, then)
            u_old, u, time, before = u, new, then, step
            s_old, s = s, self.stored(u)
            yield time, u, s
