"""Taper by (300), the mould along its length, and a contracting block inside it.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from castfem.base.tables import Table
from castfem.physics.mould import (
    Circular,
    Displaced,
    Expansion,
    FreeCavity,
    Mould,
    RectangleCavity,
    RoundCavity,
    Straight,
    Taper,
    Tapers,
    TaperSegment,
    same,
    taper_between,
)

W, R, L = 0.125, 0.005, 0.6
BILLET = RectangleCavity(W, W, R)


def moved(positions, closing):
    return Displaced(Table("position", positions, closing))


def mould(*dimensions, cavity=BILLET, length=L, **options):
    tapers = same(dimensions[0]) if len(dimensions) == 1 else Tapers(*dimensions)
    return Mould(cavity, length, tapers, **options)


def face(points=(0.0,), x=0.0625):
    """Return points of the narrow face with their normals."""
    p = np.array([[x, y] for y in points])
    return p, np.tile([1.0, 0.0], (len(p), 1))


def test_tapers_have_the_values_of_the_thesis():
    """(302): 125 to 125.4 mm in 0.6 m; (303): diagonal 172.65 to 172.18 mm in 0.475 m."""
    assert 100 * taper_between(0.125, 0.1254, 0.6) == pytest.approx(-0.53, abs=0.002)
    assert 100 * taper_between(0.17265, 0.17218, 0.475) == pytest.approx(0.57, abs=0.005)


@pytest.mark.parametrize("percent", [3.0, 0.0, -1.0, -10.0])
def test_single_taper_satisfies_300(percent):
    single = mould(Taper.single(percent / 100, L))
    zones = {z.dimension: z for z in single.zones()}
    assert set(zones) == {"width", "height", "diagonal"}
    for zone in zones.values():
        assert 100 * zone.taper == pytest.approx(percent, abs=1e-12)
    out = W / (1 + percent / 100 * L)
    assert zones["width"].outlet == pytest.approx(out, rel=1e-14)
    assert single.dimensions(0.3 * L)["width"] == pytest.approx(W + 0.3 * (out - W), rel=1e-14)
    points, normals = face((0.0, 0.05, -0.03))
    gap = single.gap_function(points, normals, 0.5 * L).gap
    assert gap == pytest.approx(0.25 * (out - W), rel=1e-11, abs=1e-16)


def test_diagonal_of_the_billet_is_that_of_the_thesis():
    assert mould(Taper.single(0.0, L)).dimensions(0.0)["diagonal"] == pytest.approx(
        0.17265, abs=2e-5
    )


def test_triple_taper_holds_in_each_zone():
    tapers = (0.02, 0.008, -0.003)
    ends = (0.2, 0.35, L)
    triple = mould(Taper(tuple(TaperSegment(e, t, t) for e, t in zip(ends, tapers, strict=True))))
    zones = [z for z in triple.zones() if z.dimension == "width"]
    assert [(z.start, z.end) for z in zones] == [(0.0, 0.2), (0.2, 0.35), (0.35, L), (0.0, L)]
    assert [z.taper for z in zones[:3]] == pytest.approx(tapers, rel=1e-12)
    assert zones[3].taper == pytest.approx(taper_between(W, zones[2].outlet, L), rel=1e-12)
    # Continuous, with a kink where the taper changes.
    w = [triple.dimensions(0.2 + d)["width"] for d in (-1e-9, 0.0, 1e-9)]
    assert w[0] > w[1] > w[2] and w[0] - w[2] < 1e-10


def test_parabolic_taper_is_linear_from_top_to_exit():
    top, exit_ = 0.02, 0.004
    parabola = mould(Taper((TaperSegment(L, top, exit_),)))
    zone = next(z for z in parabola.zones() if z.dimension == "width")
    assert zone.taper == pytest.approx(0.5 * (top + exit_), rel=1e-13)
    h = 1e-6
    for z in (0.1, 0.3, 0.5):
        w = [parabola.dimensions(z + d)["width"] for d in (-h, h)]
        local = (w[0] - w[1]) / (2 * h) / zone.outlet
        assert local == pytest.approx(top + (exit_ - top) * z / L, rel=1e-7)


def test_width_and_height_have_separate_tapers():
    """In a slab mould only the narrow faces approach each other."""
    slab = mould(
        Taper.single(0.01, 0.9),
        Taper.single(0.0, 0.9),
        cavity=RectangleCavity(1.3, 0.22, 0.0),
        length=0.9,
    )
    tapers = {z.dimension: z.taper for z in slab.zones()}
    assert tapers["width"] == pytest.approx(0.01, rel=1e-12)
    assert tapers["height"] == 0.0
    points, normals = face((0.1,), 0.65)
    assert slab.gap_function(points, normals, 0.9).gap[0] == pytest.approx(
        0.65 / 1.009 - 0.65, rel=1e-12
    )


def test_separate_corner_taper_curves_the_faces():
    """Ends by the taper of the corner, middle by that of the face, a parabola between them."""
    own = mould(Taper.single(0.01, L), Taper.single(0.01, L), Taper.single(0.03, L))
    tapers = {z.dimension: z.taper for z in own.zones()}
    assert tapers["width"] == pytest.approx(0.01, rel=1e-12)
    assert tapers["diagonal"] == pytest.approx(0.03, rel=1e-12)
    middle, end = 0.0625 / 1.006, 0.0625 / 1.018
    flat = end - R / 1.018
    y = np.array([0.0, 0.3, -0.7, 1.0]) * flat
    points, normals = face(y)
    found = own.gap_function(points, normals, L)
    expected = middle + (end - middle) * (y / flat) ** 2 - 0.0625
    assert found.gap == pytest.approx(expected, rel=1e-10)
    slope = 2 * (end - middle) * y / flat**2
    tilted = np.stack([np.ones_like(y), -slope], axis=1) / np.hypot(1.0, slope)[:, None]
    assert found.normal[:3] == pytest.approx(tilted[:3], abs=1e-12)


def test_equal_tapers_at_face_and_corner_keep_the_faces_plane():
    one = Taper.single(0.02, L)
    assert any(isinstance(s, Straight) for s in mould(one, one, one).contour(L).segments)


def strand(scale, fractions):
    """Return points and normals of a scaled billet: a face, the corner arc, the next face."""
    flat = 0.5 * W - R
    angle = 0.5 * math.pi * fractions
    arc = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    right = np.stack([np.full_like(angle, 0.5 * W), flat * fractions], axis=1)
    points = np.concatenate([right, flat + R * arc, right[:, ::-1]])
    east = np.tile([1.0, 0.0], (len(angle), 1))
    return scale * points, np.concatenate([east, arc, east[:, ::-1]])


def test_gap_of_a_contracting_block_in_a_tapered_mould():
    """Both contract about the centre: flat gaps at the faces, two circles at the corners."""
    taper, pull = 0.01, 0.004
    single = mould(Taper.single(taper, L))
    fractions = np.linspace(0.0, 1.0, 11)
    for z in (0.1, 0.3, L):
        s, e = 1 - taper / (1 + taper * L) * z, 1 - pull * (z / L) ** 2
        points, normals = strand(e, fractions)
        gap = single.gap_function(points, normals, z).gap
        face_gap = 0.5 * W * (s - e)
        # Beyond the end of the plane wall the ray hits the corner of the wall.
        flat = np.array([True] * 10 + [s >= e])
        assert gap[:11][flat] == pytest.approx(face_gap, rel=1e-11, abs=1e-16)
        offset = e * (0.5 * W - R) - s * (0.5 * W - R) + e * R * normals[11:22]
        along = (offset * normals[11:22]).sum(axis=1)
        beside = (offset**2).sum(axis=1) - along**2
        # Distance to the arc of the wall, where the ray hits the arc.
        circle = -along + np.sqrt((s * R) ** 2 - beside)
        assert gap[12:21] == pytest.approx(circle[1:10], rel=1e-9, abs=1e-15)


def test_wall_catches_up_with_the_contracting_block():
    """Contraction by k sqrt(z) and a linear taper are equal where the wall catches up."""
    taper, k = 0.01, 0.006
    single = mould(Taper.single(taper, L))
    points, normals = face((0.01,))

    def gap(z):
        return single.gap_function(points * (1 - k * math.sqrt(z)), normals, z).gap[0]

    caught = (k * (1 + taper * L) / taper) ** 2
    assert 0.0 < caught < L
    low, high = 0.01, L
    assert gap(low) > 0.0 > gap(high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if gap(middle) > 0.0 else (low, middle)
    assert low == pytest.approx(caught, rel=1e-12)


def test_step_in_the_wall_is_a_step_of_the_gap():
    step = mould(moved((0.0, 0.3, 0.3001), (0.0, 0.0, 0.0005)))
    points, normals = face()
    gaps = [step.gap_function(points, normals, z).gap[0] for z in (0.1, 0.3, 0.30005, 0.3001, L)]
    assert gaps == pytest.approx([0.0, 0.0, -0.00025, -0.0005, -0.0005], abs=1e-15)


def test_displacement_counts_from_the_meniscus():
    measured = mould(moved((0.0, L), (0.0002, 0.0005)))
    assert measured.dimensions(0.0)["width"] == W
    assert measured.dimensions(L)["width"] == pytest.approx(W - 2 * 0.0003, rel=1e-14)


def test_taper_of_a_round_mould_is_that_of_its_diameter():
    bloom = mould(Taper.single(0.01, 0.7), cavity=RoundCavity(0.2), length=0.7)
    (zone,) = bloom.zones()
    assert (zone.dimension, zone.taper) == ("diameter", pytest.approx(0.01, rel=1e-12))
    angle = np.linspace(0.0, 2 * math.pi, 33)
    m = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    assert bloom.gap_function(0.1 * m, m, 0.7).gap == pytest.approx(0.1 / 1.007 - 0.1, rel=1e-12)


def test_free_shape_is_mirrored_to_a_closed_contour():
    """A quarter with a concave corner, as of a beam blank: equal gaps in all quadrants."""
    quarter = (
        Straight((0.2, 0.0), (0.2, 0.15)),
        Straight((0.2, 0.15), (0.1, 0.15)),
        Straight((0.1, 0.15), (0.1, 0.08)),
        Circular((0.1, 0.08), (0.07, 0.05), (0.07, 0.08)),
        Straight((0.07, 0.05), (0.0, 0.05)),
    )
    blank = mould(Taper.single(0.01, 0.7), cavity=FreeCavity(quarter, 0.4, 0.3), length=0.7)
    at = np.array([[0.19, 0.1], [0.15, 0.14], [0.11, 0.1], [0.02, 0.04]])
    m = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 1.0]])
    s = 1 / 1.007
    expected = [0.2 * s - 0.19, 0.15 * s - 0.14, 0.11 - 0.1 * s, 0.05 * s - 0.04]
    for flip in ([1, 1], [-1, 1], [1, -1], [-1, -1]):
        gap = blank.gap_function(at * flip, m * np.array(flip, dtype=float), 0.7).gap
        assert gap == pytest.approx(expected, rel=1e-12)
    points = blank.contour(0.0).outline()
    assert np.abs(points).max(axis=0) == pytest.approx([0.2, 0.15])


def test_cold_mould_expands_by_its_temperature():
    temperature = Table("position", (0.0, 0.1, L), (373.15, 493.15, 393.15))
    expansion = Expansion(17e-6, 298.15, temperature)
    cold = mould(Taper.single(0.01, L), expansion=expansion)
    for z in (0.0, 0.1, 0.35, L):
        factor = 1 + 17e-6 * (temperature(z) - 298.15)
        made = cold.dimensions(z, as_made=True)
        for name, size in cold.dimensions(z).items():
            assert size == pytest.approx(made[name] * factor, rel=1e-14)
    assert [z.taper for z in cold.zones(as_made=True)] == pytest.approx([0.01] * 3, rel=1e-12)
    # 75 K more at the meniscus than cold, 95 K at the exit: the working taper is smaller.
    ratio = (1 + 17e-6 * 75) / (1 + 17e-6 * 95)
    assert cold.zones()[0].taper == pytest.approx((1.006 * ratio - 1) / L, rel=1e-12)


def test_below_the_mould_the_gap_is_infinite():
    single = mould(Taper.single(0.01, L))
    points, normals = face()
    assert np.isfinite(single.gap_function(points, normals, L * (1 + 1e-12)).gap).all()
    below = single.gap_function(points, normals, L + 1e-6)
    assert below.gap[0] == math.inf and below.normal == pytest.approx(normals)
    assert single.gap_function(points, normals, -0.1).gap[0] == 0.0


def test_wall_temperature_is_interpolated():
    table = Table("position", (0.1, 0.5), (400.0, 440.0))
    single = mould(Taper.single(0.0, L), wall_temperature=table)
    assert [single.temperature(z) for z in (0.0, 0.2, L)] == pytest.approx([400.0, 410.0, 440.0])
    with pytest.raises(ValueError, match="no wall temperature"):
        mould(Taper.single(0.0, L)).temperature(0.1)


@pytest.mark.parametrize(
    ("build", "words"),
    [
        (lambda: mould(moved((0.0, L), (0.0, 0.07))), "closes: 600 mm below"),
        (lambda: mould(Taper.single(-2.0, L)), "-200 %/m over 0.6 m has no outlet"),
        (lambda: Taper((TaperSegment(0.3, 0, 0), TaperSegment(0.2, 0, 0))), "segment 2"),
        (lambda: moved((0.0, 0.0), (0.0, 1.0)), "must increase"),
        (lambda: Table("position", (0.2, 0.1), (0.0, 1.0)), "must increase"),
    ],
)
def test_invalid_moulds_are_rejected(build, words):
    with pytest.raises(ValueError, match=words):
        build()
