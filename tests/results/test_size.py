"""Results of a section and its mould: sizes, pool, gaps, resolution of the shell."""

from __future__ import annotations

import math
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from runs.billet_runs import Kept, run_in_memory
from small_case import small
from strained_run import LOST, REGAINED, write_strained
from synthetic_run import printed

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.model import load_case
from castfem.physics.contact.state import ContactSummary
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import derived, headline
from castfem.runs.results.labels import last_quantities, resolved
from castfem.runs.results.mechanical import opposite, with_vertices
from castfem.runs.results.numbers import cells, finely, shown

CORNERS = {"corner": (2.0, 1.0), "low": (2.0, -1.0), "left": (-2.0, 1.0), "low_left": (-2.0, -1.0)}
EXPANSION = 13.5e-6  # 1/K
POURED = 1400.0 + 273.15  # K

BAR = """
title = "Elastic bar, cooled on one side"
[casting]
speed = "1 m/min"
length = "200 mm"
temperature = "1400 degC"
[steel]
name = "carbon_042"
[section]
shape = "rectangle"
width = "200 mm"
height = "40 mm"
symmetry = "whole"
[mesh]
surface_size = "3 mm"
face_size = "20 mm"
core_size = "20 mm"
core_depth = "20 mm"
[[cooling]]
name = "one side"
[[cooling.surface]]
law = "convection"
on = ["wide_face_intrados"]
coefficient = "600 W/(m^2 K)"
ambient = "100 degC"
[thermal.time]
step = "2 s"
[mechanics]
law = "./strong.toml"
elasticity = "./elastic.toml"
ferrostatic = "off"
[coupling]
interval = "12 s"
follow_shape = false
[output]
every = "12 s"
figures = false
fields = []
"""


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> Kept:
    return bar(tmp_path_factory.mktemp("bar"))


def bar(folder: Path) -> Kept:
    (folder / "strong.toml").write_text('law="perfectly_plastic"\n[yield_stress]\nvalue="1 TPa"')
    (folder / "elastic.toml").write_text('[young]\nvalue="20 GPa"\n[poisson]\nvalue=0.3')
    (folder / "bar.toml").write_text(BAR)
    return run_in_memory(load_case(folder / "bar.toml"))


def test_bent_bar_has_the_thickness_of_its_mean_heat(bent: Kept) -> None:
    """Free stresses have no resultant, so the thickness shrinks by the mean thermal strain.

    The bar tilts and moves as a body towards its cold side: no single side has its size.
    """
    last = bent.samples[-1]
    shrunk = sum(
        float(np.trapezoid(EXPANSION * (p.temperature - POURED), p.depth))
        for p in (last.profiles["mid_face"], last.profiles["mid_face_extrados"])
    )
    size = last.strained.across
    assert size["mid_face"] == size["mid_face_extrados"]
    assert size["mid_face"] - 0.04 == pytest.approx(shrunk, rel=0.02)
    apart = abs(last.strained.moved["mid_face"] - last.strained.moved["mid_face_extrados"])
    assert apart > 0.5 * abs(shrunk)


def test_free_bar_tilts_by_its_thermal_moment(bent: Kept) -> None:
    """The stress has no moment: a2 = int e_thermal y dy / (h^3 / 12); no moment tilts it in x."""
    last = bent.samples[-1]
    moment = 0.0
    for name, side in (("mid_face", 1.0), ("mid_face_extrados", -1.0)):
        profile = last.profiles[name]
        y = side * (0.02 - profile.depth)
        moment += float(np.trapezoid(EXPANSION * (profile.temperature - POURED) * y, profile.depth))
    assert bent.value("tilt_y") == pytest.approx(moment / (0.04**3 / 12.0), rel=0.01)
    assert abs(bent.value("tilt_x")) < 1e-6 * abs(bent.value("tilt_y"))


def test_opposite_places() -> None:
    quarter = {"corner": CORNERS["corner"], "mid_face": (0.0, 1.0)}
    assert opposite(quarter, 4) == {"corner": "corner", "mid_face": "mid_face"}
    half = {n: CORNERS[n] for n in ("corner", "low")} | {"side": (2.0, 0.0)}
    assert opposite(half, 2) == {"corner": "low", "low": "corner", "side": "side"}
    whole = opposite(CORNERS, 1)
    assert whole["corner"] == "low_left" and whole["left"] == "low"
    assert opposite({"surface": (3.0, 0.0)}, 1) == {"surface": "surface"}


# Ends of the pool, mean flux of the mould, and contact in tables of many runs


FLUX = [{"law": "flux", "value": "2 MW/m^2"}]
THIN = {
    "section.width": "20 mm", "section.height": "20 mm", "section.corner_radius": "2 mm",
    "mesh.face_size": "4 mm", "mesh.core_size": "4 mm", "thermal.time.step": "0.25 s",
}  # fmt: skip


def zones(mould: str) -> list[dict[str, object]]:
    air = {"law": "convection", "coefficient": "900 W/(m^2 K)", "ambient": "25 degC"}
    return [{"name": "mould", "to": mould, "surface": FLUX}, {"name": "spray", "surface": [air]}]


def test_mean_flux_of_a_mould_with_one_flux(tmp_path: Path) -> None:
    """Also below the mould, and in a run that is resumed there."""
    case = small({"cooling": zones("30 mm"), "casting.length": "45 mm"})
    first = castfem.run(case, tmp_path).quantities["mould_mean_flux"]
    assert first == pytest.approx(2e6, rel=1e-6)
    longer = small({"cooling": zones("30 mm"), "casting.length": "60 mm"})
    assert castfem.run(longer, tmp_path, resume=True).quantities["mould_mean_flux"] == first


def test_the_mean_flux_of_a_strip_is_that_of_its_cooled_end() -> None:
    """Its sides and its inner end are inside the strand."""
    case = castfem.load("verification/alloy_similarity").with_(
        {
            "cooling": zones("30 mm"),
            "casting.length": "45 mm",
            "mesh.core_size": "4 mm",
            "output.figures": False,
            "verification": None,
        }
    )
    assert castfem.run(case).quantities["mould_mean_flux"] == pytest.approx(2e6, rel=1e-6)


def test_no_mean_without_a_mould() -> None:
    case = small({"cooling": zones("30 mm")[1:]})
    assert "mould_mean_flux" not in castfem.run(case).quantities


def test_liquid_core_ends_above_the_mushy_one(tmp_path: Path) -> None:
    case = small({**THIN, "cooling": zones("200 mm"), "casting.length": "1.5 m"})
    result = castfem.run(case, tmp_path)
    found = result.quantities
    assert 0.0 < found["liquid_end"] < found["metallurgical_length"] < 1.5
    # The hottest temperature passes the liquidus and the solidus there.
    for name, level in (("liquid_end", "liquidus"), ("metallurgical_length", "solidus")):
        hottest = result.at(found[name])["temperature_max"]
        assert hottest == pytest.approx(found[level], abs=1e-3)
    text = printed(tmp_path, 100, figures=False)
    results = text[text.index("Results") :].splitlines()[3:5]
    assert [line.split("  ")[0] for line in results] == [
        "end of the liquid core, fs = 0",
        "metallurgical length",
    ]
    assert "is not solid" not in text


def test_strand_that_is_not_solid_is_reported(tmp_path: Path) -> None:
    case = small({**THIN, "cooling": zones("100 mm"), "casting.length": "200 mm"})
    assert "metallurgical_length" not in castfem.run(case, tmp_path).quantities
    message = "at the end of the run, at 0.2 m, the strand is not solid: its core is"
    assert message in printed(tmp_path, 100, figures=False)


def test_contact_and_thinnest_shell_for_tables_of_many_runs(tmp_path: Path) -> None:
    folder = write_strained(tmp_path)
    summary = Summary.load(folder)
    assert summary is not None
    found = derived(folder, summary)
    assert found["contact_lost"].value == pytest.approx(LOST, abs=1e-3)
    assert found["contact_regained"].value == pytest.approx(REGAINED, abs=1e-3)
    assert found["shell_least"].shown > 0.0 and "thinnest shell" in found["shell_least"].label
    assert set(found) == set(headline([found]))


def test_contact_not_regained_has_no_place(tmp_path: Path) -> None:
    folder = write_strained(tmp_path)
    lines = (folder / "history.csv").read_text().splitlines()
    kept = [line for line in lines[1:] if float(line.split(",")[1]) < 0.3]
    (folder / "history.csv").write_text("\n".join([lines[0], *kept, ""]))
    summary = Summary.load(folder)
    assert summary is not None
    assert np.isnan(derived(folder, summary)["contact_regained"].value)


# The largest gap of a section is over integration points and vertices, the probes included


NOWHERE = np.zeros(2)
PLACES = np.array([[0.0, 0.06], [0.06, 0.06], [0.06, 0.0]])


def of_points(gap: float) -> ContactSummary:
    return ContactSummary(
        pressure=0.0, mean_pressure=0.0, penetration=0.0, gap=gap, force=np.zeros(2), axial=0.0,
        length=0.0, share=0.0, sticking=None, points=(0, 0, 0), highest=NOWHERE,
        highest_mean=NOWHERE, widest=np.array([0.05, 0.05]),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("points", "vertices", "gap", "at"),
    [
        (0.459e-3, [0.0, 0.489e-3, 0.1e-3], 0.489e-3, (0.06, 0.06)),  # the corner's own vertex
        (0.459e-3, [0.0, 0.4e-3, 0.1e-3], 0.459e-3, (0.05, 0.05)),
        (0.459e-3, [np.inf, 0.4e-3, 0.1e-3], 0.459e-3, (0.05, 0.05)),  # no wall: no gap
        (0.0, [-1e-6, -2e-6, -1e-6], 0.0, (0.05, 0.05)),
        (0.459e-3, [], 0.459e-3, (0.05, 0.05)),  # a rank without surface
    ],
)
def test_larger_gap_counts(
    points: float, vertices: list[float], gap: float, at: tuple[float, float]
) -> None:
    places = PLACES[: len(vertices)]
    found = with_vertices(MPI.COMM_SELF, of_points(points), np.array(vertices), places)
    assert found.gap == gap and tuple(found.widest) == at


# A plain run prints no digit of a depth that its cells do not resolve


@pytest.mark.parametrize(
    ("value", "resolution", "printed"),
    [
        (39.123, 2.0, "39"),
        (39.123, 12.0, "40"),
        (39.123, 0.17, "39.1"),
        (4.8567, 0.05, "4.86"),
        (4.8567, 0.001, "4.86"),
        (4.8567, None, "4.86"),
        (0.4, 1.0, "0"),
    ],
)
def test_last_digit_is_the_first_one_of_the_resolution(
    value: float, resolution: float | None, printed: str
) -> None:
    assert shown(value, "mm", resolution) == printed
    assert finely(39.123, "mm", "shell_mid_face", 2.0) == "39 mm"


@pytest.mark.parametrize(
    ("value", "unit", "resolution", "printed"),
    [(1.5403, "in", 0.08, "1.54"), (1.5403, "in", 0.3, "1.5"), (0.15403, "in", None, "0.154")],
)
def test_other_units_have_no_more_digits(
    value: float, unit: str, resolution: float | None, printed: str
) -> None:
    assert shown(value, unit, resolution) == printed


def test_depths_have_a_sixth_of_their_cell() -> None:
    found = resolved(
        {
            "shell_mid_face": Quantity(0.0391234, "mm", "shell"),
            "fs70_corner": Quantity(0.0201234, "mm", "shell to fs = 0.7"),
            "liquidus_depth_centre": Quantity(0.03, "mm", "liquidus"),
            "heat_removed": Quantity(1.0, "MJ/m", "heat"),
        },
        {"mid_face": 0.012, "corner": 0.0006, "centre": math.nan}.get,
    )
    assert found["shell_mid_face"].resolution == pytest.approx(2e-3)
    assert found["fs70_corner"].resolution == pytest.approx(1e-4)
    assert found["liquidus_depth_centre"].resolution is None  # no front: it is solid there
    assert found["heat_removed"].resolution is None
    assert cells("shell_mid_face", found["shell_mid_face"]) == ("39", "mm")
    assert cells("fs70_corner", found["fs70_corner"]) == ("20.1", "mm")


def test_error_replaces_the_resolution() -> None:
    known = Quantity(0.0391234, "mm", "shell", error=2e-4, resolution=2e-3)
    assert cells("shell_mid_face", known) == ("39.12 ± 0.20", "mm")


def test_resolution_is_written_read_and_in_the_history() -> None:
    units = {"shell_mid_face": "mm", "solidus_cell_mid_face": "mm", "position": "m"}
    row = {"shell_mid_face": 39.1234, "solidus_cell_mid_face": 12.0, "position": 4.11}
    found = last_quantities(row, units)
    assert found["shell_mid_face"].resolution == pytest.approx(2e-3)
    assert "solidus_cell_mid_face" not in found
    summary = Summary("slab", "finished", quantities=found)
    again = Summary.from_json(summary.to_json()).quantities["shell_mid_face"]
    assert again.resolution == pytest.approx(2e-3) and again.error is None
