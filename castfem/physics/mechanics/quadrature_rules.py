"""The two quadrature rules of the slice, and the element of its displacement.

The stress deviator has one rule, the mean stress a lower one (against locking). Only a rank's own
cells count.
"""

from __future__ import annotations

from dataclasses import dataclass

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from castfem.base.types import Array, Indices
from castfem.fem.compat import CELLS, Tabulation
from castfem.fem.section import Section


@dataclass(frozen=True, slots=True)
class Integration:
    """Degrees of the two quadrature rules."""

    deviator: int = 4  #: for the stress deviator (4: 3 x 3 points, on triangles 6)
    mean: int = 3  #: for the mean stress (3: 2 x 2 points, on triangles the 4 of `STRANG_FIX`)
    #: whether the mean stress is linear on each cell, or independent at each of its points (to
    #: demonstrate locking)
    linear: bool = True

    @classmethod
    def of(cls, cell: str, order: int) -> Integration:
        """Return castfem's rules for a cell with first- or second-order geometry."""
        return cls(4, 2) if cell == "triangle" and order == 2 else cls()


# Rule of degree 3 on triangles. Only at these points is the divergence of the bubble that of its
# projection to linear functions for straight sides: the rule integrates the work of a linear mean
# stress exactly and adds no constraint. It has a negative weight, so that moduli must be equal at
# all four points, see `Points.stiffness_temperature`. Curved triangles use the three points of
# degree 2, which are not exact but do not lock either.
STRANG_FIX = (
    np.array([[1 / 3, 1 / 3], [1 / 5, 1 / 5], [3 / 5, 1 / 5], [1 / 5, 3 / 5]]),
    np.array([-27 / 96, 25 / 96, 25 / 96, 25 / 96]),
)


def displacement_element(cell: str) -> basix.ufl._ElementBase:
    """Second-order displacement: 9-node quadrilaterals; 6-node triangles with an inner bubble."""
    quadratic = basix.ufl.element("Lagrange", cell, 2)
    if cell == "triangle":
        quadratic = basix.ufl.enriched_element([quadratic, basix.ufl.element("Bubble", cell, 3)])
    return basix.ufl.blocked_element(quadratic, shape=(2,))


EVERY = slice(None)


class Rule:
    """One quadrature rule on all cells of this rank.

    Attributes:
        points: Reference points (k, 2). weights: Their weights (k,).
        measure: Area measure with these points, for forms on some of the cells.
        count: Points on this rank's cells. volume: Area of each (count,), m2.
        position: Positions on the undeformed mesh (count, 2), m.
    """

    def __init__(self, section: Section, degree: int) -> None:
        mesh = section.mesh
        self._mesh, self._cell = mesh, section.cell
        rule: dict[str, object] = {"quadrature_degree": degree}
        if section.cell == "triangle" and degree == 3:
            self.points, self.weights = STRANG_FIX
            rule["quadrature_rule"] = "custom"
            # As tuples: the signature of a form sees only a few digits of arrays.
            rule["quadrature_points"] = tuple(map(tuple, self.points.tolist()))
            rule["quadrature_weights"] = tuple(self.weights.tolist())
        else:
            kind = getattr(basix.CellType, section.cell)
            points, weights = basix.make_quadrature(kind, degree)
            self.points, self.weights = np.asarray(points), np.asarray(weights)
            rule["quadrature_rule"] = "default"
        self.measure = ufl.Measure("dx", domain=mesh, metadata=rule, subdomain_id=CELLS)
        size = Tabulation(mesh, abs(ufl.JacobianDeterminant(mesh)), self.points).values()
        self.volume = (size[..., 0] * self.weights).ravel() if size.size else np.zeros(0)
        self.count = self.volume.size
        places = Tabulation(mesh, ufl.SpatialCoordinate(mesh), self.points).values()
        self.position = places.reshape(self.count, 2)
        self._place = self._layout()

    def _layout(self) -> npt.NDArray[np.int64] | slice:
        """Degree of freedom of each point.

        DOLFINx does not guarantee that they are consecutive, nor their order: both are checked.
        """
        space = self._space(())
        cells = self._mesh.topology.index_map(2).size_local
        dofs = np.asarray(space.dofmap.list)[:cells].ravel().astype(np.int64)
        found = space.tabulate_dof_coordinates()[dofs, :2]
        scale = np.abs(found).max(initial=1e-300)
        if dofs.size != self.count or np.abs(found - self.position).max(initial=0.0) > 1e-9 * scale:
            raise RuntimeError("quadrature functions do not lie at the points of their rule")
        if np.array_equal(dofs, np.arange(self.count)):
            return slice(0, self.count)
        return dofs

    def _space(self, shape: tuple[int, ...]) -> fem.FunctionSpace:
        element = basix.ufl.quadrature_element(
            self._cell, value_shape=shape, points=self.points, weights=self.weights
        )
        return fem.functionspace(self._mesh, element)

    def function(self, *shape: int) -> fem.Function:
        """Return a function with a value of `shape` at each point."""
        return fem.Function(self._space(shape))

    def fill(self, function: fem.Function, values: Array, rows: Indices | slice = EVERY) -> None:
        """Set a function of this rule to `values` (n, ...) at some of its points."""
        if len(values):  # a rank may have no cells
            target = function.x.array.reshape(-1, values[0].size)
            at = rows if isinstance(self._place, slice) else self._place[rows]
            target[at] = values.reshape(len(values), -1)
