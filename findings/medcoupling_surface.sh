#!/bin/bash
# medcoupling moves the surface temperature of a strand by 38 K when it changes the mesh.
#
# Versions: medcoupling 9.15.0, NumPy 2.5.5 (Python 3.12).
#
# A temperature at nodes is passed from a fine mesh to a coarser one, from the thermal calculation
# to the mechanical one: MEDCouplingRemapper with "P1P1" and the nature IntensiveMaximum. The field
# is linear in both meshes and could be passed on exactly. But a node gets the mean over its dual
# cell, the parts of the triangles around it; at a surface these lie on one side. So a shell with
# 30 K/mm and cells of 5 mm gets a surface 38 K too hot, and a finer source does not help.
# From a mesh to the same one nothing changes, so that a test of that kind finds nothing. "P1P0", to
# the cells, takes the source as constant in its dual cells: it is 55 K off to a finer mesh.
# Call setIntersectionType(medcoupling.PointLocator), exact here.
#
# Output seen (1000 degC at the surface, 30 K/mm, 30 x 30 mm; error at the surface, largest at all):
#   P1P1, cells of 1 to 5 mm            37.7 K,  43.2 K
#   P1P1, 0.5 to 5 mm                   38.0 K,  43.5 K
#   P1P1, 2 to 3 mm                     19.9 K,  25.0 K
#   P1P1, 5 mm to the same               0.0 K,   0.0 K
#   P1P0, 1 to 5 mm                      0.0 K,   0.0 K
#   P1P0, 5 to 2 mm                     20.0 K,  55.0 K
#   P1P1, 1 to 5 mm, PointLocator        0.0 K,   0.0 K
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q medcoupling==9.15.0 numpy==2.5.5
cd "$work"
venv/bin/python - <<'EOF'
import sys

import medcoupling as mc
import numpy as np

SIZE, SURFACE, SLOPE = 30.0, 1000.0, 30.0


def mesh(cell):
    """Triangles with legs of `cell` mm."""
    ticks = mc.DataArrayDouble(np.linspace(0.0, SIZE, round(SIZE / cell) + 1))
    grid = mc.MEDCouplingCMesh()
    grid.setCoords(ticks, ticks)
    triangles = grid.buildUnstructured()
    triangles.simplexize(0)
    triangles.setName("strand")
    return triangles


def errors(source, target, method, kind=None):
    """The error at the surface x = 0 (mean over its nodes or cells) and the largest one, in K."""
    source, target = mesh(source), mesh(target)
    field = mc.MEDCouplingFieldDouble(mc.ON_NODES)
    field.setMesh(source)
    field.setName("temperature")
    x = source.getCoords().toNumPyArray()[:, 0]
    field.setArray(mc.DataArrayDouble(SURFACE + SLOPE * x))
    field.setNature(mc.IntensiveMaximum)
    remapper = mc.MEDCouplingRemapper()
    if kind is not None:
        remapper.setIntersectionType(kind)
    remapper.prepare(source, target, method)
    got = remapper.transferField(field, 0.0).getArray().toNumPyArray()
    points = target.getCoords() if method == "P1P1" else target.computeCellCenterOfMass()
    x = points.toNumPyArray()[:, 0]
    off = got - SURFACE - SLOPE * x
    return float(off[x == x.min()].mean()), float(np.abs(off).max())


def tell(name, *arguments):
    surface, largest = errors(*arguments)
    print(f"{name:34s} {abs(round(surface, 1)):5.1f} K, {largest:5.1f} K")
    return surface, largest


from_1 = tell("P1P1, cells of 1 to 5 mm", 1.0, 5.0, "P1P1")
from_half = tell("P1P1, 0.5 to 5 mm", 0.5, 5.0, "P1P1")
tell("P1P1, 2 to 3 mm", 2.0, 3.0, "P1P1")
same_mesh = tell("P1P1, 5 mm to the same", 5.0, 5.0, "P1P1")
cells = tell("P1P0, 1 to 5 mm", 1.0, 5.0, "P1P0")
coarse = tell("P1P0, 5 to 2 mm", 5.0, 2.0, "P1P0")
located = tell("P1P1, 1 to 5 mm, PointLocator", 1.0, 5.0, "P1P1", mc.PointLocator)
same = from_1[0] > 20 and from_half[0] > 20 and coarse[1] > 20
right = max(same_mesh[1], located[1]) < 1e-6
sys.exit(0 if same and right else "medcoupling has changed")
EOF
