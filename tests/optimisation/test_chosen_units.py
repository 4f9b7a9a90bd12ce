"""The answer of a search in the chosen units; its files keep their units."""

from __future__ import annotations

import io
import re

import pytest
from rich.console import Console

from castfem.base.shown_units import ShownUnits, shown_in
from castfem.base.table import say
from castfem.post.compare.optimum_tables import report
from castfem.post.plots import studies as figures
from castfem.studies.optimisation.optimum import (
    ConstraintStatus,
    Front,
    FrontPoint,
    FrontResult,
    Neighbour,
    Optimum,
    ResultWithError,
    Spread,
    SpreadRow,
    Value,
)

TEMPERATURE, SHELL, STRESS = (
    ResultWithError("surface_temperature_corner", "surface, corner", "degC", 1273.15, 0.5, 2.0),
    ResultWithError("shell_mid_face", "shell, mid-face", "mm", 0.0127, 1e-5, 1e-4),
    ResultWithError(
        "von_mises_max", "largest stress at 600 mm", "MPa", 5e6, 1e4, 2e5, ("twin_max", 6e6)
    ),
)
FRONT = Front(
    ("casting.speed [m/min]",),
    FrontResult("von_mises_max", "largest stress", "MPa", 1.0, 1e4),
    FrontResult("shell_mid_face", "shell, mid-face", "mm", -1.0, 1e-5),
    (FrontPoint((2.0,), 5e6, 0.0127, None, "a"), FrontPoint((3.0,), 6e6, 0.0137, 1e9, "b")),
    4,
    exhausted=False,
)
SPREAD = Spread(
    ("superheat",),
    (
        SpreadRow("von_mises_max", (-1.0, 2.0), "MPa", 0.5, None, (1.0,), (1.0,)),
        SpreadRow("corner <= 1010 degC", (-9.0, 18.0), "K", 0.9, 0.5, (1.0,), (1.0,)),
        SpreadRow("casting.speed", (-0.25, 0.5), "m/min", None, None, (1.0,), (1.0,)),
    ),
    7, 0, open=False, derivatives=False,
)  # fmt: skip
ANSWER = Optimum(
    "a billet", "found", "minimise",
    (Value("casting.speed", "m/min", 2.0, 1.9, 2.1, False, False, 2.0, (1.0, 4.0)),),
    STRESS,
    (
        ConstraintStatus("corner <= 1010 degC", TEMPERATURE, 1283.15, 9.0, 7.2, 1.8, True, False),
        ConstraintStatus(
            "shell >= 0.5 inch", SHELL, 0.0127, -2.54e-3, -2.54e-3, 1e-4, False, False
        ),
    ),
    (Neighbour("casting.speed", 2.5, -1e6, (18.0, 5.08e-3)),),
    (), "coarse", "default", 0.1, {"looked_at": 5, "search": 7, "all": 9, "failed": 0}, False, 60.0,
    "best", FRONT, SPREAD,
)  # fmt: skip


def lines(choice: str | dict[str, str]) -> dict[str, list[str]]:
    """Return the printed cells of each line, by its first words."""
    console = Console(file=io.StringIO(), width=200)
    with shown_in(ShownUnits.read(choice)):
        for block in report(ANSWER):
            say(console, block)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    split = [re.split(r"  +", line.strip()) for line in text.splitlines() if line.strip()]
    found = {first: rest for first, *rest in reversed(split)}  # the first of a name
    return found | {"all cells": [cell for one in split for cell in one]}


def test_results_are_printed_in_the_chosen_units() -> None:
    """Temperature differences are scaled without offset; text of the user is unchanged."""
    plant, si = lines("plant"), lines("si")
    own = lines({"length": "inch", "temperature": "degF", "stress": "psi"})
    assert plant["von_mises_max [MPa]"][:3] == ["5", "0.01", "0.2"]
    assert si["von_mises_max [Pa]"][:3] == ["5e+06", "1e+04", "2e+05"]
    corner, shell = "corner <= 1010 degC", "shell >= 0.5 inch"
    assert plant[f"{corner} [degC]"] == ["1000.0", "0.5", "2", "9 ± 1.8", "7.2"]
    assert si[f"{corner} [K]"] == ["1273.2", "0.5", "2", "9 ± 1.8", "7.2"]
    assert own[f"{corner} [degF]"] == ["1832.0", "0.9", "3.6", "16 ± 3.2", "13"]
    assert plant[f"{shell} [mm]"][0] == "12.70" and own[f"{shell} [inch]"][0] == "0.5"
    assert own[f"{shell} [inch]"][3:] == ["-0.1 ± 0.0039", "-0.1", "not met"]
    step = "casting.speed = 2.5 m/min"
    assert (plant[step], own[step]) == (
        ["-1", "18 K", "5.08 mm"],
        ["-145", "32.4 degF", "0.2 inch"],
    )
    assert "minimise largest stress at 0.6 m: found; no constraint binds" in si
    assert "von_mises_max lies 1e+06 Pa below twin_max, its maximum" in si
    # The front, and the spread.
    assert {"shell_mid_face [m]", "price [Pa per m]"} <= set(si["all cells"])
    assert (plant["3"], si["3"]) == (["6", "13.70", "1"], ["6e+06", "0.0137", "1e+09"])
    assert "-16.2 to +32.4" in own["all cells"]


def test_figures_have_the_chosen_units() -> None:
    chosen = ShownUnits.read({"temperature": "degF", "stress": "psi", "length": "inch"})
    with shown_in(chosen):
        drawn = figures.optimum_figure(ANSWER), figures.front_figure(FRONT)
    stress, corner, shell = drawn[0].axes
    assert [" ".join(one.get_ylabel().split()) for one in drawn[0].axes] == [
        f"{ANSWER.objective.label} [psi]", f"{TEMPERATURE.label} below its bound [degF]",
        f"{SHELL.label} above its bound [inch]",
    ]  # fmt: skip
    assert shell.get_xlabel() == "casting.speed [m/min]"
    assert stress.lines[1].get_ydata() == pytest.approx([725.19, 580.15], rel=1e-4)
    assert corner.lines[1].get_ydata() == pytest.approx([16.2, 32.4])
    assert shell.lines[1].get_ydata() == pytest.approx([-0.1, 0.2])
    assert drawn[1].axes[0].lines[0].get_ydata() == pytest.approx([725.19, 870.23], rel=1e-4)
    assert drawn[1].axes[-1].get_xlabel() == f"{FRONT.second.label} [inch]"


def test_files_keep_their_units() -> None:
    plain = ANSWER.to_json()
    with shown_in(ShownUnits.read("si")):
        assert ANSWER.to_json() == plain
