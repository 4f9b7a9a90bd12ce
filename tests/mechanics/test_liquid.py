"""Liquid as a soft elastic stand-in or fed from above, and extreme materials."""

from __future__ import annotations

from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import PerfectlyPlastic, ThermoElastic
from castfem.physics.constitutive.hardening_laws import NortonHoff
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.slice_definition import Ferrostatic
from castfem.physics.mechanics.supports import PrescribedDisplacement
from mechanics.casting import STEEL, CastSetup, billet_mesh
from mechanics.setups import RING_GROUPS, SliceSetup, box, expansion, mapped, ring

SOLIDUS, LIQUIDUS, HOT, COLD = 1700.0, 1750.0, 1760.0, 1600.0
YOUNG = 10e9


def solidity(ratio: float) -> Solidity:
    return Solidity.between(SOLIDUS, LIQUIDUS, stiffness_ratio=ratio)


def soft(ratio: float, poisson: float = 0.3) -> ThermoElastic:
    return ThermoElastic(Elasticity.constant(YOUNG, poisson, solidity(ratio)))


def pressed(head: float) -> Ferrostatic:
    return Ferrostatic(
        lambda t: head,
        lambda T: np.clip((LIQUIDUS - T) / (LIQUIDUS - SOLIDUS), 0, 1),
        outside="free",
    )


def test_liquid_slice_expands_by_hooke() -> None:
    """A slice of soft liquid expands under its pressure by Hooke's law with nu = 0."""
    ratio, head = 1e-4, 1e3
    setup = SliceSetup(
        mapped(3, 3, box(0.1, 0.1)), soft(ratio), expansion(1e-5),
        settings={"ferrostatic": pressed(head)}, start=HOT,
    )  # fmt: skip
    setup.step(1.0)
    corner = setup.displacement(lambda x, y: (x > 0.0999) & (y > 0.0999))[0]
    assert corner == pytest.approx([0.1 * head / (ratio * YOUNG)] * 2, rel=1e-9)
    assert setup.state.generalized_strains[0] == pytest.approx(0.0, abs=1e-12)


def test_liquid_does_not_contract() -> None:
    """Cooling of superheated liquid gives neither strain nor stress."""
    setup = SliceSetup(
        mapped(3, 3, box(0.1, 0.1)), soft(1e-5), STEEL.thermal_strain, start=STEEL.liquidus + 60
    )
    setup.step(1.0, lambda x, y: STEEL.liquidus + 1 + 100 * x)
    assert not setup.state.displacement.any()
    assert not setup.state.stress.any()


def test_solid_slice_has_no_ferrostatic_pressure() -> None:
    """The result is that without ferrostatic pressure."""
    settings = {"ferrostatic": pressed(1e6)}
    with_pressure, without = (
        SliceSetup(mapped(3, 3, box(0.1, 0.1)), soft(1e-5), expansion(1e-5), settings=g, start=COLD)
        for g in (settings, {})
    )
    for setup in (with_pressure, without):
        setup.step(1.0, lambda x, y: COLD - 1e4 * x * y)
    assert with_pressure.state.displacement == pytest.approx(without.state.displacement, abs=1e-15)
    assert not with_pressure.state.pressure.any()


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_shell_around_soft_liquid_is_lames_tube(cell: str) -> None:
    """A solid ring around liquid of 1e-4 to 1e-6 of its stiffness tends to Lame's tube."""
    inner, outer, head = 0.04, 0.05, 2e5

    def heat(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) > inner - 1e-6, COLD, HOT)

    found = {}
    for ratio in (1e-4, 1e-5, 1e-6):
        mesh = mapped(30, 12, ring(0.02, outer), cell, 2, RING_GROUPS)
        setup = SliceSetup(
            mesh, soft(ratio), start=heat,
            settings={
                "ferrostatic": pressed(head), "planes": PlainPlanes(()),
                "held": tuple(PrescribedDisplacement(("inner",), i) for i in range(2)),
            },
        )  # fmt: skip
        result = setup.step(1.0)
        tip = setup.displacement(lambda x, y: (x > outer - 1e-9) & (np.abs(y) < 1e-9))[0]
        found[ratio] = tip[0]
        assert result.newton <= 3
    # The cell before the frozen vertices is solid except its first third.
    radius = inner - 0.7 * (outer - 0.02) / 30
    tube = head * radius**2 / (outer**2 - radius**2)
    moved = (1 + 0.3) / YOUNG * tube * ((1 - 0.6) * outer + outer)
    assert found[1e-6] == pytest.approx(moved, rel=0.05)
    assert abs(found[1e-5] - found[1e-6]) < 0.2 * abs(found[1e-4] - found[1e-6])


def test_shell_of_a_single_cell_converges() -> None:
    """At first one row of cells is partly solid; the rest is liquid of 1e-6 of its stiffness."""
    setup = CastSetup(billet_mesh(surface_size=2e-3), ratio=1e-6, ferrostatic=None)
    setup.advance(1.5, 0.1)
    frozen = setup.thermal.state.point.temperature < STEEL.solidus
    depth = 0.0625 - setup.vertices[frozen].max(axis=1)
    assert 0.0 <= depth.max() < 2.1e-3
    assert 0.0 < setup.results[-1].flowing < 0.2
    assert np.abs(setup.moved).max() < 1e-3


@pytest.mark.parametrize("ratio", [1e-3, 1e-6])
def test_iterations_are_independent_of_liquid_stiffness(ratio: float) -> None:
    setup = CastSetup(billet_mesh(), ratio=ratio, ferrostatic=None).advance(2.0, 0.1)
    assert np.mean([r.newton for r in setup.results]) < 8
    # The shell contracts, and most at its colder corner.
    corner = np.argmax(setup.vertices.sum(axis=1))
    assert (setup.moved[corner] < 0).all()


def cliff(low: float, high: float, at: float, width: float) -> Table:
    return Table(
        "temperature", (300.0, at, at + width, 1900.0), (low, low, high, high), logarithmic=True
    )


HOFF: dict[str, Any] = {"strength": Constant(40e6), "p1": Constant(0.0), "p3": Constant(0.15),
                        "p4": Constant(0.1)}  # fmt: skip
BASE = Elasticity(
    Table("temperature", (300.0, 1200.0, 1700.0), (120e9, 30e9, 5e9), logarithmic=True),
    Constant(0.3),
    Solidity.of(STEEL, stiffness_ratio=1e-5),
)  # fmt: skip
EXTREME = {
    "yield falls 1000-fold over 0.1 K": PerfectlyPlastic(BASE, cliff(50e6, 50e3, 1500.0, 0.1)),
    "modulus falls 100-fold over 0.1 K": NortonHoff(
        Elasticity(cliff(100e9, 1e9, 1500.0, 0.1), Constant(0.3), BASE.solidity), **HOFF
    ),
    "p3 = 0.02": NortonHoff(BASE, **(HOFF | {"p3": Constant(0.02)})),
    "p3 = 1": NortonHoff(BASE, **(HOFF | {"p3": Constant(1.0), "strength": Constant(1e10)})),
    "p4 = 0": NortonHoff(BASE, **(HOFF | {"p4": Constant(0.0)})),
    "p4 = 0.6": NortonHoff(BASE, **(HOFF | {"p4": Constant(0.6)})),
    "p1 = -20": NortonHoff(BASE, **(HOFF | {"p1": Constant(-20.0)})),
    "p1 = 50": NortonHoff(BASE, **(HOFF | {"p1": Constant(50.0)})),
}


@pytest.mark.parametrize("step", [0.05, 5.0])
@pytest.mark.parametrize("name", list(EXTREME))
def test_extreme_materials_converge_or_fail_clearly(name: str, step: float) -> None:
    """A solidifying quarter in steps of 0.05 s and of 5 s."""
    setup = CastSetup(billet_mesh(), law=EXTREME[name], cooling=8000.0, ferrostatic=None)
    steps = 0
    while steps < (10 if step < 1.0 else 2):
        time = setup.state.time + step
        setup.thermal.advance(time, time)
        before = setup.state
        result = setup.stepper.step(before, time, setup.thermal.state.point.temperature)
        if not result.converged:
            assert "DIVERGED" in result.reason and "forces" in result.reason
            assert result.state is before
            break
        setup.state = result.state
        assert np.isfinite(setup.state.stress).all()
        assert result.balance is not None and result.balance.forces_error < 1e-7
        steps += 1
    assert steps, f"not even the first step: {result.reason}"


YOUNG_FED, HEAD = 10e9, 2e5


def soft_or_fed(ratio: float, fed: bool) -> ThermoElastic:
    mushy_zone: Any = "none" if fed else "geometric"
    solidity = Solidity.between(
        SOLIDUS, LIQUIDUS, stiffness_ratio=ratio, mushy_zone=mushy_zone, memory=not fed
    )
    return ThermoElastic(Elasticity.constant(YOUNG_FED, 0.3, solidity))


def built(
    mesh: Any, heat: Any, ratio: float, fed: bool = True, comm: MPI.Comm = MPI.COMM_SELF,
    **settings: Any,
) -> SliceSetup:  # fmt: skip
    def fraction(temperature: Array) -> Array:
        return np.clip((LIQUIDUS - temperature) / (LIQUIDUS - SOLIDUS), 0.0, 1.0)

    settings = {
        "ferrostatic": Ferrostatic(lambda t: HEAD, fraction, "full", "free"),
        "planes": PlainPlanes(()),
        "liquid": "fed" if fed else "elastic",
        **settings,
    }
    return SliceSetup(mesh, soft_or_fed(ratio, fed), comm=comm, start=heat, settings=settings)


def tube(ratio: float, fed: bool = True, large: bool = False) -> SliceSetup:
    """Solve a solid ring around liquid."""

    def heat(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) > 0.04 - 1e-6, COLD, HOT)

    held = tuple(PrescribedDisplacement(("inner",), i) for i in range(2))
    mesh = mapped(30, 12, ring(0.02, 0.05), "quadrilateral", 2, RING_GROUPS)
    setup = built(mesh, heat, ratio, fed, held=held, large_strain=large)
    setup.step(1.0)
    return setup


def tip(setup: SliceSetup) -> float:
    return float(setup.displacement(lambda x, y: (x > 0.05 - 1e-9) & (np.abs(y) < 1e-9))[0][0])


@pytest.mark.parametrize("large", [False, True])
def test_tube_around_fed_liquid_carries_all_pressure(large: bool) -> None:
    """For any stiffness of fed liquid: the limit of elastic liquid of vanishing stiffness."""
    limit = tip(tube(1e-8, fed=False, large=large))
    for ratio in (1e-2, 1e-7):
        assert tip(tube(ratio, large=large)) == pytest.approx(limit, rel=2e-3)
    assert tip(tube(1e-2, fed=False, large=large)) < 0.95 * limit


def test_deep_liquid_follows_the_shell() -> None:
    """The displacement of its mesh varies monotonically between shell and fixed nodes."""
    setup = tube(1e-5)
    x, y = setup.problem.space.tabulate_dof_coordinates()[:, :2].T
    u = setup.state.displacement.reshape(-1, 2)
    outward = (u[:, 0] * x + u[:, 1] * y) / np.hypot(x, y)
    radius = np.round(np.hypot(x, y), 9)
    rings = np.unique(radius)
    mean = np.array([outward[radius == r].mean() for r in rings])
    # The innermost cells are fixed and act as a shell.
    assert np.all(np.diff(mean[(rings > 0.0209) & (rings < 0.0385)]) > 0.0)
    assert np.abs(mean[rings < 0.0211]).max() < 1e-15
    deep = setup.problem.points.position[~setup.problem.liquid.carries]
    assert np.hypot(*deep.T).max() < 0.039
    stress = setup.state.stress[~setup.problem.liquid.carries]
    assert stress.size and not stress.any()


def opening(fed: bool) -> tuple[float, float]:
    """Return the force on a wall that pulls a shell off its liquid, before and after 2 mm, N/m."""

    def heat(x: Array, y: Array) -> Array:
        return np.where(x > 0.08 - 1e-6, COLD, HOT)

    held = (PrescribedDisplacement(("right",), 0, lambda x, t: np.full(len(x), 2e-3 * (t - 1.0))),)
    groups = ("symmetry_x", "symmetry_y", "right", "symmetry_y_top")
    setup = built(mapped(20, 10, box(0.1, 0.05), groups=groups), heat, 1e-3, fed, held=held)
    forces = []
    for time in (1.0, 1.5, 2.0):
        balance = setup.step(time).balance
        assert balance is not None
        forces.append(float(setup.problem.residual_state.forces[right_dofs(setup)].sum()))
    return forces[0], forces[-1]


def right_dofs(setup: SliceSetup) -> Array:
    x = setup.problem.space.tabulate_dof_coordinates()[: setup.problem.owned // 2, 0]
    return 2 * np.flatnonzero(x > 0.1 - 1e-9)


def test_fed_liquid_does_not_resist_opening() -> None:
    """The wall carries the pressure on its height at any displacement."""
    assert opening(fed=True) == pytest.approx((-HEAD * 0.05, -HEAD * 0.05), rel=1e-4)
    before, after = opening(fed=False)
    assert after - before > HEAD * 0.02


def test_freezing_steel_starts_free_of_stress() -> None:
    """The stress is 0 after any earlier deformation of the liquid."""
    held = (
        PrescribedDisplacement(("right",), 0, lambda x, t: np.full(len(x), 1e-3 * min(t, 1.0))),
        PrescribedDisplacement(("top",), 1),
    )
    setup = built(mapped(8, 4, box(0.1, 0.05)), HOT, 1e-2, held=held, ferrostatic=None)
    setup.step(1.0)
    setup.step(2.0, COLD)
    assert np.abs(setup.state.stress).max() < 1e-6 * YOUNG_FED * 1e-2


@pytest.mark.mpi
def test_ranks_agree() -> None:
    def heat(x: Array, y: Array) -> Array:
        return np.where(np.maximum(x, y) > 0.037, COLD, HOT)

    found = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        setup = built(mapped(12, 12, box(0.05, 0.05)), heat, 1e-5, comm=comm)
        setup.step(1.0)
        size = float(np.abs(setup.state.displacement).max())
        total = float(np.sum(setup.state.displacement[: setup.problem.owned] ** 2))
        found.append((comm.allreduce(size, op=MPI.MAX), comm.allreduce(total)))
    assert found[0] == pytest.approx(found[1], rel=1e-8)
