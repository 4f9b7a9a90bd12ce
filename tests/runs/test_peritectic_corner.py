"""The corner of a peritectic billet: one branch, whatever the windows, and no false breakout.

Without the skeleton of the mushy zone the run ends as a breakout 32 mm below the meniscus; with
other windows or tapers its corner goes back to the wall and leaves it again.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

import castfem

if TYPE_CHECKING:
    from pandas import DataFrame

pytestmark = pytest.mark.slow

OPEN = 0.02  # mm
CELLS = {
    "mesh.surface_size": "1.5 mm",
    "mesh.corner_size": "1.5 mm",
    "mesh.face_size": "12 mm",
    "mesh.core_size": "15 mm",
    "casting.length": "60 mm",
    "output.figures": False,
}


def history(**changes: object) -> DataFrame:
    """The billet to 60 mm on coarse cells; keys with __ for the point."""
    keys = {key.replace("__", "."): value for key, value in changes.items()}
    case = castfem.load("billet180/peritectic").with_({**CELLS, **keys})
    with castfem.run(case) as result:
        return result.history


@pytest.fixture(scope="module")
def as_shipped() -> DataFrame:
    return history()


def leaves_once(found: DataFrame) -> bool:
    """Whether the corner is off its wall at the end and has left it once."""
    apart = found["gap_corner"].to_numpy() > OPEN
    return bool(apart[-1]) and np.count_nonzero(np.diff(apart.astype(int))) == 1


def test_the_corner_leaves_its_wall_once(as_shipped: DataFrame) -> None:
    assert leaves_once(as_shipped)


def test_windows_do_not_choose_the_branch(as_shipped: DataFrame) -> None:
    longer = history(coupling__interval="0.2 s")
    for column, off in (("gap_corner", 0.03), ("surface_temperature_corner", 0.002)):
        assert longer[column].iloc[-1] == pytest.approx(as_shipped[column].iloc[-1], rel=off)


def test_more_taper_is_no_breakout_and_less_gap() -> None:
    found = [history(mould__taper=f"{taper} %/m") for taper in (1.0, 1.9)]
    assert all(map(leaves_once, found))
    assert found[0]["gap_corner"].iloc[-1] > found[1]["gap_corner"].iloc[-1]
