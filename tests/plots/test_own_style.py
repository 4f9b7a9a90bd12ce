"""Figures are castfem's own: no display and no matplotlibrc of the user reaches them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

from mpi4py import MPI

import numpy as np
import pytest
from PIL import Image
from small_case import small

from castfem.base.errors import RunFailure
from castfem.base.libraries import own_style
from castfem.post.plots import figures
from castfem.post.plots.style import look, new_figure
from castfem.runs import loop

USERS = "text.usetex: True\naxes.facecolor: red\nfont.size: 30\naxes.spines.top: False\n"
DRAW = (
    "import sys\nfrom castfem.post.plots.figures import draw_figures\ndraw_figures(sys.argv[1])\n"
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a run without figures."""
    path = tmp_path_factory.mktemp("run")
    loop.run(small(), path, comm=MPI.COMM_SELF)
    return path


def drawn(folder: Path, copy: Path, **environment: str) -> dict[str, np.ndarray]:
    """The figures of a run as another process draws them."""
    shutil.copytree(folder, copy)
    subprocess.run(
        [sys.executable, "-c", DRAW, str(copy)], env={**os.environ, **environment}, check=True
    )
    found = {p.name: np.asarray(Image.open(p).convert("RGB")) for p in copy.glob("figures/*.png")}
    assert len(found) >= 5
    return found


def test_neither_display_nor_settings_of_the_user_change_a_figure(
    folder: Path, tmp_path: Path
) -> None:
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


@pytest.mark.parametrize("display", ["module://not_in_this_python", "no display"])
def test_a_command_draws_without_a_display(tmp_path: Path, display: str) -> None:
    (tmp_path / "matplotlibrc").write_text(USERS)
    users = {"MPLBACKEND": display, "MATPLOTLIBRC": str(tmp_path / "matplotlibrc")}
    pictures = []
    for name, environment in (("usual", {}), ("users", users)):
        path = tmp_path / f"{name}.png"
        words = ["-m", "castfem.cli", "mesh", "copper200/round", "-o", str(path)]
        subprocess.run([sys.executable, *words], env={**os.environ, **environment}, check=True)
        pictures.append(np.asarray(Image.open(path)))
    assert np.array_equal(*pictures)


def test_the_settings_of_the_user_are_back_afterwards() -> None:
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


def test_a_figure_that_fails_costs_a_warning_and_not_the_others(
    folder: Path, monkeypatch: pytest.MonkeyPatch, told: pytest.LogCaptureFixture
) -> None:
    def fails(*_: object) -> None:
        raise RuntimeError("no glyph\nfor this")

    failing = replace(figures.FIGURES["shell"], draw=fails)
    monkeypatch.setitem(figures.FIGURES, "shell", failing)
    names = {path.name for path in figures.draw_figures(folder)}
    assert "shell.png" not in names and "heat.png" in names
    assert told.messages == ["shell.png could not be drawn (RuntimeError: no glyph)"]


def test_a_disk_that_is_full_is_still_told(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object, **__: object) -> None:
        raise RunFailure("figures/x.png: cannot be written")

    monkeypatch.setattr(figures, "save", full)
    with pytest.raises(RunFailure, match="cannot be written"):
        figures.draw_figures(folder)
