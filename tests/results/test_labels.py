"""Labels of results, results of a case, and warnings about a run."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from mpi4py import MPI

import pytest
from small_case import small, strip
from strained_run import write_strained
from synthetic_run import printed

import castfem
from castfem.base.result_registry import result_names
from castfem.base.shown_quantity import Quantity
from castfem.model import load_case
from castfem.model.build.simulation import Simulation, build
from castfem.model.load import load
from castfem.model.shipped_cases import find
from castfem.physics.mechanics.generalized_plane_strain import PlainPlanes
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import plain_label
from castfem.runs.results.labels import last_quantities
from castfem.runs.results.needs import fault_of, faults_of
from castfem.runs.results.registry import columns_of, results_of
from castfem.runs.results.summary import run_warnings


def test_interrupted_run_has_labels_of_a_finished_one(tmp_path):
    write_strained(tmp_path)
    (tmp_path / "summary.json").unlink()
    path = tmp_path / "run.json"
    path.write_text(path.read_text().replace('"finished"', '"running"'))
    assert RunRecord.load(tmp_path).status == "running"
    text = printed(tmp_path, 120, figures=False)
    assert text.startswith("killed or aborted")
    rows = [re.split(r"  +", line.strip()) for line in text.split("Last of ")[1].splitlines()]
    printed_rows = {row[0]: row[1:] for row in rows if len(row) == 3}
    assert list(printed_rows)[1:3] == ["time", "position"]
    assert printed_rows["share of the surface in contact"] == ["100", "%"]
    assert printed_rows["diagonal"] == ["172.12", "mm"]
    assert printed_rows["von Mises stress, mid-face"] == ["3.6", "MPa"]
    assert printed_rows["heat removed per m"][1] == "MJ/m"
    assert printed_rows["largest penetration into the mould here"] == ["0.01", "µm"]
    for word in ("newton", "force", "error", "step"):
        assert not any(word in label for label in printed_rows)


def test_labels_are_those_of_the_report(tmp_path):
    """In a run with mechanics and friction each quantity is labelled as in its summary."""
    lines = ["casting.length=6 mm", "mould.friction.law=coulomb", "mould.friction.coefficient=0.2"]
    case = load_case(find("billet125/taper_1"), overrides=lines)
    with castfem.run(case, tmp_path / "out") as result:
        table, finished = result.history, result.summary.quantities
    units = table.attrs["units"]
    found = last_quantities({str(k): float(v) for k, v in table.iloc[-1].items()}, units)
    assert {"contact_sticking", "gap_corner", "size_corner", "penetration"} <= set(found)
    for name, quantity in found.items():
        assert (quantity.label, quantity.unit) == (plain_label(finished[name]), finished[name].unit)
        assert quantity.value == pytest.approx(finished[name].value, rel=1e-9, abs=1e-15)


@pytest.mark.parametrize(
    ("label", "plain"),
    [
        (
            "largest I1, axial tension in the band, bending, extrados, corner, 4.10 m (roll 15), "
            "205 s, bending",
            "largest I1, axial tension in the band, bending",
        ),
        (
            "largest I1, axial tension in the band on the way, intrados, 61.4 mm from the corner, "
            "16.83 m, 841.6 s, straightening",
            "largest I1, axial tension in the band on the way",
        ),
        ("largest gap, x = 1.0, y = 2.0 mm, 0.52 m, 8.5 s, mould", "largest gap"),
        ("von Mises stress, narrow face", "von Mises stress, narrow face"),
    ],
)
def test_plain_label_has_no_place(label: str, plain: str) -> None:
    """In a comparison of runs the place of one of them would mislead."""
    assert plain_label(Quantity(1.0, "Pa", label)) == plain


# Results that a run lacks are found from the case only, and compared with those of runs


@pytest.fixture(scope="module")
def thermal() -> Iterator[Simulation]:
    simulation = build(small({"output.shell_at": [0.7]}), MPI.COMM_SELF)
    yield simulation
    simulation.destroy()


def names_of(simulation: Any) -> set[str]:
    having = (*columns_of(simulation), *results_of(simulation))
    return {definition.named(probe) for definition, probe in having}


def test_results_of_a_thermal_run(thermal: Simulation) -> None:
    case, having = thermal.case, sorted(names_of(thermal))
    assert len(having) > 20 and "fs70_corner" in having
    assert faults_of(case, having) == [""] * len(having)
    others = [name for name in result_names() if name not in having]
    refused = {name for name, fault in zip(others, faults_of(case, others), strict=True) if fault}
    assert {"von_mises_max", "way_von_mises_max", "gap_corner", "mould_gap_max"} <= refused
    assert {"surface_temperature_tip", "size_mid_face", "negative_strip_time"} <= refused


def test_results_of_a_slice_in_its_mould(thermal: Simulation) -> None:
    case = load("billet125/taper_1")
    law = SimpleNamespace(data=object())
    strained = SimpleNamespace(
        slice=SimpleNamespace(
            law=law, interactions=[SimpleNamespace(has_friction=True)], planes=PlainPlanes()
        )
    )
    like = SimpleNamespace(
        case=case, strained=strained, probes=thermal.probes,
        centred_probes=thermal.centred_probes, zones=thermal.zones,
    )  # fmt: skip
    having = sorted(names_of(like))
    assert "contact_sticking" in having and "gap_corner" in having
    assert faults_of(case, having) == [""] * len(having)
    assert fault_of(case, "negative_strip_time").startswith(
        "is none of this case, for it has no [mould.oscillation]; "
    )


def test_missing_tables_are_named() -> None:
    case = small()
    assert fault_of(case, "gap_max") == (
        "is none of this case, for it has no [mechanics] and [mould]; "
        "add it, or name another result"
    )
    assert fault_of(case, "shell_tip") == (
        'has no place "tip" on this section; allowed: mid_face, narrow_face, corner'
    )
    assert fault_of(case, "fs70_corner") == "is not followed; give output.shell_at = [0.7]"


# Warnings about the results of a finished run


OPEN = "does not close: its relative error is"


@pytest.mark.parametrize(
    ("heat", "force", "warmed", "messages"),
    [
        (1e-12, 1e-10, 0.0, []),
        (0.18, 1e-10, 0.0, ["the heat balance does not close: 1.8e-01 of the heat"]),
        (float("nan"), 1e-10, 0.0, ["the heat balance does not close: nan of the heat"]),
        (1e-12, 1.8e-6, 0.0, [f"the balance of forces in the plane {OPEN} 1.8e-06 (allowed: 1"]),
        (
            1e-12,
            1e-10,
            3.5,
            ["the highest temperature of the strand has risen by 3.5 K above that of"],
        ),
    ],
)
def test_unreliable_results_are_reported(
    heat: float, force: float, warmed: float, messages: list[str]
) -> None:
    balances = {
        "heat": {"whole": Quantity(heat, "-", "")},
        "forces in the plane": {"error": Quantity(force, "-", "")},
    }
    summary = Summary("", "finished", {}, {}, balances=balances)
    case = small({"mechanics": {"tolerance": 1e-8}})
    found = list(run_warnings(summary, case, warmed))
    assert [line[: len(one)] for line, one in zip(found, messages, strict=True)] == messages


def test_heat_that_comes_back_is_not_missing(tmp_path: Path) -> None:
    """A strip loses 150 kJ/m^2 and gets them back: what is removed in the end is rounding alone."""
    there, back = ({"law": "flux", "value": f"{sign}0.5 MW/m^2"} for sign in ("", "-"))
    zones = [{"name": "out", "to": "5 mm", "surface": [there]}, {"name": "in", "surface": [back]}]
    found = castfem.run(strip({"cooling": zones}), tmp_path).summary
    assert abs(found.balances["heat"]["removed"].value) < 1e-9
    assert abs(found.balances["heat"]["whole"].value) < 1e-9
    assert not any("does not close" in warning for warning in found.warnings)
    (warmed,) = (warning for warning in found.warnings if "has risen by" in warning)
    assert "heat flows into the strand, or" in warmed
    assert warmed.endswith(", which makes the temperature of the liquid wrong")
