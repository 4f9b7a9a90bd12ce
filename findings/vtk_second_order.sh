#!/bin/bash
# VTK finds isotherms, areas and integrals of a second-order field as if it were linear.
#
# Versions: VTK 9.7.2 (Python 3.12).
#
# A cell of second order has nodes in the middle of its sides, and ParaView draws and probes it with
# its own curve: vtkProbeFilter and vtkGradientFilter are exact for T = x^2 in one such triangle.
# vtkContourFilter, vtkClipDataSet and vtkIntegrateAttributes cut the cell at its nodes into linear
# ones without saying so. The isotherm is then far from where the probe finds the temperature,
# the part above a temperature has another area, and a mean or a heat content is too high where the
# field is convex. A quadrangle of eight nodes has none in its middle: a round liquid core
# within it has no isotherm at all, and the integral of x^2 + y^2 is 75 % too high.
# The same cells as Lagrange ones do not help. Probe the field at the points of a fine linear mesh
# first, or integrate in the finite-element code.
#
# Output seen:
#   x^2 in a triangle of 6 nodes: probe at x = 0.2: 0.0400, isotherm of 0.04 at x = 0.080
#     integral 0.1042, exact 0.0833; area below 0.04: 0.0768, exact 0.1800
#   Lagrange triangle: isotherm of 0.04 at x = 0.080, integral 0.1042
#   x^2 + y^2 in a quadrangle of 8 nodes: integral 4.667, exact 2.667
#     probe at (0.5, 0.5): 0.50, points of the isotherm of 0.5: 0
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q vtk==9.7.2
"$work/venv/bin/python" - <<'END'
import sys

from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import (
    VTK_LAGRANGE_TRIANGLE,
    VTK_QUADRATIC_QUAD,
    VTK_QUADRATIC_TRIANGLE,
    vtkPolyData,
    vtkUnstructuredGrid,
)
from vtkmodules.vtkFiltersCore import vtkContourFilter, vtkProbeFilter
from vtkmodules.vtkFiltersGeneral import vtkClipDataSet
from vtkmodules.vtkFiltersParallel import vtkIntegrateAttributes

TRIANGLE = [(0, 0), (1, 0), (0, 1), (0.5, 0), (0.5, 0.5), (0, 0.5)]
SQUARE = [(-1, -1), (1, -1), (1, 1), (-1, 1), (0, -1), (1, 0), (0, 1), (-1, 0)]


def cell(kind, nodes, field):
    """A grid of one cell with a field at its nodes."""
    points, values = vtkPoints(), vtkDoubleArray()
    values.SetName("T")
    for x, y in nodes:
        points.InsertNextPoint(x, y, 0.0)
        values.InsertNextValue(field(x, y))
    grid = vtkUnstructuredGrid()
    grid.SetPoints(points)
    grid.InsertNextCell(kind, len(nodes), list(range(len(nodes))))
    grid.GetPointData().SetScalars(values)
    return grid


def integral(grid):
    """Integral of T, and area."""
    of = vtkIntegrateAttributes()
    of.SetInputData(grid)
    of.Update()
    out = of.GetOutput()
    area = out.GetCellData().GetArray("Area")
    return out.GetPointData().GetArray("T").GetValue(0), area.GetValue(0)


def isotherm(grid, level):
    """Points of an isotherm."""
    contour = vtkContourFilter()
    contour.SetInputData(grid)
    contour.SetValue(0, level)
    contour.Update()
    out = contour.GetOutput()
    return [out.GetPoint(i) for i in range(out.GetNumberOfPoints())]


def probed(grid, x, y):
    """T at a point."""
    points, at = vtkPoints(), vtkPolyData()
    points.InsertNextPoint(x, y, 0.0)
    at.SetPoints(points)
    probe = vtkProbeFilter()
    probe.SetInputData(at)
    probe.SetSourceData(grid)
    probe.Update()
    return probe.GetOutput().GetPointData().GetArray("T").GetValue(0)


def below(grid, level):
    """Area where T is below a level."""
    clip = vtkClipDataSet()
    clip.SetInputData(grid)
    clip.SetValue(level)
    clip.InsideOutOn()
    clip.Update()
    return integral(clip.GetOutput())[1]


square = cell(VTK_QUADRATIC_QUAD, SQUARE, lambda x, y: x**2 + y**2)
flat, lagrange = (
    cell(kind, TRIANGLE, lambda x, y: x**2)
    for kind in (VTK_QUADRATIC_TRIANGLE, VTK_LAGRANGE_TRIANGLE)
)
at, same_at = (isotherm(grid, 0.04)[0][0] for grid in (flat, lagrange))
of, same_of = integral(flat)[0], integral(lagrange)[0]
told, part = probed(flat, 0.2, 0.3), below(flat, 0.04)
print(f"x^2 in a triangle of 6 nodes: probe at x = 0.2: {told:.4f},", end=" ")
print(f"isotherm of 0.04 at x = {at:.3f}")
print(f"  integral {of:.4f}, exact {1 / 12:.4f};", end=" ")
print(f"area below 0.04: {part:.4f}, exact {0.5 * (1.0 - 0.8**2):.4f}")
print(f"Lagrange triangle: isotherm of 0.04 at x = {same_at:.3f}, integral {same_of:.4f}")
whole, middle, points = integral(square)[0], probed(square, 0.5, 0.5), isotherm(square, 0.5)
print(f"x^2 + y^2 in a quadrangle of 8 nodes: integral {whole:.3f}, exact {8 / 3:.3f}")
print(f"  probe at (0.5, 0.5): {middle:.2f}, points of the isotherm of 0.5: {len(points)}")
exact = abs(told - 0.04) < 1e-6 and abs(middle - 0.5) < 1e-6
linear = max(abs(at - 0.08), abs(same_at - 0.08)) < 1e-3 and min(of, same_of) > 0.1
sys.exit(0 if exact and linear and whole > 4.5 and not points and part < 0.1 else "VTK has changed")
END
