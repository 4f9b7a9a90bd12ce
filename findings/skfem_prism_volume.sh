#!/bin/bash
# A mesh of prisms has half of its volume in scikit-fem, so half of its heat.
#
# Versions: scikit-fem 12.0.2 (Python 3.11, 3.12).
#
# A mesh of triangles times a line is one of prisms (MeshWedge1), as for a strand along its length.
# All integrals over it are half as large, at every order: capacity, conductance, heat sources. The
# weights of the rule for a prism add up to 1/4 where the reference prism has 1/2, and a part of the
# points lies outside the prism. Temperatures look right, as both sides of the equation are halved.
# Heat contents in J, heat flows in W and the effect of forces at nodes in N are wrong by two, and a
# source is taken at wrong places within a cell. There is no message.
# Meshes of hexahedra or tetrahedra are right. Compare basis.dx.sum() with the volume.
#
# Output seen (a cube of 1 m with 1 W/(m K), 8 by 8 by 8 cells, or those cut into parts):
#   prisms:     volume 0.5000 m3, heat from 1 K over x 0.5000 W, 1 W at its end heats by 2.0000 K
#   hexahedra:  volume 1.0000 m3, heat from 1 K over x 1.0000 W, 1 W at its end heats by 1.0000 K
#   tetrahedra: volume 1.0000 m3, heat from 1 K over x 1.0000 W, 1 W at its end heats by 1.0000 K
#   largest temperature from 1 W/m3, cold at x = 0 and 1: prisms 0.1285 K, right 0.1250 K
#   weights of the prism add up to 0.25, right 0.50; 24 of 108 points outside
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scikit-fem==12.0.2 numpy==2.4.6 scipy==1.17.1
"$work/venv/bin/python" - <<'END'
import sys

import numpy as np
from skfem import Basis, ElementHex1, ElementTetP1, ElementWedge1, Functional
from skfem import MeshHex, MeshLine, MeshTet, MeshTri, condense, solve
from skfem.models.poisson import laplace, unit_load
from skfem.quadrature import get_quadrature
from skfem.refdom import RefWedge

x = np.linspace(0.0, 1.0, 9)
MESHES = {
    "prisms": (MeshTri.init_tensor(x, x) * MeshLine(x), ElementWedge1()),
    "hexahedra": (MeshHex.init_tensor(x, x, x), ElementHex1()),
    "tetrahedra": (MeshTet.init_tensor(x, x, x), ElementTetP1()),
}
volume, flow, rise, warm = {}, {}, {}, {}
for name, (mesh, element) in MESHES.items():
    basis = Basis(mesh, element)
    matrix, at = laplace.assemble(basis), mesh.p[0]
    volume[name] = Functional(lambda w: 1.0 + 0.0 * w.x[0]).assemble(basis)
    cold = np.flatnonzero(at < 1e-9)
    end = np.flatnonzero(at > 1.0 - 1e-9)
    flow[name] = (matrix @ at)[end].sum()
    # 1 W, shared over the nodes of the end as a uniform flux is
    shares = np.zeros(len(at))
    shares[end] = (matrix @ at)[end] / flow[name]
    rise[name] = solve(*condense(matrix, shares, D=cold))[end].mean()
    both = np.concatenate((cold, end))
    warm[name] = solve(*condense(matrix, unit_load.assemble(basis), D=both)).max()
    print(
        f"{name + ':':11s} volume {volume[name]:.4f} m3, heat from 1 K over x {flow[name]:.4f} W, "
        f"1 W at its end heats by {rise[name]:.4f} K"
    )
print(
    "largest temperature from 1 W/m3, cold at x = 0 and 1: "
    f"prisms {warm['prisms']:.4f} K, right {1.0 / 8.0:.4f} K"
)
points, weights = get_quadrature(RefWedge, 4)
outside = int(np.sum(points[0] + points[1] > 1.0 + 1e-9))
total = weights.sum()
print(
    f"weights of the prism add up to {total:.2f}, right 0.50; "
    f"{outside} of {len(weights)} points outside"
)
half = all(abs(found["prisms"] - 0.5) < 1e-9 for found in (volume, flow))
right = all(
    abs(found[name] - 1.0) < 1e-9
    for found in (volume, flow, rise)
    for name in ("hexahedra", "tetrahedra")
)
same = half and right and abs(rise["prisms"] - 2.0) < 1e-6 and abs(total - 0.25) < 1e-9
sys.exit(0 if same and outside > 0 else "scikit-fem has changed")
END
