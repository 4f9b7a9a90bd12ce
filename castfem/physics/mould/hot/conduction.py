"""Steady heat conduction through the copper of a tube."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from castfem.base.errors import RunFailure
from castfem.base.types import Array, Indices
from castfem.fem import dof_values, reductions
from castfem.fem.compat import assemble_into, assemble_owned, compile_form, create_matrix
from castfem.forms import mould_tube
from castfem.physics.mould.hot.copper import Copper
from castfem.physics.mould.hot.solvers import LinearSolver, Method, Solved, chosen, heat_options
from castfem.physics.mould.hot.tube import Tube


@dataclass(frozen=True, slots=True, eq=False)
class FaceLoad:
    """Thermal loads on the two faces of the wall, at all nodes of the mesh (nodes,) or uniform."""

    flux: Array | float = 0.0  #: heat flux from the strand into the hot face, W/m2
    coefficient: Array | float = 0.0  #: heat transfer coefficient of the water, W/(m2 K)
    water: Array | float = 0.0  #: temperature of the water, K
    #: temperature of the hot face, K, instead of a flux; None with a flux
    hot: Array | float | None = None
    #: temperature of the water side, K, instead of water; None with water
    outer: Array | float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Heated:
    """The temperature of a tube."""

    temperature: fem.Function  #: function, K
    #: heat through the hot face of the quarter, W, from the given flux; NaN if its temperature is
    #: given
    supplied: float
    removed: float  #: heat to the water, W; NaN if the temperature is given
    newton: int  #: Newton iterations
    solved: Solved  #: the linear solves: iterations of the last one
    hottest: float  #: highest temperature, K


class Conduction:
    """Conduction through a tube with k(T), by Newton's method on the conduction integral.

    Args:
        tube: The tube.
        copper: Properties of the copper.
        method: Linear solver.
    """

    def __init__(self, tube: Tube, copper: Copper, method: Method = "auto") -> None:
        self.tube, self.copper = tube, copper
        unknowns = int(tube.scalars.dofmap.index_map.size_global)
        self._method = chosen(method, unknowns)
        self._unknowns = unknowns

    def solve(self, load: FaceLoad) -> Heated:
        """Return the temperature under a load (collective).

        Raises:
            RunFailure: A solver does not converge, or the load allows no steady state.
        """
        tube, copper = self.tube, self.copper
        space = tube.scalars
        theta, kelvin = fem.Function(space), tube.function()
        slope = tube.function(1.0)  # dT/dtheta = 1/k
        conditions = self._conditions(load)
        start = load.water if load.outer is None else load.outer
        kelvin.x.array[:] = np.mean(start)
        for where, value in self._given(load):
            kelvin.x.array[where] = value.x.array[where]
        theta.x.array[:] = copper.conduction_integral(kelvin.x.array)
        left, right, terms = self._forms(load, theta, kelvin, slope)
        fixed = _owned_of(conditions, tube.owned)
        matrix, newton = create_matrix(left), 0
        try:
            most = 30  # largest number of Newton iterations
            for _ in range(most):
                newton += 1
                kelvin.x.array[:] = copper.temperature(theta.x.array)
                slope.x.array[:] = 1.0 / np.asarray(copper.conductivity(kelvin.x.array))
                assemble_into(matrix, left, conditions)
                residual = assemble_owned(right, tube.owned)
                residual[fixed] = 0.0
                solver = LinearSolver(matrix, "mould_heat_", heat_options(self._method))
                step, iterations = solver.solve(residual)
                solver.destroy()
                full = dof_values.with_ghosts(space, step)
                theta.x.array[:] += full
                change = np.abs(full * slope.x.array)
                if reductions.largest(tube.comm, change) < 1e-7:  # K
                    break
            else:
                raise RunFailure(
                    f"hot mould: no temperature of the copper after {most} iterations: more heat "
                    "comes in than its water takes; give more water in [mould.tube] "
                    "(water_coefficient), or less heat"
                )
        finally:
            matrix.destroy()
        kelvin.x.array[:] = copper.temperature(theta.x.array)
        supplied, removed = (float(reductions.total(tube.comm, _sum(f))) for f in terms)
        return Heated(
            kelvin,
            supplied if load.hot is None else np.nan,
            removed if load.outer is None else np.nan,
            newton,
            Solved(self._method, self._unknowns, iterations),
            reductions.largest(tube.comm, kelvin.x.array),
        )

    def _forms(
        self, load: FaceLoad, theta: fem.Function, kelvin: fem.Function, slope: fem.Function
    ) -> tuple[fem.Form, fem.Form, tuple[fem.Form, fem.Form]]:
        """Return tangent, negative residual, and the heat through both faces."""
        tube = self.tube
        trial, v = ufl.TrialFunction(tube.scalars), ufl.TestFunction(tube.scalars)
        flux, h = tube.function(load.flux), tube.function(load.coefficient)
        water = tube.function(load.water)
        hot, cold = tube.surface("inner"), tube.surface("outer")
        left = mould_tube.conduction(trial, v, tube.dx)
        left += mould_tube.to_water(h, slope * trial, 0.0, v, cold)
        right = mould_tube.from_strand(flux, v, hot) - mould_tube.conduction(theta, v, tube.dx)
        right -= mould_tube.to_water(h, kelvin, water, v, cold)
        terms = (flux * hot, h * (kelvin - water) * cold)
        return (
            compile_form(left),
            compile_form(right),
            (compile_form(terms[0]), compile_form(terms[1])),
        )

    def _given(self, load: FaceLoad) -> list[tuple[npt.NDArray[np.int32], fem.Function]]:
        """Return the unknowns of the faces with a given temperature, and that temperature."""
        found = []
        for name, value in (("inner", load.hot), ("outer", load.outer)):
            if value is not None:
                dofs = fem.locate_dofs_topological(self.tube.scalars, 2, self.tube.facets(name))
                found.append((dofs, self.tube.function(value)))
        return found

    def _conditions(self, load: FaceLoad) -> list[fem.DirichletBC]:
        """Return conditions that keep these fixed: Newton's method starts from the given values."""
        zero = fem.Function(self.tube.scalars)
        return [fem.dirichletbc(zero, dofs) for dofs, _ in self._given(load)]


def _owned_of(conditions: list[fem.DirichletBC], owned: int) -> Indices:
    """Return the owned unknowns (of a scalar space) that conditions fix."""
    found = [condition.dof_indices()[0] for condition in conditions]
    dofs = np.concatenate(found) if found else np.zeros(0, np.int64)
    return np.unique(dofs[dofs < owned])


def _sum(form: fem.Form) -> float:
    """Return this rank's part of an integral."""
    return float(np.real(fem.assemble_scalar(form)))
