"""The solver: options, units, line search, failures and the number of evaluations."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from mpi4py import MPI
from petsc4py import PETSc

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Constant
from castfem.base.types import Array
from castfem.physics.constitutive.base import Response
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.constitutive.flow_laws import NortonCreep, PerfectlyPlastic
from castfem.physics.contact.settings import Contact
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.physics.mechanics.newton import LineSearch, step_share
from castfem.physics.mechanics.stepper import MechanicalStepper
from castfem.physics.mechanics.supports import PrescribedDisplacement, SurfacePressure
from castfem.physics.mould.wall import PlaneWall
from mechanics.setups import SliceSetup, box, elastic, expansion, mapped, pressed_tube

CREEP = NortonCreep.constant(Elasticity.constant(20e9, 0.3), 1e-3, 1e7, 5.0)


def uneven(x: Array, y: Array) -> Array:
    return np.asarray(-300.0 * (x / 0.1) ** 2 - 100.0 * (y / 0.1))


def cooled(**settings: Any) -> SliceSetup:
    """Set up a quarter that cools nonuniformly and creeps."""
    law = settings.pop("law", CREEP)
    return SliceSetup(mapped(4, 4, box(0.1, 0.1)), law, expansion(2e-5), **settings)


def test_options_reach_snes() -> None:
    setup = cooled(options={"snes_max_it": 1})
    result = setup.stepper.step(setup.state, 1.0, setup.field(uneven))
    assert not result.converged
    assert "DIVERGED_MAX_IT after 1 iterations" in result.reason
    assert "forces" in result.reason and "axial" in result.reason


@pytest.mark.parametrize("free", [True, False])
@pytest.mark.parametrize(
    ("options", "kind"),
    [
        ({"ksp_type": "gmres", "pc_type": "gamg", "ksp_rtol": 1e-10}, "gmres"),
        ({"pc_type": "lu", "pc_factor_mat_solver_type": "mumps"}, "preonly"),
        ({"pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_14": 80}, "preonly"),
        ({"pc_type": "lu", "pc_factor_mat_solver_type": "superlu_dist"}, "preonly"),
    ],
)
def test_options_reach_the_linear_solver(options: dict[str, Any], kind: str, free: bool) -> None:
    """They reach the solver of the displacement block, with and without free strains."""
    planes = PlainPlanes(("a0",) if free else ())
    reference = cooled(settings={"planes": planes})
    reference.step(1.0, uneven)
    setup = cooled(options=options, settings={"planes": planes})
    setup.step(1.0, uneven)
    ksp = setup.problem.bordered.ksp
    assert ksp.getType() == kind
    assert ksp.getPC().getType() == options.get("pc_type", "cholesky")
    if "pc_factor_mat_solver_type" in options:
        assert ksp.getPC().getFactorSolverType() == options["pc_factor_mat_solver_type"]
    if kind == "gmres":
        assert ksp.getTolerances()[0] == 1e-10
    size = np.abs(reference.state.displacement).max()
    assert np.abs(setup.state.displacement - reference.state.displacement).max() < 1e-7 * size


@pytest.mark.parametrize("free", [True, False])
def test_options_of_two_problems_are_separate(free: bool) -> None:
    """Two problems that exist at once each factorise with their own options."""
    planes = PlainPlanes(("a0",) if free else ())
    setups = {
        share: cooled(
            options={"pc_factor_mat_solver_type": "mumps", "mat_mumps_icntl_14": share},
            settings={"planes": planes},
        )
        for share in (77, 33)
    }
    for share, setup in setups.items():
        setup.step(1.0, uneven)
        ksp = setup.problem.bordered.ksp
        assert ksp.getPC().getFactorMatrix().getMumpsIcntl(14) == share
    assert not any(name.startswith("mechanical_") for name in PETSc.Options().getAll())


@pytest.mark.parametrize("free", [True, False])
def test_rejected_options_have_no_after_effect(free: bool) -> None:
    planes = PlainPlanes(("a0",) if free else ())
    for wrong in ("snes_type", "ksp_type"):
        with pytest.raises(InputError, match=f'mechanical solver, {wrong} = "bogus"'):
            cooled(options={"mat_mumps_icntl_14": 77, wrong: "bogus"}, settings={"planes": planes})
        assert not any(name.startswith("mechanical_") for name in PETSc.Options().getAll())


@pytest.mark.parametrize("free", [True, False])
def test_misspelt_options_are_reported(free: bool, told: pytest.LogCaptureFixture) -> None:
    options = {"snes_maxit": 1, "pc_typ": "lu", "snes_max_it": 20}
    setup = cooled(options=options, settings={"planes": PlainPlanes(("a0",) if free else ())})
    setup.step(1.0, uneven)
    setup.step(2.0, lambda x, y: 2 * uneven(x, y))
    first, second = sorted(record.getMessage() for record in told.records)
    assert 'pc_typ = "lu"' in first and 'snes_maxit = "1"' in second


def test_line_search_of_the_user_replaces_ours() -> None:
    setup = cooled(options={"snes_linesearch_type": "bt"})
    assert setup.problem.solver._shorten is None
    setup.step(1.0, uneven)
    assert cooled().problem.solver._shorten is not None


def test_unknown_options_are_rejected() -> None:
    with pytest.raises(InputError, match="linear_solver"):
        cooled(options={"linear_solver": "mumps"})


@pytest.mark.parametrize(
    ("length", "stress"), [(1e3, 1e-6), (1.0, 1e-9), (1e3, 1.0)], ids=["mm MPa", "m GPa", "mm Pa"]
)
def test_iterations_are_independent_of_units(length: float, stress: float) -> None:
    """The same block in other units has the same iterations and relative residuals."""

    def solved(length: float, stress: float) -> SliceSetup:
        law = PerfectlyPlastic(Elasticity.constant(20e9 * stress, 0.3), Constant(2e7 * stress))
        setup = SliceSetup(
            mapped(4, 4, box(0.1 * length, 0.1 * length)),
            law,
            lambda T: 2e-5 * T,
            settings={"planes": PlainPlanes(force=lambda t: 1e4 * stress * length**2 * t)},
        )
        for time in (1.0, 2.0):
            setup.step(time, lambda x, y, t=time: t * uneven(x / length, y / length))
        return setup

    one, other = solved(1.0, 1.0), solved(length, stress)
    assert [r.newton for r in one.results] == [r.newton for r in other.results]
    assert max(r.newton for r in one.results) > 2
    histories = [s.problem.solver._history for s in (one, other)]
    for first, second in zip(*histories, strict=True):
        for name in first:
            if first[name] > 1e3:  # below it rounding decides
                assert second[name] == pytest.approx(first[name], rel=1e-4)
    scaled = other.state.displacement / length
    assert np.abs(scaled / np.abs(scaled).max() - one.state.displacement / np.abs(
        one.state.displacement).max()).max() < 1e-7  # fmt: skip


def test_failed_step_keeps_the_committed_state() -> None:
    setup = cooled(options={"snes_max_it": 2})
    start = setup.state
    kept = {f.name: np.copy(getattr(start, f.name)) for f in fields(start)}
    result = setup.stepper.step(start, 1e4, setup.field(lambda x, y: 20 * uneven(x, y)))
    assert not result.converged
    assert result.state is start
    assert result.balance is None
    for name, value in kept.items():
        assert np.array_equal(getattr(start, name), value)
    # A smaller step then gives the result of a problem without the failed step.
    again = cooled(options={"snes_max_it": 2})
    setup.step(1e-3, lambda x, y: 1e-3 * uneven(x, y))
    again.step(1e-3, lambda x, y: 1e-3 * uneven(x, y))
    assert np.array_equal(setup.state.displacement, again.state.displacement)
    assert np.array_equal(setup.state.stress, again.state.stress)


def test_committed_states_share_no_memory() -> None:
    setup = cooled()
    first = setup.step(1.0, uneven).state
    kept = first.stress.copy(), first.displacement.copy(), first.internal.copy()
    setup.step(2.0, lambda x, y: 2 * uneven(x, y))
    for before, now in zip(kept, (first.stress, first.displacement, first.internal), strict=True):
        assert np.array_equal(before, now)


class Counting:
    """A law that records the strain increments of its calls."""

    def __init__(self, law: Any) -> None:
        self.law, self.seen = law, []

    def __getattr__(self, name: str) -> Any:
        return getattr(self.law, name)

    def integrate(self, step: Any, *args: Any, **kwargs: Any) -> Response:
        self.seen.append(step.strain_increment.copy())
        return self.law.integrate(step, *args, **kwargs)


def test_law_is_integrated_once_per_iterate() -> None:
    law = Counting(CREEP)
    setup = cooled(law=law)
    result = setup.step(1.0, uneven)
    assert len(law.seen) == result.newton + 1, result.reason
    law.seen.clear()
    setup.step(2.0, lambda x, y: 2 * uneven(x, y))
    for i, one in enumerate(law.seen):
        assert not any(np.array_equal(one, other) for other in law.seen[:i])


def test_zero_load_needs_no_iterations() -> None:
    setup = SliceSetup(mapped(2, 2, box(0.1, 0.1)))
    assert setup.step(1.0).newton == 0
    assert not setup.state.displacement.any() and not setup.state.stress.any()


def test_unloading_to_zero_removes_the_stress() -> None:
    setup = SliceSetup(mapped(3, 3, box(0.1, 0.1)), elastic(), expansion(1e-5))
    setup.step(1.0, uneven)
    largest = np.abs(setup.stress).max()
    setup.step(2.0, 0.0)
    assert np.abs(setup.stress).max() < 1e-8 * largest


def test_large_prescribed_displacement_converges() -> None:
    law = PerfectlyPlastic(Elasticity.constant(20e9, 0.3), Constant(2e7))
    setup = SliceSetup(
        mapped(3, 3, box(0.1, 0.05)),
        law,
        settings={
            "held": (PrescribedDisplacement(("right",), 0, lambda p, t: np.full(len(p), 1e-2 * t)),)
        },
    )
    result = setup.step(1.0)
    assert setup.stress[:, 0] == pytest.approx(2e7, rel=1e-7)
    assert np.abs(setup.stress[:, [1, 2, 3]]).max() < 1.0
    assert result.newton < 10
    assert result.balance.forces_error < 1e-8


def test_limit_load_of_a_tube_is_reached_and_not_exceeded() -> None:
    """Perfect plasticity in plane strain: the limit pressure is 2 k ln(b/a)."""
    flow, a, b = 2e7, 0.02, 0.04
    limit = 2 / np.sqrt(3) * flow * np.log(b / a)
    law = PerfectlyPlastic(Elasticity.constant(20e9, 0.3), Constant(flow))
    setup = pressed_tube((8, 8), (a, b), law, lambda t: t * limit)
    for share in (0.5, 0.8, 0.9, 0.96, 0.985, 0.995):
        setup.step(share)
    beyond = setup.stepper.step(setup.state, 1.01, setup.state.temperature)
    assert not beyond.converged
    assert "DIVERGED" in beyond.reason


def test_correction_larger_than_the_section_ends_the_solve() -> None:
    """Large strain only: in a tube too soft for its pressure Newton's corrections are excessive."""
    ends = []
    for large in (True, False):
        law, pressure = elastic(1e3, 0.3), lambda t: 500.0 * t
        setup = pressed_tube((4, 4), (0.02, 0.04), law, pressure, large_strain=large)
        problem = setup.problem
        assert problem.farthest == np.inf  # no limit without a stepper
        MechanicalStepper(problem)
        assert problem.farthest == (1.0 if large else np.inf)
        ends.append(setup.stepper.step(setup.state, 1.0, setup.state.temperature))
    diverged, linear = ends
    assert not diverged.converged and "DIVERGED_LINE_SEARCH" in diverged.reason
    assert linear.converged and linear.newton == 1


def test_line_search_accepts_good_full_steps() -> None:
    assert step_share(1.0, lambda share: 1.0 - share) == 1.0
    assert step_share(-1.0, lambda share: 5.0) == 1.0


@pytest.mark.parametrize("root", [0.6, 0.1, 3e-3, 1e-6])
def test_line_search_finds_the_zero_of_the_work(root: float) -> None:
    """The force saturates on both sides, as in perfect plasticity."""
    tried = []

    def work(share: float) -> float:
        tried.append(share)
        return float(np.clip((root - share) / root, -1.0, 1.0) if share > 0 else 1.0)

    share = step_share(1.0, work)
    assert abs(work(share)) <= 0.3
    assert tried[-2] == share
    assert len(tried) < 25


@pytest.mark.parametrize("reach", [0.9, 0.09, 1e-3])
@pytest.mark.parametrize("beyond", [np.nan, np.inf, -np.inf])
def test_line_search_returns_from_invalid_residuals(reach: float, beyond: float) -> None:
    """The work is 0 at half of the longest step that can be evaluated; longer ones overflow."""
    root = 0.5 * reach

    def work(share: float) -> float:
        return beyond if share > reach else 1.0 - share / root

    share = step_share(1.0, work)
    assert 0.0 < share <= reach
    assert abs(work(share)) <= 0.06


class NoInteractions:
    """Stand-in for the interactions of a slice without any."""

    def evaluated(self) -> tuple[object, ...]:
        return ()

    def kink(self, base: tuple[object, ...]) -> float:
        return 0.0


@pytest.mark.parametrize(("imbalance", "full"), [(2e-8, True), (1e-5, False)])
def test_line_search_uses_the_norm_below_rounding(imbalance: float, full: bool) -> None:
    """A step that halves an almost zero residual is accepted for any sign of its work."""

    def residual(local: Array) -> Array:
        return np.array([1.0, 0.0]) if local[0] == 0.0 else np.array([-0.5, 0.0])

    search = LineSearch(MPI.COMM_SELF, NoInteractions(), residual)  # type: ignore[arg-type]
    share = search.share(np.zeros(2), np.array([1.0, 0.0]), 0, imbalance)
    assert (share == 1.0) == full


def test_guess_without_valid_residual_is_skipped(monkeypatch: pytest.MonkeyPatch) -> None:
    setup = cooled()
    original, guessed = setup.problem._residual, iter([np.ones(1), np.full(1, np.nan)])

    def residual(local: Array) -> Array:
        """Return the residuals set for the two guesses, then those of the problem."""
        found = next(guessed, None)
        return original(local) if found is None else found

    monkeypatch.setattr(setup.problem, "_residual", residual)
    setup.problem.begin(setup.state, 1.0, setup.field(uneven))
    still = np.zeros(setup.problem.owned)
    assert setup.problem.solve([(still, np.zeros(1)), (still + np.nan, np.zeros(1))]).converged


@pytest.mark.parametrize(
    "settings",
    [
        {"held": (PrescribedDisplacement(("lid",), 0),)},
        {"loads": (SurfacePressure(("right", "lid"), lambda t: 1.0),)},
        {
            "interactions": (
                Contact(PlaneWall((0.0, 0.0), (1.0, 0.0)), ("right", "lid"), lambda t: t),
            )
        },
    ],
)
def test_unknown_boundary_groups_are_rejected(settings: dict[str, Any]) -> None:
    with pytest.raises(InputError, match='"lid": no such boundary group; there are symmetry_x'):
        cooled(settings=settings)
