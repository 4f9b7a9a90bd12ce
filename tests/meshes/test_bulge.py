"""Rectangles whose outline stands out from themselves."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.meshes import build
from castfem.meshes.bulge import normals_round, ways_round

A, B, R = 0.0625, 0.05, 0.005
SIZES = {"surface_size": 0.002, "core_size": 0.01}
SECTION = {"width": 2 * A, "height": 2 * B, "corner_radius": R}
ARC = 0.5 * np.pi * R
TABLE = ([0.0, 0.045, 0.045 + ARC, 0.045 + ARC + 0.0575], [1e-4, -2e-4, -2e-4, 3e-4])


def off(points):
    """How far points on the surface stand out from the rectangle, and their way."""
    q = np.abs(points)
    ways = ways_round(q, A, B, R)
    normal = normals_round(ways, B, R)
    centre = np.array([A - R, B - R])
    base = centre + R * normal
    right, upper = ways <= B - R, ways >= B - R + ARC
    base[right] = np.stack([np.full(right.sum(), A), q[right, 1]], 1)
    base[upper] = np.stack([q[upper, 0], np.full(upper.sum(), B)], 1)
    return ((q - base) * normal).sum(axis=1), ways


@pytest.mark.parametrize("symmetry", ["quarter", "half", "whole"])
@pytest.mark.parametrize(("cell", "order"), [("quadrilateral", 2), ("triangle", 1)])
def test_outline_has_the_offsets(symmetry, cell, order):
    parts = {"cell": cell, "order": order, "symmetry": symmetry}
    plain = build("rectangle", **SECTION, **SIZES, **parts)
    mesh = build("rectangle", **SECTION, **SIZES, **parts, bulge=TABLE)
    surface = np.unique(
        mesh.facets[[mesh.groups[g] in mesh.outer_groups for g in mesh.facet_group]]
    )
    found, ways = off(mesh.points[surface])
    assert found == pytest.approx(np.interp(ways, *TABLE), abs=1e-9)
    assert np.array_equal(plain.cells, mesh.cells)
    moved = mesh.points - plain.points
    assert np.abs(moved).max() <= 3.01e-4
    for axis in (0, 1):
        on_axis = np.abs(plain.points[:, axis]) < 1e-12
        assert np.all(moved[on_axis, axis] == 0.0)
    quality = mesh.quality()
    assert quality.min_jacobian_ratio > 0.5 * plain.quality().min_jacobian_ratio
    assert abs(quality.area_error) == pytest.approx(abs(plain.quality().area_error), abs=1e-9)


def test_uniform_bulge_is_the_larger_rectangle():
    mesh = build("rectangle", **SECTION, **SIZES, order=2, bulge=([0.0], [1e-3]))
    area = 4 * (A + 1e-3) * (B + 1e-3) - (4 - np.pi) * (R + 1e-3) ** 2
    assert 4.0 * mesh.exact_area == pytest.approx(area, rel=1e-6)
    assert mesh.probes["mid_face"][0] == pytest.approx([0.0, B + 1e-3])
    assert mesh.probes["narrow_face"][0] == pytest.approx([A + 1e-3, 0.0])
    corner = np.array([A, B]) - R + (R + 1e-3) * np.sqrt(0.5)
    assert mesh.probes["corner"][0] == pytest.approx(corner, abs=2e-5)


def test_sharp_corner_and_its_ways():
    mesh = build("rectangle", width=0.1, height=0.1, **SIZES, bulge=([0.0], [5e-4]))
    assert np.abs(mesh.points).max(axis=0) == pytest.approx([0.0505, 0.0505], abs=1e-9)
    points = np.array([[A, 0.0], [A, B - R], [A - R, B], [0.0, B], [-A, -0.01]])
    wanted = [0.0, B - R, B - R + ARC, B - R + ARC + A - R, 0.01]
    assert ways_round(points, A, B, R) == pytest.approx(wanted)


def test_too_large_a_bulge_is_refused():
    with pytest.raises(ValueError, match=r"bulge is 20 mm somewhere; allowed: at most 10 mm"):
        build("rectangle", **SECTION, **SIZES, bulge=([0.0], [0.02]))
