"""Every section with each cell shape, order and symmetry."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from castfem.meshes import SectionMesh, build
from castfem.meshes.quality import pair_up

from .sections import BEAM, BILLET, FAMILIES, ROUND, ROUNDED, SLAB, STRIP

_built: dict[str, SectionMesh] = {}


def built(**parameters: Any) -> SectionMesh:
    return _built.setdefault(repr(sorted(parameters.items())), build(**parameters))


def exact_area(name: str) -> float:
    """Return the area of the full section in closed form."""
    p = FAMILIES[name]
    if name == "round":
        return math.pi * p["diameter"] ** 2 / 4.0
    if name != "beam":
        return p["width"] * p["height"] - (4.0 - math.pi) * p.get("corner_radius", 0.0) ** 2
    c, b = 0.5 * p["web_thickness"], 0.5 * p["height"]
    tip, root = p["flange_thickness"], p["root_thickness"]
    quarter = 0.5 * p["width"] * c + 0.5 * (tip + root) * (b - c)
    # A fillet between straight lines at an angle t removes or adds r^2 (tan(t/2) - t/2).
    turn = math.atan2(b - c, root - tip)
    for radius, t, sign in (
        (p["corner_radius"], math.pi / 2.0, -1.0),
        (p["shoulder_radius"], turn, -1.0),
        (p["fillet_radius"], turn, 1.0),
    ):
        quarter += sign * radius**2 * (math.tan(t / 2.0) - t / 2.0)
    return 4.0 * quarter


# Pairwise combinations of families, cell shapes and orders.
CASES = [
    (name, cell, 1 + (i + j) % 2)
    for i, name in enumerate(FAMILIES)
    for j, cell in enumerate(("quadrilateral", "triangle"))
]


@pytest.fixture(scope="module", params=CASES, ids=lambda case: "-".join(map(str, case)))
def case(request: pytest.FixtureRequest) -> tuple[str, str, int]:
    """Return family, cell and order; the tests of each case run in sequence and share meshes."""
    return request.param  # type: ignore[no-any-return]


def test_area_is_exact_up_to_the_arcs(case: tuple[str, str, int]) -> None:
    name, cell, order = case
    mesh = built(**FAMILIES[name], cell=cell, order=order)
    q = mesh.quality()
    assert mesh.multiplicity * mesh.exact_area == pytest.approx(exact_area(name), rel=1e-13)
    assert q.exact_area == mesh.exact_area
    if name == "sharp":
        assert abs(q.area_error) < 1e-13
    elif order == 1:
        assert 1e-7 < abs(q.area_error) < 2e-3
    else:
        assert abs(q.area_error) < 2e-6


def test_mirrored_quarter_is_half_and_full_section(case: tuple[str, str, int]) -> None:
    name, cell, order = case
    quarter, half, full = (
        built(**FAMILIES[name], cell=cell, order=order, symmetry=s)
        for s in ("quarter", "half", "whole")
    )
    assert (quarter.multiplicity, half.multiplicity, full.multiplicity) == (4, 2, 1)
    area = quarter.quality().area
    assert half.quality().area == pytest.approx(2.0 * area, rel=1e-13)
    assert full.quality().area == pytest.approx(4.0 * area, rel=1e-13)
    assert len(full.cells) == 2 * len(half.cells) == 4 * len(quarter.cells)
    on_x, on_y = (np.count_nonzero(quarter.points[:, k] == 0.0) for k in (0, 1))
    assert len(half.points) == 2 * len(quarter.points) - on_y
    assert len(full.points) == 4 * len(quarter.points) - 2 * on_y - 2 * on_x + 1
    assert half.points[:, 0].min() == 0.0
    np.testing.assert_allclose(full.points.mean(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("symmetry", ["quarter", "half", "whole"])
def test_boundary_is_closed_oriented_and_grouped(case: tuple[str, str, int], symmetry: str) -> None:
    name, cell, order = case
    mesh = built(**FAMILIES[name], cell=cell, order=order, symmetry=symmetry)
    _, boundary, sides = pair_up(mesh.vertices, cell)
    facets = {tuple(f) for f in mesh.facets.tolist()}
    assert facets == {tuple(s) for s in sides[boundary].tolist()}  # oriented as by their cells
    assert len(mesh.facet_group) == len(mesh.facets)
    assert set(mesh.facet_group.tolist()) == set(range(len(mesh.groups)))
    assert len(set(mesh.groups)) == len(mesh.groups)
    outline = mesh.outline()
    assert {run for run, _ in outline} == set(mesh.groups)
    loop = np.concatenate([line[:-1] for _, line in outline])
    per_facet = 2 if order == 2 else 1
    assert len(loop) == per_facet * len(mesh.facets)
    for (_, line), (_, after) in zip(outline, outline[1:] + outline[:1], strict=True):
        np.testing.assert_array_equal(line[-1], after[0])
    x, y = loop.T
    enclosed = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
    assert enclosed == pytest.approx(mesh.exact_area, rel=3e-3)


def test_groups_have_their_names() -> None:
    quarter = {"wide_face", "narrow_face", "corner", "symmetry_x", "symmetry_y"}
    assert set(built(**ROUNDED).groups) == quarter
    assert set(built(**BILLET).groups) == quarter - {"corner"}
    half = built(**ROUNDED, symmetry="half")
    assert set(half.groups) == {
        "wide_face_intrados", "wide_face_extrados", "narrow_face",
        "corner_intrados", "corner_extrados", "symmetry_x",
    }  # fmt: skip
    assert set(half.outer_groups) == set(half.groups) - {"symmetry_x"}
    whole = set(built(**ROUNDED, symmetry="whole").groups)
    sides = itertools.product(("intrados", "extrados"), ("left", "right"))
    assert whole == {
        "wide_face_intrados", "wide_face_extrados", "narrow_face_left", "narrow_face_right",
        *(f"corner_{y}_{x}" for y, x in sides),
    }  # fmt: skip
    assert set(built(**ROUND, symmetry="half").outer_groups) == {
        "surface_intrados",
        "surface_extrados",
    }
    assert set(built(**BEAM).outer_groups) == {
        "narrow_face", "corner", "tip", "shoulder", "flank", "fillet", "web",
    }  # fmt: skip


def test_groups_are_at_the_sides_of_their_names() -> None:
    mesh = built(**ROUNDED, symmetry="whole", order=2)
    a, r = 0.0625, 0.005
    for name, line in mesh.outline():
        x, y = line.T
        if name.startswith("wide_face"):
            np.testing.assert_allclose(y, a if name.endswith("intrados") else -a, rtol=1e-14)
        elif name.startswith("narrow_face"):
            np.testing.assert_allclose(x, a if name.endswith("right") else -a, rtol=1e-14)
        else:
            np.testing.assert_allclose(np.hypot(abs(x) - a + r, abs(y) - a + r), r, rtol=1e-12)
            assert np.all((y > 0.0) == ("intrados" in name))
            assert np.all((x > 0.0) == name.endswith("right"))


def test_probes_have_their_positions() -> None:
    mesh = built(**SLAB, symmetry="half")
    a, b, r = 0.3, 0.11, 0.004
    d = r * (1.0 - math.sqrt(0.5))
    expected = {
        "mid_face": ((0.0, b), (0.0, 0.0)),
        "mid_face_extrados": ((0.0, -b), (0.0, 0.0)),
        "narrow_face": ((a, 0.0), (0.0, 0.0)),
        "corner": ((a - d, b - d), (a - b, 0.0)),
        "corner_extrados": ((a - d, d - b), (a - b, 0.0)),
    }
    assert set(mesh.probes) == set(expected)
    for name, ends in expected.items():
        np.testing.assert_allclose(mesh.probes[name], ends, atol=1e-15)
    assert set(built(**BILLET).probes) == {"mid_face", "narrow_face", "corner"}
    np.testing.assert_allclose(built(**BILLET).probes["corner"], [[0.0625] * 2, [0.0] * 2])


@pytest.mark.parametrize("name", FAMILIES)
def test_probes_start_on_the_surface_and_stay_inside(name: str) -> None:
    mesh = built(**FAMILIES[name], order=2, symmetry="whole")
    loop = np.concatenate([line[:-1] for _, line in mesh.outline()])
    for start, end in mesh.probes.values():
        assert np.hypot(*(loop - start).T).min() < 0.006  # within a facet
        assert np.hypot(*(end - start)) > 0.02
        for share in (0.01, 0.5, 0.99):
            p = loop - (start + share * (end - start))
            q = np.roll(p, -1, axis=0)
            turn = np.arctan2(p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0], (p * q).sum(axis=1))
            assert turn.sum() == pytest.approx(2.0 * math.pi)


def test_equal_parameters_give_identical_meshes(case: tuple[str, str, int]) -> None:
    name, cell, order = case
    first = built(**FAMILIES[name], cell=cell, order=order)
    again = build(**FAMILIES[name], cell=cell, order=order)
    for field in ("points", "cells", "facets", "facet_group"):
        assert getattr(first, field).tobytes() == getattr(again, field).tobytes()


def test_sharp_corner_gives_a_grid_of_rectangles() -> None:
    mesh = built(**BILLET, symmetry="whole")
    q = mesh.quality()
    assert q.min_angle == pytest.approx(90.0, abs=1e-9) == q.max_angle
    assert q.min_cotangent == 0.0
    assert q.max_growth < 1.15
    x, y = (np.unique(mesh.points[:, k].round(12)) for k in (0, 1))
    assert len(mesh.points) == len(x) * len(y)
    assert 0.9e-3 < x[-1] - x[-2] <= 1e-3


def test_sharp_triangles_give_an_m_matrix_and_split_the_corner() -> None:
    mesh = built(**BILLET, cell="triangle")
    q = mesh.quality()
    assert q.min_cotangent > -1e-12
    assert q.max_angle == pytest.approx(90.0, abs=1e-9)
    corner = np.flatnonzero(np.all(mesh.points == 0.0625, axis=1))
    assert np.count_nonzero(mesh.cells == corner) == 2


@pytest.mark.parametrize(
    ("parameters", "growth", "scaled"),
    [
        (ROUNDED, 1.3, 0.75),
        (ROUNDED | {"surface_size": 0.25e-3, "corner_size": 0.25e-3}, 1.3, 0.75),
        (ROUNDED | {"surface_size": 0.1e-3}, 1.5, 0.75),
        (SLAB, 1.4, 0.75),
        (ROUND, 1.3, 0.75),
        (BEAM, 1.6, 0.7),
    ],
)
def test_structured_cells_have_good_shapes(
    parameters: dict[str, Any], growth: float, scaled: float
) -> None:
    q = built(**parameters).quality()
    assert q.max_growth < growth
    assert q.min_scaled_jacobian > scaled
    assert q.max_angle < 135.0


@pytest.mark.parametrize(("h", "slant"), [(1e-3, 0.3), (0.25e-3, 0.1)])
def test_layers_have_the_surface_size_also_on_the_arc(h: float, slant: float) -> None:
    mesh = built(**ROUNDED | {"surface_size": h, "corner_size": h})
    outer = [i for i, g in enumerate(mesh.groups) if g in mesh.outer_groups]
    surface = {tuple(sorted(f)) for f in mesh.facets[np.isin(mesh.facet_group, outer)].tolist()}
    thickness, straightness = [], []
    for nodes in mesh.cells:
        for a, b, c, d in ((0, 1, 3, 2), (1, 3, 2, 0), (3, 2, 0, 1), (2, 0, 1, 3)):
            if tuple(sorted((int(nodes[a]), int(nodes[b])))) not in surface:
                continue
            pa, pb, pc, pd = (mesh.points[nodes[k]] for k in (a, b, c, d))
            along, up = pb - pa, 0.5 * (pc + pd) - 0.5 * (pa + pb)
            straightness.append(abs(along @ up) / np.hypot(*along) / np.hypot(*up))
            thickness.append(abs(along[0] * up[1] - along[1] * up[0]) / np.hypot(*along))
    assert len(thickness) == len(surface)
    assert max(thickness) <= h * 1.001
    assert min(thickness) > 0.55 * h  # on the bisector, where the layers are thinnest
    assert max(straightness) < slant  # the lines are almost normal to the surface


def test_strip_has_its_groups_and_sizes() -> None:
    mesh = built(**STRIP)
    assert set(mesh.groups) == {"surface", "core_end", "side_low", "side_high"}
    assert mesh.outer_groups == ("surface",)
    assert mesh.multiplicity == 1
    np.testing.assert_array_equal(mesh.probes["mid_face"], [[0.0, 0.005], [0.1, 0.005]])
    x = np.unique(mesh.points[:, 0])
    assert len(mesh.points) == 2 * len(x)
    assert np.diff(x)[0] <= 1e-3 and np.diff(x)[-1] <= 4e-3
    uniform = build(shape="strip", length=0.1, width=0.01, surface_size=0.001, face_size=0.004)
    assert len(uniform.cells) == 100 * 3
    for name, line in uniform.outline():
        axis, value = {
            "surface": (0, 0.0), "core_end": (0, 0.1), "side_low": (1, 0.0), "side_high": (1, 0.01),
        }[name]  # fmt: skip
        np.testing.assert_array_equal(line[:, axis], value)
    assert build(**STRIP, cell="triangle").quality().min_cotangent > -1e-12


def test_full_radius_makes_a_disc() -> None:
    mesh = build(**BILLET | {"corner_radius": 0.0625, "corner_size": 0.004}, order=2)
    assert set(mesh.groups) == {"corner", "symmetry_x", "symmetry_y"}
    assert mesh.exact_area == pytest.approx(math.pi * 0.0625**2 / 4.0, rel=1e-14)


@settings(max_examples=12, deadline=None, derandomize=True)
@given(
    width=st.floats(0.08, 0.8),
    height=st.floats(0.08, 0.4),
    radius=st.sampled_from([0.0, 0.02, 0.1, 0.3, 1.0]),
    surface=st.floats(2e-3, 5e-3),
    corner=st.floats(0.5, 2.0),
    coarse=st.floats(2.0, 6.0),
    depth=st.sampled_from([0.0, 6e-3]),
    order=st.sampled_from([1, 2]),
)
def test_any_sane_rectangle_is_meshed(
    width: float,
    height: float,
    radius: float,
    surface: float,
    corner: float,
    coarse: float,
    depth: float,
    order: int,
) -> None:
    mesh = build(
        "rectangle",
        width=width,
        height=height,
        corner_radius=radius * 0.4 * min(width, height),
        surface_size=surface,
        corner_size=corner * surface,
        face_size=coarse * surface,
        core_size=coarse * surface,
        surface_depth=depth,
        order=order,
    )
    q = mesh.quality()
    # Chords or parabolas instead of arcs at the four corners; cells are up to a tenth larger.
    r = radius * 0.4 * min(width, height)
    angle = min(1.1 * corner * surface / r, math.pi / 2.0) if r else 1.0
    segment, half = 0.5 * (angle - math.sin(angle)), 0.5 * angle
    parabola = 4.0 / 3.0 * math.sin(half) * (1.0 - math.cos(half)) if order == 2 else 0.0
    missing = 4.0 * (math.pi / 2.0 / angle) * r**2 * abs(segment - parabola)
    assert abs(q.area_error) < missing / (width * height) + 1e-12
    assert q.min_jacobian_ratio > 0.0
    assert q.min_scaled_jacobian > 0.4
    if radius == 0.0:
        assert q.max_growth < 1.32


@settings(max_examples=3, deadline=None, derandomize=True)
@given(
    scale=st.floats(0.7, 1.6),
    web=st.floats(0.2, 0.35),
    slope=st.floats(1.0, 1.35),
    shoulder=st.floats(0.01, 0.03),
    corner=st.floats(0.01, 0.03),
    cell=st.sampled_from(["quadrilateral", "triangle"]),
)
def test_any_sane_beam_blank_is_meshed(
    scale: float, web: float, slope: float, shoulder: float, corner: float, cell: str
) -> None:
    parameters = BEAM | {
        "width": 0.48 * scale,
        "height": 0.42 * scale,
        "web_thickness": 0.42 * scale * web,
        "flange_thickness": 0.09 * scale,
        "root_thickness": 0.09 * scale * slope,
        "fillet_radius": 0.04 * scale,
        "shoulder_radius": shoulder * scale,
        "corner_radius": corner * scale,
    }
    q = build(**parameters, cell=cell, order=2).quality()
    assert abs(q.area_error) < 1e-5
    assert q.min_scaled_jacobian > 0.4


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize(("size", "symmetry"), [(1.6e-3, "quarter"), (3e-3, "whole")])
def test_probe_starts_on_straight_cells_of_an_arc(cell: str, size: float, symmetry: str) -> None:
    """The apex of a round corner may lie off the vertices; the probe starts on the chord."""
    sizes = {"surface_size": size, "corner_size": size, "face_size": 12e-3, "core_size": 16e-3}
    section = {"shape": "rectangle", "width": 0.125, "height": 0.125, "corner_radius": 5e-3}
    mesh = build(**section, **sizes, cell=cell, symmetry=symmetry)
    ends = mesh.points[mesh.facets[:, :2]]
    curved = build(**section, **sizes, cell=cell, symmetry=symmetry, order=2).probes
    for name, (start, end) in mesh.probes.items():
        sides = ends[:, 1] - ends[:, 0]
        share = ((start - ends[:, 0]) * sides).sum(axis=1) / (sides**2).sum(axis=1)
        nearest = ends[:, 0] + np.clip(share, 0.0, 1.0)[:, None] * sides
        assert np.hypot(*(nearest - start).T).min() < 1e-12, name
        (x, y), (along_x, along_y) = curved[name][0] - start, end - start
        assert math.hypot(x, y) < 1.2 * size**2 / (8 * 5e-3)  # at most the height of the arc
        assert abs(x * along_y - y * along_x) < 1e-12  # on the same line


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_probes_of_a_beam_blank_have_equal_starts(cell: str) -> None:
    """Only the arc of the probe counts, though the line of a corner also crosses the fillet."""
    straight, curved = (built(**BEAM, cell=cell, order=o).probes for o in (1, 2))
    for name, (start, _) in straight.items():
        assert np.linalg.norm(start - curved[name][0]) < 1e-3, name
