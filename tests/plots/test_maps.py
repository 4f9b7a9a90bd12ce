"""The unrolled surface: colours by the band, white for zero, and each place where it belongs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from synthetic_maps import LENGTH, THICK, WIDE, write_maps

from castfem.post.plots.figures import draw_figures
from castfem.post.plots.maps import band_norm, draw_maps, edges, index_colours, temperature_colours
from castfem.post.plots.style import Abscissa, look
from castfem.runs.output.folder import ALL_FIGURES, OutputFolder
from castfem.runs.output.surface_maps import SurfaceMaps


@pytest.mark.parametrize(
    ("celsius", "colour"), [(700.0, 2), (780.0, 2), (990.0, 1), (1200.0, 1), (1400.0, 1)]
)
def test_blue_below_the_band_and_green_above(celsius: float, colour: int) -> None:
    rgb = temperature_colours()(band_norm(650.0, 1450.0, (800.0, 950.0))(celsius))[:3]
    assert int(np.argmax(rgb)) == colour


def test_within_the_band_from_violet_to_light_yellow() -> None:
    norm = band_norm(650.0, 1450.0, (800.0, 950.0))
    low, middle, high = (temperature_colours()(norm(t))[:3] for t in (803.0, 890.0, 947.0))
    assert low[2] > low[1] and low[0] > low[1]
    assert middle[0] > 0.8 > middle[1]
    assert high[0] > 0.95 and high[1] > 0.85 and high[2] < 0.8


def test_a_band_beyond_all_temperatures_keeps_its_third() -> None:
    norm = band_norm(500.0, 600.0, (800.0, 950.0))
    assert float(norm(800.0)) == pytest.approx(1.0 / 3.0)
    assert float(norm(950.0)) == pytest.approx(2.0 / 3.0)


def test_zero_is_white_and_what_is_more_is_darker() -> None:
    colours = index_colours()
    assert colours(np.ma.masked)[:3] == (1.0, 1.0, 1.0)
    shades = [sum(colours(share)[:3]) for share in (0.0, 0.3, 0.6, 1.0)]
    assert shades == sorted(shades, reverse=True) and shades[0] < 3.0


def test_cells_lie_around_their_places() -> None:
    assert edges(np.array([0.0, 1.0, 3.0])).tolist() == [0.0, 0.5, 2.0, 3.0]


def test_every_value_is_drawn_at_its_place(tmp_path: Path) -> None:
    """Down the strand to the right, from the extrados below to the intrados above."""
    line = write_maps(tmp_path)
    maps = SurfaceMaps(tmp_path)
    with look():
        figure = draw_maps(maps, Abscissa(maps.time, maps.position))
    assert figure is not None
    temperature, band, first, second = (axes.collections[0] for axes in figure.axes[:4])
    assert np.ma.allclose(temperature.get_array(), maps["temperature"].T - 273.15)
    assert np.array_equal(band.get_array(), maps["in_band"].T)
    drawn = first.get_array().reshape(len(line.nodes), -1)
    assert np.ma.count(drawn) == 4 and drawn.max() == pytest.approx(30.0)
    assert second.get_array().max() == pytest.approx(20.0)  # in 1e-5 1/s
    lines = figure.axes[2].get_lines()
    (worst,) = [one for one in lines if one.get_marker() == "o"]
    assert worst.get_xydata()[0] == pytest.approx([2.125, 1e3 * (0.5 * WIDE + THICK)])
    assert figure.axes[0].get_xlim() == (0.0, LENGTH)
    names = [label.get_text().replace("\n", " ") for label in figure.axes[0].get_yticklabels()]
    assert names == ["extrados", "narrow face", "intrados"]
    assert {"bending", "straightening"} <= {text.get_text() for text in figure.axes[0].texts}


def test_show_draws_them_and_castfem_takes_them_away_again(tmp_path: Path) -> None:
    with OutputFolder(tmp_path) as folder:
        folder.begin("x = 1\n")
        write_maps(tmp_path)
        folder.finish()
    assert [path.name for path in draw_figures(tmp_path)] == ["maps.png", "caster.png"]
    assert {"maps", "caster"} <= set(ALL_FIGURES)
    with OutputFolder(tmp_path) as folder:
        folder.begin("x = 1\n")
        assert {path.name for path in tmp_path.iterdir()} <= {
            "case.toml", "run.json", ".castfem.lock",
        }  # fmt: skip
