#!/bin/bash
# numdifftools finds no influence of a diffusivity in m2/s: 4 +- 7000 K s/m2 instead of -1e7.
#
# Versions: numdifftools 0.11.2, NumPy 2.4.6, SciPy 1.17.1 (Python 3.11, 3.12).
#
# For every argument that is small against 1 the steps go from 2 down to 0.0001, and the error is
# estimated from how neighbouring steps agree. A function of a diffusivity, a strain rate or a
# wavelength in SI is far past its bend at all of these steps, and there they agree well: the
# derivative is nearly 0, and the estimate of its error up to 26 powers of ten too small. No message
# is given.
# Give `base_step`, a tenth of the argument, or use units in which the argument is about 1.
# method="complex" steps by 1e-15 and is right where the function takes complex numbers.
#
# Output seen (exact; as it comes +- its estimate of the error; with base_step):
#   temperature by diffusivity, K s/m2: -1.019e+07; 3.859 +- 7.07e+03; -1.019e+07
#   flow stress by strain rate, Pa s: 6.31e+10; -74.86 +- 2.06e+09; 6.31e+10
#   radiance by wavelength, W/(m4 sr): 2.983e+16; -4.65e-24 +- 7.73e-11; 2.983e+16
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q numdifftools==0.11.2 numpy==2.4.6 scipy==1.17.1
cd "$work"
venv/bin/python - <<'END'
import math
import sys

import numdifftools
import numpy as np
from scipy.special import erf

DEPTH, SECONDS, FACE, HOT = 5e-3, 20.0, 1000.0, 1500.0
STRENGTH, RATE, EXPONENT = 50e6, 1e-3, 0.2
FIRST, SECOND, KELVIN = 1.191042972e-16, 0.014387768775, 1500.0


def temperature(diffusivity):
    """Below the face of a half space that was cooled 20 s ago; it needs a positive diffusivity."""
    return FACE + (HOT - FACE) * erf(DEPTH / (2.0 * np.sqrt(diffusivity * SECONDS)))


def flow_stress(rate):
    return STRENGTH * np.sign(rate) * np.abs(rate / RATE) ** EXPONENT


def radiance(wavelength):
    """Of a black body (Planck)."""
    return FIRST / (wavelength**5 * np.expm1(SECOND / (wavelength * KELVIN)))


diffusivity, rate, wavelength = 6e-6, 1e-4, 0.9e-6
place = DEPTH / (2.0 * math.sqrt(diffusivity * SECONDS))
slope = -(HOT - FACE) / math.sqrt(math.pi) * math.exp(-(place**2)) * place / diffusivity
ratio = SECOND / (wavelength * KELVIN)
bend = ratio * math.exp(ratio) / math.expm1(ratio) - 5.0
CASES = (
    ("temperature by diffusivity, K s/m2", temperature, diffusivity, slope, "forward"),
    ("flow stress by strain rate, Pa s", flow_stress, rate, EXPONENT * flow_stress(rate) / rate,
     "central"),
    ("radiance by wavelength, W/(m4 sr)", radiance, wavelength,
     bend * radiance(wavelength) / wavelength, "central"),
)  # fmt: skip
same = True
for name, function, at, exact, method in CASES:
    as_it_comes = numdifftools.Derivative(function, method=method, full_output=True)(at)
    given = numdifftools.Derivative(function, method=method, base_step=0.1 * at)(at)
    seen, error = float(as_it_comes.estimate), float(as_it_comes.error_estimate)
    print(f"{name}: {exact:.4g}; {seen:.4g} +- {error:.3g}; {float(given):.4g}")
    wrong = abs(seen) < 1e-3 * abs(exact) and error < 0.1 * abs(exact)
    same = same and wrong and abs(given / exact - 1.0) < 1e-3
sys.exit(0 if same else "numdifftools has changed")
END
