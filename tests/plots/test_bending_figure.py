"""Figures of a strand in its rolls: thicknesses, neutral axis within its faces, stress; bulges."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pandas
import pytest
from rolled_case import circuit, rolled, secondary

from castfem.model import load_case
from castfem.model.shipped_cases import load
from castfem.post.plots import figures
from castfem.post.plots.along_strand import draw_bulging, draw_slice
from castfem.post.plots.figures import draw_figures
from castfem.post.plots.secondary import close_by, faces_met
from castfem.post.plots.style import Abscissa, look
from castfem.runs.loop import run
from castfem.runs.output.folder import ALL_FIGURES


def history() -> pandas.DataFrame:
    """A strand that is bent from 1 to 2 m, its neutral axis 20 mm towards the intrados."""
    position = np.linspace(0.0, 4.0, 41)
    k = 0.1 * np.clip(position - 1.0, 0.0, 1.0)
    table = pandas.DataFrame({"time": 50.0 * position, "position": position})
    for place, y in (("intrados", 0.1), ("centre", 0.0), ("extrados", -0.1)):
        table[f"slice_thickness_{place}"] = (1.0 - k * y) / (1.0 - k * 0.02)
    table["neutral_axis"] = np.where((position > 1.0) & (position <= 2.0), 20.0, np.nan)
    table["size_mid_face_intrados"] = 200.0
    table["axial_stress_corner_intrados"] = -100.0 * k
    table.attrs["units"] = {"neutral_axis": "mm", "axial_stress_corner_intrados": "MPa"}
    return table


def test_the_slice_is_drawn_over_the_strand() -> None:
    table = history()
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    with look():
        figure = draw_slice(table, abscissa, None)
        assert draw_slice(table.drop(columns="slice_thickness_centre"), abscissa, None) is None
    assert figure is not None
    thickness, axis, stress = figure.axes[:3]
    drawn = {line.get_label(): line.get_ydata() for line in thickness.get_lines()}
    for place in ("intrados", "centre", "extrados"):
        assert drawn[place] == pytest.approx(table[f"slice_thickness_{place}"])
    faces = [line.get_ydata()[0] for line in axis.get_lines()[1:]]
    assert faces == [100.0, -100.0]
    assert np.nanmax(axis.get_lines()[0].get_ydata()) == 20.0
    assert {text.get_text() for text in axis.texts} == {"intrados", "extrados"}
    assert axis.get_ylabel() == "neutral axis (y) [mm]"
    assert stress.get_ylabel() == "axial stress [MPa]"


def defects(folder: Path) -> tuple[tuple[float, str], ...]:
    with ExitStack() as files:
        return figures.RunData(folder, None, files).defects


def test_rolls_with_a_defect_are_marked(tmp_path: Path) -> None:
    """Those of the run's case, on the way that is drawn."""
    case = load("slab1200/locked_48_52")
    (tmp_path / "case.toml").write_text(case.resolved_toml(), encoding="utf-8")
    found = defects(tmp_path)
    assert [name for _, name in found] == ["#48 locked", "#52 locked"]
    assert case.machine is not None and (rolls := case.machine.pairs()) is not None
    assert [place for place, _ in found] == [rolls.pairs[i - 1].position for i in (48, 52)]
    (tmp_path / "case.toml").write_text(load("slab1200/slab").resolved_toml(), encoding="utf-8")
    assert defects(tmp_path) == () == defects(tmp_path / "nowhere")
    table = history()
    way = table["time"].to_numpy(), table["position"].to_numpy()
    with look():
        plain = draw_slice(table, Abscissa(*way), None)
        marked = draw_slice(table, Abscissa(*way, (), ((3.0, "#7 lost"), (9.0, "#8 off"))), None)
    assert plain is not None and marked is not None
    for one, other in zip(plain.axes[:3], marked.axes[:3], strict=True):
        assert len(other.get_lines()) == len(one.get_lines()) + 1
        assert list(other.get_lines()[-1].get_xdata()) == [3.0, 3.0]
    assert [text.get_text() for text in marked.axes[2].texts] == ["#7 lost"]


def test_bulges_are_drawn_with_what_the_rolls_bear() -> None:
    table = history()
    for name, most in (("intrados", 0.1), ("extrados", 0.08), ("pitch", 0.12)):
        table[f"bulge_{name}"] = most * np.sin(table["position"]) ** 2
    table["roll_force"] = 20.0 * table["position"]
    table.attrs["units"] |= {"bulge_pitch": "mm", "roll_force": "kN/m"}
    abscissa = Abscissa(table["time"].to_numpy(), table["position"].to_numpy())
    with look():
        figure = draw_bulging(table, abscissa, None)
        assert draw_bulging(history(), abscissa, None) is None
    assert figure is not None
    bulge, force = figure.axes[:2]
    drawn = {line.get_label(): line.get_ydata() for line in bulge.get_lines()}
    # A curve through few places of a pitch misses its largest bulge: the legend says what it is.
    assert drawn["intrados, once a window"] == pytest.approx(table["bulge_intrados"])
    assert drawn["largest of the pitch"] == pytest.approx(table["bulge_pitch"])
    assert force.get_lines()[0].get_ydata() == pytest.approx(table["roll_force"])
    assert (bulge.get_ylabel(), force.get_ylabel()) == ("bulge [mm]", "force on a roll [kN/m]")


def test_every_figure_goes_with_the_run_it_is_of() -> None:
    """A run that replaces another removes what it knows of, by name."""
    assert set(figures.FIGURES) == set(ALL_FIGURES)
    assert all(figure.title for figure in figures.FIGURES.values())


SLAB = Path(__file__).parents[2] / "cases" / "slab1200" / "sprays.toml"


def test_it_is_drawn_of_a_run_below_its_mould(tmp_path: Path) -> None:
    short = rolled(casting__length="0.2 m")
    run(short, tmp_path / "short")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "short")]
    run(rolled(casting__length="0.5 m"), tmp_path / "run")
    drawn = {path.name: path for path in draw_figures(tmp_path / "run")}
    assert drawn["roll_to_roll.png"].stat().st_size > 10_000
    bare = rolled(secondary=None, cooling__0__to="0.25 m", casting__length="0.25 m")
    run(bare, tmp_path / "bare")
    assert "roll_to_roll.png" not in [path.name for path in draw_figures(tmp_path / "bare")]


def test_a_face_is_shown_what_it_meets() -> None:
    case = rolled(secondary=secondary(circuit=[circuit(on=["wide_face_intrados"])]))
    assert case.machine is not None
    met = faces_met(case, case.machine.pairs(), 0.65)
    kinds = {name: [stretch.kind for stretch in found] for name, found in met.items()}
    pitch = ["contact", "shade", "spray", "run_off"]
    assert kinds["intrados"] == ["shade", *pitch, *pitch]
    assert kinds["extrados"] == ["shade", "contact", "shade", "contact", "shade"]
    assert set(kinds["narrow face"]) == {"shade"}


def test_straightening_is_shown_close_by() -> None:
    case = load_case(SLAB)
    assert case.machine is not None
    rolls = case.machine.pairs()
    assert rolls is not None
    low, high = close_by(rolls, 0.8, 26.4)
    assert rolls.pairs[47].position < low < rolls.pairs[48].position
    assert rolls.pairs[56].position < high < rolls.pairs[57].position
    low, high = close_by(rolls, 0.8, 10.0)
    assert (low, high) == (pytest.approx(rolls.pairs[27].position), 10.0)
