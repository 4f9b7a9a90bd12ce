"""Contact lost all round, places equal by symmetry, heat that gaps keep from the mould."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from runs.billet_runs import run_in_memory
from small_case import small
from synthetic_run import rectangle

from castfem.base.shown_quantity import Quantity
from castfem.model import Case
from castfem.model.shipped_cases import CASE_NAME
from castfem.post.report.cautions import cautions, equal_places, less_than_asked, lost_all_round
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.summary_file import Summary
from castfem.runs.output.xdmf import FieldWriter

CONTACT = {"law": "contact", "coefficient": "1600 W/(m^2 K)", "wall": "160 degC"}
CONTACT |= {"gap_conductivity": "0.15 W/(m K)"}
PLACES = ("mid_face", "narrow_face", "corner")


def in_mould(changes: dict[str, Any]) -> Case:
    """Return the small square billet in a mould of its length."""
    zones = [{"name": "mould", "surface": [dict(CONTACT)]}]
    mould = {"length": "60 mm", "taper": "0 %/m"}
    return small({"cooling": zones, "mechanics": {}, "mould": mould, "mesh.order": 2} | changes)


def round_(changes: dict[str, Any]) -> Case:
    section = {"shape": "round", "diameter": "150 mm"}
    mesh = {"order": 2, "surface_size": "3 mm", "face_size": "10 mm", "core_size": "10 mm"}
    return in_mould({"section": section, "mesh": mesh, **changes})


@pytest.mark.parametrize(
    ("share", "message"),
    [
        ([100, 50, 0.1, 20], ""),
        ([100, 0, 0, 20], "from 20 mm to 40 mm: no point"),
        ([100, 50, 0, 0], "from 30 mm to 40 mm, where mould or run ends: no point"),
        ([np.nan, 50, 50, np.nan], ""),
        ([100, 0, 0, np.nan], "from 20 mm to 30 mm, where mould or run ends: no point"),
        ([0, 5, 0, 0, 5], "2 times, first from 10 mm to 20 mm, longest from 30 mm to 50 mm: no"),
    ],
)
def test_loss_of_all_contact_is_reported(share: list[float], message: str) -> None:
    position = 0.01 * np.arange(1, len(share) + 1)
    found = lost_all_round(np.array(share, float), position)
    assert found.startswith(f"contact lost all round {message}" if message else "")
    assert bool(found) == bool(message)


@pytest.mark.parametrize(
    ("case", "equal"),
    [
        (in_mould({}), [["mid_face", "narrow_face"]]),
        (round_({}), [list(PLACES)]),
        (in_mould({"section.width": "120 mm"}), []),
        (in_mould({"mould.width": "101 mm"}), []),
        (in_mould({"mould.taper": {"narrow_face": "1 %/m", "wide_face": "0 %/m"}}), []),
        (in_mould({"cooling.0.surface.0.on": ["wide_face"]}), []),
        (in_mould({"cooling.0.surface.0.on": ["wide_face", "narrow_face", "corner"]}),
         [["mid_face", "narrow_face"]]),
        (small({}), []),
    ],
)  # fmt: skip
def test_places_equal_by_symmetry(case: Case, equal: list[list[str]]) -> None:
    assert equal_places(case, PLACES) == equal


def test_images_of_a_face_are_equal() -> None:
    case = in_mould({"section.symmetry": "half", "section.width": "120 mm"})
    assert equal_places(case, ["mid_face", "narrow_face_left", "narrow_face_right"]) == [
        ["narrow_face_left", "narrow_face_right"]
    ]


@pytest.mark.parametrize(("apart", "reported"), [(4.0, False), (25.0, True)])
def test_difference_of_equal_places_is_reported(
    tmp_path: Path, apart: float, reported: bool
) -> None:
    """A round with two temperatures and gaps, which can only be numerical."""
    (tmp_path / CASE_NAME).write_text(round_({}).resolved_toml())
    head = "time [s],position [m],surface_temperature_mid_face [degC],"
    head += "surface_temperature_narrow_face [degC],gap_mid_face [mm],gap_narrow_face [mm]"
    rows = ["0,0,1500,1500,0,0", f"1,0.06,1400,{1400 + apart},0.01,0.05", "2,0.12,1300,1301,,"]
    (tmp_path / HISTORY_NAME).write_text("\n".join([head, *rows]) + "\n")
    found = cautions(tmp_path, Summary("x", "finished", {}))
    assert len(found) == reported
    for line in found:
        assert line.startswith(
            "all points of the surface are the same by symmetry, yet their surface temperatures "
            "differ by up to 25 K (at 60 mm) and their gaps differ by up to 0.04 mm (at 60 mm). "
            "This is numerical"
        )


def test_all_points_of_a_round_are_compared(tmp_path: Path) -> None:
    """The probes agree, and a point of the surface between them is 300 K colder."""
    (tmp_path / CASE_NAME).write_text(round_({}).resolved_toml())
    head = "time [s],position [m],surface_temperature_mid_face [degC],"
    rows = ["0,0,1500,1500", "1,0.06,1400,1400"]
    head += "surface_temperature_narrow_face [degC]"
    (tmp_path / HISTORY_NAME).write_text("\n".join([head, *rows]) + "\n")
    points, cells = rectangle(4, 4, 0.075, 0.075, "quadrilateral", 1)
    kelvin = np.full(len(points), 1673.15)
    with FieldWriter(
        tmp_path, points, cells, "quadrilateral", 1, attributes={"symmetry": "quarter"}
    ) as writer:
        writer.write(0.0, 0.0, {"temperature": kelvin})
        inner, outer = np.argmin(points.sum(axis=1)), np.argmax(points.sum(axis=1))
        kelvin[inner] += 500.0
        kelvin[outer] -= 300.0
        writer.write(1.0, 0.06, {"temperature": kelvin})
    (message,) = cautions(tmp_path, Summary("x", "finished", {}))
    assert "yet their surface temperatures differ by up to 300 K (at 60 mm). This" in message


def summary(removed: float, nominal_heat: float) -> Summary:
    """Return the summary of a strand at 0.02 m/s with these heats in the mould, J/m."""
    known = {"mould_heat_removed": removed, "mould_heat_asked": nominal_heat, "heat_removed": 2.4e7}
    found = {name: Quantity(value, "MJ/m", name) for name, value in known.items()}
    return Summary("x", "finished", found | {"cooling_power": Quantity(4.8e5, "kW", "power")})


def test_heat_that_a_gap_keeps_from_the_mould() -> None:
    message = less_than_asked(summary(1.8e7, 2e7))
    assert message.startswith(
        "the mould took 360 kW, 10.0 % less than the 400 kW that its flux asks"
    )
    assert "water_rise" in message
    more = less_than_asked(summary(2.2e7, 2e7))
    assert more == "the mould took 440 kW, 10.0 % more than the 400 kW of its given flux alone"
    assert less_than_asked(summary(1.95e7, 2e7)) == ""
    assert less_than_asked(Summary("x", "finished", {})) == ""


def nominal_heat(law: dict[str, Any]) -> float | None:
    """Return the nominal heat of a law's flux in a mould of 50 mm, in a run of 60 mm, J/m."""
    given = {k: v for k, v in CONTACT.items() if k != "coefficient"} | law
    zones = [{"name": "mould", "to": "50 mm", "surface": [given]}, {"name": "below"}]
    changes = {"cooling": zones, "mould.length": "50 mm", "mechanics.until": "mould_exit"}
    run = run_in_memory(in_mould({**changes, "output.fields": ["temperature"]}))
    found = run.summary.quantities.get("mould_heat_asked")
    return None if found is None else found.value


def test_nominal_heat_of_a_flux() -> None:
    """Through the perimeter with its arcs, in 50 mm at 60 mm/s; a scaled flux: its power."""
    perimeter, time = 0.4 - (8.0 - 2.0 * np.pi) * 5e-3, 0.05 / 0.06
    assert nominal_heat({"flux": "2 MW/m^2"}) == pytest.approx(2e6 * perimeter * time, rel=0.01)
    assert nominal_heat({"flux": "savage_pritchard", "power": "50 kW"}) == pytest.approx(5e4 / 0.06)
    assert nominal_heat({"coefficient": "1600 W/(m^2 K)"}) is None
