"""Beam blanks: a web between two flanges whose inner flanks slope.

The quarter is bounded, counter-clockwise from y = 0, by the outer face of the flange
(`narrow_face`), the outer corner (`corner`), the flange's tip (`tip`), the inner corner
(`shoulder`), the sloped flank (`flank`), the concave `fillet` and the `web`.
"""

from __future__ import annotations

import math

import numpy as np

from castfem.meshes.assemble import MULTIPLICITY, Probe, assemble
from castfem.meshes.beam_blocks import beam_quarter
from castfem.meshes.outline import Piece, Point, quarter
from castfem.meshes.rectangle import isotropic, quad_grading
from castfem.meshes.section_mesh import SectionMesh
from castfem.meshes.sizes import check_choices, check_length, check_radius, check_sizes


def beam_blank(
    *,
    width: float,
    height: float,
    web_thickness: float,
    flange_thickness: float,
    root_thickness: float,
    fillet_radius: float,
    shoulder_radius: float,
    corner_radius: float,
    symmetry: str = "quarter",
    cell: str = "quadrilateral",
    order: int = 1,
    **sizes: float,
) -> SectionMesh:
    """Mesh a beam blank.

    Args:
        width: Overall width over the outer faces of the flanges (x), m.
        height: Height of the flanges from tip to tip (y), m.
        web_thickness: Thickness of the web (y), m.
        flange_thickness: Thickness of a flange at its tip (x), the flank drawn through, m.
        root_thickness: Thickness of a flange at the surface of the web (x), m.
        fillet_radius: Radius between web and flank (concave), m.
        shoulder_radius: Radius between flank and tip (convex), m.
        corner_radius: Radius between tip and outer face (convex), m.
        symmetry: "quarter", "half" or "whole".
        cell: "quadrilateral" or "triangle".
        order: 1 or 2.
        **sizes: Those of `Sizes`, m; surface_size and core_size must be given. corner_size holds
            on shoulder and corner, core_depth is by default half the thickness of the web.

    Raises:
        ValueError: A parameter is impossible; the message names it.
    """
    check_choices(cell, order, symmetry)
    a, b = 0.5 * check_length("width", width), 0.5 * check_length("height", height)
    c = 0.5 * check_length("web_thickness", web_thickness, height, "the height")
    check_length("root_thickness", root_thickness, a, "half the width")
    check_length("flange_thickness", flange_thickness, root_thickness, "root_thickness")
    radii = (
        check_radius("fillet_radius", fillet_radius),
        check_radius("shoulder_radius", shoulder_radius),
        check_radius("corner_radius", corner_radius),
    )
    faces = surface_pieces((a, b, c), flange_thickness, root_thickness, radii)
    checked = check_sizes(min(c, 0.5 * flange_thickness), max(a, b), **{"core_depth": c, **sizes})
    outline = quarter(faces)
    quarters = 4 // MULTIPLICITY[symmetry]
    if cell == "triangle":
        points, cells = isotropic(outline, checked, (faces[1], faces[3]), quarters)
    else:
        points, cells = beam_quarter(faces, quad_grading(checked), quarters)
    return assemble(points, cells, cell, order, outline, _probes(faces, (a, b, c)), symmetry)


def surface_pieces(
    halves: tuple[float, float, float],
    tip: float,
    root: float,
    radii: tuple[float, float, float],
) -> tuple[Piece, ...]:
    """The seven pieces of the surface from (a, 0) to (0, c).

    Raises:
        ValueError: The radii do not fit into the lengths they round off.
    """
    a, b, c = halves
    fillet, shoulder, corner = radii
    if b <= c:
        raise ValueError("height must be larger than web_thickness")
    top, foot = np.array([a - tip, b]), np.array([a - root, c])
    flank = top - foot
    length = float(np.hypot(*flank))
    up = flank / length
    # Tangent lengths: radius times tan of half the angle between two directions.
    steep = math.atan2(up[1], up[0])  # angle between flank and web
    cut_fillet = fillet * math.tan(0.5 * steep)
    cut_shoulder = shoulder * math.tan(0.5 * steep)
    for name, cut, room, where in (
        ("corner_radius and shoulder_radius", corner + cut_shoulder, tip, "the flange's tip"),
        ("corner_radius", corner, b, "half the height"),
        ("fillet_radius and shoulder_radius", cut_fillet + cut_shoulder, length, "the flank"),
        ("fillet_radius", cut_fillet, a - root, "the web"),
    ):
        if cut > room * (1.0 - 1e-6):
            raise ValueError(
                f"{name} take {1e3 * cut:.5g} mm off {where}, which has {1e3 * room:.5g} mm: "
                "lower the radius or raise the thickness"
            )
    on_tip = (a - tip + cut_shoulder, b)
    high, low = _point(top - cut_shoulder * up), _point(foot + cut_fillet * up)
    on_web = (a - root - cut_fillet, c)
    return (
        Piece("narrow_face", (a, 0.0), (a, b - corner), mirrors="x"),
        Piece("corner", (a, b - corner), (a - corner, b), (a - corner, b - corner), "xy"),
        Piece("tip", (a - corner, b), on_tip, mirrors="xy"),
        Piece("shoulder", on_tip, high, (on_tip[0], b - shoulder), "xy"),
        Piece("flank", high, low, mirrors="xy"),
        Piece("fillet", low, on_web, (on_web[0], c + fillet), "xy"),
        Piece("web", on_web, (0.0, c), mirrors="y"),
    )


def _point(x: np.ndarray) -> Point:
    return float(x[0]), float(x[1])


def _probes(faces: tuple[Piece, ...], halves: tuple[float, float, float]) -> dict[str, Probe]:
    """Inward lines from the middle of the pieces where the shell is looked at."""
    a, _, c = halves
    corner, tip, fillet = faces[1], faces[2], faces[5]
    at_corner, at_tip, at_fillet = (
        _point(p.at(np.array([0.5 * p.length]))[0]) for p in (corner, tip, fillet)
    )
    # Along the radius through the middle of the fillet down to the line of symmetry.
    centre = fillet.centre or at_fillet
    down = (at_fillet[0] - centre[0]) / (centre[1] - at_fillet[1])
    deep = min(0.5 * tip.length + corner.radius, c)
    return {
        "mid_face": Probe((0.0, c), (0.0, 0.0), "y"),
        "narrow_face": Probe((a, 0.0), (0.0, 0.0), "x"),
        "corner": Probe(at_corner, (a - deep, faces[1].end[1] - deep), "xy"),
        "tip": Probe(at_tip, (at_tip[0], 0.0), "xy"),
        "fillet": Probe(at_fillet, (at_fillet[0] + down * at_fillet[1], 0.0), "xy"),
    }
