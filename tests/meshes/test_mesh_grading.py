"""One-dimensional grading."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.meshes.grading import LARGEST_GROWTH, SizeLaw, size_law, two_sided

LENGTH = 0.0625


def test_sizes_form_a_geometric_progression() -> None:
    law = size_law(0.5e-3, 5e-3, 0.0, LENGTH)
    sizes = np.diff(law.nodes(LENGTH))
    ratio = sizes[1:] / sizes[:-1]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    assert ratio[0] == pytest.approx(math.exp(4.5 / 62.5), rel=5e-3)
    assert 0.45e-3 < sizes[0] <= 0.5e-3
    assert sizes.sum() == pytest.approx(LENGTH, rel=1e-14)


def test_whole_number_of_cells_starts_exactly_with_the_fine_size() -> None:
    law = SizeLaw(0.001, 1.0, 0.0, math.log(1.2))
    length = 0.001 * (1.2**9 - 1.0) / 0.2
    assert law.count(length) == pytest.approx(9.0, abs=1e-12)
    np.testing.assert_allclose(np.diff(law.nodes(length)), 0.001 * 1.2 ** np.arange(9), rtol=1e-10)


def test_growth_is_limited() -> None:
    law = size_law(0.1e-3, 50e-3, 0.0, 0.01)
    sizes = np.diff(law.nodes(LENGTH))
    assert (sizes[1:] / sizes[:-1]).max() <= LARGEST_GROWTH + 1e-9


def test_fine_size_is_kept_over_its_depth() -> None:
    law = size_law(0.5e-3, 5e-3, 0.01, LENGTH)
    nodes = law.nodes(LENGTH)
    sizes = np.diff(nodes)
    kept = nodes[1:] <= 0.01
    assert kept.sum() >= 19
    np.testing.assert_allclose(sizes[kept], sizes[0], rtol=1e-12)
    assert sizes[0] <= 0.5e-3
    assert np.all(np.diff(sizes) >= -1e-15)


def test_halving_every_size_halves_every_cell() -> None:
    coarse = size_law(1e-3, 8e-3, 0.0, LENGTH)
    fine = size_law(0.5e-3, 4e-3, 0.0, LENGTH)
    assert fine.count(LENGTH) == pytest.approx(2.0 * coarse.count(LENGTH), rel=0.06)
    n = 20
    halves = fine.nodes(LENGTH, 2 * n)
    # The continuous laws are similar, so every second node of the fine grid is a coarse one.
    np.testing.assert_allclose(halves[::2], coarse.nodes(LENGTH, n), atol=0.02 * LENGTH)


def test_lead_grows_from_a_narrow_feature() -> None:
    law = SizeLaw(0.5e-3, 5e-3, 0.0, 0.07, lead=0.05e-3)
    sizes = np.diff(law.nodes(LENGTH))
    assert 0.045e-3 < sizes[0] <= 0.05e-3
    assert (sizes[1:] / sizes[:-1]).max() <= LARGEST_GROWTH + 1e-6
    plain = SizeLaw(0.5e-3, 5e-3, 0.0, 0.07)
    assert 0 < law.count(LENGTH) - plain.count(LENGTH) < 9


@pytest.mark.parametrize("cells", [1, 2, 5, 20, 60, 125, 400])
@pytest.mark.parametrize("keep", [0.0, 0.004])
def test_fitted_law_has_the_count_it_was_fitted_to(cells: int, keep: float) -> None:
    law = SizeLaw(0.5e-3, 5e-3, keep, 0.07)
    fitted = law.fitted(LENGTH, cells)
    nodes = fitted.nodes(LENGTH, cells)
    assert len(nodes) == cells + 1
    assert np.all(np.diff(nodes) > 0.0)
    if 20 <= cells <= 125:
        assert fitted.count(LENGTH) == pytest.approx(cells, abs=1e-6)
        assert nodes[1] == pytest.approx(0.5e-3, rel=0.05)


def test_two_sided_keeps_both_ends() -> None:
    first, last = SizeLaw(1e-3, 1e-2, 0.0, 0.1), SizeLaw(2e-3, 1e-2, 0.0, 0.1)
    sizes = np.diff(two_sided(0.2, first, last))
    assert 0.9e-3 < sizes[0] <= 1.001e-3
    assert 1.8e-3 < sizes[-1] <= 2.002e-3
    assert sizes.max() <= 1.001e-2
    given_count = np.diff(two_sided(0.2, first, last, 50))
    assert len(given_count) == 50
    assert given_count[0] == pytest.approx(1e-3, rel=0.1)


@settings(max_examples=30, deadline=None)
@given(
    fine=st.floats(1e-4, 5e-3),
    ratio=st.floats(1.0, 100.0),
    keep=st.floats(0.0, 0.03),
    length=st.floats(0.01, 1.0),
    lead=st.floats(0.0, 1.0),
)
def test_nodes_ascend_and_respect_the_law(
    fine: float, ratio: float, keep: float, length: float, lead: float
) -> None:
    law = size_law(fine, fine * ratio, keep, keep + 0.05)
    law = SizeLaw(law.fine, law.coarse, law.keep, law.slope, lead * fine if lead > 0.01 else 0.0)
    nodes = law.nodes(length)
    sizes = np.diff(nodes)
    assert nodes[0] == 0.0 and nodes[-1] == length
    assert np.all(sizes > 0.0)
    assert np.all(sizes <= law.size(nodes[1:]) * (1.0 + 1e-6))
    assert len(sizes) == law.cells(length)
