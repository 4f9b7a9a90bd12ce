"""The least factor of Nitsche's method: the trace inequality, and the check of the case model."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import ufl
from mechanics.setups import Map, SliceSetup, box, elastic, mapped, skewed
from runs.billet_runs import billet

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.constitutive.base import MaterialStep
from castfem.physics.contact.settings import FACTOR, LEAST_NITSCHE, Contact
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from contact.setups import LineWall

SHAPES: dict[str, Map] = {
    "square": box(3.0, 3.0),
    "wide": box(12.0, 3.0),
    "deep": box(3.0, 12.0),
    "skewed": skewed(3.0, 3.0),
}


def block(shape: str, cell: str, poisson: float) -> SliceSetup:
    """Set up unsupported cells whose complete foot is on a wall."""
    groups = ("left", "foot", "right", "top")
    wall = LineWall(lambda z: np.zeros(2), lambda z: np.pi)
    return SliceSetup(
        mapped(3, 3, SHAPES[shape], cell, groups=groups),
        elastic(1.0, poisson),
        settings={
            "planes": PlainPlanes(()),
            "pin": False,
            "interactions": (Contact(wall, ("foot",), method="nitsche"),),
        },
    )


def elastic_matrix(setup: SliceSetup) -> Array:
    """Return the tangent of Hooke's law (4, 4)."""
    n, law = 1, setup.law
    nothing = np.zeros((n, 4))
    step = MaterialStep(nothing, np.zeros(n), np.zeros(n), np.zeros(n), 1.0)
    return np.asarray(law.integrate(step, nothing, law.initial_state(n)).tangent[0])


def energy(setup: SliceSetup) -> Array:
    """Return the dense stiffness by both integration rules; `strain` projects the volume change."""
    points, tangent = setup.problem.points, elastic_matrix(setup)
    volume = np.outer([1.0, 1.0, 1.0, 0.0], [1.0, 1.0, 1.0, 0.0]) * tangent[:3, :3].sum() / 9.0
    strain = points.strain.toarray().reshape(points.count, 4, -1)
    rules = [
        (slice(0, points.deviator_points), tangent - volume),
        (slice(points.deviator_points, None), volume),
    ]
    parts = [
        np.einsum("q,qia,ij,qjb->ab", points.volume[rows], strain[rows], part, strain[rows])
        for rows, part in rules
    ]
    return np.asarray(parts[0] + parts[1])


def least_factor(shape: str, cell: str, poisson: float) -> float:
    """Return the least factor without a negative a(u, u) + int (K_p u_n - sigma_n(u)) u_n."""
    setup = block(shape, cell, poisson)
    contact, space = setup.problem.contact, setup.problem.space
    facets, trial, tangent = contact.facets, ufl.TrialFunction(space), elastic_matrix(setup)
    moved = facets.operator(trial, space).toarray().reshape(facets.count, 2, -1)
    g = facets.operator(ufl.grad(trial), space).toarray().reshape(facets.count, 4, -1)
    strain = np.stack([g[:, 0], g[:, 3], 0 * g[:, 0], (g[:, 1] + g[:, 2]) / np.sqrt(2)], axis=1)
    x, y = facets.normal.T
    along = np.column_stack([x * x, y * y, 0 * x, np.sqrt(2) * x * y])
    stress = np.einsum("qi,ij,qja->qa", along, tangent, strain)
    closing = np.einsum("qi,qia->qa", facets.normal, moved)
    cross = np.einsum("q,qa,qb->ab", facets.weight, stress, closing)
    spring = np.einsum("q,qa,qb->ab", facets.weight, closing, closing)
    height = facets.weight @ facets.height / facets.weight.sum()
    spring *= tangent[:3, :3].sum() / 9.0 / height
    rest = energy(setup) - 0.5 * (cross + cross.T)
    low, high = 0.0, 30.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        least = np.linalg.eigvalsh(rest + middle * spring)[0]
        low, high = (middle, high) if least < -1e-9 else (low, middle)
    return high


@pytest.mark.parametrize(
    ("shape", "poisson", "least"),
    [("square", 0.0, 3.52), ("wide", 0.0, 4.10), ("deep", 0.0, 3.00), ("square", 0.4, 8.07)],
)
def test_least_factor_is_that_of_the_documentation(
    shape: str, poisson: float, least: float
) -> None:
    """With C of h |sigma_n|^2 <= C K a(u, u) the factor is C / 4.

    The volume change is projected in a, but local in sigma_n.
    """
    assert least_factor(shape, "quadrilateral", poisson) == pytest.approx(least, abs=6e-3)


@pytest.mark.parametrize("poisson", [0.0, 0.4])
@pytest.mark.parametrize(("cell", "shape"), [("quadrilateral", "skewed"), ("triangle", "square")])
def test_default_factor_is_sufficient(shape: str, cell: str, poisson: float) -> None:
    least = least_factor(shape, cell, poisson)
    assert 1.0 < least < LEAST_NITSCHE < FACTOR


@pytest.mark.parametrize("factor", [1.0, 8.9])
def test_too_small_factor_is_rejected(factor: float) -> None:
    """The error has key and fix; the penalty method may have such a factor."""

    def case(method: str) -> Any:
        return billet("taper_1", f'mould.contact={{method="{method}",factor={factor}}}')

    with pytest.raises(InputError) as caught:
        case("nitsche")
    for part in ("mould.contact.factor", f"({factor:g}", "at least 9", "leave it out for 10"):
        assert part in str(caught.value)
    assert case("penalty").mould.contact.factor == factor
