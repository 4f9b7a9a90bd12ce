"""Liquid as a soft stand-in, freezing shells, and stiff and extreme materials."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from castfem.base.tables import Constant, Table
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import PerfectlyPlastic, ThermoElastic
from castfem.physics.constitutive.hardening_laws import NortonHoff
from castfem.physics.mechanics.definition import Ferrostatic
from castfem.physics.mechanics.planes import PlainPlanes
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


def test_fully_liquid_slice() -> None:
    """Nothing but soft liquid: it yields to its pressure as Hooke says with nu = 0."""
    ratio, head = 1e-4, 1e3
    setup = SliceSetup(
        mapped(3, 3, box(0.1, 0.1)), soft(ratio), expansion(1e-5),
        given={"ferrostatic": pressed(head)}, start=HOT,
    )  # fmt: skip
    setup.step(1.0)
    corner = setup.displacement(lambda x, y: (x > 0.0999) & (y > 0.0999))[0]
    assert corner == pytest.approx([0.1 * head / (ratio * YOUNG)] * 2, rel=1e-9)
    assert setup.state.generalized_strains[0] == pytest.approx(0.0, abs=1e-12)


def test_liquid_does_not_contract() -> None:
    """Superheat goes without strain or stress when the law of the steel says so."""
    setup = SliceSetup(
        mapped(3, 3, box(0.1, 0.1)), soft(1e-5), STEEL.thermal_strain, start=STEEL.liquidus + 60
    )
    setup.step(1.0, lambda x, y: STEEL.liquidus + 1 + 100 * x)
    assert not setup.state.displacement.any()
    assert not setup.state.stress.any()


def test_fully_solid_slice() -> None:
    """No liquid, no pressure: the same as without a ferrostatic setup."""
    given = {"ferrostatic": pressed(1e6)}
    with_, without = (
        SliceSetup(mapped(3, 3, box(0.1, 0.1)), soft(1e-5), expansion(1e-5), given=g, start=COLD)
        for g in (given, {})
    )
    for setup in (with_, without):
        setup.step(1.0, lambda x, y: COLD - 1e4 * x * y)
    assert with_.state.displacement == pytest.approx(without.state.displacement, abs=1e-15)
    assert not with_.state.pressure.any()


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_shell_under_pressure_with_a_core_of_liquid(cell: str) -> None:
    """A frozen ring of one or more cells around liquid 1e-4 ... 1e-6 as stiff: Lame's tube."""
    inner, outer, head = 0.04, 0.05, 2e5

    def heat(x: Array, y: Array) -> Array:
        return np.where(np.hypot(x, y) > inner - 1e-6, COLD, HOT)

    found = {}
    for ratio in (1e-4, 1e-5, 1e-6):
        mesh = mapped(30, 12, ring(0.02, outer), cell, 2, RING_GROUPS)
        setup = SliceSetup(
            mesh, soft(ratio), start=heat,
            given={
                "ferrostatic": pressed(head), "planes": PlainPlanes(()),
                "held": tuple(PrescribedDisplacement(("inner",), i) for i in range(2)),
            },
        )  # fmt: skip
        result = setup.step(1.0)
        tip = setup.displacement(lambda x, y: (x > outer - 1e-9) & (np.abs(y) < 1e-9))[0]
        found[ratio] = tip[0]
        assert result.newton <= 3
    # The cell before the frozen vertices is solid but for its first third.
    radius = inner - 0.7 * (outer - 0.02) / 30
    tube = head * radius**2 / (outer**2 - radius**2)
    moved = (1 + 0.3) / YOUNG * tube * ((1 - 0.6) * outer + outer)
    assert found[1e-6] == pytest.approx(moved, rel=0.05)
    assert abs(found[1e-5] - found[1e-6]) < 0.2 * abs(found[1e-4] - found[1e-6])


def test_one_cell_of_shell() -> None:
    """The first instants: one row of cells is frozen, in part; the rest is liquid 1e-6 as stiff."""
    setup = CastSetup(billet_mesh(surface_size=2e-3), ratio=1e-6, ferrostatic=None)
    setup.advance(1.5, 0.1)
    frozen = setup.thermal.state.point.temperature < STEEL.solidus
    depth = 0.0625 - setup.vertices[frozen].max(axis=1)
    assert 0.0 <= depth.max() < 2.1e-3
    assert 0.0 < setup.results[-1].flowing < 0.2
    assert np.abs(setup.moved).max() < 1e-3


@pytest.mark.parametrize("ratio", [1e-3, 1e-6])
def test_iterations_do_not_depend_on_the_softness(ratio: float) -> None:
    setup = CastSetup(billet_mesh(), ratio=ratio, ferrostatic=None).advance(2.0, 0.1)
    assert np.mean([r.newton for r in setup.results]) < 8
    # The shell shrinks and its corner is colder, so that it is pulled in most.
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
HARSH = {
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
@pytest.mark.parametrize("name", list(HARSH))
def test_harsh_materials(name: str, step: float) -> None:
    """A freezing quarter in steps of 0.05 s and of 5 s: it ends right, or says why."""
    setup = CastSetup(billet_mesh(), law=HARSH[name], cooling=8000.0, ferrostatic=None)
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
