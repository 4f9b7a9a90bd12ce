#!/bin/bash
# A Gaussian process of OpenTURNS through wall temperatures is right in mm and 16 K off in m.
#
# Versions: OpenTURNS 1.27.post1, NumPy 2.4.6 (Python 3.11, 3.12).
#
# Temperatures are known at 15 depths of a wall of 20 mm. SquaredExponential(1) has a length of 1 in
# whatever unit the depths have, and the search for the most likely length starts there. From 1 cm
# and 1 mm it finds 4.4 mm and is right to 0.01 K. From 1 m, which is outside the bounds, and
# from 1 micrometre it ends at the upper bound, 40 mm, with a likelihood smaller by a factor of
# e**63, without a message: the curve is 16 K off near the surface, though it meets all the points.
# Give the length a start: SquaredExponential([a quarter of the range], [1.0]) is right in all
# units here. Compare getOptimalLogLikelihood from two starts.
#
# Output seen (length found, logarithm of the likelihood, greatest error between the points):
#   m : start at 1: 40.0 mm, -111, 16.52 K; at a quarter of the depth: 4.4 mm, -48, 0.01 K
#   cm: start at 1: 4.4 mm, -48, 0.01 K; at a quarter of the depth: 4.4 mm, -48, 0.01 K
#   mm: start at 1: 4.4 mm, -48, 0.01 K; at a quarter of the depth: 4.4 mm, -48, 0.01 K
#   um: start at 1: 40.0 mm, -111, 16.53 K; at a quarter of the depth: 4.4 mm, -48, 0.01 K
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q openturns==1.27.post1 numpy==2.4.6
"$work/venv/bin/python" - <<'END'
import sys

import numpy as np
import openturns as ot

DEPTH = 0.02


def temperature(x):
    """At the depth x in m, in K."""
    return 300.0 + 280.0 * np.exp(-x / 0.006) + 15.0 * np.sin(900.0 * x)


def fit(unit, kernel):
    """Length in mm, log-likelihood and error in K; unit is what a metre is in the unit used."""
    depth, between = np.linspace(0.0, DEPTH, 15), np.linspace(0.02 * DEPTH, 0.98 * DEPTH, 97)
    points = ot.Sample((unit * depth).reshape(-1, 1))
    values = ot.Sample(temperature(depth).reshape(-1, 1))
    fitter = ot.GaussianProcessFitter(points, values, kernel, ot.ConstantBasisFactory(1).build())
    fitter.run()
    process = ot.GaussianProcessRegression(fitter.getResult())
    process.run()
    curve = process.getResult().getMetaModel()(ot.Sample((unit * between).reshape(-1, 1)))
    length = 1e3 * fitter.getResult().getCovarianceModel().getScale()[0] / unit
    likelihood = fitter.getResult().getOptimalLogLikelihood()
    return length, likelihood, np.abs(np.asarray(curve).ravel() - temperature(between)).max()


seen = {}
for name, unit in {"m": 1.0, "cm": 1e2, "mm": 1e3, "um": 1e6}.items():
    starts = ot.SquaredExponential(1), ot.SquaredExponential([unit * DEPTH / 4.0], [1.0])
    seen[name] = [fit(unit, kernel) for kernel in starts]
    words = [f"{a:.1f} mm, {b:.0f}, {c:.2f} K" for a, b, c in seen[name]]
    print(f"{name:2s}: start at 1: {words[0]}; at a quarter of the depth: {words[1]}")
same = all(seen[name][0][2] > 10.0 for name in ("m", "um"))
same = same and all(seen[name][0][2] < 0.1 for name in ("cm", "mm"))
sys.exit(0 if same and all(pair[1][2] < 0.1 for pair in seen.values()) else "OpenTURNS has changed")
END
