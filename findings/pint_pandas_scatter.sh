#!/bin/bash
# A scatter of 8.5 degC in a column of temperatures is 281.7 K for pint-pandas, and 8.5 K for Pint.
#
# Versions: Pint 0.26.2, Pint-Pandas 0.8.0, pandas 3.1.1, NumPy 2.5.5 (Python 3.12).
#
# A column of measured temperatures has the type pint[degC]. Its std(), sem() and groupby().std()
# keep the unit degC, that of a temperature and not of a difference, so that a conversion to kelvin
# adds 273.15 to them. The same readings as one Pint quantity give a difference of 7.4 or 8.5 K, and
# so do diff(), max() - min() and a subtraction of columns. The sum, for which Pint raises an error
# because the sum of temperatures in degC has no meaning, is 6005 degC, or 6278.15 K where that of
# the same column in kelvin is 7097.6 K. rolling().mean() returns plain numbers without a unit.
# Convert the column to kelvin first: column.pint.to("K").
#
# Output seen (1500, 1510, 1490, 1505 degC):
#   Pint            std 8.539 K, sum OffsetUnitCalculusError
#   column in degC  std 281.689 K, sem 277.420 K, by groups 280.221 and 283.757 K, sum 6278.15 K
#   column in K     std 8.539 K, sem 4.270 K, by groups 7.071 and 10.607 K, sum 7097.60 K
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q pint==0.26.2 pint-pandas==0.8.0 pandas==3.1.1 numpy==2.5.5
cd "$work"
venv/bin/python - <<'EOF'
import sys

import numpy as np
import pandas as pd
import pint_pandas

READINGS = [1500.0, 1510.0, 1490.0, 1505.0]
quantity = pint_pandas.PintType.ureg.Quantity(READINGS, "degC")
pint_std = float(np.std(quantity, ddof=1).to("K").magnitude)
try:
    pint_sum = str(np.sum(quantity))
except Exception as error:  # of a class that has moved between releases of Pint
    pint_sum = type(error).__name__
print(f"Pint            std {pint_std:.3f} K, sum {pint_sum}")
found = {}
for unit in ("degC", "K"):
    column = pd.Series(READINGS, dtype="pint[degC]").pint.to(unit)
    groups = column.groupby([0, 0, 1, 1]).std().pint.to("K").pint.magnitude
    values = [float(f().to("K").magnitude) for f in (column.std, column.sem, column.sum)]
    found[unit] = values
    print(
        f"column in {unit:5s} std {values[0]:.3f} K, sem {values[1]:.3f} K, by groups"
        f" {groups.iloc[0]:.3f} and {groups.iloc[1]:.3f} K, sum {values[2]:.2f} K"
    )
same = abs(found["degC"][0] - found["K"][0] - 273.15) < 1e-6
same = same and abs(pint_std - found["K"][0]) < 1e-6 and "Error" in pint_sum
sys.exit(0 if same else "pint-pandas has changed")
EOF
