#!/bin/bash
# VTK's gradient at a surface is up to 40 % off if the mesh has the edges of that surface as cells.
#
# Versions: VTK 9.7.2 (Python 3.12).
#
# Meshes from gmsh have, beside the triangles, the lines of named boundaries as cells of their own.
# vtkGradientFilter (ParaView's Gradient, PyVista's compute_derivative) takes at a point the mean of
# the gradients of all cells there. A line knows only the slope along itself and counts as a
# triangle does, as if the field did not change across it. For the linear field T = x + 2 y the
# gradient is (1, 2) everywhere, and is found so inside; on the boundary it is too small, by 40 % at
# the left and right in x, at the top and bottom in y. That is where a heat flux is asked for.
# There is no warning. Remove the lines, or call SetContributingCellOption(2).
#
# Output seen (unit square, 4 by 4 squares cut into triangles, its 16 edges as lines):
#   without lines: x from 1.000 to 1.000, y from 2.000 to 2.000
#   with lines:    x from 0.600 to 1.000, y from 1.200 to 2.000, wrong at 16 of 25 points
#   with lines, only cells of the highest dimension: x from 1.000 to 1.000, y from 2.000 to 2.000
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q vtk==9.7.2
"$work/venv/bin/python" - <<'END'
import sys

from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_LINE, VTK_TRIANGLE, vtkUnstructuredGrid
from vtkmodules.vtkFiltersGeneral import vtkGradientFilter

N = 4


def mesh(lines):
    """Triangles of a unit square, and the lines around it."""
    points, values, grid = vtkPoints(), vtkDoubleArray(), vtkUnstructuredGrid()
    values.SetName("T")
    for k in range((N + 1) ** 2):
        x, y = k % (N + 1) / N, k // (N + 1) / N
        points.InsertNextPoint(x, y, 0.0)
        values.InsertNextValue(x + 2.0 * y)
    grid.SetPoints(points)
    grid.GetPointData().SetScalars(values)
    for k in range((N + 1) * N):
        if k % (N + 1) < N:
            grid.InsertNextCell(VTK_TRIANGLE, 3, [k, k + 1, k + N + 1])
            grid.InsertNextCell(VTK_TRIANGLE, 3, [k + 1, k + N + 2, k + N + 1])
    side = [(i, i + 1) for i in range(N)]
    for a, b in side if lines else []:
        for first, second in (
            (a, b),
            (a + N * (N + 1), b + N * (N + 1)),
            (a * (N + 1), b * (N + 1)),
            (a * (N + 1) + N, b * (N + 1) + N),
        ):
            grid.InsertNextCell(VTK_LINE, 2, [first, second])
    return grid


def gradient(grid, option=None):
    """Gradients at the points."""
    of = vtkGradientFilter()
    of.SetInputData(grid)
    of.SetInputScalars(0, "T")
    of.SetResultArrayName("slope")
    if option is not None:
        of.SetContributingCellOption(option)
    of.Update()
    array = of.GetOutput().GetPointData().GetArray("slope")
    return [array.GetTuple(i)[:2] for i in range(array.GetNumberOfTuples())]


def text(found):
    """Least and largest components."""
    parts = zip("xy", zip(*found))
    return ", ".join(f"{c} from {min(v):.3f} to {max(v):.3f}" for c, v in parts)


def wrong(found):
    """Points whose gradient is not (1, 2)."""
    return sum(abs(x - 1.0) + abs(y - 2.0) > 1e-6 for x, y in found)


bare, mixed, highest = gradient(mesh(False)), gradient(mesh(True)), gradient(mesh(True), 2)
print("without lines:", text(bare))
print("with lines:   ", text(mixed) + f", wrong at {wrong(mixed)} of {len(mixed)} points")
print("with lines, only cells of the highest dimension:", text(highest))
same = wrong(bare) == wrong(highest) == 0 and wrong(mixed) == 4 * N
sys.exit(0 if same and min(x for x, _ in mixed) < 0.61 else "VTK has changed")
END
