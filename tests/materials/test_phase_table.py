"""Phases and heat as a table of a thermodynamic database, without pycalphad.

`fe_c_017.csv` is a table of few rows for 0.17 % C by the Fe-C database among pycalphad's tests.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from castfem.base.errors import InputError
from castfem.base.tables import Constant
from castfem.model.checks.unusual import warnings_with
from castfem.model.load import load_case, portable
from castfem.physics.materials import describe_steel, load_steel
from castfem.physics.materials.alloying import alloyed
from castfem.physics.materials.calphad import beyond_range, described
from castfem.physics.materials.phase_table import FRACTIONS, Request, Scheil, read

FILE = Path(__file__).with_name("fe_c_017.csv")
TEXT = FILE.read_text()
TABLE = read(TEXT)
ZERO = 273.15
WARM = np.linspace(1380.0, 1560.0, 400) + ZERO


def steel(composition=None, overrides=None, **request):
    database = Request(str(FILE), **request)
    return load_steel(
        "plain_carbon", composition=composition or {"C": 0.17},
        overrides={"database": database, **(overrides or {})},
    )  # fmt: skip


def test_table_is_unchanged_when_reread():
    again = read(TABLE.to_text())
    assert again.to_text() == TEXT and again.header == TABLE.header
    assert np.array_equal(again.temperature, TABLE.temperature)


def test_table_is_close_to_the_built_in_diagram():
    """The two are different assessments of iron and carbon."""
    table, built_in = TABLE, alloyed({"C": 0.17})
    assert table.liquidus == pytest.approx(built_in.liquidus, abs=1.0)
    assert table.solidus == pytest.approx(built_in.solidus, abs=1.0)
    assert table.gamma_start == pytest.approx(built_in.gamma_start, abs=1.0)
    assert table.gamma_end == pytest.approx(built_in.gamma_end, abs=2.0)
    distant = WARM[np.abs(WARM - built_in.peritectic) > 1.0]
    for name in ("liquid", "delta", "gamma"):
        one, other = (getattr(d.phases(distant), name) for d in (table, built_in))
        assert np.abs(one - other).max() < 0.03


@pytest.mark.parametrize("side", ["above", "below"])
def test_fractions_sum_to_one_and_conserve_carbon(side):
    t = np.concatenate([WARM, TABLE.temperature, [200.0, 3000.0]])
    p = TABLE.phases(t, side)
    parts = ((p.liquid, p.carbon_liquid), (p.delta, p.carbon_delta), (p.gamma, p.carbon_gamma))
    assert np.allclose(sum(part for part, _ in parts), 1.0, atol=1e-8)
    carbon = sum(part * np.nan_to_num(content) for part, content in parts)
    assert carbon == pytest.approx(0.17, abs=3e-3)
    assert all(np.array_equal(part > 0.0, ~np.isnan(content)) for part, content in parts)
    assert sum(TABLE.fraction(name, t, side) for name in FRACTIONS) == pytest.approx(1.0)


def test_peritectic_reaction_is_a_jump():
    (at,) = (t for t in TABLE.reactions if t > 1600.0)
    above, below = TABLE.phases(at, "above"), TABLE.phases(at, "below")
    assert float(above.liquid) == pytest.approx(0.176, abs=5e-3) and above.gamma == 0.0
    assert below.liquid == 0.0 and 0.0 < below.delta < 0.05
    assert at == TABLE.solidus and at in TABLE.kinks
    near = TABLE.phases(at + 1e-6), TABLE.phases(at - 1e-6)
    assert near[0].liquid == pytest.approx(above.liquid, abs=1e-6)
    assert near[1].delta == pytest.approx(below.delta, abs=1e-3)


def test_heat_of_the_steel_is_that_of_the_table():
    """At constant density the enthalpy per volume is that of the table, from cold to liquid."""
    found = steel(overrides={"density": "7000 kg/m^3"})
    assert isinstance(found.properties["density"], Constant)
    t, left, right, constant, jump = found.enthalpy_knots(298.15, 1850.0)
    gain = (0.5 * (left + right) + constant) * np.diff(t)
    below = np.concatenate([[0.0], np.cumsum(gain)]) + np.cumsum(jump) - jump
    expected = TABLE.value("enthalpy", t, "below") - TABLE.value("enthalpy", 298.15)
    assert below == pytest.approx(7000.0 * expected, rel=1e-9, abs=1.0)
    assert found.solidus == TABLE.solidus and found.liquidus == TABLE.liquidus
    assert 240e3 < found.latent_heat < 280e3
    assert "cfe_broshe.tdb" in found.origins["solid_fraction"].source


def test_enthalpy_is_extrapolated_beyond_the_rows():
    last = TABLE.temperature[-1]
    slope = np.diff(TABLE.columns["enthalpy"])[-1] / np.diff(TABLE.temperature)[-1]
    gain = TABLE.value("enthalpy", last + 100.0) - TABLE.value("enthalpy", last)
    assert gain == pytest.approx(100.0 * slope)
    assert TABLE.value("specific_heat", last + 100.0) == TABLE.columns["specific_heat"][-1]


def test_composition_beyond_the_range_gives_a_warning(tmp_path):
    text = TEXT.replace("# by: ", "# outside: C 0.17 (to 0.1)\n# by: ")
    (tmp_path / "fe_c.csv").write_text(text)
    (tmp_path / "case.toml").write_text(CASE)
    case = load_case(tmp_path / "case.toml")
    material = load_steel("plain_carbon", composition={"C": 0.17}, overrides=case.steel.changes)
    problems = warnings_with(case, material, None, None)
    found = [p for p in problems if p.path == ("steel", "composition")]
    assert ["C 0.17 (to 0.1)" in p.text for p in found] == [True]
    assert ("extrapolated", "C 0.17 (to 0.1)") in [
        (label, value.partition(": ")[2].removesuffix(" wt%"))
        for label, value in describe_steel(material)
    ]


def test_heat_of_the_case_has_priority():
    found = steel(overrides={"latent_heat": "272 kJ/kg", "specific_heat": "700 J/(kg K)"})
    assert found.latent_heat == 272e3 and float(found.specific_heat(1000.0)) == 700.0
    assert found.solidus == TABLE.solidus


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("# castfem phases 1", "# something"), "not a table of phases"),
        (("# licence: licence not stated\n", ""), 'no "licence"'),
        (("liquid [1]", "liquid [%]"), "names or units"),
        (("\n74.21875,", "\n24,"), "temperatures must increase"),
        (("74.21875,22615.6931", "74.21875,-1"), "enthalpy must increase"),
        (("0,0,0,0.974586762,0.0254132378", "0,0,0,0.974586762,0.5"), "sum to 1"),
        (("74.21875,22615.6931,", "74.21875,"), "is incomplete"),
        (("\n25,0,448.916508,0,0,0,0.9", "\n25,0,448.916508,0.9,0,0,0."), "sum to 1|from solid"),
    ],
)
def test_invalid_table_is_rejected_in_one_line(tmp_path, change, message):
    assert change[0] in TEXT
    file = tmp_path / "mine.csv"
    file.write_text(TEXT.replace(*change))
    with pytest.raises(InputError, match=message) as caught:
        load_steel(
            "plain_carbon", tmp_path, {"C": 0.17}, {"database": Request("mine.csv")}, origin="steel"
        )
    (line,) = caught.value.problems
    assert line.startswith('steel.database ("mine.csv"): ')


@pytest.mark.parametrize(
    ("changes", "key"),
    [
        ({"composition": {"C": 0.2}}, "composition"),
        ({"composition": {"C": 0.17, "Mn": 0.5}}, "composition"),
        ({"scheil": Scheil()}, "freezing"),
        ({"phases": ("LIQUID", "FCC_A1", "BCC_A2")}, "choice of phases"),
    ],
)
def test_table_of_another_steel_is_rejected(changes, key):
    with pytest.raises(InputError, match=f"another {key}") as caught:
        steel(**changes)
    assert len(caught.value.problems) == 1


def test_missing_file_or_package_is_reported_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    (tmp_path / "x.tdb").write_text("$ nothing")
    for file, message in (("none.tdb", "file not found"), ("x.tdb", "pycalphad is not installed")):
        with pytest.raises(InputError, match=message) as caught:
            load_steel("plain_carbon", tmp_path, {"C": 0.17}, {"database": Request(file)})
        assert len(caught.value.problems) == 1


def test_metal_without_a_composition_takes_no_database():
    with pytest.raises(InputError, match="a metal without a composition; leave it out") as caught:
        load_steel("copper", overrides={"database": Request("steel.tdb")}, origin="steel")
    assert caught.value.problems[0].startswith('steel.database ("steel.tdb"): ')
    assert len(caught.value.problems) == 1


def test_formula_by_a_database_requires_one():
    with pytest.raises(InputError, match=r"solid_fraction.*steel\.database"):
        load_steel(
            "plain_carbon", composition={"C": 0.17},
            overrides={"solid_fraction": {"formula": "database"}},
        )  # fmt: skip


CASE = """
extends = "billet180/peritectic"
[steel]
composition = { C = 0.17, Mn = 0, Si = 0 }
database = "fe_c.csv"
"""


def test_run_folder_with_the_table_can_be_repeated(tmp_path):
    (tmp_path / "fe_c.csv").write_text(TEXT)
    (tmp_path / "case.toml").write_text(CASE)
    text, files = portable(load_case(tmp_path / "case.toml"), "properties")
    folder = tmp_path / "run"
    for name, content in {"case.toml": text.encode(), **files}.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    (tmp_path / "fe_c.csv").unlink()
    again, same = portable(load_case(folder / "case.toml"), "properties")
    assert (again, same) == (text, files)
    assert files["properties/steel/phases.csv"].decode() == TEXT


def test_keys_of_a_database_require_one(tmp_path):
    bare = CASE.replace('database = "fe_c.csv"', 'phases = ["LIQUID"]\nscheil = {}')
    (tmp_path / "case.toml").write_text(bare)
    with pytest.raises(InputError) as caught:
        load_case(tmp_path / "case.toml")
    lines = caught.value.problems
    assert len(lines) == 2 and all("database" in line for line in lines)
    assert "steel.phases" in lines[0] and "steel.scheil" in lines[1]


def test_steel_without_a_database_does_not_import_calphad():
    code = """
import sys
from castfem.physics.materials import load_steel
load_steel("plain_carbon", composition={"C": 0.17})
names = ("pycalphad", "scheil", "castfem.physics.materials.calphad",
         "castfem.physics.materials.equilibria", "castfem.physics.materials.freezing_paths")
sys.exit(str([n for n in names if n in sys.modules] or ""))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


DATABASE = """$ steel_v3.2.tdb
$ created long ago; made available under the
$ Open Licence 1.0
$ Alloy composition (wt.%): Al<3  C<0.5  Cr<25
$ MN<25  P<0.005
$ Typical: Si < 99 is not of the list
"""


def test_version_licence_and_range_of_a_database_are_read():
    found = described("steel.tdb", DATABASE.encode())
    assert found["version"] == "3.2" and found["licence"] == "Open Licence 1.0"
    assert described("x.tdb", b"ELEMENT FE")["licence"] == "licence not stated"
    steel = {"C": 1.0, "Mn": 25.0, "P": 0.01, "Si": 100.0}
    assert beyond_range(DATABASE, steel) == ["C 1 (to 0.5)", "P 0.01 (to 0.005)"]
    assert beyond_range("$ nothing\nPARAMETER Cr<1", steel) == []
