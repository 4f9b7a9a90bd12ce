#!/bin/bash
# Which property matters in a regression of chaospy depends on the units: 12 % or nothing.
#
# Versions: chaospy 4.3.21, numpoly 1.3.9, NumPy 2.4.6, SciPy 1.17.1 (Python 3.11, 3.12).
#
# The thermal stress of a restrained plate, E alpha dT / (1 - nu), is computed at 200 Sobol points
# of its four properties. fit_regression with the terms of generate_expansion has no scaling: its
# least squares drop the directions of properties with small numbers. With E in MPa and alpha in 1/K
# the mean stays right, the scatter falls by 6 %, and the influence of alpha from 12 % to 2 %, with
# cubic terms to 0.01 %. In SI units the mean stress is 0 and E alone has an influence. There is
# no warning. fit_quadrature is right in all units.
# Call generate_expansion(..., normed=True); then all units give the same.
#
# Output seen (mean and scatter in MPa, total Sobol indices of E, alpha, dT, nu):
#   GPa, 1e-6/K       515.2 +- 125.6  0.1762, 0.1229, 0.6851, 0.0303
#   MPa, 1/K          515.3 +- 117.5  0.2015, 0.0160, 0.7744, 0.0378
#   MPa, 1/K, cubic   515.3 +- 113.6  0.2012, 0.0001, 0.8117, 0.0190
#   Pa, 1/K             0.0 +-  53.4  1.0000, 0.0000, 0.0150, 0.1025
#   Pa, 1/K, normed   515.2 +- 125.6  0.1762, 0.1229, 0.6851, 0.0303
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q chaospy==4.3.21 numpoly==1.3.9 numpy==2.4.6 scipy==1.17.1
"$work/venv/bin/python" -W ignore - <<'END'
import sys

import chaospy as cp


def study(pa, per_k, order=2, normed=False):
    """Mean, scatter and total indices; `pa` and `per_k` are 1 GPa and 1e-6/K in the units used."""
    properties = cp.J(
        cp.Normal(100.0 * pa, 10.0 * pa),
        cp.Normal(18.0 * per_k, 1.5 * per_k),
        cp.Normal(200.0, 40.0),
        cp.Uniform(0.25, 0.35),
    )
    modulus, expansion, warming, poisson = points = properties.sample(200, rule="sobol", seed=1)
    stress = modulus / pa * 1e3 * (expansion / per_k * 1e-6) * warming / (1.0 - poisson)
    terms = cp.generate_expansion(order, properties, normed=normed)
    fit = cp.fit_regression(terms, points, stress)
    mean, scatter = float(cp.E(fit, properties)), float(cp.Std(fit, properties))
    return mean, scatter, abs(cp.Sens_t(fit, properties))


seen = {}
for name, given in {
    "GPa, 1e-6/K": {"pa": 1.0, "per_k": 1.0},
    "MPa, 1/K": {"pa": 1e3, "per_k": 1e-6},
    "MPa, 1/K, cubic": {"pa": 1e3, "per_k": 1e-6, "order": 3},
    "Pa, 1/K": {"pa": 1e9, "per_k": 1e-6},
    "Pa, 1/K, normed": {"pa": 1e9, "per_k": 1e-6, "normed": True},
}.items():
    mean, scatter, share = seen[name] = study(**given)
    words = ", ".join(f"{one:.4f}" for one in share)
    print(f"{name:16s} {abs(mean):6.1f} +- {scatter:5.1f}  {words}")
right, normed = seen["GPa, 1e-6/K"], seen["Pa, 1/K, normed"]
wrong, cubic, none = seen["MPa, 1/K"], seen["MPa, 1/K, cubic"], seen["Pa, 1/K"]
same = abs(right[0] - 515.2) < 0.5 and right[2][1] > 0.11 and max(abs(right[2] - normed[2])) < 1e-6
same = same and abs(wrong[0] - right[0]) < 1.0 and wrong[2][1] < 0.03 and cubic[2][1] < 0.001
sys.exit(0 if same and abs(none[0]) < 1.0 and none[2][0] > 0.99 else "chaospy has changed")
END
