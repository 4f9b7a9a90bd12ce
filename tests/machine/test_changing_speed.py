"""A casting speed that changes in time: ramps, a stop, a restart, slices that start later."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.tables import Table
from castfem.model import Case, load_case
from castfem.model.build.simulation import case_steel, starting_temperature
from castfem.model.checks.unusual import warnings
from castfem.model.water import seen_by_slice
from castfem.physics.machine import Changing
from castfem.runs import loop
from castfem.runs.output.history import read_history
from castfem.runs.output.summary_file import Summary

CASES = Path(__file__).parents[2] / "cases" / "billet125"
COARSE = (
    "mesh.surface_size=2 mm",
    "mesh.corner_size=2 mm",
    "mesh.face_size=10 mm",
    "mesh.core_size=14 mm",
    "output.fields=[]",
    "output.figures=false",
)
# 3.6 m/min, a stop of 12 s that begins at 4 s (180 mm), and a ramp to the old speed in 2 s.
TIMES, SPEEDS = (2.0, 4.0, 16.0, 18.0), (0.06, 0.0, 0.0, 0.06)
TRAVEL = Changing(TIMES, SPEEDS)
STOP = ('casting.speed={time=[2, 4, 16, 18], time_unit="s", value=[3.6, 0, 0, 3.6], unit="m/min"}',)


def case(name: str, *overrides: str) -> Case:
    return load_case(CASES / f"{name}.toml", (*COARSE, *overrides))


def run(case: Case, folder: Path, **options: object) -> Summary:
    return loop.run(case, folder, comm=MPI.COMM_SELF, **options)  # type: ignore[arg-type]


def test_stop_is_equivalent_to_longer_zones(tmp_path: Path) -> None:
    """Only the time that the slice spends in each zone matters."""
    ends = {0: 0.6, 1: 1.0}
    zones = [f"cooling.{i}.to={60.0 * TRAVEL.time_at(z):.12g} mm" for i, z in ends.items()]
    length = 2.0
    steady = f"casting.length={60.0 * TRAVEL.time_at(length):.12g} mm"
    later = [f'cooling.{i}.to="{100 + i} m"' for i in (2, 3)]
    longer = run(case("thermal", "reference=[]", *zones, *later, steady), tmp_path / "longer")
    stopped = run(
        case("thermal", "reference=[]", *STOP, f"casting.length={length} m"), tmp_path / "stopped"
    )
    found, expected = (read_history(tmp_path / n / "history.csv") for n in ("stopped", "longer"))
    position = np.array([TRAVEL.position(t) for t in found["time"]])
    assert np.allclose(found["position"], position, rtol=1e-11)
    assert np.count_nonzero(np.diff(found["position"]) == 0.0) >= 12.0 / 0.25
    # Kinks of the speed are milestones of one run only, but all are multiples of its step.
    assert len(found) == len(expected)
    for column in ("time", "surface_temperature_corner", "shell_mid_face", "heat_removed"):
        assert np.allclose(found[column], expected[column], rtol=1e-9), column
    assert float(found["position"].iloc[-1]) == pytest.approx(length, rel=1e-12)
    # The power is the heat lost per metre times the mean speed.
    power = stopped.quantities["cooling_power"].value
    removed, time = (stopped.quantities[name].value for name in ("heat_removed", "time"))
    assert power == pytest.approx(removed * length / time, rel=1e-9)
    assert longer.quantities["heat_removed"].value == pytest.approx(removed, rel=1e-9)


def test_references_apply_when_the_position_is_first_reached(tmp_path: Path) -> None:
    """On a ramp, at the position of the stop when it begins, and after it."""
    refers = [
        f'{{quantity="time", value="1 s", source="us", at="{at} mm"}}' for at in (150, 180, 200)
    ]
    summary = run(
        case("thermal", *STOP, "casting.length=300 mm", f"reference=[{', '.join(refers)}]"),
        tmp_path,
    )
    found = {c.reference.at: c.ours for c in summary.references}
    assert found[0.15] == pytest.approx(TRAVEL.time_at(0.15), rel=1e-12)
    assert found[0.18] == 4.0
    assert found[0.2] == pytest.approx(TRAVEL.time_at(0.2), rel=1e-12)
    assert found[0.2] > 16.0


def test_run_is_resumed_within_a_stop(tmp_path: Path) -> None:
    changes = ("reference=[]", *STOP)
    # The first run ends at the beginning of the stop; the second continues through it.
    run(case("thermal", *changes, "casting.length=180 mm"), tmp_path / "parts")
    run(case("thermal", *changes, "casting.length=250 mm"), tmp_path / "parts", resume=True)
    run(case("thermal", *changes, "casting.length=250 mm"), tmp_path / "single")
    parts, single = (read_history(tmp_path / n / "history.csv") for n in ("parts", "single"))
    assert np.allclose(parts.to_numpy(), single.to_numpy(), rtol=1e-9, atol=1e-12, equal_nan=True)
    with pytest.raises(InputError, match=r"250|0\.25 m"):
        run(case("thermal", *changes, "casting.length=200 mm"), tmp_path / "parts", resume=True)


def test_mould_and_friction_follow_a_stop(tmp_path: Path) -> None:
    """The wall follows the position of the slice; friction does no work during the stop."""
    wall = '{position=[0, 240], position_unit="mm", value=[100, 340], unit="degC"}'
    summary = run(
        case(
            "taper_1", "reference=[]", *STOP, "casting.length=210 mm", "coupling.interval=1 s",
            "mould.friction.law=coulomb", "mould.friction.coefficient=0.3",
            "cooling.mould.surface.0.wall=mould", f"mould.wall_temperature={wall}",
        ),
        tmp_path,
    )  # fmt: skip
    assert summary.status == "finished"
    table = read_history(tmp_path / "history.csv")
    time, position = table["time"].to_numpy(), table["position"].to_numpy()
    assert np.allclose(position, [TRAVEL.position(t) for t in time], rtol=1e-11)
    travelled = np.diff(position)
    pull = -np.cumsum(table["friction_force"].to_numpy()[1:] * travelled)
    assert np.allclose(table["friction_pull"].to_numpy()[1:], pull, rtol=1e-6, atol=1e-9)
    stopped = (time[:-1] >= 4.0) & (time[1:] <= 16.0)
    assert np.ptp(table["mould_pull"].to_numpy()[1:][stopped]) == 0.0
    # Without a gap the flux is h (T - T_wall(z)); T_wall is constant during the stop.
    touches = (table["gap_mid_face"].to_numpy() < 1e-6) & (time > 0.0)
    touches[1:] &= touches[:-1] | (time[:-1] == 0.0)  # a window uses the mean of its gaps
    surface = table["surface_temperature_mid_face"].to_numpy()
    expected = 1.6 * (surface - np.interp(position, [0.0, 0.24], [100.0, 340.0]))
    assert touches[1:][~stopped].any()
    assert np.allclose(table["heat_flux_mid_face"][touches], expected[touches], rtol=5e-3)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("[3.6, 0]", r"casting\.speed: the strand stands for good after 10 s, 0\.3 m below the "
         r"meniscus: it never reaches casting\.length \(0\.6 m\); let the last row"),
        ("[3.6, -1]", r"casting\.speed: 'value' row 2 .*must not be below 0 m/min"),
        ("[0, 0]", r"casting\.speed: must be above 0 m/min"),
    ],
)  # fmt: skip
def test_invalid_speeds_are_rejected(value: str, message: str) -> None:
    table = f'{{time=[0, 10], time_unit="s", value={value}, unit="m/min"}}'
    with pytest.raises(InputError, match=message):
        case("thermal", f"casting.speed={table}")
    for speed in ("0 m/min", "-1 m/min"):
        with pytest.raises(InputError, match=r"casting\.speed: must"):
            case("thermal", f"casting.speed={speed}")


def test_changing_speed_is_unchanged_when_reread(tmp_path: Path) -> None:
    original = case("thermal", *STOP)
    (tmp_path / "again.toml").write_text(original.resolved_toml())
    again = load_case(tmp_path / "again.toml")
    assert again == original
    assert again.physics_hash() == original.physics_hash()
    assert original.casting.duration == TRAVEL.time_at(0.6)


def test_coupling_windows_may_have_a_length(tmp_path: Path) -> None:
    """At constant speed the run is that by time; otherwise the windows have equal lengths."""
    # These windows are long for such cells: their reduction by the gap error is switched off.
    quick = (
        "reference=[]", "casting.length=60 mm", "mesh.surface_size=4 mm",
        "coupling.window_error=1000 K",
    )  # fmt: skip
    by_length = case("taper_1", *quick, "coupling.interval=15 mm")
    run(by_length, tmp_path / "length")
    run(case("taper_1", *quick, "coupling.interval=0.25 s"), tmp_path / "time")
    found, expected = (read_history(tmp_path / n / "history.csv") for n in ("length", "time"))
    assert len(found) == len(expected) == 5
    for column in ("time", "shell_mid_face", "von_mises_max"):
        assert np.allclose(found[column], expected[column], rtol=1e-5, equal_nan=True), column
    slower = '{time=[0, 1], time_unit="s", value=[3.6, 1.2], unit="m/min"}'
    run(by_length.with_({"casting.speed": load(slower)}), tmp_path / "slower")
    table = read_history(tmp_path / "slower" / "history.csv")
    # A window also ends at the end of the ramp, 40 mm below the meniscus.
    assert np.allclose(1e3 * table["position"], [0.0, 15.0, 30.0, 40.0, 55.0, 60.0], atol=1e-6)
    (tmp_path / "again.toml").write_text(by_length.resolved_toml())
    assert load_case(tmp_path / "again.toml") == by_length
    with pytest.raises(InputError, match=r"coupling\.interval: must be above 0 mm"):
        case("taper_1", "coupling.interval=0 mm")
    with pytest.raises(InputError, match=r"coupling\.interval: .*a time is needed"):
        case("taper_1", "coupling.interval=3 K")


def load(value: str) -> dict[str, object]:
    found: dict[str, object] = tomllib.loads(f"it = {value}")["it"]
    return found


LADLE = {"time": [0, 60, 120], "time_unit": "s", "value": [40, 20, 30], "unit": "K"}
RAMP = {"time": [60, 61], "time_unit": "s", "value": [2, 4], "unit": "m/min"}
LATER = {"time": [0, 1], "time_unit": "s", "value": [2, 4], "unit": "m/min"}


def cast(**changes: Any) -> Case:
    return small({key.replace("__", "."): value for key, value in changes.items()})


@pytest.mark.parametrize(
    ("time", "kelvin"), [(None, 40.0), ("30 s", 30.0), ("500 s", 30.0), ("-3 s", 40.0)]
)
def test_slice_has_the_superheat_of_its_start(time: str | None, kelvin: float) -> None:
    start = {} if time is None else {"casting__start__time": time}
    case = cast(casting__superheat=LADLE, **start)
    steel = case_steel(case)
    assert starting_temperature(case, steel) == pytest.approx(steel.liquidus + kelvin, abs=1e-9)


def test_slice_has_the_speed_of_its_time() -> None:
    reference = cast(casting__speed=LATER).casting.travel
    late = cast(casting__speed=RAMP, casting__start__time="60 s").casting.travel
    for time in (0.0, 0.3, 1.0, 1.7):
        assert late.position(time) == pytest.approx(reference.position(time), rel=1e-12)
    assert late.kinks == pytest.approx(reference.kinks)
    early = cast(casting__speed=RAMP, casting__start__time="-3 s").casting.travel
    assert early.kinks == pytest.approx((63.0, 64.0)) and early.speed(62.0) == reference.speed(0.0)
    before = cast(casting__speed=RAMP, casting__start__time="60.5 s").casting.travel
    assert before.speed(0.0) == pytest.approx(3.0 / 60.0)


def test_run_with_a_start_time_has_shifted_tables() -> None:
    spray = {"law": "spray", "correlation": "nozaki", "water_temperature": "25 degC"}
    flows = {"time": [60, 61], "time_unit": "s", "value": [0, 2], "unit": "L/min"}
    shifted = {**flows, "time": [0, 1]}
    water = {"cooling.0.to": "100 mm"}  # length of the sprayed zone
    started = cast(**{
        **water | {"cooling.0.surface": [spray | {"flow": flows}]},
        "casting__speed": RAMP, "casting__start__time": "60 s",
    })  # fmt: skip
    law = [spray | {"flow": shifted}]
    reference = cast(**water | {"cooling.0.surface": law, "casting__speed": LATER})
    found, expected = (
        castfem.run(case).history["heat_removed"].to_numpy() for case in (started, reference)
    )
    assert len(found) == len(expected) and found == pytest.approx(expected, rel=1e-9)


def test_flow_is_shifted_to_the_time_of_the_slice() -> None:
    flow = Table("time", (0.0, 10.0, 20.0), (1.0, 3.0, 2.0))
    seen = seen_by_slice(flow, 5.0)
    assert isinstance(seen, Table) and seen.arguments == (0.0, 5.0, 15.0)
    times = np.linspace(0.0, 30.0, 7)
    assert seen(times) == pytest.approx(flow(times + 5.0), rel=1e-12)
    last = seen_by_slice(flow, 50.0)
    assert isinstance(last, Table) and last.values == (2.0,)
    assert seen_by_slice(flow, 0.0) is flow and seen_by_slice(3.0, 5.0) == 3.0


def test_unused_start_time_gives_a_warning() -> None:
    texts = [problem.text for problem in warnings(cast(casting__start__time="60 s"))]
    assert any("no speed, superheat or water" in text for text in texts)
    texts = [p.text for p in warnings(cast(casting__start__time="60 s", casting__speed=RAMP))]
    assert not any("no speed, superheat" in text for text in texts)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"casting__superheat": {**LADLE, "value": [40, -20, 30]}}, "casting.superheat.*below 0"),
        ({"casting__superheat": {**LADLE, "unit": "degC"}}, "written in kelvin"),
    ],
)
def test_invalid_superheat_is_rejected(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        cast(**changes)
