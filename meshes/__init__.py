"""Meshes of cross-sections: billet, bloom, slab, round, beam blank, and a strip.

numpy and gmsh only; gmsh is imported when unstructured triangles are requested. Lengths in m.

    mesh = build("rectangle", width=0.125, height=0.125, corner_radius=0.005,
                 surface_size=0.0005, face_size=0.005, core_size=0.008)
    mesh.points, mesh.cells, mesh.facets, mesh.groups, mesh.probes, mesh.quality()
"""

from __future__ import annotations

from castfem.meshes.build import BUILDERS, build, build_section, parameters_of
from castfem.meshes.cache import MESH_VERSION, cached, read_mesh, write_mesh
from castfem.meshes.quality import Quality
from castfem.meshes.section_mesh import SectionMesh

__all__ = [
    "BUILDERS",
    "MESH_VERSION",
    "Quality",
    "SectionMesh",
    "build",
    "build_section",
    "cached",
    "parameters_of",
    "read_mesh",
    "write_mesh",
]
