"""Water of many nozzles on a face: the flows add up, and h follows from the sum."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

from mpi4py import MPI

import numpy as np
import pytest

from castfem import meshes
from castfem.physics.thermal.boundary import Cooling
from castfem.physics.thermal.flux_laws import Convection, Radiation, Sprayed
from castfem.physics.thermal.spray_correlations import CORRELATIONS
from castfem.physics.thermal.spray_flux import (
    Coefficient,
    CoefficientTable,
    OfCorrelation,
    RollShare,
    Share,
    SprayWater,
    water_across,
)
from castfem.physics.thermal.unique_root import Branch

from .setups import ThermalSetup, constant_steel

SLAB = Path(__file__).parents[2] / "cases" / "slab1200"
TABLE = CoefficientTable(
    (500.0, 900.0, 1300.0), (0.0, 5.0, 10.0), ((0, 900, 1500), (0, 400, 700), (0, 350, 650))
)
SURFACE = np.array([450.0, 700.0, 1000.0, 1200.0, 1500.0])


def test_table_is_bilinear_and_constant_beyond_its_ends() -> None:
    at = np.array([[5.0, 900.0], [2.5, 700.0], [10.0, 1100.0], [5.0, 1400.0], [12.0, 400.0]])
    expected = [400.0, 0.25 * 1300.0, 675.0, 350.0, 1500.0]
    assert TABLE(at[:, 0], at[:, 1]) == pytest.approx(expected)
    with pytest.raises(ValueError, match="increasing"):
        CoefficientTable((1.0, 1.0), (0.0, 1.0), ((0, 0), (0, 0)))
    with pytest.raises(ValueError, match="each temperature"):
        CoefficientTable((1.0, 2.0), (0.0, 1.0), ((0, 0, 0), (0, 0, 0)))


@pytest.mark.parametrize("edge", [0.0, 0.4, 1.0])
def test_all_water_of_a_nozzle_reaches_a_wide_face(edge: float) -> None:
    x = np.linspace(-1.0, 1.0, 200_001)
    assert np.trapezoid(water_across(x, [-0.2, 0.3], 0.5, edge), x) == pytest.approx(2.0, rel=1e-5)


def test_triangles_spaced_by_half_their_width_are_uniform() -> None:
    x = np.linspace(-0.3, 0.3, 101)
    assert water_across(x, [-0.3, 0.0, 0.3], 0.6, 1.0) == pytest.approx(1.0 / 0.3)
    assert water_across(np.array([0.6]), [-0.3, 0.0, 0.3], 0.6, 1.0) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("name", list(CORRELATIONS))
def test_correlation_accepts_arrays_of_flows(name: str) -> None:
    law = OfCorrelation(CORRELATIONS[name], 298.15, 2.0)
    water = np.linspace(0.0, 12.0, 7)
    surface = np.linspace(900.0, 1400.0, 7)
    least = CORRELATIONS[name].water[0]
    one_by_one = [
        float(CORRELATIONS[name].formula(max(float(w), least), 298.15, np.array([t]))[0])
        * (min(w / least, 1.0) if least else 1.0)
        / 2.0
        for w, t in zip(water, surface, strict=True)
    ]
    assert law(water, surface) == pytest.approx(one_by_one, rel=1e-14)
    assert law(water, surface)[0] == 0.0


def rows(*parts: tuple[float, Coefficient]) -> SprayWater:
    """Return rows with uniform flows, kg/(m2 s), each with a model."""
    shares = tuple(
        Share(np.full(len(SURFACE), water / 1e-3), lambda time: 1e-3, 1e-3, h) for water, h in parts
    )
    return SprayWater(shares, 298.15)


def test_overlap_adds_water_and_not_coefficients() -> None:
    single, double, both = rows((5.0, TABLE)), rows((10.0, TABLE)), rows((5.0, TABLE), (5.0, TABLE))
    assert np.array_equal(both.flux(SURFACE, 0.0)[0], double.flux(SURFACE, 0.0)[0])
    assert (both.flux(SURFACE, 0.0)[0] < 1.95 * single.flux(SURFACE, 0.0)[0]).all()


def test_models_are_weighted_by_their_water() -> None:
    law = OfCorrelation(CORRELATIONS["nozaki"], 298.15)
    total = np.full_like(SURFACE, 8.0)
    expected = (6.0 * TABLE(total, SURFACE) + 2.0 * law(total, SURFACE)) / 8.0
    found = rows((6.0, TABLE), (2.0, law)).flux(SURFACE, 0.0)[0] / (SURFACE - 298.15)
    assert found == pytest.approx(expected)
    assert rows((0.0, TABLE), (0.0, law)).flux(SURFACE, 0.0)[0] == pytest.approx(0.0)


def laws() -> dict[str, SprayWater | RollShare]:
    spray = rows((4.0, TABLE), (2.0, OfCorrelation(CORRELATIONS["wendelstorf"], 298.15)))
    beside = ((0.12, Radiation(0.8, 330.0)), (0.06, spray), (0.03, Convection(150.0, 298.15)))
    return {"spray": spray, "roll": RollShare(0.08, 0.02, beside)}


@pytest.mark.parametrize("name", ["spray", "roll"])
def test_slope_is_the_derivative(name: str) -> None:
    law, t, d = laws()[name], SURFACE + 13.0, 1e-2
    slope = (law.flux(t + d, 0.0)[0] - law.flux(t - d, 0.0)[0]) / (2 * d)
    assert law.flux(t, 0.0)[1] == pytest.approx(slope, rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("name", ["spray", "roll"])
def test_no_slope_is_below_the_least_rise(name: str) -> None:
    law, grid = laws()[name], np.arange(400.0, 1600.0, 1.0)
    least = np.broadcast_to(law.least_rise(grid, 0.0), SURFACE.shape)
    for t in grid[::7]:
        assert (law.flux(np.full_like(SURFACE, t), 0.0)[1] >= least - 1e-3 * np.abs(least)).all()
    assert (least < 0.0).all()


# h decreases with water from 5 to 10 kg/(m2 s), and so does the slope of q at 500 to 900 K.
DROWNED = CoefficientTable(
    (500.0, 900.0, 1300.0), (0.0, 5.0, 10.0), ((0, 2500, 900), (0, 400, 700), (0, 350, 650))
)


@pytest.mark.parametrize(
    "models",
    [
        (DROWNED,),
        (TABLE, DROWNED),
        (DROWNED, OfCorrelation(CORRELATIONS["wendelstorf"], 298.15)),
        (OfCorrelation(CORRELATIONS["wendelstorf"], 298.15),),
        (OfCorrelation(CORRELATIONS["sasaki"], 298.15),),
    ],
    ids=["falling", "two tables", "table and formula", "wendelstorf", "sasaki"],
)
def test_least_rise_holds_for_all_flows_up_to_the_largest(
    models: tuple[Coefficient, ...],
) -> None:
    """For any fraction of the largest flow of each row, at vertices with little and much water."""
    random = np.random.default_rng(1)
    water, grid = np.array([0.5, 4.0, 14.0, 30.0]), np.arange(400.0, 1600.0, 1.0)
    per_row = water / len(models)
    parts = np.zeros(len(models))
    law = SprayWater(
        tuple(
            Share(per_row, lambda _, i=i: float(parts[i]), 1.0, model)  # type: ignore[misc]
            for i, model in enumerate(models)
        ),
        298.15,
    )
    least = law.least_rise(grid, 0.0)
    steepest = np.zeros_like(least)
    for _ in range(4000):
        parts[:] = random.random(len(models))
        at = np.full_like(least, random.uniform(400.0, 1600.0))
        steepest = np.minimum(steepest, law.flux(at, 0.0)[1])
    assert (steepest >= least - 1e-3 * np.abs(least)).all()
    if len(models) == 1:  # for a single model it is also reached
        assert least[2:] == pytest.approx(steepest[2:], rel=0.1)


def test_least_rise_of_a_zone_holds_for_all_its_flows() -> None:
    """The flux of 30 L/(m2 s) falls less steeply than that of a third of it."""
    law = Sprayed(CORRELATIONS["wendelstorf"], lambda time: time, 30.0, 298.15)
    grid = np.arange(400.0, 1600.0, 1.0)
    sampled = [law.flux(grid, flow)[1].min() for flow in np.linspace(0.0, 30.0, 301)]
    assert sampled[-1] > 0.9 * min(sampled)
    assert min(sampled) >= law.least_rise(grid, 0.0) * (1.0 + 1e-3)


def test_roll_removes_its_share_of_the_heat_of_a_pitch() -> None:
    roll = laws()["roll"]
    assert isinstance(roll, RollShare)
    taken = roll.length * roll.flux(SURFACE, 0.0)[0]
    rest = sum(length * law.flux(SURFACE, 0.0)[0] for length, law in roll.beside)
    assert taken / (taken + rest) == pytest.approx(0.08)


@pytest.mark.mpi
def test_water_on_one_rank_limits_the_step_of_all_ranks() -> None:
    """All ranks take part in the bound of a falling flux; otherwise they would deadlock."""
    comm = MPI.COMM_WORLD
    mesh = meshes.build(
        shape="strip", length=0.02, width=0.002, surface_size=1e-3, core_size=2e-3,
        cell="quadrilateral", order=1,
    )  # fmt: skip
    setup = ThermalSetup(mesh, constant_steel(1723.15, 1773.15), 1273.15, comm=comm)
    problem = setup.problem
    patch = setup.surface.patch(setup.section.matching(["surface"]))
    table = CoefficientTable((823.15, 873.15), (0.0, 10.0), ((0.0, 9000.0), (0.0, 600.0)))
    water = Share(np.full(len(patch.dofs), 5.0), lambda time: 1.0, 1.0, table)
    problem.set_cooling(Cooling([(patch, SprayWater((water,), 298.15))], []))
    hot, cold = (
        problem.curve.at(problem.curve.enthalpy(np.full_like(problem.area, t)))
        for t in (870.0, 830.0)
    )
    longest = Branch(problem).longest_stage(hot, cold, 0.0, np.inf)
    sprayed, lengths = zip(*comm.allgather((len(patch.dofs), longest)), strict=True)
    assert max(sprayed) > 0 and (comm.size == 1 or min(sprayed) == 0)
    assert len(set(lengths)) == 1 and 0.0 < lengths[0] < np.inf


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_nozzles", SLAB / "make_nozzles.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_shipped_tables_are_those_of_the_script(tmp_path: Path) -> None:
    module = script()
    module.HERE = tmp_path
    module.main()
    for path in tmp_path.iterdir():
        assert path.read_text() == (SLAB / path.name).read_text()
    assert len(list(tmp_path.iterdir())) == 3


def test_film_boiling_of_run_off_water_has_its_values() -> None:
    """Stagnant water removes less heat; from 600 to 1200 degC h changes little."""
    module = script()
    flowing = [module.film_boiling(t) for t in (600, 900, 1200)]
    assert flowing == sorted(flowing) and flowing[0] > 130.0 and flowing[-1] < 160.0
    assert module.film_boiling(900, module.STAGNANT) == pytest.approx(103.5, abs=1.0)
