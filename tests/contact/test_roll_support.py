"""Faces on rolls: an elastic foundation with the bulge between rolls as its rest position."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped, skewed
from mechanics.test_tangent import jacobians

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep
from castfem.physics.contact.roll_support import Bed, GivenFoundation, RollSupport
from castfem.physics.mechanics.checkpoint import MechanicalCheckpoint
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure

GROUPS = ("left", "bottom", "right", "top")
PLANE_STRAIN = PlainPlanes(())
YOUNG, POISSON = 40e9, 0.3


def rolls(*on: str, **settings: Any) -> RollSupport:
    """Return rolls under groups with one bed: a `Bed` or a function of time."""
    bed: Bed | Callable[[float], Bed] = settings.pop("bed")
    history = bed if callable(bed) else lambda time: bed
    return RollSupport(on, GivenFoundation({name: history for name in on}), **settings)


def block(
    *interactions: Any, size: tuple[float, float] = (0.1, 0.04), **settings: Any
) -> SliceSetup:
    cells, groups = settings.pop("cells", (5, 3)), settings.pop("groups", GROUPS)
    options = {k: settings.pop(k) for k in ("springs", "comm") if k in settings}
    return SliceSetup(
        mapped(*cells, box(*size), groups=groups),
        elastic(YOUNG, POISSON),
        settings={"planes": PLANE_STRAIN, "interactions": interactions, **settings},
        tolerance=1e-11,
        **options,
    )


def outward(setup: SliceSetup, face: str = "bottom") -> Array:
    """Return the displacement of a face of the block along its outward normal, m."""
    foot = setup.problem.space.tabulate_dof_coordinates()[:, 1].min()
    top = setup.problem.space.tabulate_dof_coordinates()[:, 1].max()
    sign, height = (-1.0, foot) if face == "bottom" else (1.0, top)
    return sign * setup.displacement(lambda x, y: np.isclose(y, height))[:, 1]


@pytest.mark.parametrize("large", [False, True])
def test_balanced_pressure_leaves_the_face_at_rest(large: bool) -> None:
    """Exact also at large strain, where pressure and bed act on the deformed face."""
    p, bed = 2e6, Bed(2e6, 1e10, bulge=3e-4, offset=-1e-4)
    setup = block(
        rolls("bottom", bed=bed),
        loads=(SurfacePressure(("top",), lambda t: p),),
        large_strain=large,
    )
    assert len(setup.problem.constraints.dofs) == 1  # across; the bed supports all else
    setup.step(1.0)
    assert outward(setup) == pytest.approx(np.full_like(outward(setup), 2e-4), rel=1e-9)
    (state,) = setup.state.interactions
    assert state.moved == pytest.approx([2e-4], rel=1e-9)
    wide = 0.1 + np.ptp(setup.displacement(lambda x, y: np.isclose(y, 0.0))[:, 0])
    assert state.force == pytest.approx([p * (wide if large else 0.1)], rel=1e-9)


def edge(slenderness: float) -> tuple[Array, Array]:
    """Solve a plate clamped at its left end on a bed at a moved rest position.

    Args:
        slenderness: Thickness over the length (4 D/K)^(1/4).

    Returns:
        Displacement of the plate, and that of a thin plate, m.
    """
    thickness, rest = 0.01, 1e-5
    bending = YOUNG * thickness**3 / 12.0 / (1.0 - POISSON**2)
    zone = thickness / slenderness
    stiffness = 4.0 * bending / zone**4
    p = rest * stiffness
    setup = block(
        rolls("bottom", bed=Bed(p, stiffness, rest)),
        size=(10.0 * zone, thickness),
        cells=(120, 2),
        held=(PrescribedDisplacement(("left",), 0), PrescribedDisplacement(("left",), 1)),
        loads=(SurfacePressure(("top",), lambda t: p),),
    )
    setup.step(1.0)
    places = setup.problem.space.tabulate_dof_coordinates()[:, :2]
    x = places[np.isclose(places[:, 1], 0.0), 0] / zone
    exact = rest * (1.0 - np.exp(-x) * (np.cos(x) + np.sin(x)))
    return outward(setup), exact


def test_clamped_edge_is_a_plate_on_a_winkler_foundation() -> None:
    """Shear, which the thin plate neglects, gives a difference of second order."""
    errors = []
    for slenderness in (0.2, 0.1):
        found, exact = edge(slenderness)
        errors.append(np.abs(found - exact).max() / exact.max())
    assert errors[1] < 3e-3
    assert 3.5 < errors[0] / errors[1] < 5.5


# Rolls that do not pull change only the pressure and its slope, and large strain uses these as for
# any load: the combination of both needs no test.
@pytest.mark.parametrize(
    ("large", "within", "pull"),
    [(False, 1.0, True), (False, 0.3, True), (False, 0.3, False), (True, 1.0, True),
     (True, 0.3, True)],
)  # fmt: skip
def test_jacobian_matches_differences(large: bool, within: float, pull: bool) -> None:
    size = 1e-3 if large else 2e-5
    pressure = (1e14 if pull else 1e11) * size  # with the latter some of the face is free
    bed = Bed(pressure, 4e12, bulge=0.5 * size, offset=0.1 * size, within=within)
    law = NortonCreep.constant(Elasticity.constant(200e9, 0.3), 1e-2, 1e8, 3.0)
    setup = SliceSetup(
        mapped(2, 2, skewed(0.1, 0.06), groups=GROUPS),
        law,
        expansion(1e-5),
        settings={
            "planes": PlainPlanes(("a0", "a1", "a2", "across")),
            "large_strain": large,
            "interactions": (rolls("right", "top", bed=bed, pull=pull),),
        },
    )
    exact, found, free = jacobians(setup, size)
    assert np.abs(exact - found).max() < 2e-7 * np.abs(found).max()
    tail, head = slice(-free, None), slice(None, -free)
    for block_ in ((tail, head), (head, tail), (tail, tail)):
        assert np.abs(exact - found)[block_].max() < 2e-6 * np.abs(found[block_]).max()
    symmetric = np.abs(exact - exact.T).max() < 1e-12 * np.abs(exact).max()
    assert symmetric == setup.problem.kinematics.symmetric == (not large)
    # The bed contributes to the tangent.
    assert np.abs(found[:, -1]).max() > 0.0


def under(bed: Bed, **settings: Any) -> tuple[float, float]:
    """Solve a block fixed at its top on a bed: force of the bed, N/m, motion of its foot, m."""
    setup = block(rolls("bottom", bed=bed, **settings), held=(PrescribedDisplacement(("top",), 1),))
    setup.step(1.0)
    (state,) = setup.state.interactions
    return float(state.force[0]), float(state.moved[0])


def test_face_separates_from_rolls_that_cannot_pull() -> None:
    """Up to p/K from its rest both kinds are equal; beyond, a thousandth of the stiffness acts."""
    p, stiffness = 2e5, 1e10
    near, far = Bed(p, stiffness, offset=0.5 * p / stiffness), Bed(p, stiffness, offset=1e-4)
    assert under(near, pull=False) == pytest.approx(under(near), rel=1e-9)
    assert under(far)[0] < -50e3
    force, moved = under(far, pull=False)
    residual = 1e-3 * 0.1 * (p + stiffness * (moved - far.rest))
    assert force == pytest.approx(residual, rel=1e-6) and -100.0 < force < 0.0


@pytest.mark.parametrize("share", [1.0, 0.5, 0.01])
def test_separation_is_independent_of_the_pressure_within(share: float) -> None:
    """The force up to the separation is proportional to the pressure that remains."""
    p, stiffness = 1e6, 1e9
    forces = []
    for part in (1.0, 0.5, 0.0):
        bed = Bed(share * p, stiffness, bulge=part * p / stiffness, within=share)
        forces.append(under(bed)[0] / (0.1 * p))
    assert forces[0] == pytest.approx(0.0, abs=1e-12)
    # At half the distance the force is half; the block is slightly compressed.
    assert forces[1:] == pytest.approx([0.5 * share, share], rel=2e-3)


def test_solid_strand_is_loaded_only_beyond_its_rest() -> None:
    stiffness, way = 1e9, 1e-4
    force, moved = under(Bed(0.0, stiffness, bulge=way, within=0.0))
    assert force == 0.0 and moved == 0.0
    # With a liquid core the same bed pulls at the face.
    assert under(Bed(0.0, stiffness, bulge=way))[0] == pytest.approx(
        -0.1 * stiffness * way, rel=1e-2
    )
    pressed = [under(Bed(0.0, stiffness, bulge=-way, within=c)) for c in (0.0, 1.0)]
    assert pressed[0] == pytest.approx(pressed[1], rel=1e-12)
    assert pressed[0][0] == pytest.approx(0.1 * stiffness * way, rel=1e-2) and pressed[0][1] < 0.0


def test_work_of_the_rolls_is_stored_in_block_and_bed() -> None:
    """The rest positions of two beds move differently, and one end is fixed."""
    stiffness = (3e10, 1e10)
    history = [lambda t, s=s: Bed(0.0, stiffness[0], 1e-5 * s * t) for s in (1.0, -2.0)]
    beds = {"bottom": history[0], "top": lambda t: replace(history[1](t), stiffness=stiffness[1])}
    setup = block(
        RollSupport(("bottom", "top"), GivenFoundation(beds)),
        held=(PrescribedDisplacement(("left",), 0), PrescribedDisplacement(("left",), 1)),
    )
    work, before = 0.0, np.zeros(2)
    rest = 1e-5 * np.array([1.0, -2.0])
    for time in (0.25, 0.5, 1.0):
        step = time - setup.state.time
        setup.step(time)
        force = setup.state.interactions[0].force
        work -= 0.5 * step * float((before + force) @ rest)
        before = force
    problem, places = setup.problem, setup.problem.points
    strain = (places.strain @ setup.state.displacement).reshape(-1, 4)
    n = places.deviator_points
    stress = setup.state.stress
    mean = stress[:, :3].mean(axis=1)
    deviator = stress[:n] - np.outer(mean[:n], [1, 1, 1, 0])
    stored = 0.5 * places.deviator.volume @ np.einsum("ni,ni->n", deviator, strain[:n])
    stored += 0.5 * places.mean.volume @ (mean[n:] * strain[n:, :3].sum(axis=1))
    u = problem.fields.u
    assert work > 0.0
    foundation = 0.0
    for face, k, r in zip(("bottom", "top"), stiffness, rest, strict=True):
        moved = outward(setup, face) - r
        x = problem.space.tabulate_dof_coordinates()
        height = x[:, 1].min() if face == "bottom" else x[:, 1].max()
        along = x[np.isclose(x[:, 1], height), 0]
        foundation += 0.5 * k * integral_of_square(along, moved)
    assert u.x.array.any()
    assert stored + foundation == pytest.approx(work, rel=1e-9)
    assert min(foundation, stored) > 0.01 * work


def integral_of_square(x: Array, values: Array) -> float:
    """Integrate the square of a function that is quadratic between every second position."""
    order = np.argsort(x)
    x, values = x[order], values[order]
    found = 0.0
    for i in range(0, len(x) - 1, 2):
        shape = np.polynomial.Polynomial.fit(x[i : i + 3], values[i : i + 3], 2) ** 2
        found += float(shape.integ()(x[i + 2]) - shape.integ()(x[i]))
    return found


BED = {"bottom": lambda t: Bed(2e6, 2e10, 1e-4 * t), "top": lambda t: Bed(1e6, 1e10, 0.0, 2e-5)}


def on_both(**settings: Any) -> RollSupport:
    return RollSupport(("bottom", "top"), GivenFoundation(BED), **settings)


def test_half_section_gives_the_results_of_the_full_one() -> None:
    """The pressure acts on the sides of the block."""
    loads = (SurfacePressure(("right",), lambda t: 3e6 * t),)
    half = block(on_both(), groups=("symmetry_x", *GROUPS[1:]), loads=loads)
    loads = (SurfacePressure(("left", "right"), lambda t: 3e6 * t),)
    full = block(on_both(), size=(0.2, 0.04), cells=(10, 3), loads=loads)
    for setup in (half, full):
        setup.step(0.5)
        setup.step(1.0)
    on_half, on_full = (s.state.interactions[0] for s in (half, full))
    assert 2.0 * on_half.force == pytest.approx(on_full.force, rel=1e-9)
    assert on_half.moved == pytest.approx(on_full.moved, rel=1e-9)
    assert np.ptp(outward(half)) == pytest.approx(np.ptp(outward(full)), rel=1e-8)


@pytest.mark.mpi
def test_results_are_independent_of_ranks() -> None:
    found = []
    for comm in (MPI.COMM_SELF, MPI.COMM_WORLD):
        setup = block(on_both(), loads=(SurfacePressure(("right",), lambda t: 3e6),), comm=comm)
        setup.step(1.0)
        found.append(setup.state)
    one, many = (state.interactions[0] for state in found)
    assert many.force == pytest.approx(one.force, rel=1e-9)
    assert many.moved == pytest.approx(one.moved, rel=1e-9)


class Counting:
    """A foundation whose bulge depends on the number of steps in its memory."""

    def initial(self) -> Mapping[str, Array]:
        return {"steps": np.zeros(1)}

    def beds(
        self,
        memory: Mapping[str, Array],
        start: float,
        end: float,
        before: Array,
        temperature: Array,
    ) -> tuple[Mapping[str, Bed], Mapping[str, Array]]:
        steps = memory["steps"] + 1.0
        return {"bottom": Bed(1e6, 2e10, 1e-5 * float(steps[0]))}, {"steps": steps}


@pytest.mark.mpi
def test_checkpoint_restores_the_memory_of_the_foundation() -> None:
    comm = MPI.COMM_WORLD
    setup = block(
        RollSupport(("bottom",), Counting()), RollSupport(("top",), GivenFoundation(BED)), comm=comm
    )
    setup.step(0.5)
    checkpoint = MechanicalCheckpoint(setup.problem)
    arrays = {k: comm.bcast(v) for k, v in checkpoint.arrays(setup.state).items()}
    restored = checkpoint.state(checkpoint.description(setup.state), arrays)
    setup.step(1.0)
    again = setup.stepper.step(restored, 1.0, restored.temperature)
    # On several ranks MUMPS sums in the order of arrival of messages.
    tolerance = 0.0 if comm.size == 1 else 1e-12
    for one, other in zip(again.state.interactions, setup.state.interactions, strict=True):
        assert np.abs(one.force - other.force).max() <= tolerance * np.abs(other.force).max()
        assert one.beds == other.beds
    moved = setup.state.displacement
    assert np.abs(again.state.displacement - moved).max() <= tolerance * np.abs(moved).max()
    assert setup.state.interactions[0].memory["steps"] == [2.0]
    assert setup.state.interactions[1].beds["top"].offset == 2e-5


def test_discarded_step_does_not_change_the_memory() -> None:
    setup = block(RollSupport(("bottom",), Counting()))
    first = setup.stepper.step(setup.state, 1.0, setup.state.temperature)
    second = setup.stepper.step(setup.state, 1.0, setup.state.temperature)
    assert first.state.interactions[0].memory == second.state.interactions[0].memory
    assert setup.state.interactions[0].memory["steps"] == [0.0]


def test_rolls_act_between_the_first_and_the_last() -> None:
    """Before and after, springs keep the section at its position."""
    support = rolls("bottom", bed=Bed(0.0, 1e10, 1e-4), position=lambda t: t, between=(1.0, 3.0))
    setup = block(support, springs=1e-7)
    assert setup.problem.constraints.springs is not None
    found = []
    for time in (0.5, 1.0, 2.0, 3.0, 4.0):
        setup.step(time)
        found.append(setup.state.interactions[0].moved[0])
    assert found[:2] == [0.0, 0.0]
    assert found[2:] == pytest.approx([1e-4] * 3, rel=1e-5)
    assert setup.state.interactions[0].beds["bottom"] == Bed()


def test_permanent_rolls_reduce_the_fixed_points() -> None:
    """Two faces support one translation and the rotation: one point fixes the other translation."""
    assert len(block(on_both()).problem.constraints.fixed) == 1
    assert len(block(on_both(between=(0.0, 1.0))).problem.constraints.fixed) == 3
    mirrored = ("symmetry_x", *GROUPS[1:])
    points = [
        len(block(one, groups=mirrored, springs=1e-7).problem.constraints.dofs)
        - len(block(one, groups=mirrored, pin=False).problem.constraints.dofs)
        for one in (on_both(), on_both(between=(0.0, 1.0)))
    ]
    assert points == [0, 1]  # with symmetry no point is needed, or a spring for temporary rolls


def test_temporary_beds_need_springs() -> None:
    """Two of four faces have no bed in some steps, in which only a spring acts sideways."""
    beds = {name: (lambda t: Bed(0.0, 1e10)) for name in GROUPS}
    for loose, points in (((), 0), (("left", "right"), 1), (GROUPS, 3)):
        support = RollSupport(GROUPS, GivenFoundation(beds), loose=loose)
        assert len(block(support, springs=1e-7).problem.constraints.dofs) == points


def test_default_supports_are_springs_with_interactions() -> None:
    """Without interactions points are fixed; the setting of the caller has priority."""
    for interactions, sprung in ((on_both(between=(0.0, 1.0)),), True), ((), False):
        setup = block(*interactions)
        assert setup.problem.constraints.springs is None  # as set by the caller
        problem = MechanicalProblem(setup.section, setup.problem.slice)
        assert (problem.constraints.springs is not None) == sprung
        assert len(problem.constraints.dofs) == 3


def test_invalid_beds_are_rejected() -> None:
    with pytest.raises(InputError, match=r"stiffness -1 Pa/m; it must not be negative"):
        Bed(stiffness=-1.0)
    with pytest.raises(InputError, match=r"share 1\.5 of the stiffness; it must be 0 to 1"):
        Bed(within=1.5)
    with pytest.raises(InputError, match="no numbers"):
        Bed(bulge=np.nan)
    with pytest.raises(InputError, match="between 3 and 1 m"):
        rolls("bottom", bed=Bed(), between=(3.0, 1.0))
    with pytest.raises(InputError, match="no such boundary group"):
        block(rolls("lid", bed=Bed()))
    with pytest.raises(InputError, match=r"top: rolls .* no bed"):
        block(RollSupport(("bottom", "top"), Counting())).step(1.0)


def test_forms_of_rolls_are_compiled_only_with_rolls() -> None:
    compiled = block(held=(PrescribedDisplacement(("left",), 0),)).section.compiled
    assert not [name for name in compiled if name.startswith("rolls")]
