#!/bin/bash
# The smoothing spline of SciPy gives another curve when positions are in mm in place of m.
#
# Versions: SciPy 1.17.1 (Python 3.11); the same in SciPy 1.18.1 (Python 3.12).
#
# make_smoothing_spline without `lam` chooses the amount of smoothing from the data. A measured
# curve is smoothed with its positions in different units; the result should be the same. But `lam`
# has the unit of a length cubed, and the search looks from 0 to the number of points, whatever the
# unit. With large numbers for the positions it smooths too little, or not at all; with small
# numbers it does not find the least value and returns a straight line, or raises an error.
# There is no warning. Divide the positions so that their spacing is about 0.1, then check that
# 0.1 and 10 times these numbers give the same curve.
#
# Output seen (101 points of a sine over 1 m, noise 0.1; error against the sine):
#   length of the curve in numbers        1: error 0.031, largest value 0.99
#   length of the curve in numbers       10: error 0.031, largest value 0.99
#   length of the curve in numbers     1000: error 0.071, largest value 1.06
#   length of the curve in numbers  1000000: error 0.096, largest value 1.11
#   length of the curve in numbers      0.1: error 0.451, largest value 0.93
#   length of the curve in numbers    0.001: ValueError
#   without smoothing: error 0.096
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scipy==1.17.1
"$work/venv/bin/python" -W ignore - <<'END'
import sys

import numpy as np
from scipy.interpolate import make_smoothing_spline

x = np.linspace(0.0, 1.0, 101)
true = np.sin(2.0 * np.pi * x)
measured = true + 0.1 * np.random.default_rng(0).standard_normal(x.size)


def error(y):
    """Root of the mean square of the distance from the true curve."""
    return float(np.sqrt(np.mean((y - true) ** 2)))


seen = {}
for scale in (1, 10, 1000, 1000000, 0.1, 0.001):
    print(f"length of the curve in numbers {scale:8}:", end=" ")
    try:
        smooth = make_smoothing_spline(scale * x, measured)(scale * x)
    except ValueError:
        seen[scale] = np.inf
        print("ValueError")
        continue
    seen[scale] = error(smooth)
    print(f"error {seen[scale]:.3f}, largest value {smooth.max():.2f}")
print(f"without smoothing: error {error(measured):.3f}")
good = seen[1] < 0.04 and seen[10] < 0.04
bad = seen[1000] > 0.06 and seen[1000000] > 0.09 and seen[0.1] > 0.4 and np.isinf(seen[0.001])
sys.exit(0 if good and bad else "SciPy has changed")
END
