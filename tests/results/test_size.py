"""The size of a section that its symmetry does not centre: from one side of it to the other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from runs.billet_runs import Kept, run_in_memory

from castfem.model import load_case
from castfem.runs.results.mechanical import opposite

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


def test_a_bent_bar_has_the_thickness_of_its_mean_temperature(bent: Kept) -> None:
    """Free stresses have no resultant, so the thickness shrinks by the mean thermal strain.

    The bar tilts and moves as a whole, towards its cold side: no side by itself tells its size.
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


def test_a_free_bar_tilts_by_the_moment_of_its_thermal_strain(bent: Kept) -> None:
    """Stresses that have no moment: a2 = int e_thermal y dy / (h^3 / 12); nothing tilts it in x."""
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
