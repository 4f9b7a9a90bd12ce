"""A mould of the strand's own size touches the surface of the strand's mesh everywhere."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.meshes import build
from castfem.model.build_mould import build_mould
from castfem.model.mould import Mould
from castfem.model.section import BeamBlank, Rectangle, Round

MM = 1e-3
SIZES = {"surface_size": 2 * MM, "core_size": 10 * MM}
SECTIONS = {
    "rounded": (Rectangle, {"width": 125, "height": 125, "corner_radius": 5}),
    "sharp slab": (Rectangle, {"width": 400, "height": 100, "corner_radius": 0}),
    "round": (Round, {"diameter": 200}),
    "beam_blank": (
        BeamBlank,
        {
            "width": 400,
            "height": 300,
            "web_thickness": 100,
            "flange_thickness": 60,
            "root_thickness": 90,
            "fillet_radius": 20,
            "shoulder_radius": 15,
            "corner_radius": 10,
        },
    ),
}


@pytest.mark.parametrize("symmetry", ["quarter", "half", "whole"])
@pytest.mark.parametrize("name", SECTIONS)
def test_facets_of_the_mesh_lie_on_the_wall(name, symmetry):
    """At the middle of a facet the gap is what the chord leaves of the arc, at most h^2 / 8 r."""
    model, lengths = SECTIONS[name]
    shape = {"Rectangle": "rectangle", "Round": "round", "BeamBlank": "beam_blank"}[model.__name__]
    written = {key: f"{value} mm" for key, value in lengths.items()}
    section = model.model_validate({"shape": shape, "symmetry": symmetry, **written})
    mould = build_mould(Mould.model_validate({"length": "600 mm"}), section)
    mesh = build(**section.model_dump(), **SIZES)
    outer = [mesh.groups.index(group) for group in mesh.outer_groups]
    facets = mesh.facets[np.isin(mesh.facet_group, outer)]
    start, end = mesh.points[facets[:, 0]], mesh.points[facets[:, 1]]
    along = end - start
    h = np.hypot(*along.T)[:, None]
    normals = np.stack([along[:, 1], -along[:, 0]], axis=1) / h
    found = mould.gap_function(0.5 * (start + end), normals, 0.3)
    radii = [value * MM for key, value in lengths.items() if key.endswith("radius") and value]
    smallest = min(radii, default=0.1 if shape == "round" else np.inf)
    sagitta = 1.01 * float(h.max()) ** 2 / (8.0 * smallest)
    assert np.abs(found.gap).max() <= sagitta + 1e-12
    assert (found.normal * normals).sum(axis=1).min() > 0.99
    flat = np.abs(found.gap) < 1e-12
    assert flat.sum() >= (0 if shape == "round" else 0.5 * len(flat))
