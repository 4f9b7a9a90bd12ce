"""The diagram of iron with carbon, manganese and silicon, and equilibria of a database."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from castfem.physics.materials.alloying import (
    alloyed,
)
from castfem.physics.materials.iron_carbon import ASSESSED

ZERO = 273.15

# C, Mn, Si (wt%); liquidus and solidus, degC; solid fraction by mass at a quarter, a half and three
# quarters of the way from the solidus to the liquidus, at equilibrium of liquid, delta ferrite and
# austenite by [PovodenKaradeniz2016] (docs/references.md), computed by pycalphad 0.11.2.
EQUILIBRIA = [
    (0.03, 0, 0, 1535.5, 1524.6, 0.946, 0.853, 0.659),
    (0.03, 0.6, 0.2, 1530.4, 1516.3, 0.94, 0.833, 0.608),
    (0.03, 1.5, 0.3, 1524.5, 1505.9, 0.934, 0.813, 0.565),
    (0.03, 2, 0.6, 1518.1, 1492.8, 0.926, 0.791, 0.531),
    (0.1, 0, 0, 1530.1, 1494.6, 0.929, 0.835, 0.641),
    (0.1, 0.6, 0.2, 1525.0, 1489.5, 0.901, 0.799, 0.592),
    (0.1, 1.5, 0.3, 1519.1, 1486.8, 0.84, 0.723, 0.504),
    (0.1, 2, 0.6, 1512.7, 1482.2, 0.768, 0.637, 0.416),
    (0.12, 0, 0, 1528.6, 1494.6, 0.875, 0.772, 0.571),
    (0.12, 0.6, 0.2, 1523.4, 1489.4, 0.847, 0.737, 0.527),
    (0.12, 1.5, 0.3, 1517.5, 1486.8, 0.782, 0.66, 0.446),
    (0.12, 2, 0.6, 1511.1, 1477.9, 0.753, 0.624, 0.407),
    (0.17, 0, 0, 1524.6, 1494.6, 0.747, 0.63, 0.429),
    (0.17, 0.6, 0.2, 1519.4, 1486.6, 0.744, 0.625, 0.421),
    (0.17, 1.5, 0.3, 1513.5, 1478.2, 0.872, 0.61, 0.404),
    (0.17, 2, 0.6, 1507.1, 1467.3, 0.874, 0.598, 0.39),
    (0.3, 0, 0, 1514.0, 1471.0, 0.876, 0.688, 0.363),
    (0.3, 0.6, 0.2, 1508.8, 1461.7, 0.879, 0.698, 0.366),
    (0.3, 1.5, 0.3, 1502.9, 1452.7, 0.882, 0.708, 0.359),
    (0.3, 2, 0.6, 1496.3, 1441.1, 0.882, 0.71, 0.427),
    (0.45, 0, 0, 1501.4, 1444.2, 0.882, 0.714, 0.445),
    (0.45, 0.6, 0.2, 1496.1, 1434.0, 0.883, 0.717, 0.454),
    (0.45, 1.5, 0.3, 1490.1, 1424.5, 0.884, 0.723, 0.47),
    (0.45, 2, 0.6, 1483.9, 1412.4, 0.881, 0.717, 0.465),
    (0.05, 0, 0, 1534.0, 1515.4, 0.946, 0.854, 0.661),
    (0.53, 0, 0, 1494.5, 1430.0, 0.883, 0.72, 0.469),
    (0.6, 0, 0, 1489.8, 1417.8, 0.881, 0.716, 0.463),
    (0.8, 0, 0, 1476.2, 1382.7, 0.875, 0.705, 0.451),
    (1.0, 0, 0, 1462.0, 1347.6, 0.871, 0.697, 0.441),
    (1.2, 0, 0, 1447.4, 1311.9, 0.868, 0.691, 0.434),
]


# The same for other steels, with the temperatures, degC, between which liquid, delta ferrite and
# austenite coexist, if they do.
REACTING = [
    (0.05, 2, 0, 1523.9, 1499.0, None, None, 0.945, 0.845, 0.626),
    (0.08, 2, 0, 1521.6, 1490.8, 1490.8, 1490.8, 0.898, 0.793, 0.578),
    (0.11, 2, 0, 1519.2, 1490.9, 1490.9, 1490.9, 0.803, 0.686, 0.471),
    (0.14, 2, 0, 1516.9, 1488.3, 1491.0, 1491.0, 0.742, 0.621, 0.413),
    (0.2, 2, 0, 1512.1, 1476.7, 1491.2, 1491.3, 0.876, 0.583, 0.384),
    (0.35, 2, 0, 1499.9, 1448.2, 1491.7, 1491.7, 0.887, 0.721, 0.445),
    (0.05, 0, 0.6, 1527.8, 1505.1, None, None, 0.942, 0.841, 0.625),
    (0.08, 0, 0.6, 1525.5, 1489.9, None, None, 0.945, 0.849, 0.645),
    (0.11, 0, 0.6, 1523.1, 1481.0, 1481.0, 1481.3, 0.914, 0.814, 0.609),
    (0.14, 0, 0.6, 1520.7, 1480.5, 1480.5, 1481.6, 0.846, 0.735, 0.525),
    (0.2, 0, 0.6, 1515.8, 1475.4, 1480.3, 1482.2, 0.750, 0.632, 0.427),
    (0.35, 0, 0.6, 1503.2, 1446.0, 1482.6, 1483.4, 0.877, 0.697, 0.367),
    (0.05, 1, 0.3, 1525.6, 1500.5, None, None, 0.942, 0.839, 0.617),
    (0.08, 1, 0.3, 1523.3, 1487.2, 1487.2, 1487.3, 0.932, 0.832, 0.622),
    (0.11, 1, 0.3, 1521.0, 1487.1, 1487.1, 1487.5, 0.847, 0.734, 0.519),
    (0.14, 1, 0.3, 1518.6, 1487.1, 1487.1, 1487.7, 0.766, 0.646, 0.437),
    (0.2, 1, 0.3, 1513.8, 1475.6, 1487.6, 1488.1, 0.874, 0.602, 0.400),
    (0.35, 1, 0.3, 1501.4, 1446.8, 1488.6, 1488.8, 0.882, 0.710, 0.425),
    (0.05, 1.5, 0.6, 1519.4, 1487.7, None, None, 0.937, 0.822, 0.584),
    (0.08, 1.5, 0.6, 1517.0, 1481.9, 1481.9, 1482.2, 0.878, 0.759, 0.530),
    (0.11, 1.5, 0.6, 1514.7, 1481.8, 1481.8, 1482.6, 0.790, 0.665, 0.444),
    (0.14, 1.5, 0.6, 1512.3, 1477.1, 1482.1, 1482.9, 0.753, 0.627, 0.414),
    (0.2, 1.5, 0.6, 1507.4, 1464.7, 1482.9, 1483.5, 0.875, 0.595, 0.390),
    (0.35, 1.5, 0.6, 1494.8, 1435.0, 1484.5, 1484.8, 0.881, 0.711, 0.436),
]


@pytest.mark.parametrize("steel", REACTING, ids=lambda steel: "-".join(map(str, steel[:3])))
def test_alloyed_steels_match_the_database(steel) -> None:
    """Temperatures within 1 K, fractions within 0.005 except between the two reactions."""
    carbon, manganese, silicon, liquidus, solidus, end, start, *solid = steel
    found = alloyed({"C": carbon, "Mn": manganese, "Si": silicon})
    assert found.liquidus - ZERO == pytest.approx(liquidus, abs=0.1)
    assert found.solidus - ZERO == pytest.approx(solidus, abs=1.0)
    at = solidus + np.array([0.25, 0.5, 0.75]) * (liquidus - solidus)
    off = np.abs(1.0 - found.phases(at + ZERO).liquid - solid)
    assert (end is not None) == (found.solidus <= found.peritectic)
    if end is not None:
        peritectic = found.peritectic - ZERO
        assert peritectic == pytest.approx(end, abs=1.0)
        assert start - 2.4 < peritectic < start + 1.0
        off = off[(at < min(peritectic, end) - 0.1) | (at > max(peritectic, start) + 0.1)]
    assert off.size >= 2 and off.max() < 0.005


STEELS = {
    "0 to 1.2 %C alone": lambda manganese: manganese == 0.0,
    "to 0.45 %C, 0.6 %Mn, 0.2 %Si": lambda manganese: manganese == 0.6,
    "to 0.45 %C, 2 %Mn, 0.6 %Si": lambda manganese: manganese > 0.0,
}


@pytest.mark.parametrize("steels", STEELS)
@pytest.mark.parametrize("diagram", ["assessed", "pascon"])
def test_differences_from_the_database_are_those_of_the_page(diagram, steels):
    """Largest differences of liquidus, solidus and solid fraction, with the digits of the page.

    Fractions count at 1 K or more from the peritectic; closer, the amount that reacts differs.
    """
    differences, nearby = [], [0.0]
    for carbon, manganese, silicon, liquidus, solidus, *solid in EQUILIBRIA:
        if not STEELS[steels](manganese):
            continue
        steel = alloyed({"C": carbon, "Mn": manganese, "Si": silicon}, diagram)
        at = solidus + ZERO + np.array([0.25, 0.5, 0.75]) * (liquidus - solidus)
        fractions = np.abs(1.0 - steel.phases(at).liquid - solid)
        near = np.abs(at - steel.peritectic) < 1.0
        nearby += [*fractions[near]]
        limits = (steel.liquidus - ZERO - liquidus, steel.solidus - ZERO - solidus)
        differences.append([*map(abs, limits), fractions[~near].max()])
    page = (Path(__file__).parents[2] / "docs" / "materials.md").read_text(encoding="utf-8")
    row = next(r for r in page.splitlines() if r.startswith(f"| `{diagram}` | {steels} |"))
    largest = np.max(differences, axis=0)
    assert row.split(" | ", 2)[2] == "{:.1f} | {:.1f} | {:.3f} |".format(*largest)
    if diagram == "assessed":
        assert largest[0] < 1.5 and largest[1] < 4.0 and largest[2] < 0.02
        if "2 %Mn" in steels:
            assert f"of 0.17 %C, 1.5 %Mn and 0.3 %Si by {max(nearby):.2f}" in page


# C, Mn, Si (wt%); solid fraction at two temperatures, degC, by the same database.
LITTLE_CARBON = [
    (0.01, 0, 0.2, 1532.64, 0.858, 1534.57, 0.356), (0.01, 0, 0.6, 1527.41, 0.805, 1530.34, 0.210),
    (0.01, 2, 0, 1522.75, 0.803, 1526.16, 0.211), (0.01, 0.6, 0.2, 1528.63, 0.812, 1531.23, 0.273),
    (0.01, 1.5, 0.6, 1516.06, 0.700, 1521.10, 0.210),
    (0.02, 0, 0.2, 1530.01, 0.856, 1533.43, 0.373), (0.02, 0, 0.6, 1524.68, 0.827, 1529.17, 0.267),
    (0.02, 2, 0, 1519.85, 0.833, 1524.97, 0.265), (0.02, 0.6, 0.2, 1525.92, 0.832, 1530.08, 0.314),
    (0.02, 1.5, 0.6, 1513.08, 0.753, 1519.88, 0.243),
    (0.04, 0, 0.2, 1524.65, 0.855, 1531.13, 0.386), (0.04, 2, 0, 1513.89, 0.853, 1522.57, 0.323),
    (0.04, 0.6, 0.2, 1520.36, 0.846, 1527.74, 0.352),
]  # fmt: skip


@pytest.mark.parametrize("steel", LITTLE_CARBON, ids=lambda steel: "-".join(map(str, steel[:3])))
def test_low_carbon_steels_match_the_database(steel) -> None:
    """Fractions within 0.02, which is 0.1 K or less of a range of 4 to 20 K."""
    carbon, manganese, silicon, *rows = steel
    found = alloyed({"C": carbon, "Mn": manganese, "Si": silicon})
    solid = 1.0 - found.phases(np.array(rows[::2]) + ZERO).liquid
    assert solid == pytest.approx(rows[1::2], abs=0.02)


def test_error_of_iron_with_silicon_is_that_of_the_page() -> None:
    """A tenth of a kelvin in a range of 0.8 K; the database has 0.912 solid at 1535.23 degC."""
    found = alloyed({"C": 0.0, "Si": 0.2})
    assert float(found.phases(1535.23 + ZERO).liquid) == pytest.approx(1.0 - 0.912 + 0.08, abs=5e-3)
    assert float(found.phases(1535.33 + ZERO).liquid) > 1.0 - 0.912 + 0.15
    assert found.liquidus - found.solidus == pytest.approx(0.8, abs=0.05)


# C, Mn, Si (wt%); start and end of delta to gamma, K, by the same database, to 0.5 K.
TRANSFORMATIONS = [
    (0.01, 0.0, 0.0, 1684.5, 1675.5), (0.05, 0.0, 0.0, 1733.5, 1702.5),
    (0.1, 0.0, 0.0, 1767.5, 1732.5), (0.05, 1.0, 0.0, 1744.5, 1717.5),
    (0.1, 1.0, 0.0, 1765.5, 1743.5), (0.1, 0.0, 0.3, 1761.5, 1721.5),
    (0.05, 1.0, 0.3, 1740.5, 1712.5), (0.1, 0.5, 0.25, 1761.5, 1732.5),
    (0.05, 2.0, 0.0, 1752.5, 1728.5), (0.05, 0.0, 0.6, 1714.5, 1676.5),
    (0.05, 2.0, 0.6, 1755.5, 1730.5),
]  # fmt: skip


def test_errors_of_the_transformation_are_those_of_the_page() -> None:
    errors = {"carbon": 0.0, "little": 0.0, "much": 0.0}
    for carbon, manganese, silicon, *ends in TRANSFORMATIONS:
        steel = alloyed({"C": carbon, "Mn": manganese, "Si": silicon})
        few = "carbon" if manganese == silicon == 0.0 else "little"
        key = few if manganese <= 1.0 and silicon <= 0.3 else "much"
        off = np.subtract([steel.gamma_start, steel.gamma_end], ends)
        errors[key] = max(errors[key], float(np.abs(off).max()))
    assert errors["carbon"] < 0.6 and 2.0 < errors["little"] < 3.0 and 5.0 < errors["much"] < 6.0


def test_alloying_lowers_liquidus_and_solidus_by_the_liquid():
    """The liquidus by the manganese of the steel, the solidus by that of the last liquid."""
    plain, steel = alloyed({"C": 0.05}), alloyed({"C": 0.05, "Mn": 1.0})
    assert plain.liquidus - steel.liquidus == pytest.approx(5.08 - 0.21 * 0.05, abs=1e-9)
    plain, steel = alloyed({"C": 0.7}), alloyed({"C": 0.7, "Si": 0.5})
    drop = 0.5 * (10.24 + 4.48 * 0.7 + 0.23 * 0.5)
    assert plain.liquidus - steel.liquidus == pytest.approx(drop, abs=1e-9)
    steel = alloyed({"C": 0.7, "Mn": 1.0})

    def last(t: float) -> tuple[float, float]:
        """Return carbon and manganese of the last liquid at the temperature `t` of the lines."""
        carbon = float(ASSESSED.liquid_gamma.carbon(t))
        return carbon, 1.0 / (0.738 - 0.046 * carbon)

    def deficit(t: float) -> float:
        return float(ASSESSED.gamma.carbon(t)) * (1.0 - 0.014 * last(t)[1]) - 0.7

    at = brentq(deficit, 1500.0, 1760.0)
    carbon, manganese = last(at)
    assert steel.solidus == pytest.approx(at - (4.21 - 0.29 * carbon) * manganese, abs=1e-8)


@pytest.mark.parametrize("carbon", [0.0, 0.08])
def test_coupled_partition_conserves_manganese_and_silicon(carbon):
    """The reference iterates both balances from the contents of the steel."""
    steel, (total_mn, total_si) = alloyed({"C": carbon, "Mn": 2.0, "Si": 0.6}), (2.0, 0.6)
    solid, mn, si = np.linspace(0.0, 1.0, 21), total_mn, total_si
    t, in_liquid, in_solid = steel.pairs[0].at(solid, carbon)
    for _ in range(60):
        k_mn = 0.746 - 0.083 * in_liquid - 0.102 * si
        k_si = 0.717 + 0.038 * in_liquid - 0.04 * mn
        mn = total_mn / (1.0 - solid * (1.0 - k_mn))
        si = total_si / (1.0 - solid * (1.0 - k_si))
    drop = (5.08 - 0.21 * in_liquid) * mn + (9.55 + 2.74 * in_liquid + 1.05 * si) * si
    drop += 0.94 * mn * si
    melting = np.array([ASSESSED.liquid_delta.temperature(one) for one in in_liquid])
    assert t == pytest.approx(melting - drop, abs=1e-8)
    assert solid * in_solid + (1.0 - solid) * in_liquid == pytest.approx(carbon, abs=1e-12)


def test_iron_with_manganese_obeys_the_lever_rule():
    """The temperature gives the Mn content of the liquid; the solid has 0.746 of that."""
    steel, melting, drop, partition = alloyed({"C": 0.0, "Mn": 1.5}), 1810.95, 5.08, 0.746
    t = np.linspace(steel.solidus, steel.liquidus, 30)
    in_liquid = (melting - t) / drop
    solid = (1.0 - 1.5 / in_liquid) / (1.0 - partition)
    assert 1.0 - steel.phases(t).liquid == pytest.approx(solid, abs=2e-5)
    assert steel.liquidus == pytest.approx(melting - drop * 1.5, abs=1e-9)
    assert steel.solidus == pytest.approx(melting - drop * 1.5 / partition, abs=1e-9)


def test_only_pure_iron_melts_at_one_temperature():
    iron, alloy = alloyed({"C": 0.0}), alloyed({"C": 0.0, "Mn": 1.0})
    assert iron.reactions == (1667.55, 1810.95) and iron.solidus == iron.liquidus == 1810.95
    assert alloy.reactions == (alloy.transformation,)
    assert alloy.liquidus - alloy.solidus == pytest.approx(5.08 / 0.746 - 5.08, abs=1e-9)


def test_traces_of_manganese_and_silicon_have_little_effect():
    plain, steel = alloyed({"C": 0.14}), alloyed({"C": 0.14, "Mn": 1e-6, "Si": 1e-6})
    for name in ("liquidus", "solidus", "peritectic", "gamma_start", "gamma_end"):
        assert getattr(steel, name) == pytest.approx(getattr(plain, name), abs=2e-3)
    t = np.linspace(1700.0, 1810.0, 500)
    assert steel.phases(t).liquid == pytest.approx(plain.phases(t).liquid, abs=1e-4)
