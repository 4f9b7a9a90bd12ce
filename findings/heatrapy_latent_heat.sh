#!/bin/bash
# heatrapy loses the latent heat of a material written as its manual says: twice the shell in 100 s.
#
# Versions: heatrapy 2.1.1, NumPy 2.4.2, matplotlib 3.10.8 (Python 3.11, 3.12).
#
# The manual has the latent heat, in the files lheat0.txt and lheata.txt, in J/kg, and a density in
# another file. The solvers take it as heat per cubic metre. The 270 kJ/kg of steel are then a
# 7000th of what they should be, and a strip freezes as if it had no latent heat, without a message.
# Multiply the latent heat by the density. The material "water" that comes with heatrapy has
# 334 MJ/m3 in its file.
#
# Output seen (frozen below 1800 K after 100 s, in mm; 1820 K at the start, 1000 K at the face):
#   exact: 39.1, without latent heat 78.8
#   in J/kg: 78.8, without latent heat 78.8, in J/m3: 40.0
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q heatrapy==2.1.1 numpy==2.4.2 matplotlib==3.10.8
cd "$work"
MPLBACKEND=Agg venv/bin/python - <<'END'
import math
import sys
from pathlib import Path

import heatrapy

DENSITY, CAPACITY, CONDUCTIVITY, LATENT, MELTING = 7000.0, 700.0, 30.0, 270e3, 1800.0
FACE, START, CELL, CELLS, SECONDS = 1000.0, 1820.0, 0.002, 75, 100.0


def frozen(latent):
    """Depth below the melting point in mm, with this number in the files of the latent heat."""
    folder = Path("steel")
    folder.mkdir(exist_ok=True)
    for name, value in (("cp", CAPACITY), ("k", CONDUCTIVITY), ("rho", DENSITY), ("tad", 0.0)):
        for state in "di" if name == "tad" else "0a":
            (folder / f"{name}{state}.txt").write_text(f"300\t{value}\n2000\t{value}\n")
    for state in "0a":
        (folder / f"lheat{state}.txt").write_text(f"{MELTING}\t{latent}\n" if latent else "")
    strip = heatrapy.SingleObject1D(
        START, materials=("steel",), borders=(1, CELLS + 1), dx=CELL, dt=0.05,
        file_name="strip.txt", boundaries=(FACE, 0), materials_path=f"{Path.cwd()}/", draw=[],
    )  # fmt: skip
    strip.compute(SECONDS, 10**6, solver="implicit_k(x)", verbose=False)
    at = [point[0] for point in strip.object.temperature]
    last = max(i for i, t in enumerate(at) if t < MELTING)
    part = (MELTING - at[last]) / (at[last + 1] - at[last]) if at[last + 1] > MELTING else 0.0
    return 1e3 * CELL * (last + part)


def neumann(latent):
    """The exact depth in a strip without an end, in mm."""
    above = (START - MELTING) / (MELTING - FACE)
    low, high = 0.01, 3.0
    for _ in range(60):
        s = 0.5 * (low + high)
        flux = math.exp(-s * s) * (1.0 / math.erf(s) - above / math.erfc(s))
        needed = s * math.sqrt(math.pi) * latent / CAPACITY / (MELTING - FACE)
        low, high = (s, high) if flux > needed else (low, s)
    return 2e3 * low * math.sqrt(CONDUCTIVITY / DENSITY / CAPACITY * SECONDS)


exact = neumann(LATENT), neumann(0.0)
print(f"exact: {exact[0]:.1f}, without latent heat {exact[1]:.1f}")
per_kg, none, per_volume = frozen(LATENT), frozen(0.0), frozen(LATENT * DENSITY)
print(f"in J/kg: {per_kg:.1f}, without latent heat {none:.1f}, in J/m3: {per_volume:.1f}")
same = abs(per_kg - none) < 0.5 and abs(none - exact[1]) < 3.0 and abs(per_volume - exact[0]) < 3.0
sys.exit(0 if same else "heatrapy has changed")
END
