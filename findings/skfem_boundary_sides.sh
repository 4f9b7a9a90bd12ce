#!/bin/bash
# Saving a scikit-fem mesh changes the sign of normals on its boundaries.
#
# Versions: scikit-fem 12.0.2, meshio 5.3.5, NumPy 2.4.6 (Python 3.11).
#
# A named boundary may be an inner interface. Each of its facets then has a side, from which its
# normal points away. We take all facets around the left half of a square: the integral of the
# normal over this closed curve is zero. The mesh is saved and loaded again. All names, facets and
# elements are as before, but the sides are not: the integral is -2, since the normals of the inner
# facets have turned round. A heat flow or a reaction over the interface gets the wrong sign.
# Files of VTU, VTK, XDMF and MSH do this when the facets, in the order of their numbers, belong to
# elements in another order. The JSON of scikit-fem keeps no side at all.
# After loading, set such boundaries again: mesh.facets_around("steel").
#
# Output seen:
#   before  n_x over the closed curve:  0.0
#   m.vtu   n_x over the closed curve: -2.0, same facets: True
#   m.vtk   n_x over the closed curve: -2.0, same facets: True
#   m.xdmf  n_x over the closed curve: -2.0, same facets: True
#   m.msh   n_x over the closed curve: -2.0, same facets: True
#   m.json  n_x over the closed curve: -2.0, same facets: True
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scikit-fem==12.0.2 meshio==5.3.5 numpy==2.4.6 h5py lxml
cd "$work"
venv/bin/python - 2>/dev/null <<'EOF'
import sys

import numpy as np
from skfem import ElementQuad1, FacetBasis, Functional, Mesh, MeshQuad
from skfem.io import json

mesh = MeshQuad.init_tensor(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
mesh = mesh.with_subdomains({"steel": lambda x: x[0] < 0.5})
mesh = mesh.with_boundaries({"surface": mesh.facets_around("steel")})


def normal(of):
    """Integral of the x component of the normal over the surface of the steel."""
    basis = FacetBasis(of, ElementQuad1(), facets="surface")
    return round(float(Functional(lambda w: w.n[0]).assemble(basis)), 9) + 0.0


print(f"before  n_x over the closed curve:  {normal(mesh)}")
right = normal(mesh) == 0.0
for name in ("m.vtu", "m.vtk", "m.xdmf", "m.msh", "m.json"):
    if name == "m.json":
        json.to_file(mesh, name)
        again = json.from_file(name)
    else:
        mesh.save(name, **({"file_format": "gmsh"} if name == "m.msh" else {}))
        again = Mesh.load(name)
    same = set(map(int, again.boundaries["surface"])) == set(map(int, mesh.boundaries["surface"]))
    print(f"{name:7s} n_x over the closed curve: {normal(again)}, same facets: {same}")
    right = right and same and normal(again) == -2.0
sys.exit(0 if right else "scikit-fem has changed")
EOF
