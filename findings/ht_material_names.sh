#!/bin/bash
# ht takes iron for zircon, cast iron for argon, and carbon steel for graphite.
#
# Versions: ht 1.2.0, fluids 1.3.1 (Python 3.12).
#
# k_material, rho_material and Cp_material give properties by the name of a material. A name that
# the tables do not have is no error: the nearest spelling is taken, and the number is returned
# without the name that was used. "steel" and "copper" are found. Iron gets 1/30 of its
# conductivity, cast iron that of a gas, carbon steel a density of 1550 kg/m3.
# Ask nearest_material(name) first and read what it answers.
#
# Output seen:
#   steel        Metals, steel           k 50     W/(m K), rho 7800 kg/m3
#   copper       Metals, copper          k 380    W/(m K), rho 8900 kg/m3
#   iron         Zircon                  k 2.67   W/(m K), rho 3940 kg/m3
#   cast iron    Gases, argon            k 0.017  W/(m K), rho 1.7 kg/m3
#   carbon steel Carbon, graphite        k 67     W/(m K), rho 1550 kg/m3
#   aluminium    a/b-Alumina             k 4.78   W/(m K), rho 3200 kg/m3
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q ht==1.2.0 fluids==1.3.1
"$work/venv/bin/python" - <<'END'
import sys

from ht import k_material, nearest_material, rho_material

NAMES = ("steel", "copper", "iron", "cast iron", "carbon steel", "aluminium")
taken = {}
for name in NAMES:
    taken[name] = nearest_material(name)
    k, rho = k_material(name), rho_material(name)
    print(f"{name:12s} {taken[name]:23s} k {k:<6g} W/(m K), rho {rho:g} kg/m3")
right = "steel" in taken["steel"] and "copper" in taken["copper"]
iron = taken["iron"] == "Zircon" and k_material("iron") < 3.0
other = "argon" in taken["cast iron"] and "graphite" in taken["carbon steel"]
sys.exit(0 if right and iron and other else "ht has changed")
END
