#!/bin/bash
# VTK takes a concave polygon for up to 2.4 times its area, and finds no gradient on polygons.
#
# Versions: VTK 9.7.2 (Python 3.11).
#
# The section of a beam blank is given as one polygon of 12 corners. vtkCellSizeFilter (CellSize in
# ParaView, compute_cell_sizes and area in PyVista) and vtkIntegrateAttributes (Integrate Variables)
# add up the triangles between its first corner and each of its edges, all with a positive area. For
# a concave polygon the sum is too large, and it changes with the corner that the list begins with.
# vtkPolygon::ComputeArea is right, and so is the area after vtkTriangleFilter.
# In a cell of the type polygon VTK interpolates with weights of one over the squared distance from
# the corners. Such an interpolation is flat at each corner, and that is where vtkGradientFilter
# takes the slope: for T = 1000 + 100 x on a mesh of hexagons the gradient at the points is not
# (100, 0) but between -6 and 6 in x, and not 0 in y. A heat flux from polygons, as OpenFOAM and
# Voronoi meshes have them, is nearly nothing. There is no warning. vtkTriangleFilter before the
# integral or the gradient puts both right.
#
# Output seen (section in mm2, exact 143200; gradient exact (100, 0)):
#   vtkPolygon::ComputeArea: 143200 to 143200
#   triangles:               143200 to 143200
#   vtkCellSizeFilter:       249600 to 348400
#   vtkIntegrateAttributes:  249600 to 348400
#   gradient on hexagons:    x from -6.2 to 6.3, y from -2.2 to 2.2
#   gradient on triangles:   x from 100.0 to 100.0, y from -0.0 to 0.0
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q vtk==9.7.2
"$work/venv/bin/python" - <<'END'
import math
import sys

from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_POLYGON, vtkPolyData, vtkCellArray
from vtkmodules.vtkFiltersCore import vtkTriangleFilter
from vtkmodules.vtkFiltersGeneral import vtkGradientFilter
from vtkmodules.vtkFiltersParallel import vtkIntegrateAttributes
from vtkmodules.vtkFiltersVerdict import vtkCellSizeFilter

HALF = [(0, 0), (120, 0), (120, 190), (400, 190), (400, 0), (520, 0)]
SECTION = HALF + [(x, 480 - y) for x, y in reversed(HALF)]
EXACT = 520 * 480 - 2 * 280 * 190
LABELS = ("vtkPolygon::ComputeArea", "triangles", "vtkCellSizeFilter", "vtkIntegrateAttributes")


def surface(places, polygons):
    """Polygons with the temperature 1000 + 100 x."""
    points, cells, values = vtkPoints(), vtkCellArray(), vtkDoubleArray()
    points.SetDataTypeToDouble()
    values.SetName("T")
    for x, y in places:
        points.InsertNextPoint(x, y, 0.0)
        values.InsertNextValue(1000.0 + 100.0 * x)
    for polygon in polygons:
        cells.InsertNextCell(len(polygon), polygon)
    mesh = vtkPolyData()
    mesh.SetPoints(points)
    mesh.SetPolys(cells)
    mesh.GetPointData().SetScalars(values)
    return mesh


def through(of, mesh):
    """Output of a filter."""
    of.SetInputData(mesh)
    of.Update()
    return of.GetOutput()


def size(mesh):
    """Sum of the areas of the cells."""
    array = through(vtkCellSizeFilter(), mesh).GetCellData().GetArray("Area")
    return sum(array.GetValue(i) for i in range(array.GetNumberOfTuples()))


def areas(start):
    """Area of the section in four ways, its list of corners beginning with this one."""
    mesh = surface(SECTION[start:] + SECTION[:start], [list(range(len(SECTION)))])
    whole = through(vtkIntegrateAttributes(), mesh).GetCellData().GetArray("Area").GetValue(0)
    cut = size(through(vtkTriangleFilter(), mesh))
    return mesh.GetCell(0).ComputeArea(), cut, size(mesh), whole


def hexagons(n):
    """A mesh of n x n hexagons."""
    numbers, cells = {}, []
    for column in range(n):
        for row in range(n):
            centre = 1.5 * column, math.sqrt(3.0) * (row + 0.5 * (column % 2))
            corners = [
                (
                    round(centre[0] + math.cos(k * math.pi / 3), 9),
                    round(centre[1] + math.sin(k * math.pi / 3), 9),
                )
                for k in range(6)
            ]
            cells.append([numbers.setdefault(c, len(numbers)) for c in corners])
    return surface(list(numbers), cells)


def gradient(mesh):
    """Least and largest components of the gradient at the points."""
    of = vtkGradientFilter()
    of.SetInputScalars(0, "T")
    of.SetResultArrayName("slope")
    array = through(of, mesh).GetPointData().GetArray("slope")
    return [array.GetRange(component) for component in (0, 1)]


found = list(zip(*(areas(start) for start in range(len(SECTION)))))
for label, values in zip(LABELS, found):
    print(f"{label + ':':24} {min(values):.0f} to {max(values):.0f}")
mesh = hexagons(6)
assert mesh.GetCellType(0) == VTK_POLYGON
bare, cut = gradient(mesh), gradient(through(vtkTriangleFilter(), mesh))
for label, (x, y) in (("hexagons", bare), ("triangles", cut)):
    print(
        f"{'gradient on ' + label + ':':24} x from {x[0]:.1f} to {x[1]:.1f},"
        f" y from {y[0]:.1f} to {y[1]:.1f}"
    )
right = all(abs(a - EXACT) < 1.0 for values in found[:2] for a in values)
right = right and all(abs(v - 100.0) < 1e-6 for v in cut[0])
large = all(min(v) > 1.7 * EXACT and max(v) > 2.4 * EXACT for v in found[2:])
flat = -10.0 < bare[0][0] < 0.0 < bare[0][1] < 10.0
sys.exit(0 if right and large and flat else "VTK has changed")
END
