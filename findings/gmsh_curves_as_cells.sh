#!/bin/bash
# Numbers of curves from a gmsh file are taken for numbers of cells, by meshio and by scikit-fem.
#
# Versions: gmsh 4.15.2, meshio 5.3.5, scikit-fem 12.0.2, NumPy 2.4.6 (Python 3.11).
#
# An MSH file of version 4.1, gmsh's default, says which curves bound a surface; a curve that runs
# the other way has a negative number. meshio puts these numbers among its sets of cells, as
# "gmsh:bounding_entities". What reads sets of cells believes them:
# - scikit-fem has a subdomain of that name. Its elements have the numbers of the curves, and the
#   negative ones count from the end of the elements. A loop over all subdomains meets elements
#   twice, so that the sum of their areas is more than the area of the mesh.
# - meshio cannot write sets to VTU and makes one column of cell data of them, the index of the set.
#   A cell in two sets keeps the last one. Cells of the shell and the mould so lose their name.
# Files of version 2.2 have no such set. Else delete it after reading:
# del mesh.cell_sets["gmsh:bounding_entities"].
#
# Output seen (two unit squares, "shell" and "mould", side by side):
#   area of the mesh 2.0, of its subdomains 2.126
#   of 66 cells of the shell 62 have its index in the VTU file, of 66 of the mould 62
#   without the set: area of the subdomains 2.0, cells 66 66
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q gmsh==4.15.2 scikit-fem==12.0.2 meshio==5.3.5 numpy==2.4.6
cd "$work"
venv/bin/python - <<'EOF'
import sys

import gmsh
import meshio
import numpy as np
from skfem import Basis, ElementTriP1, Functional
from skfem.io.meshio import from_meshio

gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
parts = [(2, gmsh.model.occ.addRectangle(x, 0, 0, 1, 1)) for x in (0, 1)]
gmsh.model.occ.fragment(parts[:1], parts[1:])
gmsh.model.occ.synchronize()
gmsh.model.addPhysicalGroup(2, [1], 1, "shell")
gmsh.model.addPhysicalGroup(2, [2], 2, "mould")
gmsh.model.addPhysicalGroup(1, [2], 3, "wall")
gmsh.option.setNumber("Mesh.MeshSizeMax", 0.5)
gmsh.model.mesh.generate(2)
gmsh.write("two.msh")


def areas(mesh):
    """Area of a mesh, and the sum of those of its subdomains."""
    one = Functional(lambda w: 1.0 + 0.0 * w.x[0])
    bases = [Basis(mesh, ElementTriP1(), elements=name) for name in mesh.subdomains]
    every = one.assemble(Basis(mesh, ElementTriP1()))
    return round(float(every), 6), round(float(sum(one.assemble(b) for b in bases)), 3)


def written(mesh):
    """Cells of the shell and of the mould that carry the index of their set in a VTU file."""
    names = list(mesh.cell_sets)
    group = np.concatenate(mesh.cell_data["gmsh:physical"])
    mesh.write("two.vtu")
    column = np.concatenate(meshio.read("two.vtu").cell_data["-".join(names)])
    sets = (("shell", 1), ("mould", 2))
    return [int((column[group == tag] == names.index(name)).sum()) for name, tag in sets]


whole, parts = areas(from_meshio(meshio.read("two.msh")))
cells = written(meshio.read("two.msh"))
without, bare = meshio.read("two.msh"), meshio.read("two.msh")
del without.cell_sets["gmsh:bounding_entities"], bare.cell_sets["gmsh:bounding_entities"]
true_parts, true_cells = areas(from_meshio(bare))[1], written(without)
print(f"area of the mesh {whole}, of its subdomains {parts}")
print(f"of {true_cells[0]} cells of the shell {cells[0]} have its index in the VTU file,", end=" ")
print(f"of {true_cells[1]} of the mould {cells[1]}")
print(f"without the set: area of the subdomains {true_parts}, cells", *true_cells)
wrong = parts > whole and cells[0] < true_cells[0] and cells[1] < true_cells[1]
sys.exit(0 if wrong and true_parts == whole else "meshio or scikit-fem has changed")
EOF
