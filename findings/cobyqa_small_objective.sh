#!/bin/bash
# COBYQA in SciPy stops early, and with success, if the objective is a small number.
#
# Versions: SciPy 1.17.1 (Python 3.11); the same in SciPy 1.18.1 (Python 3.13).
#
# The least point of a function does not change when it is multiplied by a number. COBYQA keeps to
# that from 1e6 down to 1e-6, but at 1e-9 it returns a point halfway, with success True and the
# message of a search that has converged. Squares of gaps or displacements in metres are that
# small: a gap of 0.03 mm has 1e-9 m2. COBYLA, Nelder-Mead and Powell are right at all scales.
# Scale the objective, so that it changes by about 1 over the ranges.
#
# Output seen (minimum at [3, 5], start at [1, 1]):
#   1e+00  COBYQA True [3. 5.], COBYLA True [3. 5.], Powell True [3. 5.]
#   1e-06  COBYQA True [3. 5.], COBYLA True [3. 5.], Powell True [3. 5.]
#   1e-09  COBYQA True [1.172 2.196], COBYLA True [3. 5.], Powell True [3. 5.]
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scipy==1.17.1
"$work/venv/bin/python" -W ignore - <<'EOF'
import sys

import numpy as np
from scipy.optimize import Bounds, minimize

LEAST = np.array([3.0, 5.0])
off = {}
for scale in (1.0, 1e-6, 1e-9):
    line = []
    for method in ("COBYQA", "COBYLA", "Powell"):
        found = minimize(
            lambda x, scale=scale: scale * ((x - LEAST) ** 2).sum(),
            [1.0, 1.0],
            method=method,
            bounds=Bounds([0, 0], [10, 10]),
        )
        off[scale, method] = np.abs(found.x - LEAST).max() if found.success else np.nan
        line.append(f"{method} {bool(found.success)} {np.round(found.x, 3)}")
    print(f"{scale:.0e}  " + ", ".join(line))
small = off.pop((1e-9, "COBYQA"))
sys.exit(0 if small > 1.0 and max(off.values()) < 1e-2 else "SciPy has changed")
EOF
