"""Blocks and a punch to test the stability of the mean stress."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.sparse.linalg import splu

from castfem import meshes
from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.fem.section import Section
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.slice_definition import Slice
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import PrescribedDisplacement

from .mapped import box, mapped, ring, skewed

Field = Callable[[Array, float], Array]

SIDES = ("left", "bottom", "right", "top")
FOUR_TERMS = Integration(4, 3, linear=False)
YOUNG, POISSON = 200e9, 0.499999
SHEAR = 0.5 * YOUNG / (1.0 + POISSON)
NO_MODE = 1e-13  # square of an inf-sup constant that counts as 0


@dataclass
class Block:
    """A slice in plane strain and its current state."""

    problem: MechanicalProblem  #: equilibrium
    stepper: MechanicalStepper  #: time steps
    state: MechanicalState  #: current state

    @classmethod
    def of(
        cls, mesh: meshes.SectionMesh, law: Any, rules: Integration | None, **settings: Any
    ) -> Block:
        """Return a block free of stress."""
        section = Section(MPI.COMM_SELF, mesh)
        slice_ = Slice(law, np.zeros_like, PlainPlanes(()), integration=rules, **settings)
        problem = MechanicalProblem(section, slice_)
        stepper = MechanicalStepper(problem, judge=False)
        return cls(problem, stepper, stepper.initial(0.0, np.zeros(section.owned)))

    def step(self, time: float) -> Block:
        """Take one step to `time` (s).

        Raises:
            RuntimeError: The step did not converge.
        """
        result = self.stepper.step(self.state, time, self.state.temperature)
        if not result.converged:
            raise RuntimeError(result.reason)
        self.state = result.state
        return self

    @property
    def mean(self) -> Array:
        """Return the mean stress at its points, as it enters equilibrium, Pa."""
        points = self.problem.points
        return points.linear(self.state.stress[points.deviator_points :, :3].mean(axis=1))

    def rms(self, values: Array) -> float:
        """Return the rms over the area of values at the points of the mean stress."""
        weights = self.problem.points.mean.volume
        return float(np.sqrt(weights @ values**2 / weights.sum()))


def elastic(poisson: float = POISSON) -> ThermoElastic:
    return ThermoElastic(Elasticity.constant(YOUNG, poisson))


def inf_sup(mesh: meshes.SectionMesh, rules: Integration | None) -> tuple[int, float]:
    """Compute the inf-sup constant for displacements that are zero on all sides.

    The least of max_v int p div v / (|p| |eps(v)|) over the mean stresses p of the discretisation,
    with the norms of int p^2 and int 2 eps : eps.

    Returns:
        Number of mean stresses that do no work on any displacement (at least the uniform one), and
        the constant of the others.
    """
    held = tuple(PrescribedDisplacement(SIDES, i) for i in range(2))
    points = (block := Block.of(mesh, elastic(), rules, held=held, pin=False)).problem.points
    space, free = block.problem.space, np.flatnonzero(block.problem.constraints.free)
    strain = points.strain[: 4 * points.deviator_points]
    norm = 2.0 * strain.T @ sparse.diags(np.repeat(points.deviator.volume, 4)) @ strain
    values = points.linear.values
    weighted = values * points.mean.volume.reshape(*values.shape[:2], 1)
    work = weighted.transpose(0, 2, 1) @ points.dilation
    rows = dof_values.operator(space, np.arange(len(work)), work)[:, free].toarray()
    coupled = rows @ splu(norm[free][:, free].tocsc()).solve(rows.T)
    size = scipy.linalg.block_diag(*(weighted.transpose(0, 2, 1) @ values))
    found = scipy.linalg.eigh(0.5 * (coupled + coupled.T), size, eigvals_only=True)
    spurious = int((found < NO_MODE).sum())
    return spurious, float(np.sqrt(found[spurious]))


def colliding(cells: int, rules: Integration | None, cell: str = "quadrilateral") -> float:
    """Return the rms error of the mean stress in colliding flows over its rms.

    Stokes' flow u = (20 x y^3, 5 x^4 - 5 y^4), p = 60 x^2 y - 20 y^3 in a square of side 2, driven
    by its displacements on all sides. They leave a uniform mean stress free, which does not count.
    """
    flow: list[Field] = [
        lambda p, t: 1e-6 * t * 20.0 * p[:, 0] * p[:, 1] ** 3,
        lambda p, t: 1e-6 * t * 5.0 * (p[:, 0] ** 4 - p[:, 1] ** 4),
    ]
    held = tuple(PrescribedDisplacement(SIDES, i, value) for i, value in enumerate(flow))
    mesh = mapped(cells, cells, box(2.0, 2.0, -1.0, -1.0), cell, groups=SIDES)
    block = Block.of(mesh, elastic(), rules, held=held, pin=False).step(1.0)
    x, y = block.problem.points.mean.position.T
    exact = -1e-6 * SHEAR * (60.0 * x**2 * y - 20.0 * y**3)
    wrong = block.mean - exact
    weights = block.problem.points.mean.volume
    return block.rms(wrong - weights @ wrong / weights.sum()) / block.rms(exact)


def punch(cells: int, rules: Integration | None) -> Block:
    """Press a rough rigid punch into a block of twice its width between rough walls."""
    mesh = mapped(cells, cells, box(1.0, 1.0), groups=("symmetry_x", "bottom", "right", "top"))
    middle = mesh.points[mesh.facets].mean(axis=1)
    pressed = (mesh.facet_group == 3) & (middle[:, 0] < 0.5)
    mesh = replace(
        mesh, groups=(*mesh.groups, "punch"), facet_group=np.where(pressed, 4, mesh.facet_group)
    )
    walls = ("bottom", "right")
    held = (
        *(PrescribedDisplacement(walls, i) for i in range(2)),
        PrescribedDisplacement(("punch",), 0),
        PrescribedDisplacement(("punch",), 1, lambda p, t: np.full(len(p), -1e-3 * t)),
    )
    return Block.of(mesh, elastic(), rules, held=held, pin=False).step(1.0)


def under_punch(block: Block, cells: int) -> tuple[Array, Array]:
    """Fit the mean stress by four terms on each of cells x cells squares, as on a coarse mesh.

    Returns:
        Factors of 1, x, y and xy, x and y from -1 to 1 in the square (squares, 4), Pa; centres of
        the squares (squares, 2).
    """
    places = block.problem.points.mean.position * cells
    square = np.floor(places).astype(int)
    order = np.lexsort([*np.round(places - square, 6).T, square[:, 1], square[:, 0]])
    each = len(order) // cells**2
    x, y = (2.0 * (places - square) - 1.0)[order[:each]].T
    terms = np.column_stack([np.ones(each), x, y, x * y])
    found = np.linalg.lstsq(terms, block.mean[order].reshape(-1, each).T, rcond=None)[0]
    return found.T, (square[order[::each]] + 0.5) / cells


def punch_error(block: Block, fine: Block, cells: int) -> tuple[float, float]:
    """Return the relative rms errors of the mean stress and of its term xy, by a fine mesh.

    Squares at the edges of punch and walls, where the stress is singular, do not count.
    """
    (found, centre), (better, _) = under_punch(block, cells), under_punch(fine, cells)
    corners = [(0.5, 1.0), (1.0, 1.0), (1.0, 0.0)]
    far = np.min([np.abs(centre - c).max(axis=1) for c in corners], axis=0) > 0.25
    # Mean squares of the terms over a square.
    share = np.array([1.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 9.0])

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(values[far] ** 2 @ share)))

    mixed = (found - better) * [0.0, 0.0, 0.0, 1.0]
    return rms(found - better) / rms(better), rms(mixed) / rms(better)


MESHES: dict[str, tuple[str, Any, int]] = {
    "square": ("quadrilateral", box(1.0, 1.0), 1),
    "square, distorted": ("quadrilateral", skewed(1.0, 1.0), 1),
    "ring": ("quadrilateral", ring(1.0, 2.0), 2),
    "square, triangles": ("triangle", box(1.0, 1.0), 1),
    "ring, triangles": ("triangle", ring(1.0, 2.0), 2),
    "1 : 3.14, triangles of the ring's rule": ("triangle", box(1.0, 3.14), 2),
}
