"""Creeping plates: elastic ones of the handbook, the strip of Norton's law, the order in n."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import creeping_plate as study

RIGIDITY = 4.0 / 3.0  # of a curvature in one direction alone, at n = 1
SQUARE = {True: 0.00126532, False: 0.00191714}  # p L^4/D (Timoshenko, Plates and Shells)


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "TERMS", (5, 5))
    monkeypatch.setattr(study, "POINTS", 24)


@pytest.mark.parametrize("clamped", [True, False])
def test_an_elastic_square_plate(clamped: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(study, "POWERS", (1.0,))
    found = study.Plate.of(1.0, clamped).rises(1.0)[1.0]
    assert found * RIGIDITY == pytest.approx(SQUARE[clamped], rel=2e-3)


def test_a_strip_is_that_of_its_moments(monkeypatch: pytest.MonkeyPatch) -> None:
    """The curvature of a clamped strip is |M|^n: M0 = -p/13.243 for n = 3, as in a travelling one.

    The deflection in the middle is the integral of the curvature's moment about it.
    """
    monkeypatch.setattr(study, "POWERS", (1.0, 2.0, 3.0))
    monkeypatch.setattr(study, "TERMS", (10, 5))
    found = study.Plate.of(None).rises()
    z = np.linspace(0.0, 0.5, 4001)
    for power, least in ((1.0, 12.0), (3.0, 13.2430)):
        moment = study.LOAD * (0.5 * z * (1.0 - z) - 1.0 / least)
        bent = np.sign(moment) * (np.abs(moment) / np.sqrt(RIGIDITY)) ** power / np.sqrt(RIGIDITY)
        middle = -np.trapezoid(bent * (0.5 - z), z)
        assert found[power] == pytest.approx(middle, rel=2e-3)


def test_width_holds_back_what_creeps_and_nothing_that_is_elastic(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(study, "POWERS", (1.0, 2.0, 3.0))
    strip = study.Plate.of(None).rises()
    clamped, supported = (
        {n: w / strip[n] for n, w in study.Plate.of(2.4, edges).rises().items()}
        for edges in (True, False)
    )
    assert clamped[1.0] == pytest.approx(1.0, abs=0.01)
    assert 0.7 < clamped[3.0] < supported[3.0] < 0.9
    assert study.felt(clamped[3.0], 3.0) ** 3 == pytest.approx(clamped[3.0])
