#!/bin/bash
# CoolProp gives boiling water a heat capacity of 435 GJ/(kg K), and a negative one.
#
# Versions: CoolProp 8.0.0 (Python 3.12).
#
# Between liquid and steam, cp at constant pressure has no finite value, and viscosity and
# conductivity are those of two phases. PropsSI raises an error there for the speed of sound, and
# with the backend IF97 for cp too. With the default backend it returns numbers for cp, viscosity
# and conductivity: those of its equation of state for one phase at the mean density, a state that
# does not exist. At 1 % of steam by mass, cp is 1e8 times that of water, and the viscosity is
# below those of water and steam; at 20 % cp is negative. At 50 % the numbers look
# harmless. A heat-transfer correlation with (P, H) as input meets them where water begins to boil.
# Ask for PropsSI("Phase", ...) first, or for the numbers at Q = 0 and Q = 1.
#
# Output seen (1 atm; cp in J/(kg K), Prandtl number, viscosity in Pa s):
#   steam 0     cp 4.22e+03, Pr 1.75e+00, viscosity 2.8e-04
#   steam 0.01  cp 4.35e+11, Pr 3.18e+07, viscosity 6.7e-06
#   steam 0.2   cp -3.36e+04, Pr -1.51e+01, viscosity 1.2e-05
#   steam 0.5   cp 2.65e+03, Pr 1.29e+00, viscosity 1.2e-05
#   steam 1     cp 2.08e+03, Pr 1.04e+00, viscosity 1.2e-05
#   IF97, steam 0.01: error
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q CoolProp==8.0.0
"$work/venv/bin/python" - <<'END'
import sys

from CoolProp.CoolProp import PropsSI

ATMOSPHERE = 101325.0
cp = {}
for steam in (0.0, 0.01, 0.2, 0.5, 1.0):
    state = ("P", ATMOSPHERE, "Q", steam, "Water")
    cp[steam], prandtl, viscosity = (PropsSI(n, *state) for n in ("C", "Prandtl", "V"))
    print(f"steam {steam:<4g}  cp {cp[steam]:.2e}, Pr {prandtl:.2e}, viscosity {viscosity:.1e}")
try:
    PropsSI("C", "P", ATMOSPHERE, "Q", 0.01, "IF97::Water")
    refused = False
except ValueError:
    refused = True
print("IF97, steam 0.01:", "error" if refused else "no error")
same = cp[0.01] > 1e11 and cp[0.2] < 0.0 and 2000.0 < cp[0.5] < 4000.0
sys.exit(0 if same and refused else "CoolProp has changed")
END
