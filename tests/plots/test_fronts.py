"""The curve of a front ends where the pool closes; a front that walks to the middle is kept."""

from __future__ import annotations

import numpy as np
import pandas
import pytest

from castfem.post.plots.along_strand import draw_shell
from castfem.post.plots.history import open_front
from castfem.post.plots.style import Abscissa

NAN = np.nan


@pytest.mark.parametrize(
    ("depth", "shown"),
    [
        ([0, 80, 90, 746, 746, 746], [0, 80, 90, NAN, NAN, NAN]),
        ([NAN, 0, 90, 746, 746], [NAN, 0, 90, NAN, NAN]),
        ([0, 60, 90, 100, 110, 110], [0, 60, 90, 100, 110, 110]),  # it has walked there
        ([0, 0, 0.4], [0, 0, 0.4]),  # the first shell
        ([0, 0, 0], [0, 0, 0]),
        ([NAN, NAN], [NAN, NAN]),
        ([5], [5]),
        ([746, 746], [746, 746]),  # solid all the way: nothing else is to be seen
        ([0, 9, 20, 12, 15], [0, 9, 20, 12, 15]),  # melted again
    ],
)
def test_which_part_is_shown(depth: list[float], shown: list[float]) -> None:
    given = np.array(depth, float)
    np.testing.assert_array_equal(open_front(given), np.array(shown, float))
    np.testing.assert_array_equal(given, np.array(depth, float))


def test_the_axis_is_that_of_the_shell() -> None:
    position = np.linspace(0.0, 20.0, 41)
    shell = np.where(position < 15.0, 6.5 * np.sqrt(10 * position), 746.0)
    table = pandas.DataFrame({"position": position, "shell_narrow_face": shell})
    table.attrs["units"] = {"position": "m", "shell_narrow_face": "mm"}
    figure = draw_shell(table, Abscissa(60 * position, position, ()), None)
    assert figure is not None
    assert 80.0 < figure.axes[0].get_ylim()[1] < 100.0
