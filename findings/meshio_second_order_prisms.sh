#!/bin/bash
# Second-order prisms from gmsh have an eighth of their volume in VTK when meshio hands them on.
#
# Versions: gmsh 4.15.2, meshio 5.3.5, VTK 9.7.2, PyVista 0.49.1, NumPy 2.5.5 (Python 3.12).
#
# A section that is extruded in layers has prisms, with 18 nodes at second order. gmsh and VTK
# number the nodes in the middle of the edges in other orders. meshio knows that for tetrahedra and
# hexahedra, and renumbers them; prisms of 18 nodes it passes on in gmsh's order. It writes them
# to VTU as valid cells: their corners are right, so that pictures look right, but the volume is
# an eighth, and a temperature interpolated within a prism is wrong or, at a point that no prism is
# found to contain, 0. Prisms of 15 nodes (Mesh.SecondOrderIncomplete) cannot be read at all.
# Renumber the nodes (see ORDER below), or let gmsh write .vtk itself, which is right.
#
# Output seen (a cube of 1 m3, T = x + z^2 at three points):
#   tetrahedra  10 nodes: volume 1.0000, T off by 0.000 at most
#   hexahedra   27 nodes: volume 1.0000, T off by 0.000 at most
#   prisms      18 nodes: volume 0.1250, T off by 1.410 at most
#   prisms      18 nodes in VTK's order: volume 1.0000, T off by 0.000 at most
#   prisms      18 nodes, gmsh's own .vtk: volume 1.0000, T off by 0.000 at most
#   prisms      15 nodes: KeyError('wedge15')
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q gmsh==4.15.2 meshio==5.3.5 vtk==9.7.2 pyvista==0.49.1 numpy==2.5.5
cd "$work"
venv/bin/python - <<'EOF'
import sys

import gmsh
import meshio
import numpy as np
import pyvista

# The place in gmsh's prism of each of the 18 nodes of VTK's.
ORDER = [0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16]
POINTS = np.array([[0.3, 0.4, 0.2], [0.6, 0.7, 0.9], [0.5, 0.5, 0.5]])


def cube(name, kind, incomplete=0):
    gmsh.initialize()
    gmsh.option.setNumber("General.Verbosity", 0)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
    gmsh.option.setNumber("Mesh.SecondOrderIncomplete", incomplete)
    if kind == "tetrahedra":
        gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    else:
        square = gmsh.model.occ.addRectangle(0, 0, 0, 1, 1)
        gmsh.model.occ.extrude([(2, square)], 0, 0, 1, [4], recombine=True)
    gmsh.model.occ.synchronize()
    if kind == "hexahedra":
        gmsh.model.mesh.setTransfiniteAutomatic()
    gmsh.model.addPhysicalGroup(3, [1], name="steel")
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.setOrder(2)
    gmsh.write(name + ".msh")
    gmsh.write(name + ".vtk")
    gmsh.finalize()


def measure(grid):
    """The volume, and the largest error of T = x + z^2 at the points."""
    grid["T"] = grid.points[:, 0] + grid.points[:, 2] ** 2
    sizes = grid.compute_cell_sizes(length=False, area=False)
    probed = pyvista.PolyData(POINTS).sample(grid)["T"]
    off = float(np.abs(probed - POINTS[:, 0] - POINTS[:, 2] ** 2).max())
    return float(sizes["Volume"].sum()), off


def tell(name, volume, off):
    print(f"{name}: volume {volume:.4f}, T off by {off:.3f} at most")
    return volume, off


def through_meshio(name, cell, order=None):
    """The cells as meshio reads them, through a VTU file that meshio writes."""
    mesh = meshio.read(name + ".msh")
    cells = mesh.cells_dict[cell]
    cells = cells if order is None else cells[:, order]
    meshio.Mesh(mesh.points, [(cell, cells)]).write(name + ".vtu")
    return measure(pyvista.read(name + ".vtu"))


for kind in ("tetrahedra", "hexahedra", "prisms"):
    cube(kind, kind)
cube("incomplete", "prisms", 1)
tetra = tell("tetrahedra  10 nodes", *through_meshio("tetrahedra", "tetra10"))
hexa = tell("hexahedra   27 nodes", *through_meshio("hexahedra", "hexahedron27"))
prism = tell("prisms      18 nodes", *through_meshio("prisms", "wedge18"))
mended = tell("prisms      18 nodes in VTK's order", *through_meshio("prisms", "wedge18", ORDER))
own = pyvista.read("prisms.vtk")
own = tell("prisms      18 nodes, gmsh's own .vtk", *measure(own))
try:
    meshio.read("incomplete.msh")
    unread = False
except KeyError as error:
    unread = True
    print(f"prisms      15 nodes: {error!r}")
right = all(abs(v - 1.0) < 1e-6 and off < 0.01 for v, off in (tetra, hexa, mended, own))
same = right and abs(prism[0] - 0.125) < 1e-6 and prism[1] > 0.1 and unread
sys.exit(0 if same else "meshio has changed")
EOF
