"""Phases and heat computed with pycalphad, by the Fe-C database among its tests.

They need the extra calphad (tools/env.sh calphad) and are skipped without it. Temperatures are
chosen more coarsely than in use, to be quick.
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
    """Few temperatures, and a cache of the test's own."""
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


def test_pure_iron_freezes_and_transforms_at_one_temperature():
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
def test_lines_are_those_of_the_built_in_diagram(carbon):
    """Beside the ends of the peritectic line and above; two assessments differ by some kelvins."""
    ours, theirs = table(carbon), alloyed({"C": carbon})
    assert ours.liquidus == pytest.approx(theirs.liquidus, abs=2.0)
    assert ours.solidus == pytest.approx(theirs.solidus, abs=8.0 if carbon == 1.0 else 3.0)
    peritectic = [t for t in ours.reactions if t > 1700.0]
    assert len(peritectic) == (1 if 0.1 < carbon < 0.5 else len(peritectic))
    assert ours.header["freezing"] == "equilibrium" and "outside" not in ours.header
    carbides = ours.fraction("carbides", 500.0)
    assert carbides == pytest.approx(carbon / 6.69, rel=0.05)


def test_scheil_without_diffusion_is_that_of_the_package():
    scheil = pytest.importorskip("scheil")
    ours = table(0.6, Scheil(end=0.05, carbon_diffuses=False))
    carbon = 0.6 / 12.011 / (0.6 / 12.011 + 99.4 / 55.847)
    theirs = scheil.simulate_scheil_solidification(
        pycalphad.Database(str(DATABASE)), ["FE", "C", "VA"], list(PHASES),
        {pycalphad.variables.X("C"): carbon}, ours.liquidus + 1.0, step_temperature=2.0, stop=0.04,
    )  # fmt: skip
    t, solid = np.array(theirs.temperatures[1:-1]), np.array(theirs.fraction_solid[1:-1])
    inside = (t > ours.solidus) & (t < ours.liquidus - 2.0)
    assert inside.sum() > 40
    # Theirs is of moles, of which the liquid has up to a tenth more by its carbon.
    assert np.abs(1.0 - ours.fraction("liquid", t[inside]) - solid[inside]).max() < 0.02


def test_scheil_with_carbon_that_diffuses_is_the_lever_rule_of_iron_and_carbon():
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


def test_the_rest_freezes_at_the_stated_end():
    """Without diffusion carbon piles up in the liquid: it freezes far below the solidus."""
    path = table(0.6, Scheil(end=0.05, carbon_diffuses=False))
    assert path.solidus in path.reactions
    assert 0.02 < path.fraction("liquid", path.solidus) <= 0.05
    assert path.fraction("liquid", path.solidus, "below") == 0.0
    assert path.solidus < alloyed({"C": 0.6}).solidus - 50.0


@pytest.mark.parametrize(
    ("text", "composition", "phases", "said"),
    [
        ("ELEMENT FE BCC_A2 nonsense", {"C": 0.1}, (), "cannot be read as"),
        ("", {"C": 0.1}, (), "cannot be read as|has no elements; it is no thermodynamic database"),
        (None, {"C": 0.1, "Mn": 0.5, "Cr": 1.0}, (), "has no data for Cr, Mn; it has C, Fe"),
        (None, {"C": 0.1}, ("LIQUID", "SIGMA"), "has no phase SIGMA"),
        (None, {"C": 0.1}, ("LIQUID", "FCC_A1"), "has no phase BCC_A2"),
    ],
)
def test_what_a_database_cannot_do_is_one_line(tmp_path, text, composition, phases, said):
    file = DATABASE if text is None else tmp_path / "bad.tdb"
    if text is not None:
        file.write_text(text)
    with pytest.raises(InputError, match=said) as told:
        load_steel(
            "plain_carbon", composition=composition,
            overrides={"database": Request(str(file), phases)}, origin="steel",
        )  # fmt: skip
    (line,) = told.value.problems
    assert line.startswith(f'steel.database ("{file}"): ') and "\n" not in line
    assert not list((tmp_path / "cache").rglob("*.csv"))


def test_pieces_of_an_enthalpy_that_miss_one_another_leave_a_row_out():
    """As that of liquid iron at 1811 K, just above where iron melts, in one database."""
    solve = equilibria.Equilibria(DATABASE, ["Fe"], PHASES[:3])
    at = [solve.state(t, solve.moles({})) for t in (1810.99, 1811.0, 1811.05, 1815.0)]
    first, fallen, *rest = at
    fallen = replace(fallen, enthalpy=first.enthalpy - 6.0)
    assert freezing_paths.joined([first, fallen, *rest]) == [first, *rest]
    wrong = replace(fallen, enthalpy=first.enthalpy - 25.0)  # no misfit, but another state
    assert freezing_paths.joined([first, wrong, *rest]) == [first, wrong, *rest]


def test_no_equilibrium_is_one_line_and_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(equilibria.Equilibria, "_solve", lambda *_: None)
    with pytest.raises(ValueError, match=r"no equilibrium at 1600\.00 degC .*Fe") as told:
        calphad.table_of(Request(str(DATABASE)), {"C": 0.1})
    assert "\n" not in str(told.value)
    assert not list((tmp_path / "cache").rglob("*.csv"))


def test_the_better_of_two_equilibria_counts(monkeypatch):
    """A start of pycalphad may end at a state that is not the most stable one."""
    solve = equilibria.Equilibria(DATABASE, ["Fe", "C"], PHASES)
    moles = solve.moles({"C": 0.1})
    real = solve._solve

    def deceived(temperature, moles, phases, samples):
        few = ["LIQUID"] if samples == 60 else phases
        return real(temperature, moles, few, samples)

    monkeypatch.setattr(solve, "_solve", deceived)
    assert solve.state(1300.0, moles).mass[0] == 0.0


def test_states_that_do_not_fit_together_are_sought_from_more_starts(monkeypatch):
    """Where the first starts find austenite in the cold, the enthalpy falls at the end of that."""
    real = equilibria.Equilibria._solve

    def deceived(self, temperature, moles, phases, samples):
        cold = 500.0 < temperature < 700.0 and samples in (60, 20)
        return real(self, temperature, moles, ["FCC_A1"] if cold else phases, samples)

    honest = table(0.6)
    monkeypatch.setattr(equilibria.Equilibria, "_solve", deceived)
    found = table.__wrapped__(0.6)
    t = np.linspace(300.0, 1800.0, 60)
    assert found.value("enthalpy", t) == pytest.approx(honest.value("enthalpy", t), abs=3e3)
    for name in ("alpha", "carbides", "liquid"):
        assert found.fraction(name, t) == pytest.approx(honest.fraction(name, t), abs=0.02)


def test_a_table_is_computed_once(tmp_path, monkeypatch):
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
    kept.write_text(kept.read_text()[:2000])  # cut short: of no use
    calphad._cached.cache_clear()
    monkeypatch.setattr(calphad, "compute", lambda *_: first)
    calphad.table_of(request, {"C": 0.6})
    assert kept.read_text() == first.to_text()
