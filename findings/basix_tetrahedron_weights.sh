#!/bin/bash
# Basix integrates a positive function over a tetrahedron to less than nothing.
#
# Versions: fenics-basix 0.10.0 (Python 3.11); the same in 0.9.0 and 0.11.0.
#
# The default quadrature of a tetrahedron has negative weights at degrees 3, 7 and 8, and at no
# other up to 30; that of a triangle has none. Degree 3 is that of a second-order field times a
# first-order one. Its weight at the centre is -0.8 of the volume. Polynomials are integrated
# exactly all the same, but not a law that jumps within the cell: where only the middle is still
# liquid, the integral of the liquid fraction is negative. From degree 15 to 16 the number of points
# becomes three times larger.
# Ask for degree 4, 5, 6 or 9 to 15, in FEniCSx with metadata={"quadrature_degree": 4}.
#
# Output seen:
#   triangle: degrees with negative weights: none
#   tetrahedron: degrees with negative weights: [3, 7, 8]
#   sum of their absolute values, volumes: degree 3: 2.60, degree 7: 4.00, degree 8: 1.47
#   liquid within 0.1 of the centre: degree 3: -0.80 of the volume is liquid, degree 4: 0.00
#   points at degree 15: 214, at degree 16: 729
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q fenics-basix==0.10.0 numpy==2.4.6
"$work/venv/bin/python" - <<'EOF'
import sys

import numpy as np
from basix import CellType, make_quadrature


def negative(cell):
    """Degrees of a cell whose rule has a negative weight."""
    return [d for d in range(1, 31) if (make_quadrature(cell, d)[1] < 0.0).any()]


triangle, tetrahedron = negative(CellType.triangle), negative(CellType.tetrahedron)
print("triangle: degrees with negative weights:", triangle or "none")
print("tetrahedron: degrees with negative weights:", tetrahedron)
sums = {d: 6.0 * np.abs(make_quadrature(CellType.tetrahedron, d)[1]).sum() for d in tetrahedron}
print("sum of their absolute values, volumes:", end=" ")
print(", ".join(f"degree {d}: {s:.2f}" for d, s in sums.items()))
liquid = {}
for degree in (3, 4):
    points, weights = make_quadrature(CellType.tetrahedron, degree)
    inside = np.linalg.norm(points - 0.25, axis=1) < 0.1
    liquid[degree] = 6.0 * float((weights * inside).sum())
print("liquid within 0.1 of the centre:", end=" ")
print(f"degree 3: {liquid[3]:.2f} of the volume is liquid,", end=" ")
print(f"degree 4: {liquid[4]:.2f}")
count = [len(make_quadrature(CellType.tetrahedron, d)[1]) for d in (15, 16)]
print(f"points at degree 15: {count[0]}, at degree 16: {count[1]}")
same = not triangle and tetrahedron == [3, 7, 8] and abs(liquid[3] + 0.8) < 1e-9
sys.exit(0 if same and count == [214, 729] else "Basix has changed")
EOF
