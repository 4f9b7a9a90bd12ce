"""Pictures and the table of a steel."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.physics.materials import available_steels, describe_steel, load_steel
from castfem.physics.materials.plot import plot_steel


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


def test_description_tells_values_units_and_sources():
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


def test_drawing_leaves_the_users_matplotlib_alone(tmp_path):
    import matplotlib

    before = dict(matplotlib.rcParams)
    plot_steel(load_steel("carbon_042"), tmp_path / "steel.png")
    assert dict(matplotlib.rcParams) == before
