"""Parameters identified from tensile curves, their uncertainty, and the files of the curves."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.constitutive import NortonHoff, load_elasticity, load_law
from castfem.physics.constitutive.flow_curves import Austenite, modified_norton_hoff
from castfem.studies.identification.fit import IdentifyOptions, identify
from castfem.studies.identification.measured import TensileData, read_tensile
from castfem.studies.identification.result import IdentifiedLaw

from .samples import ZERO

CELSIUS = (900.0, 1000.0, 1100.0, 1200.0, 1300.0)
RATES = (1e-4, 1e-3, 5e-3)
STRENGTH = np.array([90e6, 62e6, 44e6, 30e6, 20e6])
P1, P3, P4 = 1.5, 0.14, 0.2


def synthetic(
    noise: float = 0.0, seed: int = 0, rates: tuple[float, ...] = RATES, p1: float = P1
) -> TensileData:
    """Return curves of known parameters with multiplicative noise."""
    t, r, e = (
        a.ravel()
        for a in np.meshgrid(
            np.array(CELSIUS) + ZERO, rates, np.geomspace(2e-3, 0.3, 30), indexing="ij"
        )
    )
    strength = np.interp(t, np.array(CELSIUS) + ZERO, STRENGTH)
    stress = modified_norton_hoff(e, r, strength, p1, P3, P4)
    rng = np.random.default_rng(seed)
    return TensileData(t, r, e, stress * np.exp(noise * rng.normal(size=len(t))), "synthetic")


def kozlowski(rates: npt.ArrayLike, strains: npt.ArrayLike) -> TensileData:
    """Return tensile curves of Kozlowski III, 0.10 %C."""
    celsius = np.array([800.0, 900.0, 1000.0, 1100.0, 1200.0, 1300.0, 1400.0, 1450.0])
    t, r, e = (a.ravel() for a in np.meshgrid(celsius + ZERO, rates, strains, indexing="ij"))
    return TensileData(t, r, e, Austenite.at(t, 0.10).stress(e, r), "Kozlowski III")


def truth(law: IdentifiedLaw) -> Array:
    return np.stack([np.log(STRENGTH), np.full(5, P1), np.full(5, P3), np.full(5, P4)], axis=1)


def test_exact_data_return_the_parameters() -> None:
    law = identify(synthetic())
    np.testing.assert_allclose([f.values for f in law.fits], truth(law), rtol=1e-6)
    assert max(f.worst for f in law.fits) < 1e-6
    assert law.statements() == ()


@pytest.mark.parametrize("degree", [None, 3])
def test_intervals_contain_the_truth_at_their_level(degree: int | None) -> None:
    """Of the 300 intervals of 15 noisy sets, about 95 % contain the truth (90 to 99 %)."""
    inside: list[bool] = []
    for seed in range(15):
        law = identify(synthetic(0.03, seed), IdentifyOptions(degree=degree))
        if degree is not None:  # here the strength is no polynomial of temperature
            law_truth, columns = truth(law), (1, 2, 3)
        else:
            law_truth, columns = truth(law), (0, 1, 2, 3)
        for fit, true in zip(law.fits, law_truth, strict=True):
            assert fit.rms == pytest.approx(0.03, rel=0.6)
            inside += [bool(abs(fit.values[c] - true[c]) <= fit.half_width[c]) for c in columns]
    assert 0.90 < np.mean(inside) < 0.99


def test_joint_fits_have_narrower_intervals() -> None:
    data = synthetic(0.03)
    separate, joint = identify(data), identify(data, IdentifyOptions(degree=2))
    middle = [law.fits[2].half_width for law in (separate, joint)]
    assert all(b < 0.75 * a for a, b in zip(*middle, strict=True))


def test_fit_of_kozlowski_has_the_error_of_the_shipped_set() -> None:
    """Without p1 the rms error is 3 to 7 %, with p1 half of that."""
    data = kozlowski(np.geomspace(1e-4, 5e-3, 6), np.geomspace(0.002, 0.05, 12))
    shipped = load_law("norton_hoff_kozlowski", load_elasticity())
    assert isinstance(shipped, NortonHoff)
    law = identify(data, IdentifyOptions(softening="none"))
    stated = [3.0, 3.9, 4.8, 5.5, 6.1, 6.5, 6.6, 6.6]
    for fit, error in zip(law.fits, stated, strict=True):
        assert 100.0 * fit.rms < error + 0.6
    np.testing.assert_allclose(
        law.parameter("strength"), shipped.strength(law.temperature), rtol=0.04
    )
    np.testing.assert_allclose(law.parameter("p3"), shipped.p3(law.temperature), atol=4e-3)
    np.testing.assert_allclose(law.parameter("p4"), shipped.p4(law.temperature), atol=6e-3)
    free = identify(data, IdentifyOptions(softening="free", p4=(-0.5, 0.9)))
    assert all(100.0 * f.rms < 3.3 for f in free.fits)
    assert (free.parameter("p1") < -3.0).all()


def test_absent_softening_is_not_identified() -> None:
    law = identify(kozlowski(np.geomspace(1e-4, 5e-3, 4), np.geomspace(0.002, 0.05, 12)))
    assert (law.parameter("p1") == 0.0).all()
    assert any("p1 is held by its bound" in text for text in law.statements())
    doubtful = identify(synthetic(0.05, p1=0.05))
    assert any("softening is not proven" in text for text in doubtful.statements())


@pytest.mark.parametrize("degree", [None, 2])
def test_single_rate_leaves_rate_exponent_undetermined(degree: int | None) -> None:
    law = identify(synthetic(0.02, rates=(1e-3,)), IdentifyOptions(degree=degree))
    for fit in law.fits:
        assert np.isinf(fit.half_width[0]) and np.isinf(fit.half_width[2])
        assert np.isfinite(fit.half_width[1]) and np.isfinite(fit.half_width[3])
        assert fit.values[2] == pytest.approx(0.13, abs=1e-3)
        assert fit.rms < 0.1
    text = " ".join(law.statements())
    assert "p3 cannot be found" in text and "one strain rate only" in text
    assert "(open)" in law.report()


def test_interval_is_independent_of_sampling_density() -> None:
    """With ten times the points, errors correlated as in measurements, intervals stay as wide."""
    rng = np.random.default_rng(4)
    widths = []
    for n in (30, 300):
        e = np.tile(np.geomspace(2e-3, 0.3, n), 3)
        r = np.repeat(RATES, n)
        drift = np.concatenate([_smooth_error(np.linspace(0.0, 1.0, n), rng) for _ in RATES])
        stress = modified_norton_hoff(e, r, 44e6, P1, P3, P4) * np.exp(0.05 * drift)
        data = TensileData(np.full(3 * n, 1373.15), r, e, stress)
        widths.append(identify(data, IdentifyOptions(points=1000)).fits[0].half_width)
    ratio = np.array(widths[0]) / np.array(widths[1])
    assert (ratio < 2.0).all() and (ratio > 0.3).all()


def _smooth_error(x: Array, rng: np.random.Generator) -> Array:
    """Return a smooth random error along a curve."""
    a, b = rng.normal(size=4), rng.uniform(0.0, 6.28, 4)
    return np.asarray(sum(a[k] * np.sin(3.0 * (k + 1) * x + b[k]) for k in range(4)) / 2.0)


def test_elastic_and_large_strains_are_omitted() -> None:
    data = synthetic()
    strain = np.concatenate([data.strain, np.full(5, 1e-4)])
    more = TensileData(
        np.concatenate([data.temperature, np.full(5, 1373.15)]),
        np.concatenate([data.rate, np.full(5, 1e-3)]),
        strain,
        np.concatenate([data.stress, np.full(5, 1e6)]),
    )
    law = identify(more, IdentifyOptions(points=10, largest_strain=0.2))
    assert law.used.strain.min() >= 0.002 and law.used.strain.max() <= 0.2
    assert len(law.used.stress) == 5 * 3 * 10 and len(law.given.stress) == len(strain)
    np.testing.assert_allclose([f.values for f in law.fits], truth(law), rtol=1e-6)


def test_written_file_contains_the_law(tmp_path: Path) -> None:
    law = identify(synthetic(0.02))
    path = tmp_path / "fitted.toml"
    path.write_text(law.to_toml(), "utf-8")
    data = tomllib.loads(path.read_text("utf-8"))
    assert "synthetic" in data["description"] and data["status"] == "C"
    elasticity = load_elasticity()
    read, identified = load_law("fitted.toml", elasticity, tmp_path), law.law(elasticity)
    assert isinstance(read, NortonHoff)
    t = np.linspace(1100.0, 1700.0, 50)
    for name in ("strength", "p1", "p3", "p4"):
        np.testing.assert_allclose(getattr(read, name)(t), getattr(identified, name)(t), rtol=1e-5)
    single = identify(synthetic().select(np.flatnonzero(synthetic().temperature < 1200.0)))
    path.write_text(single.to_toml(), "utf-8")
    read = load_law("fitted.toml", elasticity, tmp_path)
    assert isinstance(read, NortonHoff)
    assert read.strength(t)[0] == pytest.approx(90e6, rel=1e-5)


def test_report_and_picture_are_written(tmp_path: Path) -> None:
    law = identify(synthetic(0.03))
    lines = law.report().splitlines()
    assert len(lines) == 7 and "+-" in lines[1] and "95 %" in lines[6]
    assert law.plot(tmp_path / "fit.png").stat().st_size > 20_000


def test_file_of_curves_is_read(tmp_path: Path) -> None:
    path = tmp_path / "tests.csv"
    path.write_text(
        "# Gleeble, 2003\n"
        "Stress [MPa]; strain [percent]; strain_rate [1/min]; temperature [K]\n"
        "10; 1; 0.06; 1273.15\n"
        "12; 2; 0.0601; 1273.65\n"
        "\n"
        "20; 1; 0.6; 1273.2\n"
    )
    data = read_tensile(path)
    np.testing.assert_allclose(data.stress, [10e6, 12e6, 20e6])
    np.testing.assert_allclose(data.strain, [0.01, 0.02, 0.01])
    np.testing.assert_allclose(data.rate, [1.00083e-3, 1.00083e-3, 1e-2], rtol=1e-5)
    assert len(np.unique(data.rate)) == 2 and len(data.temperatures) == 1
    assert data.temperatures[0] == pytest.approx(1273.3333, abs=1e-3)
    assert [list(c) for c in data.curves()] == [[0, 1], [2]]


def test_identify_takes_a_path(tmp_path: Path) -> None:
    data = synthetic()
    path = tmp_path / "curves.csv"
    rows = zip(data.temperature - ZERO, data.rate, data.strain, data.stress / 1e6, strict=True)
    lines = ["temperature [degC], strain rate [1/s], strain [-], stress [MPa]"]
    path.write_text("\n".join([*lines, *(", ".join(f"{v:.9g}" for v in row) for row in rows)]))
    law = identify(path)
    np.testing.assert_allclose([f.values for f in law.fits], truth(law), rtol=1e-4)
    assert law.used.name == "curves.csv"


def test_units_with_negative_power_are_read(tmp_path: Path) -> None:
    path = tmp_path / "curves.csv"
    for unit in ("1/s", "s^-1", "s-1"):
        path.write_text(
            f"temperature [K], strain rate [{unit}], strain [-], stress [MPa]\n1200, 1e-3, 0.1, 20"
        )
        assert read_tensile(path).rate == pytest.approx([1e-3])
    path.write_text("temperature [K], strain rate [s], strain [-], stress [MPa]\n1200,1,0.1,20")
    with pytest.raises(InputError, match="column 'strain rate'"):
        read_tensile(path)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("temperature [degC], strain [-], stress [MPa]\n1,2,3", "'strain rate' is missing"),
        ("temprature [degC], strain rate [1/s], strain, stress [MPa]", "did you mean temperature?"),
        ("temperature, strain rate [1/s], strain, stress [MPa]\n", "column 'temperature'"),
        ("temperature [K], temperature [K], strain, stress [MPa]\n", "twice"),
        ("temperature [K], strain rate [1/s], strain, stress [MPa]\n1000,1,x,3", "line 2: strain"),
        ("temperature [K], strain rate [1/s], strain, stress [MPa]\n1000,1,nan,3", "not finite"),
    ],
)
def test_invalid_files_are_rejected(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "faulty.csv"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        read_tensile(path)
    assert expected in str(caught.value) and "faulty.csv" in str(caught.value)


def test_insufficient_data_are_rejected(tmp_path: Path) -> None:
    data = synthetic()
    few = data.select(np.arange(3))
    with pytest.raises(InputError, match="3 usable points at 900 degC"):
        identify(few)
    with pytest.raises(InputError, match="degree 4 at most"):
        identify(data, IdentifyOptions(degree=5))
    with pytest.raises(InputError, match="no point has a positive stress"):
        identify(data, IdentifyOptions(least_strain=0.9))
    with pytest.raises(InputError, match="file not found; correct the path"):
        identify(tmp_path / "none.csv")
