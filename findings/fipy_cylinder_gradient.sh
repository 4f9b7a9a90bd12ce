#!/bin/bash
# FiPy gives a uniform temperature a gradient on a cylindrical or spherical mesh.
#
# Versions: FiPy 4.0.3, NumPy 2.4.6, SciPy 1.17.1 (Python 3.11).
#
# CellVariable.grad is the sum of the values on the faces times their areas, over the volume. That
# is right on a Cartesian mesh. On a cylindrical one the areas grow with r, and the result is the
# gradient plus T/r; on a spherical one, plus 2 T/r. So a billet at 1000 K throughout has a gradient
# of 2000 K/m at a radius of 0.5 m, and in degrees Celsius another one. On CylindricalGrid2D
# faceGrad is wrong in the same way, so that heat fluxes at faces are too. There is no warning. The
# diffusion equation is not affected: the temperature that it gives is right.
# Take leastSquaresGrad within the mesh, or differences of the values.
#
# Output seen (28 November 2026; radial gradient at r = 0.55 m, cells of 0.1 m):
#   Cartesian    1000 K throughout: grad 0, least squares 0 K/m
#   cylinder     1000 K throughout: grad 1818, least squares 0 K/m
#   cylinder, 2D 1000 K throughout: grad 1818, least squares 0 K/m
#   sphere       1000 K throughout: grad 3636, least squares 0 K/m
#   cylinder, 2D faceGrad up to 20000 K/m
#   conduction through a hollow cylinder: off by 0.002 of 100 K
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q fipy==4.0.3 numpy==2.4.6 scipy==1.17.1
cd "$work"
FIPY_SOLVERS=scipy venv/bin/python - <<'EOF'
import sys

import numpy as np
from fipy import (
    CellVariable,
    CylindricalGrid1D,
    CylindricalGrid2D,
    DiffusionTerm,
    Grid1D,
    SphericalGrid1D,
)

MESHES = {
    "Cartesian": Grid1D(dx=0.1, nx=10),
    "cylinder": CylindricalGrid1D(dx=0.1, nx=10),
    "cylinder, 2D": CylindricalGrid2D(dx=0.1, dy=0.1, nx=10, ny=3),
    "sphere": SphericalGrid1D(dx=0.1, nx=10),
}
grad = {}
for name, mesh in MESHES.items():
    uniform = CellVariable(mesh=mesh, value=1000.0)
    grad[name] = float(uniform.grad.value[0][5])
    squares = float(uniform.leastSquaresGrad.value[0][5])
    print(f"{name:12s} 1000 K throughout: grad {grad[name]:.0f}, least squares {squares:.0f} K/m")
uniform = CellVariable(mesh=MESHES["cylinder, 2D"], value=1000.0)
face = float(np.abs(uniform.faceGrad.value[0]).max())
print(f"cylinder, 2D faceGrad up to {face:.0f} K/m")
shell = CylindricalGrid1D(dx=0.01, nx=100, origin=(1.0,))
hot = CellVariable(mesh=shell, value=0.0)
hot.constrain(0.0, shell.facesLeft)
hot.constrain(100.0, shell.facesRight)
DiffusionTerm().solve(hot)
exact = 100.0 * np.log(np.array(shell.cellCenters.value[0])) / np.log(2.0)
off = float(np.abs(np.array(hot.value) - exact).max())
print(f"conduction through a hollow cylinder: off by {off:.3f} of 100 K")
same = abs(grad["Cartesian"]) < 1e-6 and abs(grad["cylinder"] - 1000 / 0.55) < 1.0
other = abs(grad["sphere"] - 2000 / 0.55) < 30.0 and face > 1000.0 and off < 0.1
sys.exit(0 if same and other else "FiPy has changed")
EOF
