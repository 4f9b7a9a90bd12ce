#!/bin/bash
# pycalphad says that iron and low-carbon steel have no ferrite at exactly 1043 K.
#
# Versions: pycalphad 0.11.2 (Python 3.12), with the Fe-C database that is part of the package.
#
# 1043 K is the Curie temperature of ferrite in the usual databases of iron, with any carbon. The
# magnetic part of the Gibbs energy has one formula below the Curie temperature and another above.
# At the temperature itself it has neither, and the energy of ferrite jumps up by 676 J/mol and its
# enthalpy by 3672 J/mol. A table in steps of 1 K meets this point: there, pure iron becomes
# austenite, over 100 K too early, and a steel with 0.1 % of carbon loses its 82 % of ferrite for
# one row. The result looks like any other. Shift the temperatures by 0.001 K.
#
# Output seen:
#   pure ferrite  1042.999 K: G -45202, H 27145 J/mol, cp 60.3 J/(mol K)
#   pure ferrite  1043.000 K: G -44526, H 30818 J/mol, cp 32.9 J/(mol K)
#   pure ferrite  1043.001 K: G -45202, H 27146 J/mol, cp 52.1 J/(mol K)
#   0.1 % carbon  1042.999 K: FCC_A1 0.18, BCC_A2 0.82
#   0.1 % carbon  1043.000 K: FCC_A1 1.00
#   0.1 % carbon  1043.001 K: FCC_A1 0.18, BCC_A2 0.82
#   pure iron is: 1042 K BCC_A2, 1043 K FCC_A1, 1044 K BCC_A2
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q pycalphad==0.11.2
"$work/venv/bin/python" -W ignore - <<'END'
import sys
from importlib.resources import files

import numpy as np
from pycalphad import Database, calculate, equilibrium
from pycalphad import variables as v

data = Database(str(files("pycalphad") / "tests" / "databases" / "cfe_broshe.tdb"))
TEMPERATURES = [1042.999, 1043.0, 1043.001]
OUTPUTS = ("GM", "HM", "heat_capacity")
IRON = (["FE", "VA"], "BCC_A2")
of = {
    name: np.ravel(calculate(data, *IRON, T=TEMPERATURES, P=101325, output=name)[name])
    for name in OUTPUTS
}
for i, t in enumerate(TEMPERATURES):
    g, h, cp = (of[name][i] for name in OUTPUTS)
    print(f"pure ferrite  {t:.3f} K: G {g:.0f}, H {h:.0f} J/mol, cp {cp:.1f} J/(mol K)")


def parts(elements, temperature, **more):
    """Stable phases and their amounts, in moles of atoms."""
    phases = ["LIQUID", "FCC_A1", "BCC_A2"] + (["CEMENTITE_D011"] if more else [])
    state = {v.P: 101325, v.N: 1, v.T: temperature, **{v.X(k): x for k, x in more.items()}}
    found = equilibrium(data, elements, phases, state)
    names, amounts = np.ravel(found.Phase), np.ravel(found.NP)
    return {str(n): float(a) for n, a in zip(names, amounts) if n}


steel = [parts(["FE", "C", "VA"], t, C=0.0046) for t in TEMPERATURES]
for t, amounts in zip(TEMPERATURES, steel):
    text = ", ".join(f"{name} {amount:.2f}" for name, amount in amounts.items())
    print(f"0.1 % carbon  {t:.3f} K: {text}")
iron = {t: next(iter(parts(["FE", "VA"], t))) for t in (1042, 1043, 1044)}
print("pure iron is:", ", ".join(f"{t} K {name}" for t, name in iron.items()))
jump = of["GM"][1] - of["GM"][[0, 2]].max()
ferrite = [amounts.get("BCC_A2", 0.0) for amounts in steel]
same = 660 < jump < 680 and ferrite[1] == 0.0 and min(ferrite[0], ferrite[2]) > 0.8
same = same and list(iron.values()) == ["BCC_A2", "FCC_A1", "BCC_A2"]
sys.exit(0 if same else "pycalphad has changed")
END
