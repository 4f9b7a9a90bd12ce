"""The steel in the thermal model: kinks, enthalpy, conductivity; description and pictures."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.base.errors import InputError
from castfem.base.tables import Constant, Table
from castfem.physics.materials import available_steels, describe_steel, knots, load_steel
from castfem.physics.materials.alloying import alloyed
from castfem.physics.materials.iron_carbon import IronCarbon
from castfem.physics.materials.solid_fraction import LeverFraction, LinearFraction, TableFraction
from castfem.physics.materials.steel import Steel
from castfem.post.plots.steel import plot_steel

LOWER, UPPER = 900.0, 1900.0
PERITECTIC = 1768.15
STRAIGHT = {"diagram": "pascon"}  # the lines of the thesis


def simple(fraction, density=7200.0, heat=700.0, conductivity=30.0, latent=272e3) -> Steel:
    laws = {"density": density, "specific_heat": heat, "conductivity": conductivity}
    properties = {k: Constant(v) if isinstance(v, float) else v for k, v in laws.items()}
    return Steel("test", "", fraction.solidus, fraction.liquidus, latent, properties, fraction)


def enthalpy(steel: Steel, lower=LOWER, upper=UPPER) -> tuple[np.ndarray, np.ndarray]:
    """Return the knots and the enthalpy above `lower` just above each knot, from the pieces."""
    t, left, right, latent, jump = steel.enthalpy_knots(lower, upper)
    gain = (0.5 * (left + right) + latent) * np.diff(t)
    return t, np.concatenate([[0.0], np.cumsum(gain)]) + np.cumsum(jump)


def fine_heat(steel: Steel, a: float, b: float) -> float:
    """Integrate rho dh from a to b by a Romberg pair of Stieltjes sums, with h of Harste."""
    law, sums = steel.properties["enthalpy"], []
    for n in (20001, 40001):
        t = np.linspace(a, b, n)
        rho, h = steel.density(t), law(t)
        rho[-1], h[-1] = steel.density(b, "below"), law(b, "below")
        sums.append(float(np.sum(0.5 * (rho[1:] + rho[:-1]) * np.diff(h))))
    return (4.0 * sums[1] - sums[0]) / 3.0


def test_constant_properties_give_three_pieces():
    t, left, right, latent, jump = simple(LinearFraction(1723.15, 1773.15)).enthalpy_knots(
        LOWER, UPPER
    )
    assert t == pytest.approx([LOWER, 1723.15, 1773.15, UPPER], abs=0)
    assert left == pytest.approx([7200 * 700.0] * 3, rel=1e-15)
    assert right == pytest.approx([7200 * 700.0] * 3, rel=1e-15)
    assert latent == pytest.approx([0.0, 7200 * 272e3 / 50.0, 0.0], rel=1e-12)
    assert np.all(jump == 0.0)


@pytest.mark.parametrize("width", [0.0, 1e-4, 50.0])
def test_latent_heat_is_complete_for_any_freezing_range(width):
    steel = simple(LinearFraction(1750.0, 1750.0 + width))
    t, h = enthalpy(steel)
    assert h[-1] == pytest.approx(7200 * (700 * (UPPER - LOWER) + 272e3), rel=1e-14)
    jump = steel.enthalpy_knots(LOWER, UPPER)[4]
    assert jump.sum() == pytest.approx(7200 * 272e3 if width == 0.0 else 0.0)
    assert 1750.0 in t


def test_isothermal_freezing_is_a_jump_at_the_melting_point():
    t, *_, jump = load_steel("neumann_steel").enthalpy_knots(LOWER, UPPER)
    assert t[jump > 0.0] == pytest.approx([1767.55], abs=0)
    assert jump.max() == pytest.approx(7500 * 272e3, rel=1e-14)


def test_product_of_density_and_heat_tables_is_exact():
    density = Table("temperature", (1000.0, 1800.0), (7600.0, 7000.0))
    heat = Table("temperature", (1000.0, 1400.0, 1800.0), (600.0, 800.0, 700.0))
    steel = simple(LinearFraction(1850.0, 1860.0), density, heat)
    t, h = enthalpy(steel, 1000.0, 1800.0)

    def exact(a, b):  # Simpson is exact for the product of two lines
        middle = 0.5 * (a + b)
        f = [float(density(x) * heat(x)) for x in (a, middle, b)]
        return (b - a) / 6.0 * (f[0] + 4.0 * f[1] + f[2])

    assert h[-1] == pytest.approx(exact(1000.0, 1400.0) + exact(1400.0, 1800.0), rel=1e-13)
    assert 1400.0 in t and np.diff(t).max() <= knots.LIMITS.longest + 1e-9


def test_latent_heat_with_varying_density_is_exact():
    """H of the mushy zone is the integral of rho L dT/(Tl - Ts) for a linear density."""
    density = Table("temperature", (1000.0, 1900.0), (7600.0, 6800.0))
    steel = simple(LinearFraction(1700.0, 1760.0), density, heat=1e-3, latent=270e3)
    t, h = enthalpy(steel, 1700.0, 1760.0)
    mean = float(density(1730.0))
    assert h[-1] == pytest.approx(mean * (270e3 + 1e-3 * 60.0), rel=1e-12)
    at = np.interp(1715.0, t, h)
    half = 0.5 * (float(density(1700.0)) + float(density(1715.0)))
    assert at == pytest.approx(half * (270e3 / 4 + 1e-3 * 15.0), rel=1e-5)


@settings(max_examples=25)
@given(st.one_of(st.floats(0.0, 1.2), st.sampled_from([0.0, 0.10, 0.15, 0.18, 0.51])))
def test_enthalpy_of_harste_is_exact_at_the_knots(carbon):
    steel = load_steel("plain_carbon", composition={"C": carbon})
    _, h = enthalpy(steel)
    jump = steel.enthalpy_knots(LOWER, UPPER)[4]
    breaks = [LOWER, *steel.breakpoints(LOWER + 1, UPPER - 1), UPPER]
    total = 0.0
    for a, b in itertools.pairwise(breaks):
        total += fine_heat(steel, a, b)
    assert h[-1] == pytest.approx(total + jump.sum(), rel=2e-9)


def test_enthalpy_with_constant_density_is_that_of_harste():
    steel = load_steel(
        "plain_carbon", composition={"C": 0.15}, overrides={"density": "7000 kg/m^3"}
    )
    t, h = enthalpy(steel)
    law = steel.properties["enthalpy"]
    assert h == pytest.approx(7000.0 * (law(t) - law(LOWER)), rel=1e-12, abs=1.0)


def test_peritectic_heat_is_a_jump():
    steel = load_steel("plain_carbon", composition={"C": 0.15}, overrides=STRAIGHT)
    t, *_, jump = steel.enthalpy_knots(LOWER, UPPER)
    assert list(t[jump > 0.0]) == [PERITECTIC]
    law = steel.properties["enthalpy"]
    heat = float(law(PERITECTIC, "above") - law(PERITECTIC, "below"))
    rho = [float(steel.density(PERITECTIC, side)) for side in ("above", "below")]
    assert jump.max() == pytest.approx(0.5 * sum(rho) * heat, rel=1e-14)
    assert 35e3 < heat < 50e3


def test_lever_rule_with_a_separate_latent_heat_is_exact():
    diagram = IronCarbon(0.42)
    steel = simple(LeverFraction(diagram))
    t, h = enthalpy(steel)
    total = 7200 * (700 * (UPPER - LOWER) + 272e3)
    assert h[-1] == pytest.approx(total, rel=1e-13)
    jump = steel.enthalpy_knots(LOWER, UPPER)[4]
    assert jump.sum() == pytest.approx(7200 * 272e3 * (32 / 41 - 24 / 33), rel=1e-12)
    solid = steel.solid_fraction(t)
    assert h == pytest.approx(7200 * (700 * (t - LOWER) + 272e3 * (1 - solid)), rel=1e-12)


@pytest.mark.parametrize("composition", [{"C": 0.03}, {"C": 0.14}, {"C": 0.3}, {"C": 0.7}])
def test_alloyed_steel_releases_its_latent_heat_by_fraction(composition):
    """The total is exact, and the heat of the reaction is released at its temperature."""
    diagram = alloyed({**composition, "Mn": 1.5, "Si": 0.6})
    steel = simple(LeverFraction(diagram))
    t, h = enthalpy(steel)
    assert h[-1] == pytest.approx(7200 * (700 * (UPPER - LOWER) + 272e3), rel=1e-13)
    assert h == pytest.approx(
        7200 * (700 * (t - LOWER) + 272e3 * (1 - steel.solid_fraction(t))), rel=1e-12
    )
    knots, *_, jump = steel.enthalpy_knots(LOWER, UPPER)
    assert list(knots[jump > 0.0]) == list(diagram.reactions)


def test_latent_heat_of_an_enthalpy_is_that_of_freezing():
    def heat(carbon: float, **diagram: str) -> float:
        return load_steel("plain_carbon", composition={"C": carbon}, overrides=diagram).latent_heat

    assert heat(0.0) == heat(0.0, diagram="assessed") == pytest.approx(249.4e3, abs=50)
    assert heat(0.0, diagram="pascon") == pytest.approx(249.4e3, abs=50)
    assert heat(0.42, diagram="pascon") == pytest.approx(264e3, rel=0.01)
    assert heat(0.42) == pytest.approx(264e3, rel=0.01)


def test_thermal_curve_is_inverted_exactly():
    for steel in (load_steel("plain_carbon", composition={"C": 0.12}), load_steel("carbon_042")):
        curve = steel.thermal_curve(300.0, 2000.0)
        t = np.linspace(310.0, 1990.0, 700)
        point = curve.at(curve.enthalpy(t))
        assert point.temperature == pytest.approx(t, abs=1e-8)
        assert curve.conductivity(t) == pytest.approx(steel.conductivity(t), rel=2e-4)


def test_curve_is_valid_at_knots_beyond_ends_and_at_nan():
    """Every knot belongs to the piece above it; slopes match differences."""
    curve = load_steel("plain_carbon", composition={"C": 0.12}).thermal_curve(300.0, 2000.0)
    at_knots = curve.enthalpy(curve.knots)
    assert curve.at(at_knots).temperature == pytest.approx(curve.knots, abs=1e-9)
    low, high = curve.enthalpy(np.array([300.0, 2000.0])) + np.array([-1e9, 1e9])
    h = np.append(np.linspace(low, high, 4001), [at_knots + 1.0, at_knots - 1.0])
    point, above, below = curve.at(h), curve.at(h + 0.4), curve.at(h - 0.4)
    slope = (above.temperature - below.temperature) / 0.8
    assert point.temperature_slope == pytest.approx(slope, rel=1e-4, abs=1e-12)
    slope = (above.conduction - below.conduction) / 0.8
    assert point.conduction_slope == pytest.approx(slope, rel=1e-4, abs=1e-11)
    assert curve.at(h.reshape(-1, 1)).temperature.shape == (len(h), 1)
    none = curve.at(np.array([np.nan, np.inf, -np.inf, 0.0]))
    assert np.isnan(none.temperature[0]) and np.isfinite(none.temperature[3])


def test_conductivity_pieces_match_the_formula_and_its_jumps():
    steel = load_steel(
        "plain_carbon",
        composition={"C": 0.15},
        overrides={"conductivity": {"parameters": {"liquid_factor": 5.0}}, **STRAIGHT},
    )
    t, left, right = steel.conductivity_knots(LOWER, UPPER)
    law = steel.properties["conductivity"]
    assert left == pytest.approx(law(t[:-1], "above"), rel=1e-15)
    assert right == pytest.approx(law(t[1:], "below"), rel=1e-15)
    at = int(np.searchsorted(t, PERITECTIC))
    assert t[at] == PERITECTIC and left[at] - right[at - 1] > 15.0
    middle = 0.5 * (t[1:] + t[:-1])
    assert 0.5 * (left + right) == pytest.approx(law(middle), rel=1e-3)


def test_constant_conductivity_is_one_piece():
    t, left, right = load_steel("carbon_042").conductivity_knots(LOWER, UPPER)
    assert (list(t), list(left), list(right)) == ([LOWER, UPPER], [30.0], [30.0])


def test_breakpoints_are_the_kinks_within_the_range():
    steel = load_steel("carbon_042")
    assert list(steel.breakpoints(LOWER, UPPER)) == [1725.15, 1775.65]
    assert list(steel.breakpoints(LOWER, 1750.0)) == [1725.15]
    low = load_steel("plain_carbon", composition={"C": 0.05})
    inside = [t for t in low.breakpoints(LOWER, UPPER) if t in low.diagram.kinks]
    assert inside == list(low.diagram.kinks)


def test_nearly_equal_kinks_are_merged():
    merged = knots.merged([1000.0, 1500.0 + 1e-12, 1600.0], [1500.0], 900.0, 1700.0)
    assert list(merged) == [1000.0, 1500.0, 1600.0]


def test_range_may_end_at_a_kink():
    steel = load_steel("neumann_steel")
    t, _, _, _, jump = steel.enthalpy_knots(LOWER, 1767.55)
    assert t[-1] == 1767.55 and jump[-1] == pytest.approx(7500 * 272e3)


def test_solid_fraction_laws_have_their_values():
    linear = LinearFraction(1700.0, 1800.0)
    assert list(linear([1600.0, 1700.0, 1725.0, 1800.0, 1900.0])) == [1.0, 1.0, 0.75, 0.0, 0.0]
    step = LinearFraction(1700.0, 1700.0)
    assert float(step(1700.0)) == 0.0 and float(step(1700.0, "below")) == 1.0
    table = TableFraction(Table("temperature", (1700.0, 1750.0, 1800.0), (1.0, 0.2, 0.0)))
    assert list(table([1600.0, 1725.0, 1900.0])) == [1.0, 0.6, 0.0]
    assert (table.solidus, table.liquidus) == (1700.0, 1800.0)
    lever = LeverFraction(IronCarbon(0.42))
    assert float(lever(PERITECTIC)) == pytest.approx(9 / 41)
    assert float(lever(PERITECTIC, "below")) == pytest.approx(9 / 33)


@pytest.mark.parametrize("values", [(1.0, 0.5), (1.0, 0.2, 0.4, 0.0), (1.0, 1.0, 0.0)])
def test_solid_fraction_table_must_decrease_from_one_to_zero(values):
    with pytest.raises(ValueError, match="from 1 in the first row to 0 in the last"):
        TableFraction(
            Table("temperature", tuple(1700.0 + 10 * i for i in range(len(values))), values)
        )


def test_table_property_is_interpolated():
    law = Table("temperature", (1000.0, 1200.0), (20.0, 30.0))
    assert list(law([900.0, 1100.0, 1300.0])) == [20.0, 25.0, 30.0]
    strict = Table("temperature", (1000.0, 1200.0), (20.0, 30.0), refuse_outside=True)
    with pytest.raises(ValueError, match=r"from 1026\.85 to 1026\.85 degC are needed"):
        strict(1300.0)
    with pytest.raises(ValueError, match="must increase"):
        Table("temperature", (1000.0, 1000.0), (1.0, 2.0))


def test_rejected_table_names_the_required_range():
    table = Table("temperature", (1000.0, 1900.0), (20.0, 30.0), refuse_outside=True)
    steel = simple(LinearFraction(1700.0, 1750.0), conductivity=table)
    with pytest.raises(InputError, match=r"conductivity: the table covers .* is needed"):
        steel.conductivity_knots(900.0, 1900.0)
    with pytest.raises(InputError, match="test: conductivity: the table goes from"):
        steel.conductivity(950.0)


def test_missing_property_is_reported():
    steel = load_steel("alloy_similarity")
    assert not steel.has("emissivity") and not steel.has("thermal_expansion")
    with pytest.raises(InputError, match="alloy_similarity: emissivity: this steel has none"):
        steel.emissivity(1500.0)
    with pytest.raises(InputError, match="thermal_expansion: this steel has none"):
        steel.thermal_strain(1500.0)


def test_properties_accept_arrays_of_any_shape():
    steel = load_steel("plain_carbon", composition={"C": 0.2})
    t = np.linspace(800.0, 1900.0, 12).reshape(3, 4)
    for name in ("density", "specific_heat", "conductivity", "emissivity", "solid_fraction",
                 "thermal_expansion", "thermal_strain", "youngs_modulus"):  # fmt: skip
        values = getattr(steel, name)(t)
        assert values.shape == t.shape and np.all(np.isfinite(values)), name


def test_density_with_decreasing_enthalpy_is_rejected():
    """In a deforming slice H = rho (h - h_poured) decreases where rho rises steeply with T."""
    steep = Table("temperature", (1600.0, 1750.0, 1752.0, 1900.0), (6000.0, 6000.0, 7400.0, 7400.0))
    steel = simple(LinearFraction(1723.15, 1773.15), density=steep)
    with pytest.raises(InputError, match="test: density: it rises so much from 1476"):
        steel.enthalpy_knots(LOWER, UPPER, poured=1800.0)
    steel.enthalpy_knots(LOWER, UPPER)


@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6, 1e-3])
def test_tiny_freezing_range_has_all_its_heat(apart: float) -> None:
    """A range too narrow to be resolved is isothermal for the enthalpy and everywhere else."""
    ends = {"solidus": f"{1502.5 - apart!r} degC", "liquidus": "1502.5 degC"}
    steel = load_steel("carbon_042", overrides=ends)
    curve = steel.thermal_curve(1700.0, 1800.0)
    by_hand = 7400.0 * (270e3 + 700.0 * 100.0)
    assert curve.enthalpy(1800.0) - curve.enthalpy(1700.0) == pytest.approx(by_hand, rel=1e-12)
    assert (steel.solidus == steel.liquidus) == (apart < 1e-6)


@pytest.mark.parametrize("key", ["conductivity", "specific_heat", "density"])
def test_rows_too_close_for_a_jump_are_rejected(key: str) -> None:
    unit = {"conductivity": "W/(m K)", "specific_heat": "J/(kg K)", "density": "kg/m^3"}[key]
    table = {"temperature_unit": "degC", "unit": unit}
    few = {"conductivity": [30, 60], "specific_heat": [600, 800], "density": [7400, 7000]}[key]
    jump = table | {"value": [few[0], *few, few[1]]}
    with pytest.raises(InputError, match="row 3 is 1e-10 K above row 2; a jump takes 1e-06 K"):
        close = jump | {"temperature": [20, 1452, 1452.0000000001, 1600]}
        load_steel("carbon_042", overrides={key: close})
    steel = load_steel(
        "carbon_042", overrides={key: jump | {"temperature": [20, 1452, 1452.001, 1600]}}
    )
    assert getattr(steel, key)(1725.15 + 0.1) == pytest.approx(few[1])


@pytest.mark.parametrize("name", sorted(available_steels()))
def test_every_set_is_drawn_and_described(name, tmp_path):
    from matplotlib.image import imread

    composition = {"C": 0.15} if name.startswith("plain") else None
    steel = load_steel(name, composition=composition)
    picture = imread(plot_steel(steel, tmp_path / "steel.png"))
    assert min(picture.shape[:2]) > 700
    assert 0.02 < np.mean(picture[..., :3].min(axis=2) < 0.9) < 0.5  # neither empty nor black
    rows = dict(describe_steel(steel))
    assert {"steel", "solidus", "liquidus", "latent heat", "density"} <= set(rows)
    assert all("[" in rows[key] for key in ("solidus", "density", "conductivity"))


def test_description_has_values_units_and_sources():
    rows = dict(describe_steel(load_steel("carbon_042")))
    assert rows["solidus"].startswith("1452 °C  [F: Pascon")
    assert rows["latent heat"].startswith("270 kJ/kg")
    assert rows["density"].startswith("7400 kg/m³  [M:")
    assert "F: read in the source, M: not yet checked against it" in rows["sources"]
    straight = {"diagram": "pascon"}
    low_carbon = load_steel("plain_carbon", composition={"C": 0.05}, overrides=straight)
    changing = dict(describe_steel(low_carbon))
    assert "at 1000 °C / solidus / liquidus" in changing["conductivity"]
    assert changing["δ to γ"].startswith("1444.5 to 1422.06 °C")


def test_pure_iron_is_drawn(tmp_path):
    steel = load_steel("plain_carbon", composition={"C": 0.0})
    assert plot_steel(steel, tmp_path / "iron.png").stat().st_size > 20_000


def test_drawing_keeps_the_matplotlib_settings(tmp_path):
    import matplotlib

    before = dict(matplotlib.rcParams)
    plot_steel(load_steel("carbon_042"), tmp_path / "steel.png")
    assert dict(matplotlib.rcParams) == before
