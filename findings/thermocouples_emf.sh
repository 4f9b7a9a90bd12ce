#!/bin/bash
# thermocouples gives false voltages for types B, R and S, and false temperatures for J, N and S.
#
# Versions: thermocouples 2.1.2, thermocouple-its90 1.0.2 (Python 3.11, 3.12).
#
# The ITS-90 functions are right in a part of the range of these types and wrong in the next,
# without a message. From temperature to voltage: S above 1064 degC (with the wrong sign), R above
# 1664 degC and B above 630 degC, so all of liquid steel. From voltage to temperature: J above
# 760 degC, S by up to 35 K below 1200 degC, N by up to 93 K below 600 degC; R is refused from 1205
# to 1660 degC; and a type B without a voltage, a cold one, reads 98 degC. E, K and T are right
# both ways; so is a reading of S or B in liquid steel.
# thermocouple-its90 returns each temperature it was given, for all types.
#
# Output seen (where the error is above 0.6 K; in steps of 5 K):
#   B: temp_to_volt 635..1815 degC
#   E: right
#   J: volt_to_temp 765..1190 degC
#   K: right
#   N: volt_to_temp 225..595 degC
#   R: temp_to_volt 1665..1760 degC, volt_to_temp 1730..1760 degC, refused 1205..1660 degC
#   S: temp_to_volt 1065..1760 degC, volt_to_temp 235..1195 degC
#   T: right
#   S at 1550 degC: -31.641 mV, right 16.182
#   B at 1550 degC: 170.569 mV, right 10.679
#   R at 1700 degC: -57.762 mV, right 20.222
#   J with 45.494 mV: -123.5 degC, right 800
#   N with 20.418 mV: 687.8 degC, right 595
#   S with 11.890 mV: 1159.9 degC, right 1195
#   B without a voltage: 98.4 degC
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q thermocouples==2.1.2 thermocouple-its90==1.0.2
"$work/venv/bin/python" - <<'END'
import sys

import thermocouple_its90
from thermocouples import get_thermocouple

RANGES = {
    "B": (250, 1815), "E": (0, 990), "J": (0, 1190), "K": (0, 1370),
    "N": (0, 1295), "R": (0, 1760), "S": (0, 1760), "T": (0, 395),
}  # fmt: skip
wrong = {}
for kind, (low, high) in RANGES.items():
    table, tried = thermocouple_its90.get(kind), get_thermocouple(kind)
    bad = {"temp_to_volt": [], "volt_to_temp": [], "refused": []}
    for t in range(low, high + 1, 5):
        emf = table.emf(float(t))
        if abs(table.temperature(emf) - t) > 0.01:
            sys.exit("thermocouple-its90 has changed")
        if abs(1e3 * tried.temp_to_volt(float(t)) - emf) > 0.6 * table.seebeck(float(t)):
            bad["temp_to_volt"].append(t)
        try:
            if abs(tried.volt_to_temp(1e-3 * emf) - t) > 0.6:
                bad["volt_to_temp"].append(t)
        except ValueError:
            bad["refused"].append(t)
    wrong[kind] = {name: (at[0], at[-1]) for name, at in bad.items() if at}
    words = [f"{name} {a}..{b} degC" for name, (a, b) in wrong[kind].items()]
    print(f"{kind}: {', '.join(words) or 'right'}")
for kind, t in (("S", 1550), ("B", 1550), ("R", 1700)):
    seen = 1e3 * get_thermocouple(kind).temp_to_volt(float(t))
    emf = thermocouple_its90.get(kind).emf(float(t))
    print(f"{kind} at {t} degC: {seen:.3f} mV, right {emf:.3f}")
for kind, t in (("J", 800), ("N", 595), ("S", 1195)):
    emf = thermocouple_its90.get(kind).emf(float(t))
    seen = get_thermocouple(kind).volt_to_temp(1e-3 * emf)
    print(f"{kind} with {emf:.3f} mV: {seen:.1f} degC, right {t}")
cold = get_thermocouple("B").volt_to_temp(0.0)
print(f"B without a voltage: {cold:.1f} degC")
same = wrong["S"]["temp_to_volt"] == (1065, 1760) and wrong["B"]["temp_to_volt"] == (635, 1815)
same = same and "temp_to_volt" in wrong["R"] and "refused" in wrong["R"] and 98.0 < cold < 99.0
same = same and all("volt_to_temp" in wrong[kind] for kind in "JNS")
sys.exit(0 if same and not any(wrong[kind] for kind in "EKT") else "thermocouples has changed")
END
