"""The mean stress: how stable it is, and what locking and a poor choice of its terms would do.

Writes the tables of docs/mechanics.md on the quadrature rules and the terms of the mean stress.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from mpi4py import MPI

import numpy as np
import scipy.linalg
from scipy import sparse
from scipy.sparse.linalg import splu

from benchmarks.mapped import RING_GROUPS, box, mapped, ring, skewed
from benchmarks.report import Output, table
from castfem import meshes
from castfem.base.types import Array
from castfem.fem import dof_values
from castfem.fem.section import Section
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep, ThermoElastic
from castfem.physics.mechanics.definition import Slice
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.quadrature_rules import Integration
from castfem.physics.mechanics.state import MechanicalState
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure

Field = Callable[[Array, float], Array]

SIDES = ("left", "bottom", "right", "top")
FOUR_TERMS = Integration(4, 3, linear=False)
ONE_RULE = Integration(4, 4, linear=False)
YOUNG, POISSON = 200e9, 0.499999
SHEAR = 0.5 * YOUNG / (1.0 + POISSON)
NO_MODE = 1e-13  # square of a constant that counts as none


@dataclass
class Block:
    """A slice in plane strain and the state it has come to.

    Attributes:
        problem: Its equilibrium. stepper: Its steps. state: Where it is.
    """

    problem: MechanicalProblem
    stepper: MechanicalStepper
    state: MechanicalState

    @classmethod
    def of(
        cls, mesh: meshes.SectionMesh, law: Any, rules: Integration | None, **given: Any
    ) -> Block:
        """Free of stress."""
        section = Section(MPI.COMM_SELF, mesh)
        slice_ = Slice(law, np.zeros_like, PlainPlanes(()), integration=rules, **given)
        problem = MechanicalProblem(section, slice_)
        stepper = MechanicalStepper(problem, judge=False)
        return cls(problem, stepper, stepper.initial(0.0, np.zeros(section.owned)))

    def step(self, time: float) -> Block:
        """One step to `time` (s).

        Raises:
            RuntimeError: It did not converge.
        """
        result = self.stepper.step(self.state, time, self.state.temperature)
        if not result.converged:
            raise RuntimeError(result.reason)
        self.state = result.state
        return self

    @property
    def mean(self) -> Array:
        """Mean stress at its points, as it enters equilibrium, Pa."""
        points = self.problem.points
        return points.linear(self.state.stress[points.deviator_points :, :3].mean(axis=1))

    def rms(self, values: Array) -> float:
        """Root of the mean square over the area of values at the points of the mean stress."""
        weights = self.problem.points.mean.volume
        return float(np.sqrt(weights @ values**2 / weights.sum()))


def elastic(poisson: float = POISSON) -> ThermoElastic:
    """Hooke's law."""
    return ThermoElastic(Elasticity.constant(YOUNG, poisson))


def inf_sup(mesh: meshes.SectionMesh, rules: Integration | None) -> tuple[int, float]:
    """How well displacements that are zero on all sides feel each mean stress.

    The least of max_v int p div v / (|p| |eps(v)|) over the mean stresses p of the discretisation,
    with the norms of int p^2 and int 2 eps : eps.

    Returns:
        Number of mean stresses that no displacement feels (the uniform one at least), and the
        constant of the others.
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
    felt = rows @ splu(norm[free][:, free].tocsc()).solve(rows.T)
    size = scipy.linalg.block_diag(*(weighted.transpose(0, 2, 1) @ values))
    found = scipy.linalg.eigh(0.5 * (felt + felt.T), size, eigvals_only=True)
    unfelt = int((found < NO_MODE).sum())
    return unfelt, float(np.sqrt(found[unfelt]))


def colliding(cells: int, rules: Integration | None, cell: str = "quadrilateral") -> float:
    """Rms error of the mean stress in colliding flows, over its rms.

    Stokes' flow u = (20 x y^3, 5 x^4 - 5 y^4), p = 60 x^2 y - 20 y^3 in a square of side 2, by its
    displacements on all sides.  A uniform mean stress is left free by them, and does not count.
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
    """A rough rigid punch, half as wide as the block it is pressed into; rough walls all round."""
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
    """Mean stress by its four terms on each of cells x cells squares, as on a coarse mesh.

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
    """Error of the mean stress against a fine mesh's, and its term xy alone, rms over the rms.

    Squares that touch the edges of punch and walls, where the stress has no bound, do not count.
    """
    (found, centre), (better, _) = under_punch(block, cells), under_punch(fine, cells)
    corners = [(0.5, 1.0), (1.0, 1.0), (1.0, 0.0)]
    far = np.min([np.abs(centre - c).max(axis=1) for c in corners], axis=0) > 0.25
    # Of the terms over a square; those of the fine mesh are what the coarse one could have.
    share = np.array([1.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 9.0])

    def rms(values: Array) -> float:
        return float(np.sqrt(np.mean(values[far] ** 2 @ share)))

    mixed = (found - better) * [0.0, 0.0, 0.0, 1.0]
    return rms(found - better) / rms(better), rms(mixed) / rms(better)


INNER, OUTER, PRESSURE = 0.02, 0.04, 1e7  # of the tube, m and Pa
SPEED = 1.037924e-5  # of its bore in stationary creep, m/s


def tube(cells: int, cell: str, rules: Integration | None, law: Any) -> Block:
    """A quarter of a thick tube under inner pressure."""
    mesh = mapped(cells, cells, ring(INNER, OUTER), cell, 2, RING_GROUPS)
    return Block.of(mesh, law, rules, loads=(SurfacePressure(("inner",), lambda t: PRESSURE),))


def bore(block: Block, nodal_values: Array) -> float:
    """Radial part of a nodal field at the bore."""
    places = block.problem.space.tabulate_dof_coordinates()[:, :2]
    at = int(np.argmin(np.abs(places - [INNER, 0.0]).sum(axis=1)))
    return float(nodal_values[2 * at])


def lame(cells: int, cell: str, rules: Integration | None) -> tuple[float, float]:
    """Elastic tube: error of the bore's displacement; of the mean stress, rms over the pressure."""
    block = tube(cells, cell, rules, elastic()).step(1.0)
    share = PRESSURE * INNER**2 / (OUTER**2 - INNER**2)
    ratio = (1.0 - 2.0 * POISSON) * INNER + OUTER**2 / INNER
    exact = share * (1.0 + POISSON) / YOUNG * ratio
    stress = block.problem.points.recovered(block.state.stress)
    wrong = stress[:, :3].mean(axis=1) - 2.0 * (1.0 + POISSON) / 3.0 * share
    moved = bore(block, block.state.displacement) / exact - 1.0
    return moved, float(np.sqrt(np.mean(wrong**2))) / PRESSURE


def creeping(cells: int, cell: str, rules: Integration | None) -> tuple[float, float]:
    """Norton's tube, stationary: error of the bore's speed; of the axial stress, rms likewise."""
    law = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-9, 1e6, 5.0)
    block = tube(cells, cell, rules, law)
    for time in np.cumsum(2.0 ** np.arange(20)):
        block.step(float(time))
    points = block.problem.points
    radius = np.hypot(*points.deviator.position.T)
    # sigma_zz is the mean of radial and hoop stress.
    spread, here = (OUTER / INNER) ** 0.4 - 1.0, (OUTER / radius) ** 0.4
    exact = 0.5 * PRESSURE * (1.0 - here - 0.6 * here + 1.0) / spread
    wrong = points.recovered(block.state.stress)[:, 2] - exact
    speed = bore(block, block.state.rate) / SPEED - 1.0
    return speed, float(np.sqrt(np.mean(wrong**2))) / PRESSURE


def percent(share: float) -> float:
    """Two digits of it."""
    return float(f"{100.0 * share:.2g}")


def locking(output: Output, quick: bool) -> None:
    """Two rules and one."""
    names = {
        lame: ("elastic: displacement of the bore", "elastic: mean stress, rms over the pressure"),
        creeping: ("creep: speed of the bore", "creep: sigma_zz, rms over the pressure"),
    }
    runs = [(c, n) for c in ("quadrilateral", "triangle") for n in ((2,) if quick else (2, 4, 8))]
    rows: list[dict[str, Any]] = []
    for kind, words in names.items():
        for cell, cells in runs:
            both = zip(kind(cells, cell, None), kind(cells, cell, ONE_RULE), strict=True)
            for word, (two, one) in zip(words, both, strict=True):
                errors = {"two": percent(two), "one": percent(one)}
                rows.append({"tube": word, "cell": cell, "cells": cells, **errors})
    rows.sort(key=lambda row: [w for pair in names.values() for w in pair].index(row["tube"]))
    output.csv("locking", rows)


def show_locking(output: Output) -> None:
    """Two rules and one, from the data."""
    rows = output.rows("locking")
    columns = {
        "tube": "tube", "cell": "cells", "cells": "n", "two": "error, two rules, %",
        "one": "error, one rule, %",
    }  # fmt: skip
    output.insert("locking", table(rows, columns, {}))


TERMS = {"1, x, y": None, "a value at each of four points": FOUR_TERMS}
MESHES: dict[str, tuple[str, Any, int]] = {
    "square": ("quadrilateral", box(1.0, 1.0), 1),
    "square, distorted": ("quadrilateral", skewed(1.0, 1.0), 1),
    "ring": ("quadrilateral", ring(1.0, 2.0), 2),
    "square, triangles": ("triangle", box(1.0, 1.0), 1),
    "ring, triangles": ("triangle", ring(1.0, 2.0), 2),
    "1 : 3.14, triangles of the ring's rule": ("triangle", box(1.0, 3.14), 2),
}


def stability(output: Output, quick: bool) -> None:
    """The inf-sup constants."""
    counts = (2, 4) if quick else (2, 4, 8, 16)
    rows: list[dict[str, Any]] = []
    for name, (cell, shape, order) in MESHES.items():
        for terms, rules in TERMS.items():
            if rules is not None and cell == "triangle":
                continue
            found = [inf_sup(mapped(n, n, shape, cell, order, SIDES), rules) for n in counts]
            row: dict[str, Any] = {"mesh": name, "terms": terms, "unfelt": found[0][0]}
            rows.append(row | {f"n{n}": one[1] for n, one in zip(counts, found, strict=True)})
    output.csv("inf_sup", rows)


def show_stability(output: Output) -> None:
    """The inf-sup constants, from the data."""
    rows = output.rows("inf_sup")
    counts = [int(key[1:]) for key in rows[0] if key[0] == "n" and key[1:].isdigit()]
    columns = {"mesh": "section", "terms": "mean stress on a cell", "unfelt": "not felt at all"}
    columns |= {f"n{n}": f"n = {n}" for n in counts}
    output.insert("inf_sup", table(rows, columns, {f"n{n}": ".2g" for n in counts}))


def errors(output: Output, quick: bool) -> None:
    """Of the mean stress under a punch and in colliding flows."""
    fine = punch(16 if quick else 64, None)
    rows: list[dict[str, Any]] = []
    for cells in (4, 8) if quick else (4, 8, 16):
        for terms, rules in TERMS.items():
            wrong, mixed = punch_error(punch(cells, rules), fine, cells)
            flow = colliding(cells, rules)
            rows.append(
                {"cells": cells, "terms": terms, "punch": 100 * wrong, "mixed": 100 * mixed,
                 "flow": 100 * flow}
            )  # fmt: skip
    output.csv("mean_stress", rows)


def show_errors(output: Output) -> None:
    """Under a punch and in colliding flows, from the data."""
    rows = output.rows("mean_stress")
    columns = {
        "cells": "n", "terms": "mean stress on a cell", "punch": "punch: error, %",
        "mixed": "of it the mixed term, %", "flow": "colliding flows: error, %",
    }  # fmt: skip
    output.insert("punch", table(rows, columns, dict.fromkeys(("punch", "mixed", "flow"), ".2g")))


def main(output: Output, quick: bool = False) -> None:
    """All tables."""
    locking(output, quick)
    stability(output, quick)
    errors(output, quick)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    show_locking(output)
    show_stability(output)
    show_errors(output)
