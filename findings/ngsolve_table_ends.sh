#!/bin/bash
# A table of a property in NGSolve is zero below its first temperature, and goes on above its last.
#
# Versions: NGSolve 6.2.2608 (Python 3.12).
#
# BSpline of order 2 makes a function of a table: a conductivity from 300 to 1200 K. Above 1200 K it
# goes on along its last slope; that can be seen and is often wanted. Below 300 K it does not, and
# does not hold its first value either: it is 0, and so is its slope. Where the steel or the
# mould is colder by a fraction of a kelvin, it conducts no heat, and the mean conductivity of a
# part at 290 to 310 K is half of what it is. There is no warning.
# Begin the table far below all temperatures, here with a row at 1 K.
#
# Output seen (W/(m K)):
#   at 299.9 K: 0.00, 300 K: 60.00, 1200 K: 30.00, 1300 K: 26.67
#   mean over a bar from 290 to 310 K: 29.9
#   with a first row at 1 K: at 299.9 K 60.00, mean 59.9
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q ngsolve==6.2.2608
"$work/venv/bin/python" - <<'END'
import sys

from ngsolve import BSpline, Integrate, x
from ngsolve.meshes import Make1DMesh

table = BSpline(2, [300, 300, 600, 900, 1200], [60, 50, 40, 30, 20])
longer = BSpline(2, [1, 1, 300, 600, 900, 1200], [60, 60, 50, 40, 30, 20])
bar = Make1DMesh(100)
mean, mean_longer = (float(Integrate(k(290.0 + 20.0 * x), bar)) for k in (table, longer))
at = {t: table(t) for t in (299.9, 300, 1200, 1300)}
print("at", ", ".join(f"{t:g} K: {k:.2f}" for t, k in at.items()))
print(f"mean over a bar from 290 to 310 K: {mean:.1f}")
print(f"with a first row at 1 K: at 299.9 K {longer(299.9):.2f}, mean {mean_longer:.1f}")
same = at[299.9] == 0.0 and at[300] == 60.0 and 26.0 < at[1300] < 27.0
sys.exit(0 if same and mean < 31.0 and mean_longer > 59.0 else "NGSolve has changed")
END
