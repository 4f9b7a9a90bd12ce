"""Liquid that is fed from above: it presses, and resists nothing."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import ThermoElastic
from castfem.physics.mechanics.definition import Ferrostatic
from castfem.physics.mechanics.planes import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.setups import RING_GROUPS, SliceSetup, box, mapped, ring

SOLIDUS, LIQUIDUS, HOT, COLD = 1700.0, 1750.0, 1760.0, 1600.0
YOUNG, HEAD = 10e9, 2e5


def soft(ratio: float, fed: bool) -> ThermoElastic:
    mushy_zone: Any = "none" if fed else "geometric"
    solidity = Solidity.between(
        SOLIDUS, LIQUIDUS, stiffness_ratio=ratio, mushy_zone=mushy_zone, memory=not fed
    )
    return ThermoElastic(Elasticity.constant(YOUNG, 0.3, solidity))


def built(
    mesh: Any, heat: Any, ratio: float, fed: bool = True, comm: MPI.Comm = MPI.COMM_SELF,
    **given: Any,
) -> SliceSetup:  # fmt: skip
    def fraction(temperature: Array) -> Array:
        return np.clip((LIQUIDUS - temperature) / (LIQUIDUS - SOLIDUS), 0.0, 1.0)

    given = {
        "ferrostatic": Ferrostatic(lambda t: HEAD, fraction, "full", "free"),
        "planes": PlainPlanes(()),
        "liquid": "fed" if fed else "elastic",
        **given,
    }
    return SliceSetup(mesh, soft(ratio, fed), comm=comm, start=heat, given=given)


def tube(ratio: float, fed: bool = True, large: bool = False) -> SliceSetup:
    """A frozen ring around liquid."""

    def heat(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) > 0.04 - 1e-6, COLD, HOT)

    held = tuple(PrescribedDisplacement(("inner",), i) for i in range(2))
    mesh = mapped(30, 12, ring(0.02, 0.05), "quadrilateral", 2, RING_GROUPS)
    made = built(mesh, heat, ratio, fed, held=held, large_strain=large)
    made.step(1.0)
    return made


def tip(made: SliceSetup) -> float:
    return float(made.displacement(lambda x, y: (x > 0.05 - 1e-9) & (np.abs(y) < 1e-9))[0][0])


@pytest.mark.parametrize("large", [False, True])
def test_a_tube_of_steel_bears_all_of_the_pressure(large: bool) -> None:
    """The limit of an elastic liquid without stiffness, whatever the fed one is given."""
    limit = tip(tube(1e-8, fed=False, large=large))
    for ratio in (1e-2, 1e-7):
        assert tip(tube(ratio, large=large)) == pytest.approx(limit, rel=2e-3)
    assert tip(tube(1e-2, fed=False, large=large)) < 0.95 * limit


def test_deep_liquid_follows_the_shell() -> None:
    """Its mesh goes along, evenly, between the shell and what is held."""
    made = tube(1e-5)
    assert made.problem.liquid is not None
    x, y = made.problem.space.tabulate_dof_coordinates()[:, :2].T
    u = made.state.displacement.reshape(-1, 2)
    outward = (u[:, 0] * x + u[:, 1] * y) / np.hypot(x, y)
    radius = np.round(np.hypot(x, y), 9)
    rings = np.unique(radius)
    mean = np.array([outward[radius == r].mean() for r in rings])
    # The innermost cells are held and stand for a shell themselves.
    assert np.all(np.diff(mean[(rings > 0.0209) & (rings < 0.0385)]) > 0.0)
    assert np.abs(mean[rings < 0.0211]).max() < 1e-15
    deep = made.problem.points.position[~made.problem.liquid.carries]
    assert np.hypot(*deep.T).max() < 0.039
    stress = made.state.stress[~made.problem.liquid.carries]
    assert stress.size and not stress.any()


def opening(fed: bool) -> tuple[float, float]:
    """Force on a wall that draws a shell away from its liquid, before and after 2 mm, N/m."""

    def heat(x: Array, y: Array) -> Array:
        return np.where(x > 0.08 - 1e-6, COLD, HOT)

    held = (PrescribedDisplacement(("right",), 0, lambda x, t: np.full(len(x), 2e-3 * (t - 1.0))),)
    groups = ("symmetry_x", "symmetry_y", "right", "symmetry_y_top")
    made = built(mapped(20, 10, box(0.1, 0.05), groups=groups), heat, 1e-3, fed, held=held)
    forces = []
    for time in (1.0, 1.5, 2.0):
        balance = made.step(time).balance
        assert balance is not None
        forces.append(float(made.problem.residual_state.forces[right_dofs(made)].sum()))
    return forces[0], forces[-1]


def right_dofs(made: SliceSetup) -> Array:
    x = made.problem.space.tabulate_dof_coordinates()[: made.problem.owned // 2, 0]
    return 2 * np.flatnonzero(x > 0.1 - 1e-9)


def test_liquid_resists_no_opening() -> None:
    """The wall bears the pressure on its height, wherever it is."""
    assert opening(fed=True) == pytest.approx((-HEAD * 0.05, -HEAD * 0.05), rel=1e-4)
    before, after = opening(fed=False)
    assert after - before > HEAD * 0.02


def test_liquid_has_no_memory() -> None:
    """Steel that freezes starts free of stress, whatever its liquid went through."""
    held = (
        PrescribedDisplacement(("right",), 0, lambda x, t: np.full(len(x), 1e-3 * min(t, 1.0))),
        PrescribedDisplacement(("top",), 1),
    )
    made = built(mapped(8, 4, box(0.1, 0.05)), HOT, 1e-2, held=held, ferrostatic=None)
    made.step(1.0)
    made.step(2.0, COLD)
    assert np.abs(made.state.stress).max() < 1e-6 * YOUNG * 1e-2


@pytest.mark.mpi
def test_ranks_agree() -> None:
    def heat(x: Array, y: Array) -> Array:
        return np.where(np.maximum(x, y) > 0.037, COLD, HOT)

    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        made = built(mapped(12, 12, box(0.05, 0.05)), heat, 1e-5, comm=comm)
        made.step(1.0)
        size = float(np.abs(made.state.displacement).max())
        total = float(np.sum(made.state.displacement[: made.problem.owned] ** 2))
        found.append((comm.allreduce(size, op=MPI.MAX), comm.allreduce(total)))
    assert found[0] == pytest.approx(found[1], rel=1e-8)
