"""Solidification with microsegregation: limits by hand, balances, peritectic steel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.materials import load_steel
from castfem.physics.materials.microsegregation import (
    FRACTIONS,
    SegregatedDiagram,
    Segregation,
    back_diffusion,
    enriched,
    segregated,
)

PLANT = {"Mn": 0.8, "Si": 0.2, "P": 0.015, "S": 0.01}
LIQUIDUS = 1800.0  # K


def test_back_diffusion_has_the_values_by_hand() -> None:
    """For 4 D t/l2^2 = 0.4: a = 1, b = 2 (1 - 1/e) - 1/sqrt(e) = 0.65771."""
    assert back_diffusion(0.4) == pytest.approx(0.65771, abs=5e-6)
    assert back_diffusion(1e6) == pytest.approx(1.0, abs=1e-6)
    ends = [back_diffusion(0.1 * 2.0**n) for n in range(8)]
    assert all(np.diff(ends) > 0.0)


def test_limits_are_lever_rule_and_scheil() -> None:
    at = np.array([0.0, 0.3, 0.9, 0.99])
    assert enriched(0.2, at, 0.3, 1.0) == pytest.approx(0.2 / (1.0 - 0.7 * at), rel=1e-12)
    assert enriched(0.2, at, 0.3, 0.0) == pytest.approx(0.2 * (1.0 - at) ** -0.7, rel=1e-12)


CARBON = (0.05, 0.19, 0.0127, 19450.0, 78.0)
SULPHUR = (0.02, 0.05, 4.56, 51300.0, 38.0)
"""Content in %, partition, diffusion in cm2/s, its energy in cal/mol, liquidus slope in K/%."""


def by_hand(rate: float, solutes: list[tuple[float, ...]], fraction: float) -> float:
    """Return the temperature of a solid fraction of steel with 0.05 % C, K.

    The diffusion depends on the temperature at the end of solidification, which is solved for.
    """

    def excess(end: float, fraction: float = 1.0) -> float:
        spacing = 1e-6 * (169.1 - 720.9 * 0.05) * rate**-0.4935
        time, found = (LIQUIDUS - end) / rate, 0.0
        for content, k, d, q, m in solutes:
            alpha = 4e-4 * d * np.exp(-q / (1.987 * end)) * time / spacing**2
            a = 2.0 * (alpha + 0.1)
            b = 2.0 * a * (1.0 - np.exp(-1.0 / a)) - np.exp(-0.5 / a)
            power = (1.0 - k) / (b * k - 1.0)
            found += m * content * ((1.0 + fraction * (b * k - 1.0)) ** power - 1.0)
        return LIQUIDUS - found - (end if fraction == 1.0 else 0.0)

    end = brentq(excess, 1600.0, LIQUIDUS - 1.0)
    return float(end if fraction == 1.0 else excess(end, fraction))


def test_path_is_that_of_an_independent_solution() -> None:
    """0.05 % C solidifies as delta ferrite, 0.2 K off the lever rule 78 K (0.05/(1 - 0.81 f))."""
    steel = Segregation({"C": 0.05}, 1.0, LIQUIDUS)
    for i in (0, 124, 200, 380, 400):
        expected = by_hand(1.0, [CARBON], FRACTIONS[i])
        assert steel.path[i] == pytest.approx(expected, abs=1e-5)
        lever = LIQUIDUS - 78.0 * (0.05 / (1.0 - 0.81 * FRACTIONS[i]) - 0.05)
        assert expected == pytest.approx(lever, abs=0.2)
    at = np.array([steel.path[124], LIQUIDUS + 5.0, steel.path[-1] - 5.0])
    assert steel.temperature(0.31) == pytest.approx(steel.path[124], rel=1e-12)
    assert steel.solid_fraction(at) == pytest.approx([0.31, 0.0, 1.0], abs=1e-6)
    assert steel.carbon(at) == pytest.approx(
        0.05 + (LIQUIDUS - np.clip(at, steel.path[-1], LIQUIDUS)) / 78.0
    )


def test_sulphur_lowers_the_solidus() -> None:
    """0.02 % S in 0.05 % C lowers it by some kelvins, and more at faster cooling."""
    path = Segregation({"C": 0.05, "S": 0.02}, 20.0, LIQUIDUS)
    expected = by_hand(20.0, [CARBON, SULPHUR], 1.0)
    assert expected < by_hand(20.0, [CARBON], 1.0) - 5.0
    assert path.path[-1] == pytest.approx(expected, abs=1e-4)
    assert path.path[-1] < Segregation({"C": 0.05, "S": 0.02}, 2.0, LIQUIDUS).path[-1]


def test_ferrite_solidifies_until_it_transforms() -> None:
    """Slow cooling of 0.25 % C, by hand: then the liquid has (T0 - 1392)/(78 + 1122 * 0.19) % C.

    T0 is the melting point of iron by the slope of the liquidus. Below that temperature, T2, the
    share of ferrite is ((T - T1)/(T2 - T1))^2; T1 is the transformation with liquid of 0.25 % C.
    """
    carbon, slow = 0.25, Segregation({"C": 0.25}, 1e-12, LIQUIDUS)
    iron = LIQUIDUS + 78.0 * carbon
    content = (iron - 1665.15) / (78.0 + 1122.0 * 0.19)
    start, stop = iron - 78.0 * content, 1665.15 + 1122.0 * 0.19 * carbon
    fraction = (1.0 - carbon / content) / 0.81
    before = fraction - 0.0025 > FRACTIONS
    expected = iron - 78.0 * carbon / (1.0 - 0.81 * FRACTIONS)
    assert slow.path[before] == pytest.approx(expected[before], abs=2e-5)

    def off(unknowns: Array) -> list[float]:
        share = ((unknowns[0] - stop) / (start - stop)) ** 2
        liquid = share * carbon / 0.19 + (1.0 - share) * carbon / 0.34
        return [iron - 78.0 * liquid - unknowns[0]]

    assert slow.path[-1] == pytest.approx(fsolve(off, [start - 50.0])[0], abs=0.05)
    assert (np.diff(slow.path) < 0.0).all()


def test_cooling_rate_has_the_effect_of_the_page() -> None:
    """docs/materials.md: a tenth of the cooling rate raises the solidus of 0.42 % C by 5 K."""
    raised = []
    for carbon in (0.15, 0.42):
        own = segregated({"C": carbon, **PLANT}).freezing
        raised.append(replace(own, cooling_rate=0.1 * own.cooling_rate).path[-1] - own.path[-1])
    assert raised == pytest.approx([0.0, 5.1], abs=0.1)


@pytest.mark.parametrize("carbon", [0.05, 0.1, 0.15, 0.17, 0.25, 0.42, 0.8])
def test_carbon_and_heat_are_conserved(carbon: float) -> None:
    """The phases contain the carbon of the steel; the heat to 1200 degC is that of equilibrium."""
    equilibrium = load_steel("plain_carbon", composition={"C": carbon, **PLANT})
    steel = load_steel(
        "plain_carbon", composition={"C": carbon, **PLANT}, overrides={"diagram": "segregated"}
    )
    diagram = steel.diagram
    assert isinstance(diagram, SegregatedDiagram)
    at = np.linspace(1550.0, 1830.0, 2001)
    for side in ("above", "below"):
        phases = diagram.phases(at, side)  # type: ignore[arg-type]
        parts = (phases.liquid, phases.delta, phases.gamma)
        contents = (phases.carbon_liquid, phases.carbon_delta, phases.carbon_gamma)
        carbons = [p * np.nan_to_num(c) for p, c in zip(parts, contents, strict=True)]
        assert sum(parts) == pytest.approx(np.ones_like(at), rel=1e-12)
        assert all((np.isnan(c) == (p <= 0.0)).all() for p, c in zip(parts, contents, strict=True))
        assert sum(carbons) == pytest.approx(np.full_like(at, carbon), rel=1e-6)
    heats = [
        one.thermal_curve(1400.0, 1900.0).enthalpy(np.array([1473.15, 1823.15]))
        for one in (equilibrium, steel)
    ]
    assert np.diff(heats[1]) == pytest.approx(np.diff(heats[0]), rel=3e-4)
    assert steel.liquidus == equilibrium.liquidus and steel.solidus < equilibrium.solidus - 5.0


def test_peritectic_steel_has_a_brittle_range() -> None:
    """In equilibrium the last 0.15 % C freezes at one temperature; P and S widen the range."""
    pure, plant = segregated({"C": 0.15}), segregated({"C": 0.15, **PLANT})
    begins, ends = (plant.freezing.temperature(f) for f in (0.9, 0.99))
    assert begins - ends > pure.freezing.temperature(0.9) - pure.freezing.temperature(0.99) > 8.0
    reaction = plant.equilibrium.peritectic
    assert plant.reactions == (reaction,) == (plant.gamma_start,)
    liquid = [float(plant.phases(reaction, side).liquid) for side in ("above", "below")]  # type: ignore[arg-type]
    assert liquid[0] == liquid[1] > 0.0  # the reaction consumes ferrite, no liquid
    assert plant.gamma_end is not None and plant.solidus < plant.gamma_end < reaction
    assert not float(plant.phases(plant.gamma_end - 1e-3).delta)
    assert segregated({"C": 0.8}).gamma_start is None


@pytest.mark.parametrize("composition", [{"C": 0.0}, {"C": 1.2}])
def test_carbon_out_of_range_is_rejected(composition: dict[str, float]) -> None:
    with pytest.raises(InputError, match=r'composition: C: diagram = "segregated" needs carbon'):
        load_steel("plain_carbon", composition=composition, overrides={"diagram": "segregated"})
