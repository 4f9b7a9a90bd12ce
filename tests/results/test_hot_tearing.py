"""Criteria of hot tearing of a run: similarity solution, restart, ranks, derivatives."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from scipy.optimize import brentq
from small_case import small, strip
from stretched_strip import AROUND, AXIAL, stretched
from test_quality import break_off

import castfem
from castfem.base.errors import InputError, RunFailure
from castfem.base.types import Array
from castfem.model import Case
from castfem.model.build.simulation import build
from castfem.physics.closed_forms.solidification import ThreeZones
from castfem.physics.materials import load_steel
from castfem.physics.materials.hot_tearing import MushyHistory
from castfem.post.report.cracks import crack_places
from castfem.runs import loop
from castfem.runs.loop import TimeLoop
from castfem.runs.output.folder import DEPTH_ROWS_NAME, DEPTHS_NAME
from castfem.runs.output.history import read_history
from castfem.runs.output.surface_maps import DEPTHS, SurfaceMaps
from castfem.runs.results.crack_state import Tearing
from castfem.runs.results.thermal_quantities import temperature_at

CRITERIA = ["won", "clyne_davies", "rdg"]
FEEDING = {"shrinkage": "4 percent", "arm_spacing": "100 um"}
EXACT = ThreeZones(30.0, 7200.0, 700.0, 272e3, 1273.15, 1723.15, 1773.15, 1813.15)


def followed(case: Case) -> tuple[Array, Tearing]:
    """Return the depths of a strip from 10 to 14 mm, m, and the tearing state there."""
    simulation = build(case, MPI.COMM_SELF)
    run = TimeLoop(simulation)
    run.run()
    found = run.run_state.sampler.quality.state.tearing
    x, y = simulation.section.vertex_space.tabulate_dof_coordinates()[:, :2].T
    simulation.destroy()
    chosen = np.flatnonzero((np.abs(y) < 1e-9) & (x > 9.9e-3) & (x < 14.1e-3))
    arrays = {n: getattr(found.history, n)[chosen] for n in MushyHistory.names()}
    return x[chosen], Tearing(
        MushyHistory(**arrays), found.width, found.mushy, found.law, None, found.enthalpy[chosen],
        found.rate[chosen], found.strain, found.here[chosen], found.passed[chosen],
    )  # fmt: skip


def exact_times() -> tuple[float, float, float]:
    """Return the times at solid fractions of 0.4, 0.9 and 0.99 at a depth x: over x^2, s/m2."""

    def over(fraction: float) -> float:
        level = EXACT.liquidus - 50.0 * fraction

        def off(eta: float) -> float:
            return float(EXACT.temperature(np.array([2.0 * eta]), 1.0)[0]) - level

        return 0.25 / brentq(off, 1e-4, 1e-1) ** 2

    return over(0.4), over(0.9), over(0.99)


def test_times_and_strains_are_those_of_the_similarity() -> None:
    """The times are proportional to x^2, so that their ratio is constant.

    The brittle range is 0.15 mm there: with cells half as large the error is half as large. The
    strain is exactly the time in the range by the rate, and the damage is that by hand.
    """
    feeds, begins, ends = exact_times()
    ratio = (ends - begins) / (begins - feeds)
    errors = []
    for size in (0.5, 0.25):
        x, found = followed(stretched(size))
        time = found.history.vulnerable
        assert found.passed.all()
        assert found.history.around == pytest.approx(AROUND * time, rel=1e-9)
        assert found.history.axial == pytest.approx(AXIAL * time, rel=1e-9)
        critical = 0.02821 / (AROUND**0.3131 * found.width**0.8638)
        assert found.width == pytest.approx(4.5, rel=1e-9)
        assert found.won() == pytest.approx(AROUND * time / critical, rel=1e-9)
        errors.append(
            [np.mean(time / (x**2 * (ends - begins))) - 1.0,
             np.mean(found.clyne_davies() / ratio) - 1.0]
        )  # fmt: skip
    coarse, fine = np.array(errors)
    assert (fine > 0.0).all() and (fine < 0.65 * coarse).all() and (fine < 0.12).all()


@pytest.mark.parametrize(("carbon", "within"), [(0.12, 0.99), (0.2, 0.9)])
def test_isothermal_freezing_is_by_the_enthalpy(carbon: float, within: float) -> None:
    """Steel below and above 0.17 % C: the peritectic reaction ends its freezing, or is in it."""
    from castfem.runs.results.hot_tearing_tracking import enthalpy_at

    steel = load_steel("plain_carbon", composition={"C": carbon})
    curve = steel.thermal_curve(1600.0, 1850.0)
    reaction = temperature_at(steel, within)
    liquid, solid = (float(steel.solid_fraction(reaction + by)) for by in (1e-5, -1e-5))
    hot, cold = (float(curve.enthalpy(reaction + by)) for by in (1e-5, -1e-5))
    assert liquid < within < solid and hot - cold > 1e6
    expected = hot - (within - liquid) / (solid - liquid) * (hot - cold)
    assert enthalpy_at(curve, steel, within) == pytest.approx(expected, abs=1e-4 * (hot - cold))
    level = float(curve.enthalpy(temperature_at(steel, 0.4)))
    assert enthalpy_at(curve, steel, 0.4) == level > hot


def test_place_has_passed_when_the_reaction_ends() -> None:
    """A thin sheet in the middle of the peritectic reaction, with which its freezing ends."""
    sheet = strip({
        "steel": {"name": "plain_carbon", "composition": {"C": 0.12}},
        "section": {"shape": "strip", "length": "0.2 mm", "width": "0.1 mm"},
        "mesh": {"surface_size": "0.1 mm", "core_size": "0.1 mm"},
        "casting.temperature": "1540 degC", "casting.length": "326 mm",
        "cooling.0.surface": [{"law": "flux", "on": ["surface"], "value": "20 kW/m^2"}],
        "thermal.time.step": "0.1 s", "quality": {"hot_tearing": ["clyne_davies"]},
    })  # fmt: skip
    simulation = build(sheet, MPI.COMM_SELF)
    run, steel = TimeLoop(simulation), simulation.steel
    reaction = temperature_at(steel, 0.99)
    hot, cold = (float(simulation.problem.curve.enthalpy(reaction + by)) for by in (1e-5, -1e-5))
    run.run()
    simulation.destroy()
    quality = run.run_state.sampler.quality
    assert quality is not None and quality.state.tearing is not None
    tearing, liquid = quality.state.tearing, float(steel.solid_fraction(reaction + 1e-5))
    solid = liquid + (hot - tearing.enthalpy) / (hot - cold) * (1.0 - liquid)
    freezing = (solid > liquid + 1e-3) & (solid < 0.989)
    assert freezing.any() and tearing.here[freezing].all() and not tearing.passed[freezing].any()
    assert (tearing.history.vulnerable[freezing] > 0.0).all()


PERITECTIC = {
    "name": "plain_carbon", "composition": {"C": 0.15, "Mn": 0.8, "Si": 0.2, "P": 0.015, "S": 0.01},
    "diagram": "segregated",
}  # fmt: skip


def test_segregating_peritectic_steel_with_any_cells() -> None:
    """In equilibrium its front has no thickness: the time of a place in it depends on the cell.

    With microsegregation the range is 14 K, and half the cells change times by 5 % at most. The
    strain is the time by the rate, the damage is that by hand.
    """
    overrides = {"youngs_modulus": "10 GPa", "poisson_ratio": 0.3, "thermal_expansion": "0 1/K"}
    times = []
    for size in (0.5, 0.25):
        case = stretched(
            size,
            **{
                "steel": PERITECTIC | {"overrides": overrides},
                "quality": {
                    "hot_tearing": CRITERIA, "rdg": FEEDING,
                    "won": {"factor": 0.02, "rate_exponent": 0.2, "range_exponent": 0.5},
                },
            },
        )  # fmt: skip
        x, found = followed(case)
        time = found.history.vulnerable
        assert found.passed.all() and found.width == pytest.approx(14.0, abs=0.1)
        assert found.history.around == pytest.approx(AROUND * time, rel=1e-9)
        critical = 0.02 / (AROUND**0.2 * found.width**0.5)
        assert found.won() == pytest.approx(AROUND * time / critical, rel=1e-9)
        times.append([np.mean(time / x**2), np.mean(found.clyne_davies())])
    coarse, fine = np.array(times)
    assert coarse == pytest.approx(fine, rel=0.05)
    assert 0.3 < fine[1] < 0.5


def test_critical_strain_may_be_one_number() -> None:
    """With both exponents 0 the factor is the strain, for any rate and range."""
    quality = {"hot_tearing": ["won"]}
    constant = {"factor": 0.016, "rate_exponent": 0, "range_exponent": 0}
    _, own = followed(stretched(1.0, quality=quality))
    _, found = followed(stretched(1.0, quality=quality | {"won": constant}))
    assert found.won() == pytest.approx(found.history.strain / 0.016, rel=1e-12)
    assert found.history.strain == pytest.approx(own.history.strain, rel=1e-12)
    assert (own.won() != found.won()).all()


def test_ends_of_windows_do_not_matter() -> None:
    """Windows of a third and two thirds of the time in the range, 0.3 to 0.7 s."""
    found = [followed(stretched(1.0, window))[1] for window in (0.1, 0.2, 0.4)]
    times = np.array([one.history.vulnerable for one in found])
    assert times[1] == pytest.approx(times[0], rel=0.02)
    assert times[2] == pytest.approx(times[0], rel=0.06)


def billet(**changes: object) -> Case:
    """Return a coarse billet whose shell begins to freeze, with all criteria."""
    defaults: dict[str, object] = {
        "mechanics": {}, "quality": {"hot_tearing": CRITERIA, "rdg": FEEDING},
        "casting.length": "120 mm", "output": {"figures": False, "checkpoint_every": 4},
        "coupling": {"interval": "0.1 s"},
    }  # fmt: skip
    return small(defaults | changes)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run of the billet."""
    folder = tmp_path_factory.mktemp("whole")
    loop.run(billet(), folder, comm=MPI.COMM_SELF)
    return folder


def results(folder: Path) -> dict[str, dict[str, Any]]:
    return json.loads((folder / "summary.json").read_text())["quantities"]  # type: ignore[no-any-return]


def test_columns_maps_and_results_agree(whole: Path) -> None:
    table, maps, found = read_history(whole / "history.csv"), SurfaceMaps(whole), results(whole)
    for name, factor in (("won", 0.01), ("clyne_davies", 1.0), ("rdg", 1e3)):
        surface, front = (table[f"{one}_max"].to_numpy() for one in (name, f"{name}_front"))
        assert maps[name].max(axis=1) == pytest.approx(factor * surface, rel=1e-6)
        assert found[f"way_{name}_max"]["value"] == pytest.approx(surface.max(), rel=1e-9)
        assert found[f"way_{name}_front_max"]["value"] == pytest.approx(front.max(), rel=1e-9)
        assert front.max() > 0.0
        (row,) = np.flatnonzero(front == front.max())
        label = found[f"way_{name}_front_max"]["label"]
        assert f"{table['position'][row]:.2f} m" in label
    share = found["rdg_share"]["value"]
    assert share == pytest.approx(100.0 * found["way_rdg_front_max"]["value"] / 2.0)


def test_depth_maps_begin_at_the_surface(whole: Path) -> None:
    """The first place of each line is one of the surface map; liquid places have no value yet."""
    depths, surface = SurfaceMaps(whole, DEPTHS), SurfaceMaps(whole)
    line = depths.heading.line
    assert depths.names() == ("temperature", *CRITERIA) and "mid-face" in line.faces
    for first in np.flatnonzero(line.way == 0.0):
        vertex = surface.heading.line.at(*line.place[first])
        for name in depths.names():
            mine, theirs = depths[name][:, first], surface[name][:, vertex]
            assert mine == pytest.approx(theirs, rel=2e-3, abs=1e-7), (name, first)
    hot = depths["temperature"] > depths.heading.band[1] + 60.0
    assert hot.any() and not depths["clyne_davies"][hot].any()
    found = crack_places(whole, None)
    (row,) = [row for row in found.ranking if row[0] == "clyne_davies, inside"]
    assert "mm deep" in row[3] and row[1] == f"{depths['clyne_davies'].max():.3g}"


def test_kill_loses_nothing(tmp_path: Path, whole: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        break_off(patch)
        patch.setattr(loop, "_leave", lambda *given: None)
        patch.setattr("castfem.runs.output.surface_maps.MapWriter.close", lambda self: None)
        with pytest.raises(RunFailure, match="power"):
            loop.run(billet(), tmp_path, comm=MPI.COMM_SELF)
    assert (tmp_path / DEPTH_ROWS_NAME).is_file()
    loop.run(billet(), tmp_path, comm=MPI.COMM_SELF, resume=True)
    for name in (DEPTHS_NAME, "surface_maps.h5", "history.csv"):
        assert (tmp_path / name).read_bytes() == (whole / name).read_bytes(), name
    assert results(tmp_path) == results(whole)


@pytest.mark.mpi
def test_ranks_agree(shared_folder: Path) -> None:
    single, many = shared_folder / f"{MPI.COMM_WORLD.rank}", shared_folder / "many"
    loop.run(billet(), single, comm=MPI.COMM_SELF)
    loop.run(billet(), many, comm=MPI.COMM_WORLD)
    MPI.COMM_WORLD.Barrier()
    one, two = SurfaceMaps(single, DEPTHS), SurfaceMaps(many, DEPTHS)
    for name in one.names():
        size = np.abs(one[name]).max()
        assert two[name] == pytest.approx(one[name], rel=1e-5, abs=1e-6 * size), name


def test_derivatives_are_difference_quotients(tmp_path: Path) -> None:
    def chilled(coefficient: float) -> Case:
        law = {"law": "convection", "on": ["surface"], "ambient": "25 degC"}
        law["coefficient"] = f"{coefficient} W/(m^2 K)"  # type: ignore[assignment]
        return stretched(
            1.0,
            **{
                "cooling.0.surface": [law], "casting.length": "0.15 m",
                "quality": {"hot_tearing": CRITERIA, "rdg": FEEDING},
            },
        )  # fmt: skip

    key = "cooling.0.convection.coefficient"
    names = ["way_won_front_max", "way_clyne_davies_front_max", "way_rdg_max", "rdg_share"]
    found = castfem.sensitivities(chilled(1500.0), [key], ",".join(names))
    ends = [
        loop.run(chilled(h), tmp_path / f"{h}", comm=MPI.COMM_SELF).quantities
        for h in (1499.9, 1500.1)
    ]
    for name in names:
        quotient = 5.0 * (ends[1][name].value - ends[0][name].value)
        assert quotient != 0.0
        assert found.gradient[name][key] == pytest.approx(quotient, rel=1e-5), name
    with pytest.raises(InputError, match=r"--of won_front_max: .*way_won_front_max"):
        castfem.sensitivities(chilled(1500.0), [key], "won_front_max")
    with pytest.raises(InputError, match=r"--of way_won_max: with casting.speed the ends of the"):
        castfem.sensitivities(chilled(1500.0), ["casting.speed"], "way_won_max")


def test_criteria_do_not_change_the_run(tmp_path: Path, whole: Path) -> None:
    """Columns of a case with and without criteria agree to the last digit."""
    loop.run(billet(quality={}), tmp_path, comm=MPI.COMM_SELF)
    plain, judged = read_history(tmp_path / "history.csv"), read_history(whole / "history.csv")
    own = [name for name in judged.columns if name not in plain.columns]
    assert own and all(name.startswith(("won", "rdg", "clyne_davies")) for name in own)
    for name in plain.columns:
        np.testing.assert_array_equal(judged[name], plain[name], err_msg=name)
