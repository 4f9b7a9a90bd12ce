"""Keys fitted to measured values: statistics by closed form, and a case by its own twin."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy import stats
from small_case import small

import castfem
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.cli import calibrating
from castfem.cli.calibrating import _check_results, calibrate_case
from castfem.model import Case
from castfem.post.plots.style import save
from castfem.studies.calibration.fit import Fit, Free, computed, fit, read_free
from castfem.studies.calibration.measured import Measured, read_measured

X = np.linspace(0.0, 3.0, 9)
NOISE = np.array([0.3, -0.2, 0.1, -0.4, 0.25, -0.05, 0.15, -0.3, 0.2])
KEYS = (Free("slope", 0.0, 10.0, "m"), Free("offset", -5.0, 5.0))


def line(errors_known: bool = False, bounds: float = 10.0) -> Fit:
    """Fit a straight line to noisy points of 4 x - 1."""

    def residuals(values: Sequence[Mapping[str, str]]) -> list[Array]:
        found = []
        for one in values:
            slope, offset = float(one["slope"].split()[0]), float(one["offset"])
            found.append(slope * X + offset - (4.0 * X - 1.0 + NOISE))
        return found

    keys = (Free("slope", 0.0, bounds, "m"), KEYS[1])
    return fit(residuals, keys, [1.0, 3.0], errors_known=errors_known)


def test_straight_line_has_the_intervals_of_the_textbook() -> None:
    found, known = line(), stats.linregress(X, 4.0 * X - 1.0 + NOISE)
    slope, offset = found.keys
    t = stats.t.ppf(0.975, len(X) - 2)
    assert slope.value == pytest.approx(known.slope, rel=1e-6)
    assert offset.value == pytest.approx(known.intercept, rel=1e-6)
    assert slope.interval == pytest.approx(t * known.stderr, rel=1e-4)
    assert offset.interval == pytest.approx(t * known.intercept_stderr, rel=1e-4)
    expected = -X.mean() / np.sqrt((X**2).mean())
    assert found.correlation[0, 1] == pytest.approx(expected, rel=1e-4)
    assert found.converged and not slope.held


def test_stated_errors_are_used() -> None:
    """For errors of 1 and a scatter of 0.27 the interval is that of the errors."""
    found = line(errors_known=True)
    inverse = np.linalg.inv(np.array([[X @ X, X.sum()], [X.sum(), len(X)]]))
    assert found.keys[0].interval == pytest.approx(1.95996 * np.sqrt(inverse[0, 0]), rel=1e-4)
    assert found.spread < 0.4


def test_bound_holds() -> None:
    slope, offset = line(bounds=2.5).keys
    assert slope.value == pytest.approx(2.5, abs=0.01) and slope.held
    assert not slope.moved and not offset.moved
    slope, offset = line(bounds=0.5).keys
    assert slope.moved and slope.start == 0.5 and not offset.moved


def test_undetermined_keys_have_no_interval() -> None:
    def residuals(values: Sequence[Mapping[str, str]]) -> list[Array]:
        sums = [float(v["slope"].split()[0]) + float(v["offset"]) for v in values]
        return [np.array([s - 3.0, s - 3.1, s - 2.9]) for s in sums]

    found = fit(residuals, KEYS, [1.0, 1.0], errors_known=False)
    assert all(np.isnan(key.interval) for key in found.keys)


def test_fewer_data_than_keys_are_refused() -> None:
    with pytest.raises(InputError, match="1 measured values cannot determine 2 keys"):
        fit(lambda values: [np.zeros(1) for _ in values], KEYS, [1.0, 1.0], errors_known=False)


@pytest.fixture(scope="module")
def twin(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a case, and of data of its twin with a coefficient of 2100 W/m2K."""
    folder = tmp_path_factory.mktemp("twin")
    case = small()
    (folder / "case.toml").write_text(case.resolved_toml())
    key = "cooling.mould.surface.0.coefficient"
    result = castfem.run(case.with_({key: "2100 W/(m^2 K)"}))
    rows = ["position [mm]; surface_temperature_mid_face [degC]"]
    for position, noise in ((12.0, 0.2), (24.0, -0.3), (36.0, 0.1), (48.0, 0.15), (54.0, -0.1)):
        kelvin = result.at(1e-3 * position)["surface_temperature_mid_face"]
        rows.append(f"{position}; {kelvin - 273.15 + noise:.6f}")
    (folder / "data.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_case_finds_the_coefficient_of_its_twin(
    twin: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    monkeypatch.setattr(calibrating, "save", lambda it, path: save(drawn.append(it) or it, path))
    key = "cooling.mould.surface.0.coefficient"
    words = (str(twin / "case.toml"), twin / "data.csv", [f"{key}=800..4000 W/(m^2 K)"])
    calibrate_case(*words, twin / "fit", processes=0)
    text = capsys.readouterr().out
    stored = json.loads((twin / "fit" / "calibration.json").read_text())
    (found,) = stored["keys"]
    assert found["start"] == pytest.approx(1600.0)
    assert abs(found["value"] - 2100.0) < found["half_interval_95"] < 30.0
    assert stored["converged"] and "fitted" in text
    # The written case has the value, and the length of the original one.
    case = castfem.load(twin / "fit" / "calibrated.toml")
    (law,) = case.cooling[0].surface
    assert law.coefficient == pytest.approx(found["value"])  # type: ignore[attr-defined]
    assert case.casting.length == pytest.approx(0.06)
    image = matplotlib.image.imread(twin / "fit" / "calibration.png")
    assert image[..., :3].std() > 0.02
    # A second call finds all runs.
    calibrate_case(*words, twin / "fit", processes=0, units=("temperature=degF",))
    again = capsys.readouterr().out
    assert "0 runs" in again
    kelvin, fahrenheit = (
        float(re.search(rf"([\d.]+) {unit} fitted", one)[1])  # type: ignore[index]
        for unit, one in (("K", text), ("°F", again))
    )
    assert fahrenheit == pytest.approx(1.8 * kelvin, abs=0.15)
    assert json.loads((twin / "fit" / "calibration.json").read_text())["keys"] == [found]
    labels = [one.axes[0].get_ylabel().rpartition(" ")[2] for one in drawn]
    assert labels == ["[°C]", "[°F]"]
    (along, against), (legend,) = drawn[0].axes, drawn[0].legends
    assert [text.get_text() for text in legend.get_texts()] == [
        "computed, before", "computed, fitted", "measured", "computed = measured",
    ]  # fmt: skip
    same, before, after = (line.get_xydata() for line in against.lines)
    assert (same[:, 0] == same[:, 1]).all()
    assert np.abs(np.diff(after)).max() < 1.0 < np.abs(np.diff(before)).max()
    assert along.get_title() == "surface, mid-face" and against.get_xlabel() == "measured [°C]"
    assert float(drawn[1].axes[0].yaxis.get_major_formatter()(1000.0)) == pytest.approx(1832.0)
    assert "outside these bounds" not in text
    calibrate_case(*words[:2], [f"{key}=1700..4000 W/(m^2 K)"], twin / "fit", processes=0)
    starts = 'outside these bounds; the fit starts, and "before" is, at 1700 W/(m² K)\n'
    assert f"{key}: the case's value lies {starts}" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("casting.speed", "write KEY=LOW..HIGH UNIT"),
        ("casting.speed=3 m/min", "write KEY=LOW..HIGH UNIT"),
        ("casting.speed=4..2 m/min", "lower bound must be below"),
        ("casting.speed=2 m/s..4 m/min", "both bounds need the same unit"),
        ("casting.speed=a..b", "bounds are numbers"),
    ],
)
def test_invalid_bounds_are_refused(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_free(text)


HEAD = "position [mm], shell_mid_face [mm], shell_mid_face error [mm]"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "a header and rows are needed"),
        (
            "position [mm], shell_mid_face\n5, 1",
            r"shell_mid_face has no unit; .* header, shell_mid",
        ),
        ("position, shell_mid_face [mm]\n5, 1", r"line 1: position has no unit; .*position \[mm\]"),
        ("position [mm], shell_mid_face [mm]\n-5, 1", r"line 2: the position lies above the men"),
        (f"{HEAD}\n5, 1", r"line 2: 2 cells, not 3"),
        (f"{HEAD}\n5, 1, 0", r"line 2: shell_mid_face error must be above 0"),
        (f"{HEAD}\n5, 1, 0.1\n6, 2, ", r"at 6 mm has no error, but others have"),
        (f"{HEAD}\n, 1, 0.1", "the position is missing"),
        ("position [mm], shell_mid_face [mm], heat_removed [MJ/m]\n5, 1, 2", "need their errors"),
        ("position [mm], shell_mid_face [mm]\n5, x", r"line 2: shell_mid_face \[mm\] \(x\)"),
        (
            "position [mm], shell_mid_face [K]\n5, 1",
            r'line 1: .*"1 K"\) does not measure shell_mid',
        ),
        ("position [mm], shell_mid_face [cubits]\n5, 1", r"data\.csv: line 1: shell_mid_face \["),
    ],
)
def test_invalid_data_are_refused(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "data.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_measured(path)


@pytest.mark.parametrize(
    ("free", "message"),
    [
        (["casting.speed=2..4 m/min"] * 2, r'^--free "casting\.speed": is given twice'),
        (["casting.spede=2..4 m/min"], r'^--free "casting\.spede": .*did you mean speed'),
        (["title=0..1"], r'^--free "title": title: is a text \("'),
        (["casting.speed=2..4 mm"], r'^--free "casting\.speed": .*a speed is needed'),
    ],
)
def test_invalid_keys_are_refused(twin: Path, free: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        calibrate_case(str(twin / "case.toml"), twin / "data.csv", free, twin / "none")
    assert not (twin / "none").exists()
    with pytest.raises(InputError, match=r"^--accuracy fin: .*did you mean fine"):
        calibrate_case(str(twin / "case.toml"), twin / "data.csv", free, None, accuracy="fin")


@pytest.mark.parametrize(
    ("column", "position", "line"),
    [
        ("shell_mid_face", 500, r"shell_mid_face: 500 mm was .* --set casting\.length=.500 mm"),
        ("shell_mid_face", 0, r"shell_mid_face: .*at the meniscus"),
        ("gap_mid_face", 54, r"gap_mid_face: is none of this case, for it has no \[mechanics\] an"),
        ("surface_temp", 54,
         r"surface_temp: no such (?!.*_tip).*allowed: .*surface_temperature_mid_face"),
        ("shel_mid_face", 54, r"shel_mid_face: no such .* did you mean shell_mid"),
        ("shell_mid_fac", 54, r'shell_mid_fac: has no place "mid_fac" .*did you mean mid_face'),
    ],
)  # fmt: skip
def test_data_that_the_run_lacks_are_refused(
    twin: Path, tmp_path: Path, column: str, position: int, line: str
) -> None:
    path = tmp_path / "data.csv"
    path.write_text(f"position [mm], {column} [mm]\n{position}, 9\n")
    free = ["cooling.mould.surface.0.coefficient=800..4000 W/(m^2 K)"]
    with pytest.raises(InputError, match=rf"data\.csv: line 2: {line}"):
        calibrate_case(str(twin / "case.toml"), path, free, tmp_path / "fit", processes=0)
    assert not (tmp_path / "fit").exists()


def probed(coefficient: str = "1600 W/(m^2 K)") -> Case:
    probe = {"name": "tc1", "under": "mid_face", "depth": "3 mm"}
    return small({"output.probe": [probe], "cooling.0.surface.0.coefficient": coefficient})


def test_values_at_a_probe_are_interpolated(tmp_path: Path) -> None:
    result = castfem.run(probed(), folder=tmp_path / "run")
    table = result.probes["tc1"]
    (found,) = computed(
        probed(), tmp_path / "run", [Measured(0.045, "tc1.temperature", 1700.0, 5.0)]
    )
    known = np.interp(0.045, table["position"], table["temperature"])
    assert found.value == pytest.approx(known + 273.15)
    assert (found.shown_unit, found.label) == ("degC", "temperature at tc1")
    with pytest.raises(InputError, match="probe tc1 has no temperature at 90 mm"):
        computed(probed(), tmp_path / "run", [Measured(0.09, "tc1.temperature", 1700.0, 5.0)])


def data(folder: Path, heading: str) -> list[Measured]:
    path = folder / "data.csv"
    path.write_text(f"position [mm], {heading}\n45, 1200\n")
    return read_measured(path)


def test_file_names_probe_and_column(tmp_path: Path) -> None:
    (one,) = data(tmp_path, "tc1.temperature [degC]")
    assert (one.name, one.value) == ("tc1.temperature", pytest.approx(1473.15))
    _check_results(probed(), [one])


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        ("tc2.temperature [degC]", "the case has no probe tc2; did you mean tc1.*it has tc1"),
        ("tc1.temprature [degC]", "a probe has no temprature; did you mean temperature"),
        ("tc1.stress_zz [MPa]", "a probe has no stress_zz.*it has temperature, solid_fraction"),
        ("tc1.temperature [mm]", "does not measure tc1.temperature; it has a unit such as"),
        ("tc1.temperature", "tc1.temperature has no unit"),
    ],
)
def test_missing_results_are_refused_before_any_run(
    tmp_path: Path, heading: str, message: str
) -> None:
    with pytest.raises(InputError, match=message):
        _check_results(probed(), data(tmp_path, heading))
