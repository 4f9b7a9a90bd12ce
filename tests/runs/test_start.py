"""A run that begins below its mould, or with a temperature profile."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from rolled_case import rolled
from small_case import small

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.build.simulation import build
from castfem.model.build.start import depth_below_surface
from castfem.runs.loop import TimeLoop, run
from castfem.runs.output.history import read_history
from castfem.runs.output.xdmf import HDF5_NAME

EXIT = {"at": "mould_exit"}
PROFILE = {
    "depth": [0, 5, 20], "depth_unit": "mm", "value": [1480, 1510, 1525], "unit": "degC",
}  # fmt: skip
STRAINED: dict[str, Any] = {
    "mechanics": {"ferrostatic": "off", "liquid": "elastic"},
    "coupling": {"interval": "20 mm"},
    "casting__length": "0.35 m",
}


def begun(case: Case) -> TimeLoop:
    return TimeLoop(build(case, MPI.COMM_WORLD))


def test_depth_is_the_distance_from_the_nearest_face() -> None:
    loop = begun(rolled())
    section = loop.simulation.section
    x, y = section.vertex_space.tabulate_dof_coordinates()[: section.owned, :2].T
    expected = np.minimum(0.08 - x, 0.03 - np.abs(y))  # a half, x >= 0: no face at x = 0
    assert depth_below_surface(section) == pytest.approx(expected, abs=1e-12)
    loop.simulation.destroy()


def test_start_below_the_mould_is_the_run_from_the_meniscus() -> None:
    """Temperature only: to rounding, heat and balance too."""
    whole, below = begun(rolled()), begun(rolled(casting__start=EXIT))
    state = below.run_state.state
    assert state.time == pytest.approx(10.0) and state.mechanical is None
    one, other = whole.run(), below.run()
    t = [s.state.thermal.point.temperature for s in (one, other)]
    assert t[1] == pytest.approx(t[0], abs=1e-6)
    assert other.removed == pytest.approx(one.removed, rel=1e-12)
    gained = below.run_state.sampler.heat_gained(other.state.thermal)
    assert 2.0 * gained == pytest.approx(-other.removed, rel=1e-10)
    for loop in (whole, below):
        loop.simulation.destroy()


def test_slice_is_unstrained_below_the_mould() -> None:
    loop = begun(rolled(casting__start=EXIT, **STRAINED))
    strand = loop.run_state.state
    assert strand.mechanical.time == strand.thermal.time == pytest.approx(10.0)
    assert not strand.mechanical.stress.any() and not strand.mechanical.displacement.any()
    assert strand.thermal.extremes[0] < 1250.0 + ZERO_CELSIUS  # it has a shell
    sample = loop.run()
    assert sample.position == pytest.approx(0.35)
    assert sample.mechanics is not None and sample.state.mechanical is not None
    assert np.abs(sample.state.mechanical.stress).max() > 1e5
    loop.simulation.destroy()


def test_history_and_fields_begin_at_the_start(tmp_path: Path) -> None:
    given = {"figures": False, "every": "7 s", "fields": ["temperature"]}
    case = rolled(casting__start=EXIT, casting__length="0.45 m", output=given)
    assert run(case, tmp_path).status == "finished"
    table = read_history(tmp_path / "history.csv")
    assert table["time"].iloc[0] == pytest.approx(10.0)
    assert table["position"].iloc[0] == pytest.approx(0.25)
    assert (tmp_path / HDF5_NAME).is_file()
    from castfem.runs.output.fields import Fields

    with Fields(tmp_path) as fields:
        assert fields.times == pytest.approx([10.0, 14.0, 18.0])


@pytest.mark.parametrize("at", ["meniscus", "mould_exit"])
def test_run_begins_with_a_profile(at: str) -> None:
    """Below the liquidus at the wall; its heat is counted from the profile."""
    loop = begun(rolled(casting__start={"at": at, "profile": PROFILE}))
    state, section = loop.run_state.state.thermal, loop.simulation.section
    depth = 1e3 * depth_below_surface(section)
    expected = np.interp(depth, PROFILE["depth"], PROFILE["value"]) + ZERO_CELSIUS  # type: ignore[arg-type]
    assert state.point.temperature == pytest.approx(expected, abs=1e-6)
    assert (state.time, state.removed) == (pytest.approx(0.0 if at == "meniscus" else 10.0), 0.0)
    sample = loop.run()
    gained = loop.run_state.sampler.heat_gained(sample.state.thermal)
    assert 2.0 * gained == pytest.approx(-sample.removed, rel=1e-10)
    loop.simulation.destroy()


def test_meniscus_with_contact_is_further_down() -> None:
    """With one law of cooling the slice is as 30 mm further down; heat counts as poured."""
    ahead = begun(small({"casting.start": {"meniscus": "30 mm"}, "casting.length": "24 mm"}))
    plain = begun(small({"casting.length": "54 mm"}))
    first = ahead.run_state.state.thermal
    assert first.time == 0.0 and first.removed > 0.0
    assert first.extremes[0] < ahead.simulation.start_temperature - 50.0
    one, other = plain.run(), ahead.run()
    t = [s.state.thermal.point.temperature for s in (one, other)]
    assert t[1] == pytest.approx(t[0], abs=1e-6)
    assert other.removed == pytest.approx(one.removed, rel=1e-10)
    gained = ahead.run_state.sampler.heat_gained(other.state.thermal)
    assert 4.0 * gained == pytest.approx(-other.removed, rel=1e-10)
    for loop in (ahead, plain):
        loop.simulation.destroy()


def test_shell_at_the_meniscus_is_unstrained_in_its_mould(tmp_path: Path) -> None:
    """It is solid from the first row of the history."""
    changes: dict[str, Any] = {
        "casting.start": {"meniscus": "120 mm"},
        "casting.length": "24 mm",
        "mesh.order": 2,
        "cooling.0.surface.0.gap_conductivity": "0.15 W/(m K)",
        "mould": {"length": "600 mm", "taper": "1 %/m"},
        "mechanics": {"liquid": "fed", "ferrostatic": "full"},
        "coupling": {"interval": "0.1 s"},
    }
    case = small(changes)
    loop = begun(case)
    strand = loop.run_state.state
    assert strand.mechanical is not None and strand.mechanical.time == 0.0
    assert not strand.mechanical.displacement.any()
    loop.simulation.destroy()
    result = run(case, tmp_path)
    assert result.status == "finished"
    table = read_history(tmp_path / "history.csv")
    assert table["shell_corner"].iloc[0] > 0.0 and table["position"].iloc[0] == 0.0
    assert table["von_mises_max"].iloc[-1] > 0.0


def test_profile_with_fed_liquid_balances() -> None:
    """Heat is counted from the profile, and fed liquid comes as poured: they balance."""
    from castfem.runs.results.summary import summarise

    colder = PROFILE | {"value": [1100, 1495, 1525]}
    given = STRAINED | {"mechanics": {}, "casting__length": "0.3 m"}
    loop = begun(rolled(casting__start=EXIT | {"profile": colder}, **given))
    state = loop.run().state.thermal
    heat = summarise(loop.run_state, "finished").balances["heat"]
    assert abs(state.fed) > 1e-4 * state.removed
    assert heat["whole"].value < 1e-9
    loop.simulation.destroy()


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"casting__start": {"meniscus": "8 mm", "profile": PROFILE}}, "leave one of them out"),
        ({"casting__start": {"meniscus": "0.28 m"}}, "is not within the first zone of the cooling"),
        ({"casting__start": {"profile": "1500 degC"}}, "a table over depth is needed"),
        ({"casting__start": EXIT, "cooling__0__name": "chill", "cooling__0__surface": []},
         "there is no mould"),
    ],
)  # fmt: skip
def test_impossible_start_is_refused(changes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError) as found:
        rolled(**changes)
    assert len(found.value.problems) == 1 and text in found.value.problems[0]


def test_case_without_a_start_is_unchanged() -> None:
    case = rolled()
    assert "start" not in case.document()["casting"] and "start" not in case.physics()["casting"]
    assert rolled(casting__start=EXIT).physics_hash() != case.physics_hash()
