"""Legends are within their panel and hide no curve; figures of new columns."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pandas
import pytest
from PIL import Image
from small_case import small

from castfem.base.errors import RunFailure
from castfem.base.libraries import own_style
from castfem.post.plots import figures
from castfem.post.plots.along_strand import draw_contact, draw_shell
from castfem.post.plots.history import place_legend
from castfem.post.plots.style import Abscissa, look, new_figure, new_panels
from castfem.runs import loop

X = np.linspace(0.0, 1.0, 51)
LONG = "mid-face, narrow face and mid-face extrados, solidus (shell)"
CURVES = {
    "rising": [X, 0.5 * X],
    "falling": [1.0 - X, 0.5 - 0.5 * X],
    "everywhere": [0.5 + 0.5 * np.sin(40.0 * X), X, 1.0 - X],
    "levels": [np.full(51, level) for level in (0.05, 0.3, 0.6, 0.95)],
    "gaps": [np.where(X < 0.5, np.nan, X), X**4],
    "steep": [np.where(X < 0.02, 1.0, 0.01)],
}


@pytest.mark.parametrize("label", ["corner", LONG])
@pytest.mark.parametrize("name", CURVES)
def test_legend_hides_no_curve(name: str, label: str) -> None:
    figure, (panel,) = new_panels(1, 2.0)
    for number, y in enumerate(CURVES[name]):
        panel.plot(X, y, label=f"{label} {number}")
    panel.set_xlim(0.0, 1.0)
    place_legend(panel)
    figure.canvas.draw()
    legend = panel.get_legend()
    box, around = legend.get_window_extent(), panel.get_window_extent()
    assert box.x0 >= around.x0 and box.x1 <= around.x1 and box.y1 <= around.y1
    for line in panel.lines:
        path = line.get_transform().transform(np.asarray(line.get_xydata(), float))
        fine = np.linspace(path[0, 0], path[-1, 0], 2000)
        y = np.interp(fine, *path.T)
        inside = (fine > box.x0) & (fine < box.x1) & (y > box.y0) & (y < box.y1)
        assert not inside.any()


def _table(columns: dict[str, tuple[str, np.ndarray]]) -> pandas.DataFrame:
    table = pandas.DataFrame({name: values for name, (_, values) in columns.items()})
    table.attrs["units"] = {name: unit for name, (unit, _) in columns.items()}
    return table


def test_band_of_the_cells_is_only_that_of_the_solidus() -> None:
    columns = {
        "shell_corner": ("mm", 40.0 * X),
        "liquidus_depth_corner": ("mm", 60.0 * X),
        "solidus_cell_corner": ("mm", np.full(51, 4.2)),
    }
    abscissa = Abscissa(10.0 * X, X)
    figure = draw_shell(_table(columns), abscissa, None)
    (band,) = figure.axes[0].collections
    corners = band.get_paths()[0].vertices
    at_end = corners[np.isclose(corners[:, 0], 1e3), 1]
    assert (at_end.min(), at_end.max()) == pytest.approx((39.3, 40.7))
    del columns["solidus_cell_corner"]  # of an older run
    figure = draw_shell(_table(columns), abscissa, None)
    assert figure is not None and not figure.axes[0].collections


def test_friction_of_the_strand_and_mean_pressure_are_drawn() -> None:
    columns = {
        "contact_pressure_corner": ("MPa", X),
        "mean_contact_pressure_max": ("MPa", 2.0 * X),
        "contact_pressure_max": ("MPa", 5.0 * X),
        "contact_share": ("percent", 100.0 - X),
        "friction_force": ("kN/m", -X),
        "mould_friction": ("kN/m", 4.0 * X),
    }
    abscissa = Abscissa(10.0 * X, X)
    figure = draw_contact(_table(columns), abscissa, None)
    pressure, share, friction = figure.axes
    assert [line.get_label() for line in pressure.lines] == [
        "corner",
        "largest anywhere, over 5 mm",
    ]
    assert np.nanmax(pressure.lines[-1].get_ydata()) == 2.0
    assert np.nanmin(share.lines[0].get_ydata()) == 99.0
    assert friction.get_ylabel() == "friction force,\nwhole strand [kN/m]"
    assert np.nanmax(friction.lines[0].get_ydata()) == 4.0
    older = _table({"contact_share": ("-", 1.0 - 0.01 * X), "friction_force": ("kN/m", -X)})
    figure = draw_contact(older, abscissa, None)
    share, friction = figure.axes
    assert np.nanmin(share.lines[0].get_ydata()) == 99.0
    assert "modelled part" in friction.get_ylabel()


# Figures are castfem's own: independent of display and matplotlibrc of the user


USERS = "text.usetex: True\naxes.facecolor: red\nfont.size: 30\naxes.spines.top: False\n"
DRAW = (
    "import sys\nfrom castfem.post.plots.figures import draw_figures\ndraw_figures(sys.argv[1])\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run without figures."""
    path = tmp_path_factory.mktemp("run")
    loop.run(small(), path, comm=MPI.COMM_SELF)
    return path


def drawn(folder: Path, copy: Path, **environment: str) -> dict[str, np.ndarray]:
    """Return the figures of a run, drawn by another process."""
    shutil.copytree(folder, copy)
    subprocess.run(
        [sys.executable, "-c", DRAW, str(copy)], env={**os.environ, **environment}, check=True
    )
    found = {p.name: np.asarray(Image.open(p).convert("RGB")) for p in copy.glob("figures/*.png")}
    assert len(found) >= 5
    return found


def test_display_and_user_settings_change_no_figure(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text(USERS)
    usual = drawn(folder, tmp_path / "usual")
    found = drawn(
        folder,
        tmp_path / "users",
        MPLBACKEND="module://matplotlib_inline.backend_inline",
        MATPLOTLIBRC=str(tmp_path / "matplotlibrc"),
    )
    assert found.keys() == usual.keys()
    for name, picture in usual.items():
        assert np.array_equal(found[name], picture), name


def mesh_of_a_round(folder: Path, **environment: str) -> np.ndarray:
    """Return the picture of a mesh, drawn by another process."""
    path = folder / "mesh.png"
    words = ["-m", "castfem.cli", "mesh", "copper200/round", "-o", str(path)]
    subprocess.run([sys.executable, *words], env={**os.environ, **environment}, check=True)
    return np.asarray(Image.open(path))


@pytest.fixture(scope="module")
def usual_mesh(tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    return mesh_of_a_round(tmp_path_factory.mktemp("usual"))


@pytest.mark.parametrize("display", ["module://not_in_this_python", "no display"])
def test_command_draws_without_a_display(
    tmp_path: Path, display: str, usual_mesh: np.ndarray
) -> None:
    (tmp_path / "matplotlibrc").write_text(USERS)
    users = {"MPLBACKEND": display, "MATPLOTLIBRC": str(tmp_path / "matplotlibrc")}
    assert np.array_equal(usual_mesh, mesh_of_a_round(tmp_path, **users))


def test_user_settings_are_restored() -> None:
    import matplotlib

    with matplotlib.rc_context({"font.size": 30.0, "text.usetex": True}):
        with own_style({"axes.grid": True}):
            inside = dict(matplotlib.rcParams)
        assert (inside["font.size"], inside["text.usetex"], inside["axes.grid"]) == (
            10,
            False,
            True,
        )
        assert matplotlib.rcParams["font.size"] == 30 and matplotlib.rcParams["text.usetex"]
        with look():
            axes = new_figure(3.0, 2.0).subplots()
        assert axes.xaxis.label.get_fontsize() == 9.5 and not axes.title.get_usetex()


def test_failing_figure_gives_only_a_warning(
    folder: Path, monkeypatch: pytest.MonkeyPatch, told: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("no glyph\nfor this")

    failing = replace(figures.FIGURES["shell"], draw=fails)
    monkeypatch.setitem(figures.FIGURES, "shell", failing)
    names = {path.name for path in figures.draw_figures(folder)}
    assert "shell.png" not in names and "heat.png" in names
    assert told.messages == ["shell.png could not be drawn (RuntimeError: no glyph)"]


def test_full_disk_is_still_reported(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise RunFailure("figures/x.png: cannot be written")

    monkeypatch.setattr(figures, "save", full)
    with pytest.raises(RunFailure, match="cannot be written"):
        figures.draw_figures(folder)
