#!/bin/bash
# CalculiX creeps as at one temperature if the elastic constants are given at one only.
#
# Versions: CalculiX 2.20-1 of Debian 12.
#
# *CREEP takes a row of constants for each temperature, like every other property. But the solver
# keeps them at the temperatures of the rows of *ELASTIC, and no others. With one row for Young's
# modulus, the usual one, the first row of *CREEP holds at all temperatures: a steel whose creep is
# 50 times faster at 1400 than at 1200 K creeps at 1400 as at 1200 K. With *ELASTIC at 300 and
# 1500 K the rate at 1200 K is 38 times too high, on a straight line between the values at both
# ends. The yield stress in *PLASTIC is right at each temperature. There is no warning.
# And a material with *PLASTIC beside *CREEP does not creep at all below its yield stress.
# Give *ELASTIC a row, the same constants if need be, at each temperature of *CREEP.
#
# Output seen (rate over the one at 1200 K in the table; bar of 10 MPa, rate = A stress^2, 100 s):
#   in the table                     1200 K: 1, 1300 K: 8, 1400 K: 50
#   *ELASTIC without a temperature   1200 K: 1, 1300 K: 1, 1400 K: 1
#   *ELASTIC at 1300 K               1200 K: 8, 1300 K: 8, 1400 K: 8
#   *ELASTIC at 1200 and 1400 K      1200 K: 1, 1300 K: 25.5, 1400 K: 50
#   *ELASTIC at 300 and 1500 K       1200 K: 37.7, 1300 K: 41.8, 1400 K: 45.9
#   *ELASTIC at all of them          1200 K: 1, 1300 K: 8, 1400 K: 50
#   the same and *PLASTIC, 1000 MPa  1200 K: 0, 1300 K: 0, 1400 K: 0
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck disable=SC2046
apt-get download -q calculix-ccx=2.20-1 \
    $(apt-get install -s calculix-ccx=2.20-1 | awk '/^Inst/ && $2 != "calculix-ccx" {print $2}') \
    >download.log 2>&1
for package in *.deb; do dpkg -x "$package" .; done
lib=$work/usr/lib/$(uname -m)-linux-gnu
export LD_LIBRARY_PATH=$lib:$lib/blas:$lib/lapack OMP_NUM_THREADS=1
"${PYTHON:-python3}" - <<'EOF'
import re
import subprocess
import sys
from pathlib import Path

# A in 1/(Pa^2 s) over the temperature; E and stress in Pa; seconds.
CREEP = {1200: 1e-20, 1250: 2e-20, 1300: 8e-20, 1350: 20e-20, 1400: 50e-20}
YOUNG, STRESS, TIME = 1e11, 1e7, 100.0
ASKED = (1200, 1300, 1400)


def rate(temperature, elastic, plastic=""):
    """The creep rate over that of the table at 1200 K, from the strain of a cube that is pulled."""
    rows = "\n".join(f"{a},2.,0.,{t}." for t, a in CREEP.items())
    Path("bar.inp").write_text(f"""*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=BAR
1,1,2,3,4,5,6,7,8
*NSET, NSET=TOP
5,6,7,8
*MATERIAL, NAME=STEEL
*ELASTIC
{elastic}
{plastic}*CREEP
{rows}
*SOLID SECTION, ELSET=BAR, MATERIAL=STEEL
*BOUNDARY
1,1,3
2,2,3
3,3,3
4,3,3
4,1,1
5,1,2
6,2,2
8,1,1
*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL,{temperature}.
*STEP, INC=10000
*VISCO, CETOL=1.E-4
1.,{TIME}
*TEMPERATURE
ALL,{temperature}.
*CLOAD
TOP,3,{STRESS / 4}
*EL PRINT, ELSET=BAR
E
*END STEP
""")
    subprocess.run(["usr/bin/ccx", "bar"], check=True, capture_output=True, timeout=120)
    last = Path("bar.dat").read_text().split("strains")[-1]
    strain = float(re.findall(r"-?\d\.\d+E[+-]\d+", last.split("\n", 1)[1])[2])
    return (strain - STRESS / YOUNG) / TIME / STRESS**2 / CREEP[1200]


def rows(*temperatures):
    return "\n".join(f"{YOUNG},.3,{t}." for t in temperatures)


def tell(name, rates):
    rates = [abs(round(r, 1)) for r in rates]
    words = ", ".join(f"{t} K: {r:g}" for t, r in zip(ASKED, rates, strict=True))
    print(f"{name:33s}{words}")
    return rates


table = tell("in the table", [CREEP[t] / CREEP[1200] for t in ASKED])
none = tell("*ELASTIC without a temperature", [rate(t, f"{YOUNG},.3") for t in ASKED])
one = tell("*ELASTIC at 1300 K", [rate(t, rows(1300)) for t in ASKED])
tell("*ELASTIC at 1200 and 1400 K", [rate(t, rows(1200, 1400)) for t in ASKED])
wide = tell("*ELASTIC at 300 and 1500 K", [rate(t, rows(300, 1500)) for t in ASKED])
full = tell("*ELASTIC at all of them", [rate(t, rows(*CREEP)) for t in ASKED])
plastic = "*PLASTIC\n1.E9,0.\n"
hard = [rate(t, rows(*CREEP), plastic) for t in ASKED]
hard = tell("the same and *PLASTIC, 1000 MPa", hard)
same = none == [1, 1, 1] and one == [8, 8, 8] and full == table and hard == [0, 0, 0]
sys.exit(0 if same and wide[0] > 30 else "CalculiX has changed")
EOF
