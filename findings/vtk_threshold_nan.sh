#!/bin/bash
# Whether vtkThreshold keeps a cell with a NaN depends on which corner the cell begins with.
#
# Versions: VTK 9.7.2, NumPy 2.4.6 (Python 3.11).
#
# A quadrangle has the temperatures 1400, 1500, 1600 at three points and NaN at the fourth (as
# where there is no steel). We ask for the cells that reach into a range of temperatures, with
# AllScalars off and UseContinuousCellRange on, and write the same quadrangle with each of its four
# corners first. It is kept for some first corners and dropped for others; which, depends also on
# the range. With AllScalars on it is always dropped, as it should be.
# Replace NaN, or cut out the cells that have one, before a threshold.
#
# Output seen, with the values in the order of the cell's corners:
#   [nan, 1400, 1500, 1600]  1440 to 1460: kept     1540 to 1560: kept
#   [1400, 1500, 1600, nan]  1440 to 1460: kept     1540 to 1560: kept
#   [1500, 1600, nan, 1400]  1440 to 1460: dropped  1540 to 1560: dropped
#   [1600, nan, 1400, 1500]  1440 to 1460: kept     1540 to 1560: dropped
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q vtk==9.7.2 numpy==2.4.6
"$work/venv/bin/python" - <<'EOF'
import sys

from vtkmodules.vtkCommonCore import vtkDoubleArray, vtkPoints
from vtkmodules.vtkCommonDataModel import VTK_QUAD, vtkUnstructuredGrid
from vtkmodules.vtkFiltersCore import vtkThreshold

VALUES = [float("nan"), 1400.0, 1500.0, 1600.0]
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
RANGES = [(1440.0, 1460.0), (1540.0, 1560.0)]


def kept(first, low, high, every=False):
    """Whether a cell that begins with a corner passes."""
    points, values = vtkPoints(), vtkDoubleArray()
    for corner, value in zip(CORNERS, VALUES):
        points.InsertNextPoint(*corner)
        values.InsertNextValue(value)
    grid = vtkUnstructuredGrid()
    grid.SetPoints(points)
    grid.Allocate(1)
    grid.InsertNextCell(VTK_QUAD, 4, [(first + i) % 4 for i in range(4)])
    grid.GetPointData().SetScalars(values)
    filtered = vtkThreshold()
    filtered.SetInputData(grid)
    filtered.SetLowerThreshold(low)
    filtered.SetUpperThreshold(high)
    filtered.SetAllScalars(every)
    filtered.SetUseContinuousCellRange(not every)
    filtered.Update()
    return filtered.GetOutput().GetNumberOfCells() == 1


results = []
for first in range(4):
    passed = [kept(first, *limits) for limits in RANGES]
    results.append(tuple(passed))
    order = [f"{v:.0f}" for v in VALUES[first:] + VALUES[:first]]
    words = ["kept" if p else "dropped" for p in passed]
    text = "  ".join(f"{a:.0f} to {b:.0f}: {w:7s}" for (a, b), w in zip(RANGES, words))
    print(f"[{', '.join(order)}]  {text}")
dropped = not any(kept(first, 0.0, 9e9, every=True) for first in range(4))
sys.exit(0 if len(set(results)) > 1 and dropped else "VTK has changed")
EOF
