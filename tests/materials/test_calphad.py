"""Phases and heat computed with pycalphad, with the Fe-C database among its tests.

They need the extra calphad (tools/env.sh calphad) and are skipped without it. Temperatures are
coarser than in use, for speed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.physics.materials import calphad, equilibria, freezing_paths, load_steel
from castfem.physics.materials.alloying import alloyed
from castfem.physics.materials.phase_table import PhaseTable, Request, Scheil

pycalphad = pytest.importorskip("pycalphad", reason="needs the extra calphad: tools/env.sh calphad")
DATABASE = Path(pycalphad.__file__).parent / "tests" / "databases" / "cfe_broshe.tdb"
PHASES = ("LIQUID", "BCC_A2", "FCC_A1", "CEMENTITE_D011")
ZERO = 273.15
pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def coarse(monkeypatch, tmp_path):
    """Use few temperatures and a separate cache."""
    settings = replace(
        equilibria.SETTINGS, longest=80.0, fraction=0.01, enthalpy=3e3, narrowest=0.05,
        freezing=0.08, step=3.0,
    )  # fmt: skip
    for module in (equilibria, freezing_paths):
        monkeypatch.setattr(module, "SETTINGS", settings)
    monkeypatch.setattr(calphad, "cache_folder", lambda: tmp_path / "cache")
    calphad._cached.cache_clear()


@cache
def table(carbon: float, scheil: Scheil | None = None) -> PhaseTable:
    return calphad.compute(Request(str(DATABASE), PHASES, scheil), {"C": carbon})


def test_pure_iron_transforms_at_single_temperatures():
    iron = table(0.0)
    assert iron.solidus == iron.liquidus == pytest.approx(1538.0 + ZERO, abs=0.5)
    alpha, delta, melting = iron.reactions
    assert alpha == pytest.approx(911.7 + ZERO, abs=0.5)
    assert delta == pytest.approx(1394.3 + ZERO, abs=0.5) == iron.gamma_start == iron.gamma_end
    melted = iron.value("enthalpy", melting) - iron.value("enthalpy", melting, "below")
    assert melted == pytest.approx(247e3, abs=1e3)  # 13.81 kJ/mol, Dinsdale (1991)
    steel = load_steel(
        "plain_carbon", composition={"C": 0.0}, overrides={"database": Request(str(DATABASE))}
    )
    assert steel.solidus == steel.liquidus
    assert steel.latent_heat == pytest.approx(melted, rel=1e-3)


@pytest.mark.parametrize("carbon", [0.09, 0.17, 0.53, 1.0])
def test_lines_are_close_to_the_built_in_diagram(carbon):
    """Also near the ends of the peritectic line; two assessments differ by some kelvins."""
    computed, built_in = table(carbon), alloyed({"C": carbon})
    assert computed.liquidus == pytest.approx(built_in.liquidus, abs=2.0)
    assert computed.solidus == pytest.approx(built_in.solidus, abs=8.0 if carbon == 1.0 else 3.0)
    peritectic = [t for t in computed.reactions if t > 1700.0]
    assert len(peritectic) == (1 if 0.1 < carbon < 0.5 else len(peritectic))
    assert computed.header["freezing"] == "equilibrium" and "outside" not in computed.header
    carbides = computed.fraction("carbides", 500.0)
    assert carbides == pytest.approx(carbon / 6.69, rel=0.05)


def test_scheil_without_diffusion_matches_the_package():
    scheil = pytest.importorskip("scheil")
    computed = table(0.6, Scheil(end=0.05, carbon_diffuses=False))
    carbon = 0.6 / 12.011 / (0.6 / 12.011 + 99.4 / 55.847)
    reference = scheil.simulate_scheil_solidification(
        pycalphad.Database(str(DATABASE)), ["FE", "C", "VA"], list(PHASES),
        {pycalphad.variables.X("C"): carbon}, computed.liquidus + 1.0,
        step_temperature=2.0, stop=0.04,
    )  # fmt: skip
    t, solid = np.array(reference.temperatures[1:-1]), np.array(reference.fraction_solid[1:-1])
    inside = (t > computed.solidus) & (t < computed.liquidus - 2.0)
    assert inside.sum() > 40
    # The package has mole fractions; those of the liquid are up to a tenth larger by its carbon.
    assert np.abs(1.0 - computed.fraction("liquid", t[inside]) - solid[inside]).max() < 0.02


def test_scheil_with_diffusing_carbon_is_the_lever_rule():
    lever, path = table(0.4), table(0.4, Scheil(end=0.01))
    t = np.linspace(lever.solidus + 3.0, lever.liquidus - 1.0, 40)
    peritectic = max(lever.reactions)
    t = t[np.abs(t - peritectic) > 4.0]
    assert np.abs(path.fraction("liquid", t) - lever.fraction("liquid", t)).max() < 0.02
    assert path.solidus == pytest.approx(lever.solidus, abs=4.0)
    assert path.liquidus == pytest.approx(lever.liquidus, abs=0.1)
    cold = np.array([400.0, 900.0, 1200.0, 1500.0])
    both = [one.value("enthalpy", cold) for one in (path, lever)]
    assert both[0] == pytest.approx(both[1], rel=2e-3)
    total = [one.value("enthalpy", lever.liquidus + 1.0) for one in (path, lever)]
    assert total[0] == pytest.approx(total[1], rel=2e-3)


def test_residual_liquid_freezes_at_the_stated_fraction():
    """Without diffusion carbon accumulates in the liquid, which freezes far below the solidus."""
    path = table(0.6, Scheil(end=0.05, carbon_diffuses=False))
    assert path.solidus in path.reactions
    assert 0.02 < path.fraction("liquid", path.solidus) <= 0.05
    assert path.fraction("liquid", path.solidus, "below") == 0.0
    assert path.solidus < alloyed({"C": 0.6}).solidus - 50.0


@pytest.mark.parametrize(
    ("text", "composition", "phases", "message"),
    [
        ("ELEMENT FE BCC_A2 nonsense", {"C": 0.1}, (), "cannot be read as"),
        ("", {"C": 0.1}, (), "cannot be read as|has no elements; it is no thermodynamic database"),
        (None, {"C": 0.1, "Mn": 0.5, "Cr": 1.0}, (), "has no data for Cr, Mn; it has C, Fe"),
        (None, {"C": 0.1}, ("LIQUID", "SIGMA"), "has no phase SIGMA"),
        (None, {"C": 0.1}, ("LIQUID", "FCC_A1"), "has no phase BCC_A2"),
    ],
)
def test_unsuitable_database_is_rejected_in_one_line(tmp_path, text, composition, phases, message):
    file = DATABASE if text is None else tmp_path / "bad.tdb"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=message) as caught:
        load_steel(
            "plain_carbon", composition=composition,
            overrides={"database": Request(str(file), phases)}, origin="steel",
        )  # fmt: skip
    (line,) = caught.value.problems
    assert line.startswith(f'steel.database ("{file}"): ') and "\n" not in line
    assert not list((tmp_path / "cache").rglob("*.csv"))


def test_row_with_a_small_misfit_of_enthalpy_is_omitted():
    """In one database the enthalpy of liquid iron has such a misfit at 1811 K."""
    solve = equilibria.Equilibria(DATABASE, ["Fe"], PHASES[:3])
    at = [solve.state(t, solve.moles({})) for t in (1810.99, 1811.0, 1811.05, 1815.0)]
    first, lower, *rest = at
    lower = replace(lower, enthalpy=first.enthalpy - 6.0)
    assert freezing_paths.joined([first, lower, *rest]) == [first, *rest]
    different = replace(lower, enthalpy=first.enthalpy - 25.0)  # another state, no misfit
    assert freezing_paths.joined([first, different, *rest]) == [first, different, *rest]


def test_failed_equilibrium_is_reported_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(equilibria.Equilibria, "_solve", lambda *_: None)
    with pytest.raises(ValueError, match=r"no equilibrium at 1600\.00 degC .*Fe") as caught:
        calphad.table_of(Request(str(DATABASE)), {"C": 0.1})
    assert "\n" not in str(caught.value)
    assert not list((tmp_path / "cache").rglob("*.csv"))


def test_more_stable_of_two_equilibria_is_used(monkeypatch):
    """An initial guess of pycalphad may end at a state that is not the most stable."""
    solve = equilibria.Equilibria(DATABASE, ["Fe", "C"], PHASES)
    moles = solve.moles({"C": 0.1})
    original = solve._solve

    def misled(temperature, moles, phases, samples):
        few = ["LIQUID"] if samples == 60 else phases
        return original(temperature, moles, few, samples)

    monkeypatch.setattr(solve, "_solve", misled)
    assert solve.state(1300.0, moles).mass[0] == 0.0


def test_inconsistent_states_are_recomputed_from_more_starts(monkeypatch):
    """The first starts find austenite at low temperatures, after which the enthalpy decreases."""
    original = equilibria.Equilibria._solve

    def misled(self, temperature, moles, phases, samples):
        cold = 500.0 < temperature < 700.0 and samples in (60, 20)
        return original(self, temperature, moles, ["FCC_A1"] if cold else phases, samples)

    expected = table(0.6)
    monkeypatch.setattr(equilibria.Equilibria, "_solve", misled)
    found = table.__wrapped__(0.6)
    t = np.linspace(300.0, 1800.0, 60)
    assert found.value("enthalpy", t) == pytest.approx(expected.value("enthalpy", t), abs=3e3)
    for name in ("alpha", "carbides", "liquid"):
        assert found.fraction(name, t) == pytest.approx(expected.fraction(name, t), abs=0.02)


def test_table_is_computed_once(tmp_path, monkeypatch):
    request = Request(str(DATABASE), PHASES)
    first = calphad.table_of(request, {"C": 0.6})
    stored = tmp_path / "phases.csv"
    stored.write_text(first.to_text())
    again = calphad.table_of(replace(request, file=str(stored)), {"C": 0.6})
    assert again.to_text() == first.to_text()
    (kept,) = (tmp_path / "cache" / "phases").glob("*.csv")
    assert kept.read_text() == first.to_text()
    calphad._cached.cache_clear()
    monkeypatch.setattr(calphad, "compute", lambda *_: pytest.fail("computed again"))
    assert calphad.table_of(request, {"C": 0.6}).to_text() == first.to_text()
    kept.write_text(kept.read_text()[:2000])  # truncated: invalid
    calphad._cached.cache_clear()
    monkeypatch.setattr(calphad, "compute", lambda *_: first)
    calphad.table_of(request, {"C": 0.6})
    assert kept.read_text() == first.to_text()
