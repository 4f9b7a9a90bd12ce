#!/bin/bash
# thermo gives solid iron the heat capacity of delta iron throughout: 67 % too much at 300 K.
#
# Versions: thermo 0.6.1, chemicals 1.5.2, fluids 1.3.1 (Python 3.11, 3.12).
#
# Chemical("iron").Cp is 749 J/(kg K) at 300 K, at the Curie point and at 1800 K. The library has
# one function of temperature for solid iron, a constant for 1674 to 1803 K, and goes on with it
# down to 300 K without a message. Its own value at 298 K is 449 J/(kg K). So a cold strand, roll or
# plate of iron holds too much heat, and the peak of ferrite at 1043 K and austenite are missing.
# Copper, nickel, chromium and manganese have functions from 298 K on.
# Read HeatCapacitySolid.method and .T_limits of a substance before its numbers are used, and take
# iron from elsewhere.
#
# Output seen (J/(kg K); the value is that at 298 K):
#   iron      at 300, 600, 1043 K: 749, 749, 749; value 449; PERRY151 is for 1674 to 1803 K
#   copper    at 300, 600, 1043 K: 385, 418, 456; value 384; WEBBOOK_SHOMATE is for 298 to 1358 K
#   nickel    at 300, 600, 1043 K: 444, 594, 554; value 445; WEBBOOK_SHOMATE is for 298 to 1728 K
#   chromium  at 300, 600, 1043 K: 451, 533, 628; value 450; WEBBOOK_SHOMATE is for 298 to 2130 K
#   manganese at 300, 600, 1043 K: 479, 581, 689; value 479; WEBBOOK_SHOMATE is for 298 to 1519 K
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q thermo==0.6.1 chemicals==1.5.2 fluids==1.3.1
"$work/venv/bin/python" - <<'END'
import sys

from thermo import Chemical

METALS = ("iron", "copper", "nickel", "chromium", "manganese")
capacity, value, limits = {}, {}, {}
for name in METALS:
    capacity[name] = [Chemical(name, T=t).Cp for t in (300.0, 600.0, 1043.0)]
    metal = Chemical(name, T=300.0)
    function = metal.HeatCapacitySolid
    value[name] = function.calculate(298.15, "CRCSTD") / metal.MW * 1e3
    limits[name] = function.T_limits[function.method]
    words = ", ".join(f"{c:.0f}" for c in capacity[name])
    low, high = limits[name]
    print(
        f"{name:9s} at 300, 600, 1043 K: {words}; value {value[name]:.0f}; "
        f"{function.method} is for {low:.0f} to {high:.0f} K"
    )
others = max(abs(capacity[name][0] / value[name] - 1.0) for name in METALS[1:])
iron = capacity["iron"]
same = max(iron) - min(iron) < 1.0 and 1.6 < iron[0] / value["iron"] < 1.7 and others < 0.02
sys.exit(0 if same and limits["iron"][0] > 1600.0 else "thermo has changed")
END
