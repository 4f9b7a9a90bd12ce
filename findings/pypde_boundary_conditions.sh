#!/bin/bash
# py-pde gives a closed surface the fixed value of the equation before it, also within one run.
#
# Versions: py-pde 0.60.0 (Python 3.12) and 0.59.0 (Python 3.11), NumPy 2.4.6, numba 0.68.1.
#
# Operators are kept from one use to the next. The key under which they are found has the number of
# a boundary condition, but not its kind: `{"value": 0}`, `{"derivative": 0}` and
# `{"curvature": 0}` of the same grid are the same to it, as are any two with equal numbers. The
# first that is used holds for all later ones, without a message:
# - of a temperature with fixed surfaces and a concentration with closed ones, in one PDE, both have
#   fixed surfaces; with the equations in the other order, both have closed ones;
# - of a script that calculates a cooled strip and then an insulated one, both are cooled, though
#   each has a PDE and a grid of its own.
# Numbers that differ are kept apart: 1e-30 instead of 0 for one of the two serves. Or run each
# case in a process of its own.
#
# Output seen (mean after 200 s of a strip of 100 mm that is 1 at the start):
#   exact: surfaces at 0 0.248, closed surfaces 1.000
#   in one script: surfaces at 0 0.248, then closed surfaces 0.248
#   in one PDE: temperature 0.248, concentration 0.248
#   in one PDE, other order: temperature 1.000, concentration 1.000
#   in one PDE, 1e-30 for the closed surface: temperature 0.248, concentration 1.000
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q "py-pde==0.60.0; python_version >= '3.12'" \
    "py-pde==0.59.0; python_version < '3.12'" numpy==2.4.6 numba==0.68.1
cd "$work"
cat > strip.py <<'END'
"""Means after 200 s of the cases in the arguments, calculated one after the other."""

import json
import sys

import pde

DIFFUSIVITY, LENGTH, CELLS, SECONDS = 6e-6, 0.1, 40, 200.0
FIXED, CLOSED, NEARLY = {"value": 0}, {"derivative": 0}, {"derivative": 1e-30}


def means(conditions):
    """Of one field for each name, diffusing with these conditions at both ends."""
    grid = pde.CartesianGrid([[0, LENGTH]], CELLS)
    equations = {name: f"{DIFFUSIVITY} * laplace({name})" for name in conditions}
    ends = {f"{name}:laplace": condition for name, condition in conditions.items()}
    start = pde.FieldCollection([pde.ScalarField(grid, 1.0) for _ in conditions])
    rates = pde.PDE(equations, bc_ops=ends)
    result = rates.solve(start, t_range=SECONDS, dt=0.25, tracker=None)
    return {name: float(field.average) for name, field in zip(conditions, result)}


CASES = {
    "fixed": {"T": FIXED}, "closed": {"c": CLOSED}, "both": {"T": FIXED, "c": CLOSED},
    "turned": {"c": CLOSED, "T": FIXED}, "apart": {"T": FIXED, "c": NEARLY},
}  # fmt: skip
print(json.dumps([means(CASES[name]) for name in sys.argv[1:]]))
END
venv/bin/python - <<'END'
import json
import math
import subprocess
import sys


def ran(*cases):
    """Means of the cases, calculated in one process."""
    command = [sys.executable, "strip.py", *cases]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


rate = math.pi**2 * 6e-6 * 200.0 / 0.1**2
odd = range(1, 40, 2)
exact = 8.0 / math.pi**2 * sum(math.exp(-n * n * rate) / n**2 for n in odd)
first, second, apart = ran("fixed", "closed", "apart")
(both,), (turned,) = ran("both"), ran("turned")
print(f"exact: surfaces at 0 {exact:.3f}, closed surfaces 1.000")
after = first["T"], second["c"]
print("in one script: surfaces at 0 {:.3f}, then closed surfaces {:.3f}".format(*after))
for how, seen in (
    ("", both), (", other order", turned), (", 1e-30 for the closed surface", apart),
):  # fmt: skip
    print(f"in one PDE{how}: temperature {seen['T']:.3f}, concentration {seen['c']:.3f}")
cooled = first["T"], second["c"], both["T"], both["c"], apart["T"]
closed = turned["T"], turned["c"], apart["c"]
same = all(abs(mean - exact) < 0.01 for mean in cooled)
same = same and all(abs(mean - 1.0) < 1e-6 for mean in closed)
sys.exit(0 if same else "py-pde has changed")
END
