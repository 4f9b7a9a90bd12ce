#!/bin/bash
# ht gives the Sanitjai-Goldstein Nusselt number of a cylinder when asked for Churchill-Bernstein.
#
# Versions: ht 1.2.0 (Python 3.11).
#
# Nu_external_cylinder takes the name of a correlation for a cylinder in a cross flow, such as air
# over a roll. Its method "Churchill-Bernstein" calls the function of Sanitjai and Goldstein: both
# names give the same number, without a message. For air at Re = 1e5, about 5 m/s over a roll of
# 300 mm, that is 24 % more than the correlation of Churchill and Bernstein, at Re = 100 13 % less.
# The function Nu_cylinder_Churchill_Bernstein itself is right, and so are the other methods. Who
# compares correlations to see how far they differ finds these two to agree in every digit.
#
# Output seen (Nu of air, Pr 0.71; formula: Churchill and Bernstein 1977 written out):
#   Re     formula  function  method  Sanitjai-Goldstein
#   1e+02     5.18      5.18    4.52    4.52
#   1e+03    16.02     16.02   15.64   15.64
#   1e+04    53.63     53.63   58.89   58.89
#   1e+05   215.35    215.35  266.86  266.86
#   other methods that are not their function: none of 7
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q ht==1.2.0
"$work/venv/bin/python" - <<'END'
import sys

import ht

PR = 0.71
OTHERS = {
    "Sanitjai-Goldstein": ht.Nu_cylinder_Sanitjai_Goldstein,
    "Fand": ht.Nu_cylinder_Fand,
    "McAdams": ht.Nu_cylinder_McAdams,
    "Zukauskas": ht.Nu_cylinder_Zukauskas,
    "Whitaker": ht.Nu_cylinder_Whitaker,
    "Perkins-Leppert 1962": ht.Nu_cylinder_Perkins_Leppert_1962,
    "Perkins-Leppert 1964": ht.Nu_cylinder_Perkins_Leppert_1964,
}


def churchill_bernstein(re):
    """Nusselt number of a cylinder in a cross flow, for Re Pr > 0.2."""
    laminar = 0.62 * re**0.5 * PR ** (1 / 3) / (1 + (0.4 / PR) ** (2 / 3)) ** 0.25
    return 0.3 + laminar * (1 + (re / 282000) ** (5 / 8)) ** (4 / 5)


same, wrong = True, set()
print("Re     formula  function  method  Sanitjai-Goldstein")
for re in (1e2, 1e3, 1e4, 1e5):
    formula = churchill_bernstein(re)
    function = ht.Nu_cylinder_Churchill_Bernstein(re, PR)
    method = ht.Nu_external_cylinder(re, PR, Method="Churchill-Bernstein")
    other = ht.Nu_cylinder_Sanitjai_Goldstein(re, PR)
    print(f"{re:.0e} {formula:8.2f} {function:9.2f} {method:7.2f} {other:7.2f}")
    same = same and abs(formula / function - 1) < 1e-6 and method == other
    same = same and abs(method / formula - 1) > 0.02
    for name, own in OTHERS.items():
        if ht.Nu_external_cylinder(re, PR, Method=name) != own(re, PR):
            wrong.add(name)
print(f"other methods that are not their function: {sorted(wrong) or 'none'} of {len(OTHERS)}")
sys.exit(0 if same and not wrong else "ht has changed")
END
