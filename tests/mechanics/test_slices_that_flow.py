"""Slices that flow, rotate, relax and are incompressible: closed forms and energy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from constitutive.samples import norton_relaxation

from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.fem.factorisation import has_minimum_degree
from castfem.physics.constitutive.base import rotation
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep, PerfectlyPlastic
from castfem.physics.constitutive.hardening_laws import UnifiedSteel
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure
from mechanics.setups import RING_GROUPS, SliceSetup, box, elastic, mapped, ring, skewed

FREE = ("left", "bottom", "right", "top")
CELLS = ["quadrilateral", "triangle"]
YOUNG = 20e9


def test_slice_at_constant_strain_relaxes_as_norton() -> None:
    """With s0 = 15 MPa, n = 5, A = 1e-9 MPa^-n/s; the elastic energy lost is dissipated."""
    law = NortonCreep.constant(Elasticity.constant(YOUNG, 0.3), 1e-9, 1e6, 5.0)
    strain = 15e6 / YOUNG
    mesh = mapped(2, 2, skewed(0.02, 0.01))
    setup = SliceSetup(
        mesh, law, settings={"planes": PlainPlanes((), {"a0": lambda t: strain if t > 0 else 0.0})}
    )
    times = np.concatenate([[1e-9], np.geomspace(1e-3, 1e3, 481)])
    volume = setup.problem.points.deviator.volume
    found, heat = [], 0.0
    for time in times:
        heat += float(setup.step(float(time)).dissipation @ volume)
        found.append(setup.stress[:, 2].mean())
    exact = norton_relaxation(times, 15e6, YOUNG, 1e-9 / 1e6**5, 5.0)
    assert found == pytest.approx(exact, rel=6e-3)  # first order in the step
    goals = [10.006182e6, 5.909888e6, 3.341641e6, 1.880185e6]
    assert np.interp([1, 10, 100, 1000], times, found) == pytest.approx(goals, rel=6e-3)
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-3
    lost = (15e6**2 - found[-1] ** 2) / (2 * YOUNG) * volume.sum()
    assert heat == pytest.approx(lost, rel=0.01)


@pytest.mark.parametrize("cell", CELLS)
def test_work_on_a_compressed_slice_is_stored_or_dissipated(cell: str) -> None:
    """Work of the supports = elastic energy + dissipation, to first order in the step."""
    stiff = Elasticity.constant(YOUNG, 0.3)
    gaps = []
    for steps in (10, 20, 40):
        setup = SliceSetup(
            mapped(4, 4, box(0.02, 0.02), cell, groups=FREE),
            NortonCreep.constant(stiff, 1e-4, 2e7, 4.0),
            settings={
                "planes": PlainPlanes(()),
                "held": (
                    *(PrescribedDisplacement(("bottom",), i) for i in range(2)),
                    PrescribedDisplacement(("top",), 0),
                    PrescribedDisplacement(("top",), 1, lambda p, t: np.full(len(p), -1e-4 * t)),
                ),
                "pin": False,
            },
        )  # fmt: skip
        work = heat = 0.0
        force = 0.0
        volume = setup.problem.points.deviator.volume
        y = setup.problem.space.tabulate_dof_coordinates()[:, 1]
        top = 2 * np.flatnonzero(np.isclose(y, 0.02)) + 1
        for i in range(steps):
            heat += float(setup.step((i + 1) / steps).dissipation @ volume)
            now = float(setup.problem.residual_state.forces[top].sum())
            work += 0.5 * (force + now) * -1e-4 / steps
            force = now
        points = setup.problem.points
        s = setup.state.stress
        mean = s[:, :3].mean(axis=1)
        deviator = s - mean[:, None] * np.array([1.0, 1.0, 1.0, 0.0])
        deviator_points = points.deviator_points
        shear, bulk = YOUNG / 2.6, YOUNG / (3 * 0.4)
        stored = float(np.square(deviator[:deviator_points]).sum(axis=1) @ volume) / (4 * shear)
        stored += float(np.square(mean[deviator_points:]) @ points.mean.volume) / (2 * bulk)
        gaps.append((heat + stored - work) / work)
    assert abs(gaps[-1]) < 0.01
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.3)
    assert gaps[1] / gaps[2] == pytest.approx(2.0, abs=0.2)


@pytest.mark.parametrize("cell", CELLS)
def test_nearly_incompressible_tube_does_not_lock(cell: str) -> None:
    """With few cells the error of the widening of the bore does not grow with nu."""
    a, b, pressure = 0.02, 0.04, 1e7
    errors = {}
    for poisson in (0.3, 0.49, 0.4999):
        setup = SliceSetup(
            mapped(3, 4, ring(a, b), cell, 2, RING_GROUPS),
            elastic(YOUNG, poisson),
            settings={
                "planes": PlainPlanes(()),
                "loads": (SurfacePressure(("inner",), lambda t: pressure),),
            },
        )
        setup.step(1.0)
        level = pressure * a**2 / (b**2 - a**2)
        exact = (1 + poisson) / YOUNG * level * ((1 - 2 * poisson) * a + b**2 / a)
        found = setup.displacement(lambda x, y: np.isclose(x, a) & np.isclose(y, 0.0))[0, 0]
        errors[poisson] = abs(found / exact - 1)
        # The mean stress does not oscillate from point to point either.
        mean = setup.stress[:, :3].mean(axis=1)
        assert mean == pytest.approx(2 * (1 + poisson) / 3 * level, rel=0.2)
    assert errors[0.4999] < 3 * errors[0.3] + 2e-3


def held_by(gradient: Any) -> tuple[PrescribedDisplacement, ...]:
    """Return supports that move the complete boundary by a deformation gradient over time."""
    return tuple(
        PrescribedDisplacement(FREE, i, lambda p, t, i=i: p @ (gradient(t) - np.eye(2))[i])  # type: ignore[misc]
        for i in range(2)
    )


@pytest.mark.parametrize("flows", ["creep", "plastic", "signed"])
def test_rotating_block_flows_as_one_at_rest(flows: str) -> None:
    """The block rotates by 120 degrees while it is stretched along its own axes."""
    stiff = Elasticity.constant(YOUNG, 0.3)
    law: Any = NortonCreep.constant(stiff, 1e-3, 2e7, 5.0)
    if flows == "plastic":
        law = PerfectlyPlastic(stiff, Constant(2e7))
    elif flows == "signed":  # the back stress must rotate with the block
        law = UnifiedSteel(stiff, 0.1, np.zeros_like, hardening="signed")
    final = np.radians(120.0)

    def turn(angle: float) -> Array:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])

    def stretched(t: float) -> Array:
        return np.diag([np.exp(2e-2 * t), np.exp(-1e-2 * t)])

    def end(angle: float, steps: int) -> tuple[Array, Array]:
        setup = SliceSetup(
            mapped(2, 2, box(0.1, 0.07), groups=FREE), law, extrapolate=False,
            settings={
                "held": held_by(lambda t: turn(angle * t) @ stretched(t)),
                "planes": PlainPlanes(()), "pin": False, "large_strain": True,
            },
        )  # fmt: skip
        for time in np.linspace(0.0, 1.0, steps + 1)[1:]:
            setup.step(float(time))
        return setup.stress, law.strain(setup.state.internal)

    gaps = []
    for steps in (10, 20, 40):
        (rest, flow), (moved, moved_flow) = end(0.0, steps), end(final, steps)
        gaps.append(np.abs(moved - rest @ rotation(final).T).max() / np.abs(rest).max())
        assert flow.max() > 5e-3
    # Second order: the strain of a step is evaluated at its middle.
    assert gaps[-1] < 1e-3
    assert moved_flow == pytest.approx(flow, rel=1e-3)
    assert np.log2(gaps[:-1]) - np.log2(gaps[1:]) == pytest.approx([2.0, 2.0], abs=0.2)


@pytest.mark.parametrize("imposed", [True, False])
def test_bending_about_the_y_axis_is_exact(imposed: bool) -> None:
    """As test_bar_bending_is_exact, for a1 and the moment with x."""
    width, height, k = 0.06, 0.04, 0.05
    inertia = height * width**3 / 12
    if imposed:
        planes = PlainPlanes(("a0", "a2"), {"a1": lambda t: k * t})
    else:
        planes = PlainPlanes(("a0", "a1", "a2"), moment_x=lambda t: YOUNG * inertia * k)
    mesh = mapped(4, 2, box(width, height, -width / 2, -height / 2), groups=FREE)
    setup = SliceSetup(mesh, elastic(YOUNG, 0.3), settings={"planes": planes})
    balance = setup.step(1.0).balance
    assert setup.state.generalized_strains == pytest.approx([0.0, k, 0.0, 0.0], abs=1e-13)
    largest = YOUNG * k * width / 2
    assert np.abs(setup.stress[:, 2] - YOUNG * k * setup.places[:, 0]).max() < 1e-10 * largest
    assert np.abs(setup.stress[:, [0, 1, 3]]).max() < 1e-10 * largest
    assert balance.axial == pytest.approx([0.0, YOUNG * inertia * k, 0.0], rel=1e-10, abs=1e-6)


def test_imposed_elongation_gives_the_axial_force() -> None:
    """The force follows an imposed a0 over time; at a0 = 0 it is -E A alpha dT."""
    area, alpha = 1e-4, 1e-5
    history = np.array([0.0, 1e-4, 3e-4, -2e-4])
    planes = PlainPlanes((), {"a0": lambda t: float(np.interp(t, range(4), history))})
    setup = SliceSetup(mapped(1, 1, box(0.01, 0.01)), elastic(YOUNG), settings={"planes": planes})
    for time in (1.0, 2.0, 3.0):
        balance = setup.step(time).balance
        assert balance.axial[0] == pytest.approx(YOUNG * history[int(time)] * area, rel=1e-10)
    fixed = SliceSetup(
        mapped(1, 1, box(0.01, 0.01)), elastic(YOUNG), lambda T: alpha * T,
        settings={"planes": PlainPlanes(())},
    )  # fmt: skip
    balance = fixed.step(1.0, 100.0).balance
    assert balance.axial[0] == pytest.approx(-YOUNG * alpha * 100.0 * area, rel=1e-10)
    assert not fixed.state.generalized_strains.any()


GETTERS: dict[str, tuple[Any, Any]] = {
    "snes_max_it": (17, lambda s, k: s.getTolerances()[3]),
    "snes_stol": (1e-3, lambda s, k: s.getTolerances()[2]),
    "snes_max_funcs": (1234, lambda s, k: s.max_funcs),
    "snes_type": ("newtonls", lambda s, k: s.getType()),
    "ksp_type": ("cg", lambda s, k: k.getType()),
    "ksp_rtol": (1e-9, lambda s, k: k.getTolerances()[0]),
    "ksp_atol": (1e-30, lambda s, k: k.getTolerances()[1]),
    "ksp_max_it": (77, lambda s, k: k.getTolerances()[3]),
    "pc_type": ("lu", lambda s, k: k.getPC().getType()),
}


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize("name", list(GETTERS))
def test_each_option_reaches_petsc(name: str, free: bool) -> None:
    """Options of SNES or of the solver of the displacement block, with and without free strains."""
    value, getter = GETTERS[name]
    options: dict[str, Any] = {name: value}
    if name.startswith("ksp_"):
        options = {"ksp_type": "cg", "pc_type": "jacobi", name: value}
    planes = PlainPlanes(("a0",) if free else ())
    setup = SliceSetup(
        mapped(2, 2, box(0.1, 0.1)), thermal=lambda T: 1e-5 * T, options=options,
        settings={"planes": planes},
    )  # fmt: skip
    setup.step(1.0, lambda x, y: 100 * x)
    bordered, snes = setup.problem.bordered, setup.problem.solver.snes
    found = getter(snes, bordered.ksp)
    assert found == value


def test_default_solver_is_direct() -> None:
    """PETSc's LU on one rank; else MUMPS: Cholesky for small strain, LU for large."""
    own = has_minimum_degree()
    for large, kind in ((False, "lu" if own else "cholesky"), (True, "lu")):
        setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)), settings={"large_strain": large})
        setup.step(1.0)
        ksp = setup.problem.bordered.ksp
        assert (ksp.getType(), ksp.getPC().getType()) == ("preonly", kind)
        assert ksp.getPC().getFactorSolverType() == ("petsc" if own else "mumps")
