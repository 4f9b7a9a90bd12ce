"""Remarks on a run: lost contact, thin shells, hot spots."""

from __future__ import annotations

import numpy as np
import pandas
import pytest
from synthetic_run import HALF, LIQUIDUS, SOLIDUS, rectangle, summary

from castfem.post.report.hot_spots import hottest, thinnest
from castfem.post.report.remarks import remarks
from castfem.runs.output.fields import Fields
from castfem.runs.output.summary_file import Summary, Zone
from castfem.runs.output.xdmf import FieldWriter
from castfem.runs.results.headline import OPEN, Spell, spells
from castfem.runs.results.numbers import finely


def test_spells_without_contact_are_interpolated():
    z = np.linspace(0.0, 1.0, 11)
    gap = np.array([0, 0, 2e-3, 5e-3, 0, 0, 0, 4e-3, np.nan, 5e-3, 6e-3])
    first, second = spells(gap, z, OPEN)
    assert first == Spell(pytest.approx(0.15), pytest.approx(0.38), True)
    assert second == Spell(pytest.approx(0.625), 1.0, False)
    assert spells(np.full(11, 0.5), z, OPEN) == []  # never in contact
    assert spells(np.zeros(11), z, OPEN) == []
    (late,) = spells(np.r_[1.0, 1.0, np.zeros(8), 1.0], z, OPEN)
    assert (late.start, late.regained) == (pytest.approx(0.9001), False)


def of(found, what):
    """Return the remark on a subject."""
    (remark,) = [remark for remark in found if remark.what == what]
    return remark


def test_remarks_name_extremes(table):
    found = remarks(table, summary())
    lost = of(found, "largest gap, corner")
    assert "lost at 120 mm, t = 2 s, regained at 360 mm" in lost.where
    assert lost.value == table["gap_corner"].max()
    assert not [r for r in found if r.what == "largest gap, mid-face"]
    assert of(found, "largest gap on the way").value == table["gap_max"].max()
    pressure = of(found, "highest contact pressure")
    assert pressure.value == pytest.approx(0.12)
    assert pressure.where == "at 600 mm, t = 10 s; corner: 0.12 MPa"
    least = of(found, "least contact")
    assert (least.value, least.unit) == (pytest.approx(80.0), "%")
    assert least.where.endswith("; 100 % at the end of the run")
    thinnest = of(found, "thinnest shell of the probes")
    assert thinnest.value == pytest.approx(table["shell_mid_face"].iloc[-1])
    assert thinnest.where == "mid-face, mould exit at 600 mm"
    hottest = of(found, "hottest surface of the probes")
    assert (hottest.value, hottest.unit) == (
        pytest.approx(table["surface_temperature_mid_face"].iloc[-1]),
        "°C",
    )
    assert of(found, "largest von Mises stress").value == pytest.approx(12.0)


def test_mould_end_and_reheating_are_named(table):
    zones = (Zone("mould", 0.0, 0.3), Zone("spray", 0.3, 2.0))
    units = table.attrs["units"]
    late = table["position"] > 0.4
    table.loc[late, "surface_temperature_corner"] += 100.0
    table.attrs["units"] = units
    found = remarks(table, Summary("x", "finished", zones=zones, mould_exit=0.3))
    assert of(found, "thinnest shell of the probes").where.endswith("mould exit at 300 mm")
    within = Summary("x", "finished", zones=(Zone("mould", 0.0, 0.6),), mould_exit=0.8)
    assert of(remarks(table, within), "thinnest shell of the probes").where.endswith(
        "end of the run at 600 mm"
    )
    z, shell = table["position"], table["shell_mid_face"]
    assert of(found, "thinnest shell of the probes").value == pytest.approx(
        np.interp(0.3, z, shell)
    )
    reheated = of(found, "largest reheating of the surface")
    assert reheated.unit == "K"
    assert 50.0 < reheated.value < 100.0
    assert reheated.where.startswith("corner, from ")
    found = remarks(table, Summary("x", "finished", zones=(Zone("mould", 0.0, 0.6),)))
    assert of(found, "thinnest shell of the probes").where.endswith("end of the run at 600 mm")


def test_missing_shell_is_named_and_full_contact_is_not(table):
    units = table.attrs["units"]
    table["shell_corner"] = 0.0
    table["contact_share"] = 100.0
    table.attrs["units"] = units
    found = remarks(table, summary())
    thin = of(found, "thinnest shell of the probes")
    assert (thin.value, thin.where) == (0.0, "no shell at all; corner, mould exit at 600 mm")
    assert not [r for r in found if r.what == "least contact"]


def test_windows_not_converged_are_named(table):
    what = "coupling windows not converged"
    steps = {"coupling windows": 396.0, what: 63.0}
    found = of(remarks(table, Summary("x", "finished", steps=steps)), what)
    assert (found.value, found.unit) == (pytest.approx(15.909, abs=1e-3), "%")
    assert found.where.startswith("63 of 396: ") and "shorten coupling.interval" in found.where
    converged = Summary("x", "finished", steps={**steps, what: 0.0})
    assert not [r for r in remarks(table, converged) if r.what == what]


def test_shares_of_older_runs_are_fractions(table):
    new = of(remarks(table, summary()), "least contact")
    table["contact_share"] *= 0.01
    table.attrs["units"]["contact_share"] = "-"
    old = of(remarks(table, summary()), "least contact")
    assert (old.value, old.where) == (pytest.approx(new.value), new.where)


def test_highest_pressure_is_a_mean_if_there_is_one(table):
    table["mean_contact_pressure_max"] = 0.5 * table["contact_pressure_max"]
    table.attrs["units"]["mean_contact_pressure_max"] = "MPa"
    found = of(remarks(table, summary()), "highest contact pressure, mean over 5 mm")
    assert found.value == pytest.approx(0.06)
    assert found.where == "at 600 mm, t = 10 s; corner: 0.12 MPa"


def test_too_large_cells_are_named(table):
    """The curve is off by a sixth of the cell; a small error is not named."""
    assert not [r for r in remarks(table, summary()) if r.what.startswith("resolution")]
    for size, named in ((1.0, False), (4.2, True)):
        table["solidus_cell_corner"] = np.where(table["position"] < 0.1, np.nan, size)
        table.attrs["units"]["solidus_cell_corner"] = "mm"
        found = [r for r in remarks(table, summary()) if r.what.startswith("resolution")]
        assert bool(found) == named
    assert (found[0].value, found[0].unit) == (pytest.approx(0.7), "mm")
    assert "corner, at " in found[0].where and "cells of 4.2 mm" in found[0].where


def test_missing_shell_at_the_exit_has_no_resolution(table):
    """A remelted corner has no cell of the solidus: its depth of 0 is printed nevertheless."""
    table["solidus_cell_corner"] = np.where(table["position"] < 0.4, 1.0, np.nan)
    table["shell_corner"] = np.where(table["position"] < 0.4, 1.0, 0.0)
    table.attrs["units"]["solidus_cell_corner"] = "mm"
    found = of(remarks(table, summary()), "thinnest shell of the probes")
    assert (found.value, found.resolution) == (0.0, None)
    assert finely(found.value, found.unit, found.name, found.resolution) == "0.000 mm"


def test_gap_without_a_wall_is_no_gap(table):
    units = table.attrs["units"]
    beyond = table["position"] > 0.5
    for name in ("gap_corner", "gap_max"):
        table.loc[beyond, name] = np.inf
    table.attrs["units"] = units
    found = remarks(table, summary())
    assert of(found, "largest gap on the way").value == table["gap_max"][~beyond].max()
    assert "regained at 360 mm" in of(found, "largest gap, corner").where


def test_remarks_need_increasing_positions(table):
    units = table.attrs["units"]
    still = table.assign(position=0.0)
    still.attrs["units"] = units
    assert remarks(still, None) == []
    assert remarks(table.iloc[:1], None) == []


@pytest.mark.parametrize(("cell", "order"), [("quadrilateral", 1), ("triangle", 2)])
def test_weak_spots_between_probes_are_in_the_fields(tmp_path, table, cell, order):
    points, cells = rectangle(16, 16, HALF, HALF, cell, order, power=1.7)
    depth = HALF - points.max(axis=1)
    even = 1600.0 + 2e4 * depth  # the solidus is 6.2575 mm deep everywhere
    hot_spot = np.array([0.0467, HALF])
    near = np.exp(-(np.linalg.norm(points - hot_spot, axis=1) ** 2) / (2 * 4e-3**2))
    facts = {"solidus": SOLIDUS, "liquidus": LIQUIDUS, "symmetry": "quarter"}
    with FieldWriter(tmp_path, points, cells, cell, order, attributes=facts) as writer:
        for time, kelvin in ((0.0, even + 300.0), (5.0, even), (10.0, even + 60.0 * near)):
            writer.write(time, 0.06 * time, {"temperature": kelvin})
    with Fields(tmp_path) as fields:
        assert thinnest(fields, SOLIDUS, 0).value == 0.0
        assert thinnest(fields, 4000.0, 0) is None
        assert thinnest(fields, SOLIDUS, 1).value == pytest.approx(6.2575e-3, rel=1e-3)
        assert hottest(fields, 1).value == pytest.approx(1600.0)
        hot, thin = hottest(fields, 2), thinnest(fields, SOLIDUS, 2)
        for found in (hot, thin):
            assert (found.x, found.y) == (pytest.approx(hot_spot[0], abs=2e-3), HALF)
        assert 1645.0 < hot.value <= 1660.001
        z = depth_of_level(lambda s: 1600.0 + 2e4 * s + 60.0 * np.exp(-(s**2) / (2 * 4e-3**2)))
        assert thin.value == pytest.approx(z, rel=0.05)
        table["shell_mid_face"] = table["shell_corner"] = 6.2575
        for name in ("mid_face", "corner"):
            table[f"surface_temperature_{name}"] = 1326.85
        remark = of(remarks(table, summary(), fields), "thinnest shell")
        assert remark.value == pytest.approx(1e3 * thin.value)
        probes = "; mid-face and corner: 6.26 mm"
        assert remark.where.endswith(f" y = 62.5 mm, mould exit at 600 mm{probes}")
        remark = of(remarks(table, summary(), fields), "hottest surface")
        assert remark.value == pytest.approx(hot.value - 273.15)
        assert remark.where.endswith("mould exit at 600 mm; mid-face and corner: 1327 °C")
        later = Summary("x", "finished", mould_exit=0.45)
        remark = of(remarks(table, later, fields), "thinnest shell of the probes")  # no field there
        assert (remark.value, remark.where) == (
            pytest.approx(6.2575),
            "mid-face and corner, mould exit at 450 mm",
        )


def depth_of_level(kelvin):
    """Return the depth at which a temperature that grows with depth passes the solidus [m]."""
    s = np.linspace(0.0, 0.02, 20001)
    return float(s[np.flatnonzero(kelvin(s) >= SOLIDUS)[0]])


def test_unsupported_shell_is_named(table):
    """A bulge above a hundredth of the section shows the stiffness of the liquid, not of steel."""
    assert not [r for r in remarks(table, summary()) if r.what.startswith("bulge")]
    table["displacement_mid_face"] *= 40.0
    bulge = of(remarks(table, summary()), "bulge, mid-face")
    assert bulge.value == table["displacement_mid_face"].max() and bulge.unit == "mm"
    assert bulge.where.startswith("at 600 mm") and "mechanics.liquid" in bulge.where


@pytest.mark.parametrize(
    ("corner", "message"),
    [
        (
            [0.0, 1.2, 1.9, 0.0, 0.0, 2.5],
            "no shell there from 300 mm to 500 mm: a sign of a breakout",
        ),
        ([60.0, 120.0, 158.0, 153.0, 153.5, 153.4], "where 150 mm are left"),
        ([60.0, 120.0, 154.95, 154.5, 154.4, 154.3], ""),  # solid to the middle, which shrinks
        ([0.0, 1.2, 1.9, 0.4, 0.9, 2.5], "where 0.4 mm are left"),
        ([0.0, 1.2, 1.9, 1.85, 1.9, 2.5], ""),
    ],
)
def test_remelting_shell_is_named(corner, message):
    table = pandas.DataFrame(
        {
            "time": np.arange(6.0),
            "position": 0.1 * np.arange(6.0),
            "shell_mid_face": [0.0, 1.0, 2.0, 3.0, 4.0, 5.0],
            "shell_corner": corner,
        }
    )
    table.attrs["units"] = {"time": "s", "position": "m"} | dict.fromkeys(table.columns[2:], "mm")
    found = [one for one in remarks(table, None) if one.what == "shell melted again"]
    expected = [f"corner, from 200 mm to 300 mm, {message}"] if message else []
    assert [one.where for one in found] == expected
