#!/bin/bash
# COBYQA in SciPy goes wrong where an objective or a constraint is NaN, as that of a failed run.
#
# Versions: SciPy 1.17.1 (Python 3.11); the same in SciPy 1.18.1 (Python 3.13).
#
# - It moves a start that is nearer to a bound than its first step, and never looks at the start
#   itself: with the default step, [0.9, 0.9] in a unit square becomes [1, 1]. If the objective is
#   NaN there, it finds the minimum all the same, but returns the first point, with the value NaN.
# - If a constraint is NaN in a part of the range, it ends with success, a violation of 0 and the
#   wrong point. COBYLA finds the right one. A violation of 1000 in place of NaN does the same harm.
# For a failed run, return a worse objective and a violation of the size of the others (here 1 or
# 10); and make `initial_tr_radius` smaller than the way from the start to the bounds.
#
# Output seen (minimum at [0.3, 0.6]; at [0.7, 0.6] with x >= 0.7):
#   first point looked at: [1. 1.]
#   objective NaN where x > 0.6: success False, x [1. 1.], fun nan; it had seen 8.0e-15
#   constraint NaN where x < 0.5: COBYQA success True, x [1.  0.5], violation 0.0
#   constraint NaN where x < 0.5: COBYLA success True, x [0.7 0.6], violation 0.0
#   -1000 in place of NaN: x [1.  0.5]; -1: x [0.7 0.6]
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scipy==1.17.1
"$work/venv/bin/python" -W ignore - <<'EOF'
import sys

import numpy as np
from scipy.optimize import Bounds, NonlinearConstraint, minimize

SQUARE, START = Bounds([0, 0], [1, 1]), [0.9, 0.9]
seen = []


def objective(x):
    """A paraboloid, least at [0.3, 0.6]."""
    return (x[0] - 0.3) ** 2 + (x[1] - 0.6) ** 2


def failing(x):
    """The same, known in a part of the square."""
    seen.append((float("nan") if x[0] > 0.6 else objective(x), *x))
    return seen[-1][0]


failed = minimize(failing, START, method="COBYQA", bounds=SQUARE)
least = np.nanmin([value for value, *_ in seen])
print("first point looked at:", np.array(seen[0][1:]))
print(f"objective NaN where x > 0.6: success {failed.success}, x {failed.x},", end=" ")
print(f"fun {failed.fun};", end=" ")
print(f"it had seen {least:.1e}")

wall = NonlinearConstraint(lambda x: x[0] if x[0] >= 0.5 else float("nan"), 0.7, 2.0)
found = {}
for method in ("COBYQA", "COBYLA"):
    r = minimize(objective, START, method=method, bounds=SQUARE, constraints=wall)
    found[method] = r
    print(f"constraint NaN where x < 0.5: {method} success {r.success},", end=" ")
    print(f"x {np.round(r.x, 3)}, violation {r.maxcv}")
filled = {}
for number in (-1000.0, -1.0):
    wall = NonlinearConstraint(lambda x, n=number: x[0] if x[0] >= 0.5 else n, 0.7, 2.0)
    r = minimize(objective, START, method="COBYQA", bounds=SQUARE, constraints=wall)
    filled[number] = np.round(r.x, 3)
print("; ".join(f"{n:.0f}: x {x}" for n, x in filled.items()).replace(":", " in place of NaN:", 1))
lost = np.isnan(failed.fun) and least < 1e-9 and seen[0][1:] == (1.0, 1.0)
q = found["COBYQA"]
wrong = q.success and q.maxcv == 0.0 and np.abs(q.x - [0.7, 0.6]).max() > 0.05
right = np.abs(found["COBYLA"].x - [0.7, 0.6]).max() < 1e-3
large = np.abs(filled[-1000.0] - [0.7, 0.6]).max() > 0.05
small = np.abs(filled[-1.0] - [0.7, 0.6]).max() < 1e-3
sys.exit(0 if lost and wrong and right and large and small else "SciPy has changed")
EOF
