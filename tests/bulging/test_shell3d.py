"""Strip and slice against the whole shell in three dimensions, elastic."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.shell3d import Box, row_of, slice_of, solid_of

pytestmark = pytest.mark.slow


def test_a_wide_slab_bulges_as_strip_and_shear() -> None:
    box = Box(1.2, 0.03, 0.5)
    face, undented = solid_of(box)
    assert box.by_shear / box.strip == pytest.approx(8 * 1.2 / 0.7 * (0.03 / 0.5) ** 2, rel=1e-9)
    assert undented == pytest.approx(box.strip + box.by_shear, rel=1e-2)
    assert 0.0 < face.moved[0] - undented < 10e-6  # the roll's dent
    thicker = Box(1.2, 0.06, 0.5)
    found = solid_of(thicker)[1]
    assert found == pytest.approx(thicker.strip + thicker.by_shear, rel=3e-2)
    assert found > 1.15 * thicker.strip


def test_the_slice_knows_of_the_edges_what_the_strip_does_not() -> None:
    row = row_of(Box(0.32, 0.03, 0.25))
    assert row["strip"] > 1.3 * row["solid"]
    assert row["slice"] == pytest.approx(row["solid"], rel=4e-2)
    assert row["off"] < 3.0
    assert row["half_slice"] == pytest.approx(row["half_solid"], abs=3.0)


def test_cells_are_enough() -> None:
    box = Box(0.32, 0.03, 0.25)
    coarse, fine = (solid_of(box, k)[1] for k in (2, 3))
    assert coarse == pytest.approx(fine, rel=5e-3)
    faces = [slice_of(box, k) for k in (2, 3)]
    assert np.interp(0.0, faces[0].x, faces[0].moved) == pytest.approx(faces[1].moved[0], rel=5e-3)
