"""Free contraction of peritectic and other steels, compared with values computed by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from castfem.physics.materials import Steel, load_steel
from castfem.physics.materials.alloying import alloyed
from castfem.physics.materials.describe import describe_steel
from castfem.physics.materials.iron_carbon import DiagramName

ZERO = 273.15
COLD = 1200.0  # degC, down to which the steels contract
PERITECTIC = 1767.75 - ZERO  # degC, of the assessed diagram
DELTA_END, GAMMA_END = 0.0929, 0.1717  # wt%, of delta and gamma at the peritectic


def solidus(carbon: float) -> float:
    """Return the temperature at which the solidus of delta or gamma has a carbon content, degC."""
    if DELTA_END <= carbon <= GAMMA_END:
        return PERITECTIC
    hot, cold, first, last, b0, b1 = (
        (1810.95, 1767.75, 0.0, DELTA_END, 0.0074, 0.0006) if carbon < DELTA_END else
        (1767.75, 1408.9, GAMMA_END, 2.11, 0.0306, 0.2564)
    )  # fmt: skip

    def too_rich(s: float) -> float:
        return first + (last - first) * s + s * (1.0 - s) * (b0 + b1 * s) - carbon

    return hot + (cold - hot) * float(brentq(too_rich, 0.0, 1.0)) - ZERO


def steel(carbon: float, expansion: str = "chandra") -> Steel:
    law = {"thermal_expansion": {"formula": expansion}}
    return load_steel("plain_carbon", composition={"C": carbon}, overrides=law)


def chandra(celsius: float, carbon: float, phase: str) -> float:
    """Return the volume of 1 g of delta (2 atoms per cell) or gamma iron (4) with carbon, cm3."""
    start, slope, atoms = (0.1234, 9.38e-6, 2) if phase == "delta" else (0.1225, 9.45e-6, 4)
    pure = start + slope * (celsius - 20)
    edge = (pure * atoms * 55.845 / 6.02214076e23) ** (1 / 3) * 1e8  # Angstrom
    atomic = 100 * (carbon / 12.011) / (carbon / 12.011 + (100 - carbon) / 55.845)
    wider = 8.4e-3 * atomic
    if phase == "gamma":
        wider = (0.0317 - 11.65e-7 * celsius - 0.05e-7 * celsius**2) * carbon
    return pure * (1 + wider / edge) ** 3 * (1 - carbon / 100)


def harste(celsius: float, carbon: float, phase: str) -> float:
    """Return the volume of 1 kg by Harste's densities, m3."""
    start, slope, widening = (8011, 0.47, 0.013) if phase == "delta" else (8106, 0.51, 0.008)
    return (100 - carbon) * (1 + widening * carbon) ** 3 / (100 * (start - slope * celsius))


VOLUMES = {"chandra": chandra, "density": harste}


def by_hand(carbon: float, formula: str) -> float:
    """Return the contraction from the solidus to 1200 degC, per cent, positive.

    0.05 %C solidifies as delta and transforms in the solid; 0.12 %C consists of delta and gamma by
    the lever rule at the end of the peritectic reaction; 0.25 %C ends its solidification as gamma.
    """
    volume = VOLUMES[formula]
    if carbon == 0.05:
        hot = volume(solidus(carbon), carbon, "delta")
    elif carbon == 0.12:
        gamma = (carbon - DELTA_END) / (GAMMA_END - DELTA_END)
        hot = (1 - gamma) * volume(PERITECTIC, DELTA_END, "delta")
        hot += gamma * volume(PERITECTIC, GAMMA_END, "gamma")
    else:
        hot = volume(solidus(carbon), carbon, "gamma")
    return 100 * (1 - (volume(COLD, carbon, "gamma") / hot) ** (1 / 3))


@pytest.mark.parametrize("formula", VOLUMES)
@pytest.mark.parametrize("carbon", [0.05, 0.12, 0.25])
def test_free_contraction_is_that_by_hand(carbon: float, formula: str) -> None:
    found = steel(carbon, formula)
    assert found.solidus - ZERO == pytest.approx(solidus(carbon), abs=1e-9)
    contraction = -100.0 * float(found.thermal_strain(COLD + ZERO))
    assert contraction == pytest.approx(by_hand(carbon, formula), rel=1e-9)


@pytest.mark.parametrize(
    ("formula", "expected"),
    [("chandra", (0.9589, 0.8463, 0.6238)), ("density", (0.9009, 0.8075, 0.6402))],
)
def test_contraction_decreases_with_austenite_at_the_solidus(
    formula: str, expected: tuple[float, ...]
) -> None:
    """The values are of 0.05, 0.12 and 0.25 %C to 1200 degC, per cent."""
    found = [by_hand(carbon, formula) for carbon in (0.05, 0.12, 0.25)]
    assert found == pytest.approx(expected, abs=1e-4)


@pytest.mark.parametrize("formula", VOLUMES)
def test_transformation_contracts_in_its_range(formula: str) -> None:
    """0.12 %C: within 25 K of its solidus; 0.05 %C: far below; 0.25 %C: above its solidus."""
    first, ends = {}, {}
    for carbon in (0.05, 0.12, 0.25):
        found = steel(carbon, formula)
        start, end = found.diagram.gamma_start, found.diagram.gamma_end
        assert start is not None and end is not None
        at = np.array([start, end, end - 100.0])
        by_phase = found.transformation_strain(at)
        by_phase /= 1.0 + found.thermal_strain(at) - by_phase  # relative to the cooled length
        assert by_phase[0] == pytest.approx(0.0, abs=1e-12)
        assert by_phase[2] == pytest.approx(by_phase[1], abs=1e-12)
        if carbon < 0.25:
            assert 0.0012 < -by_phase[1] < 0.0025
        ends[carbon] = end
        first[carbon] = -float(found.thermal_strain(found.solidus - 25.0))
    assert first[0.12] > 3.0 * max(first[0.05], first[0.25])
    # In 0.12 %C all of it occurs within those 25 K.
    assert PERITECTIC - 25.0 < ends[0.12] - ZERO < PERITECTIC - 24.0


@pytest.mark.parametrize("formula", VOLUMES)
@pytest.mark.parametrize("carbon", [0.0, 0.05, 0.12, 0.17, 0.25])
def test_thermal_part_is_the_integral_at_fixed_phases(carbon: float, formula: str) -> None:
    """The reference is a quadrature of slopes at fixed fractions and carbon contents."""
    found = steel(carbon, formula)

    def slope(kelvin: float) -> float:
        p = found.diagram.phases(kelvin)  # type: ignore[union-attr]

        def volume(celsius: float) -> float:
            parts = ((float(p.delta), float(p.carbon_delta), "delta"),
                     (float(p.gamma), float(p.carbon_gamma), "gamma"))  # fmt: skip
            return sum(f * VOLUMES[formula](celsius, c, name) for f, c, name in parts if f > 0.0)

        t = kelvin - ZERO
        return (volume(t + 0.5) - volume(t - 0.5)) / (3.0 * volume(t))

    cold, hot = COLD + ZERO, found.solidus - 1e-9
    kinks = [t for t in found.diagram.kinks if cold < t < hot]
    thermal = -quad(slope, cold, hot, points=kinks or None, limit=200)[0]
    by_phase = float(found.thermal_strain(cold) - found.transformation_strain(cold))
    assert np.log1p(by_phase) == pytest.approx(thermal, rel=1e-6)


def test_steel_without_phases_has_no_transformation_strain() -> None:
    found = load_steel("carbon_042")
    t = np.array([300.0, 1400.0, 1900.0])
    assert not found.transformation_strain(t).any() and found.thermal_strain(t).any()


def test_description_has_the_contraction_by_phases() -> None:
    text = dict(describe_steel(steel(0.12)))["contraction"]
    assert text == "0.846 % from solidus to 1200 °C, 0.176 % of it by δ to γ"
    assert "contraction" not in dict(describe_steel(steel(0.25)))


@pytest.mark.parametrize(
    ("diagram", "end", "below"), [("assessed", 19.6, 16.5), ("pascon", 35.2, 32)]
)
def test_tenth_of_delta_is_at_the_temperature_of_the_page(
    diagram: DiagramName, end: float, below: float
) -> None:
    """There the flow law of `billet180/peritectic` jumps, `below` K below the solidus."""
    billet = alloyed({"C": 0.12, "Mn": 0.5, "Si": 0.25}, diagram)

    def excess(drop: float) -> float:
        return float(billet.phases(billet.solidus - drop, "below").delta) - 0.1

    jump = float(brentq(excess, 1.0, 40.0))
    assert billet.gamma_end is not None
    assert billet.solidus - billet.gamma_end == pytest.approx(end, abs=0.1)
    assert jump == pytest.approx(below, abs=0.6)
    if diagram == "assessed":
        assert billet.solidus - jump - ZERO == pytest.approx(1471.5, abs=0.5)
