"""summary.json: units, references, and reading back."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from synthetic_run import summary

import castfem
from castfem.base.atomic_files import plain, write_json
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity, from_si, to_si
from castfem.model import load_case
from castfem.runs.output.summary_file import Reference, Summary, compare


def test_values_are_in_their_stated_unit():
    content = summary().to_json()
    assert content["quantities"]["solidus"] == {"value": 1452.0, "unit": "degC", "label": "solidus"}
    assert content["quantities"]["heat_removed_slice"]["value"] == 139.2
    assert content["balances"]["energy"]["removed"]["value"] == 2.38
    assert content["zones"] == [{"name": "mould", "start": 0.0, "end": 0.6, "whole": True}]


def test_references_have_our_value_and_the_difference():
    quantities = {
        "shell": Quantity(4.9875e-3, "mm", "shell"),
        "surface": Quantity(1525.15, "degC", "surface"),
    }
    shell, surface = compare(
        [Reference("shell", 4.75e-3, "mm", "A"), Reference("surface", 1515.15, "degC", "B", 0.3)],
        quantities,
    )
    assert shell.shown_difference == pytest.approx(0.2375, rel=1e-12)
    assert shell.relative == pytest.approx(0.05, rel=1e-12)
    assert surface.difference == pytest.approx(10.0, rel=1e-12)
    assert math.isnan(surface.relative)
    content = plain(Summary("t", "finished", quantities, (shell, surface)).to_json())
    row = content["references"][1]
    assert (row["value"], row["ours"], row["unit"]) == (1242.0, 1252.0, "degC")
    assert (row["relative"], row["source"], row["at"]) == (None, "B", 0.3)


def test_reference_in_another_unit_is_compared():
    (found,) = compare(
        [Reference("surface", 1515.15, "K", "A")], {"surface": Quantity(1525.15, "degC", "s")}
    )
    assert found.difference == pytest.approx(10.0)
    assert found.missing == ""


def test_unfit_references_get_a_note():
    references = [Reference("shel", 1.0, "mm", "A"), Reference("shell", 1.0, "s", "B")]
    quantities = {"shell": Quantity(1e-3, "mm", "shell")}
    misspelt, wrong = compare(references, quantities)
    assert misspelt.missing == "no such quantity; did you mean shell?"
    assert wrong.missing == "s is not a unit of it; it is in mm"
    (beyond,) = compare([Reference("metallurgical_length", 13.0, "m", "C")], quantities)
    assert beyond.missing == "not a result of this run"
    content = plain(Summary("t", "finished", quantities, (misspelt, wrong)).to_json())
    assert [row["ours"] for row in content["references"]] == [None, None]


def test_zero_reference_has_no_relative_difference():
    (found,) = compare([Reference("a", 0.0, "-", "A")], {"a": Quantity(1.0, "-", "a")})
    assert found.difference == 1.0
    assert math.isnan(found.relative)


@pytest.mark.parametrize(
    ("kind", "ours", "met"),
    [
        ("at_most", 134.1e3, True),
        ("at_most", 136.5e3, False),
        ("at_least", 124.6e3, False),
        ("at_least", math.nan, None),
    ],
)
def test_bound_is_met_or_missed_and_keeps_its_note(kind, ours, met):
    reference = Reference("heat", 134.1e3, "kJ", "A", kind=kind, note="a share")
    quantities = {"heat": Quantity(ours, "kJ", "heat")}
    (found,) = compare([reference], quantities)
    assert found.met is met
    content = plain(Summary("t", "finished", quantities, (found,)).to_json())
    row = content["references"][0]
    assert (row["kind"], row["note"], row["met"], row["missing"]) == (kind, "a share", met, "")
    (again,) = Summary.from_json(content).references
    assert (again.reference.kind, again.reference.note, again.met) == (kind, "a share", met)


def test_summary_without_kinds_of_references_is_read():
    old = {"quantity": "shel", "value": 4.75, "unit": "mm", "source": "A", "at": None}
    old |= {"ours": None, "difference": None, "relative": None, "note": "no such quantity"}
    content = summary().to_json() | {"references": [old]}
    (found,) = Summary.from_json(plain(content)).references
    assert (found.reference.kind, found.reference.note) == ("value", "")
    assert found.missing == "no such quantity"
    with pytest.raises(ValueError, match="unknown kind of reference: about"):
        Summary.from_json(plain(content | {"references": [old | {"kind": "about"}]}))


def test_file_reads_back(tmp_path):
    write_json(tmp_path / "summary.json", summary().to_json())
    found = Summary.load(tmp_path)
    once, again = (
        json.loads(json.dumps(plain(content)), parse_float=lambda text: f"{float(text):.12g}")
        for content in (summary().to_json(), found.to_json())
    )
    assert once == again
    assert math.isnan(found.quantities["metallurgical_length"].value)
    assert found.zones == summary().zones
    assert found.mould_exit == 0.6


@given(
    st.floats(-1e12, 1e12),
    st.sampled_from(["-", "mm", "degC", "K", "kJ", "MJ/m", "kW/m^2", "MPa", "percent", "min"]),
)
def test_units_convert_both_ways(value, unit):
    value = abs(value) if unit == "degC" else value
    assert to_si(from_si(value, unit), unit) == pytest.approx(value, rel=1e-14, abs=1e-10)


def test_missing_file_is_none_and_damaged_one_an_error(tmp_path):
    assert Summary.load(tmp_path) is None
    for content in ("{", "[]", '{"title": 1}', '{"title": "t", "status": "", "quantities": 3}'):
        (tmp_path / "summary.json").write_text(content)
        with pytest.raises(InputError, match=r"summary\.json: cannot be read"):
            Summary.load(tmp_path)


def test_json_never_contains_nan(tmp_path):
    write_json(tmp_path / "a.json", {"a": [math.nan, {"b": -math.inf}], "c": (1, True, None)})
    text = (tmp_path / "a.json").read_text()
    assert json.loads(text) == {"a": [None, {"b": None}], "c": [1, True, None]}
    assert "NaN" not in text


def test_value_is_si_and_shown_has_its_own_unit() -> None:
    heat = Quantity(9091360.0, "MJ/m", "heat")
    assert (heat.value, heat.unit) == (9091360.0, "J/m")
    assert (heat.shown, heat.shown_unit) == (pytest.approx(9.09136), "MJ/m")
    assert repr(heat) == (
        "Quantity(value=9091360.0, unit='J/m', label='heat', shown='9.09136 MJ/m')"
    )
    assert Quantity(0.79, "percent", "share").unit == "-"
    theirs = Reference("heat", 9e6, "MJ/m", "thesis")
    (found,) = compare([theirs], {"heat": heat})
    assert theirs.unit == "J/m"
    assert found.difference == pytest.approx(91360.0)
    assert found.shown_difference == pytest.approx(0.09136)


def test_changed_case_has_no_difference() -> None:
    theirs = Reference("heat", 9e6, "MJ/m", "thesis", kind="at_least", changed=("casting.speed",))
    (found,) = compare([theirs], {"heat": Quantity(9091360.0, "MJ/m", "heat")})
    assert math.isnan(found.difference) and math.isnan(found.relative) and found.met is None
    summary = Summary("t", "finished", references=(found,))
    (again,) = Summary.from_json(json.loads(json.dumps(plain(summary.to_json())))).references
    assert again == found


def test_data_from_memory_are_reported_in_every_run(tmp_path: Path) -> None:
    from rich.console import Console

    from castfem.model.shipped_cases import find
    from castfem.physics.constitutive.parameters import unchecked
    from castfem.post.report.show import show

    changes = ["casting.length=6 mm", "mechanics.law=kozlowski_zhu", "mesh.surface_size=3 mm"]
    case = load_case(find("billet125/idealised"), [*changes, "output.fields=[]"])
    with castfem.run(case, tmp_path / "run") as result:
        reported = " ".join(result.summary.unchecked)
    assert "density: usual size for carbon steel" in reported and "conductivity: usual" in reported
    assert "mechanics.law:" in reported and "thermal expansion" not in reported, (
        "that is from the thesis"
    )
    assert Summary.load(tmp_path / "run").unchecked == result.summary.unchecked
    console = Console(record=True, width=200)
    show(tmp_path / "run", console, figures=False)
    shown = " ".join(console.export_text().split())
    assert "not yet checked against its source: density" in shown
    steel = ["steel.name=plain_carbon", "steel.composition={C=0.2}"]
    short = ["casting.length=6 mm", "mesh.surface_size=3 mm", "output.fields=[]"]
    with castfem.run(load_case(find("billet125/thermal"), [*steel, *short])) as result:
        reported = " ".join(result.summary.unchecked)
    assert "density" in reported and "modulus" not in reported, "not used without mechanics"
    # Its numbers are an own fit, but the range of the measurements is from memory.
    assert unchecked("norton_hoff_kozlowski") == {"data": "Kozlowski et al. (1992), model III"}
