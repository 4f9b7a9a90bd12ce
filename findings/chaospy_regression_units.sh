#!/bin/bash
# chaospy finds a thermal stress of 0 on average if the modulus is in Pa: 240 MPa if it is in GPa.
#
# Versions: chaospy 4.3.21, numpoly 1.3.9, NumPy 2.4.6, SciPy 1.17.1 (Python 3.11, 3.12).
#
# The stress E alpha dT of a clamped bar is a polynomial of order 2 in its modulus E and its
# expansion alpha, so that an expansion of this order by regression is exact. The polynomials of
# `generate_expansion` are orthogonal, but not of length 1: those of E grow with powers of 1e10, and
# next to them `fit_regression` takes all others, with the constant, for zero. It returns an
# expansion whose mean is 0 and whose variance comes from E alone. No message is given, though the
# expansion misses the runs it was fitted to by more than the stress itself.
# Give `normed=True` to `generate_expansion`, or use units in which the scatter is about 1.
# `fit_quadrature` is right in any unit.
#
# Output seen (mean and standard deviation in MPa, first-order indices of E and alpha):
#   exact: 240.0, 13.5, 0.26, 0.73
#   regression, E in Pa: 0.0, 5.8, 1.00, 0.00; off by up to 269 MPa at its own runs
#   regression, E in GPa: 240.0, 13.5, 0.26, 0.73; off by up to 0 MPa at its own runs
#   regression, E in Pa, normed: 240.0, 13.5, 0.26, 0.73; off by up to 0 MPa at its own runs
#   quadrature, E in Pa: 240.0, 13.5, 0.26, 0.73
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q chaospy==4.3.21 numpoly==1.3.9 numpy==2.4.6 scipy==1.17.1
cd "$work"
venv/bin/python - <<'END'
import sys

import chaospy
import numpy as np

WARMER, ORDER = 100.0, 2
MODULUS, EXPANSION = (2e11, 0.1e11), (1.2e-5, 0.1e-5)


def moments(fitted, joint):
    """Mean and standard deviation in Pa, first-order indices."""
    spread = chaospy.Std(fitted, joint)
    return [float(chaospy.E(fitted, joint)), float(spread), *chaospy.Sens_m(fitted, joint)]


def scatter(unit):
    """E in this unit and alpha in 1/K, uniform about their means."""
    return chaospy.J(*(
        chaospy.Uniform((mean - half) / by, (mean + half) / by)
        for (mean, half), by in ((MODULUS, unit), (EXPANSION, 1.0))
    ))  # fmt: skip


def by_regression(unit, **options):
    """From 200 runs, and the largest error at them in Pa."""
    joint = scatter(unit)
    runs = joint.sample(200, rule="sobol")
    stress = runs[0] * unit * runs[1] * WARMER
    polynomials = chaospy.generate_expansion(ORDER, joint, **options)
    fitted = chaospy.fit_regression(polynomials, runs, stress)
    return moments(fitted, joint), float(np.abs(fitted(*runs) - stress).max())


def by_quadrature(unit):
    joint = scatter(unit)
    nodes, weights = chaospy.generate_quadrature(ORDER + 1, joint, rule="gaussian")
    polynomials = chaospy.generate_expansion(ORDER, joint)
    stress = nodes[0] * unit * nodes[1] * WARMER
    return moments(chaospy.fit_quadrature(polynomials, nodes, weights, stress), joint)


shares = [(half / mean) ** 2 / 3.0 for mean, half in (MODULUS, EXPANSION)]
variance = shares[0] + shares[1] + shares[0] * shares[1]
mean = MODULUS[0] * EXPANSION[0] * WARMER
exact = [mean, mean * variance**0.5, *(share / variance for share in shares)]


def show(name, found, missed=None):
    numbers = f"{1e-6 * found[0]:.1f}, {1e-6 * found[1]:.1f}, {found[2]:.2f}, {found[3]:.2f}"
    missed = "" if missed is None else f"; off by up to {1e-6 * missed:.0f} MPa at its own runs"
    print(f"{name}: {numbers}{missed}".replace("-0.0,", "0.0,"))
    return np.allclose(found, exact, rtol=1e-3)


show("exact", exact)
wrong = by_regression(1.0)
show("regression, E in Pa", *wrong)
right = [
    show("regression, E in GPa", *by_regression(1e9)),
    show("regression, E in Pa, normed", *by_regression(1.0, normed=True)),
    show("quadrature, E in Pa", by_quadrature(1.0)),
]
(seen, _, of_modulus, of_expansion), missed = wrong
same = abs(seen) < 1e6 and of_modulus > 0.99 and of_expansion < 0.01 and missed > 1e8
sys.exit(0 if same and all(right) else "chaospy has changed")
END
