"""The boundary groups a case may name are those the meshes have."""

from __future__ import annotations

import pytest

from castfem.model import from_document

SECTIONS = {
    "rectangle": {"width": "60 mm", "height": "40 mm", "corner_radius": "5 mm"},
    "sharp": {"shape": "rectangle", "width": "60 mm", "height": "40 mm"},
    "round": {"diameter": "60 mm"},
    "beam_blank": {
        "width": "300 mm",
        "height": "250 mm",
        "web_thickness": "80 mm",
        "flange_thickness": "60 mm",
        "root_thickness": "90 mm",
        "fillet_radius": "20 mm",
        "shoulder_radius": "10 mm",
        "corner_radius": "10 mm",
    },
    "strip": {"length": "50 mm", "width": "1 mm"},
}


def _case(name: str, symmetry: str | None):
    section = {"shape": name, **SECTIONS[name]}
    if symmetry:
        section["symmetry"] = symmetry
    return from_document(
        {
            "title": name,
            "casting": {"speed": "1 m/min", "length": "1 m", "superheat": "20 K"},
            "steel": {"name": "carbon_042"},
            "section": section,
            "mesh": {"surface_size": "5 mm", "core_size": "10 mm"},
            "cooling": [{"name": "mould"}],
        }
    )


@pytest.mark.parametrize(
    ("name", "symmetry"),
    [(n, s) for n in SECTIONS if n != "strip" for s in ("quarter", "half", "whole")]
    + [("strip", None)],
)
def test_groups_are_those_of_the_mesh(name, symmetry):
    meshes = pytest.importorskip("castfem.meshes", reason="no gmsh")
    case = _case(name, symmetry)
    mesh = meshes.build(**case.mesh_parameters())
    outer = {group for group in mesh.groups if not group.startswith("symmetry")}
    assert set(case.section.outer_groups()) == outer
