"""The solidifying half-space: stress of the strip against the closed form (physics 1b)."""

from __future__ import annotations

import numpy as np
import pytest

from mechanics.weiner_boley import HalfSpace, Strip

pytestmark = pytest.mark.slow

EXACT = HalfSpace()


def test_closed_form_gives_the_known_numbers() -> None:
    assert EXACT.front == pytest.approx(0.665780, abs=1e-6)
    assert EXACT.compressed == pytest.approx(0.147449, abs=1e-6)
    assert EXACT.stretched == pytest.approx(0.263898, abs=1e-6)
    assert EXACT.rate == pytest.approx(-4.053264e-3, rel=1e-6)
    depths = np.array([0.0, 2, 3, 4, 5, 6, 8, 10, 12, 15]) * 1e-3
    published = [
        -20.0,
        -17.0865,
        -15.6427,
        -3.7846,
        8.1180,
        11.2705,
        8.7490,
        6.2234,
        3.8720,
        0.7113,
    ]
    assert EXACT.stress(depths, 21.0) / 1e6 == pytest.approx(published, abs=2e-4)
    depths = np.arange(8) * 1e-3
    published = [-20.0, -17.0149, -2.0916, 11.1986, 8.4924, 5.9232, 3.5397, 1.3614]
    assert EXACT.stress(depths, 5.0) / 1e6 == pytest.approx(published, abs=2e-4)
    assert EXACT.shell(21.0) == pytest.approx(15.7433e-3, abs=1e-7)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_coarse_strip(cell: str) -> None:
    """Cells of 0.5 mm: 5 % of 20 MPa at 5 s and 21 s."""
    strip = Strip(0.5e-3, cell=cell).advance(5.0, 0.05)
    assert strip.error(EXACT) < 0.05
    strip.advance(21.0, 0.1)
    assert strip.error(EXACT) < 0.03
    # Both directions of the plane of the shell are one, and no force is left in either.
    stress = strip.stress
    close = 1e-6 if cell == "quadrilateral" else 0.03
    assert np.abs(stress[:, 1] - stress[:, 2]).max() < close * 20e6
    assert strip.state.generalized_strains[0] == pytest.approx(
        strip.state.generalized_strains[3], rel=close
    )
    assert max(r.balance.axial_error for r in strip.results if r.balance) < 1e-8
    # In the liquid and across the shell there is (next to) none.
    assert np.abs(stress[:, 0]).max() < 0.05 * 20e6


def test_fine_strip() -> None:
    """Cells of 0.1 mm: 1 % at 5 s, peak tension and zero where they belong."""
    strip = Strip(0.1e-3).advance(5.0, 0.04)
    assert strip.error(EXACT) < 0.01
    peak = int(np.argmax(strip.stress[:, 2]))
    assert strip.stress[peak, 2] == pytest.approx(11.2711e6, rel=0.02)
    assert strip.depth[peak] == pytest.approx(2.921e-3, abs=0.15e-3)
    # Strain rate in the plane, K / 2t, over the last second.
    rate = (
        strip.state.generalized_strains[0] - strip.results[-26].state.generalized_strains[0]
    ) / 1.0
    mean = EXACT.rate / 2 * np.log(5.0 / 4.0)
    assert rate == pytest.approx(mean, rel=0.01)


def test_error_falls_with_the_cells() -> None:
    coarse, fine = (Strip(size).advance(5.0, 0.05).error(EXACT) for size in (1e-3, 0.25e-3))
    assert np.log2(coarse / fine) / 2 > 0.9
