#!/bin/bash
# CalculiX takes the last temperatures of a heat calculation for its stress, not their history.
#
# Versions: CalculiX 2.20-1 of Debian 12.
#
# The temperatures of a heat step are stored at each of its increments, and a stress step of the
# same length reads them with *TEMPERATURE, FILE=heat.frd, BSTEP=1. A block is chilled from 1000 to
# 500 K in the first second, stays so until 5 s, and is at 800 K after 10 s, as a strand that leaves
# its mould. The stress step goes in a straight line from the initial temperature to the last one:
# it has 980 K at 1 s. What was stored between is not used, and no message says so. The end is
# right, so that a comparison there finds nothing, but stresses that depend on the path are not.
# Make a step of the heat calculation for each time, and one of the stress for each, with its number
# as BSTEP.
#
# Output seen (temperature in K of the stress calculation):
#   stored by the heat step      1 s: 500, 2 s: 500, 5 s: 500, 10 s: 800
#   stress, one step of 10 s     1 s: 980, 2 s: 960, 5 s: 900, 10 s: 800
#   stress, ten steps of 1 s     1 s: 500, 2 s: 500, 5 s: 500, 10 s: 800
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

BLOCK = """*NODE, NSET=ALL
1,0,0,0
2,1,0,0
3,1,1,0
4,0,1,0
5,0,0,1
6,1,0,1
7,1,1,1
8,0,1,1
*ELEMENT, TYPE=C3D8, ELSET=BLOCK
1,1,2,3,4,5,6,7,8
*MATERIAL, NAME=STEEL
*DENSITY
7000.
*CONDUCTIVITY
30.
*SPECIFIC HEAT
700.
*ELASTIC
1.E11,.3
*EXPANSION, ZERO=1000.
1.E-5
*SOLID SECTION, ELSET=BLOCK, MATERIAL=STEEL
*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL,1000.
"""
CHILL = "*AMPLITUDE, NAME=CHILL, TIME=TOTAL TIME\n0.,1.,1.,.5,5.,.5,10.,.8\n"


def solve(name, text):
    Path(name + ".inp").write_text(text)
    subprocess.run(["usr/bin/ccx", name], check=True, capture_output=True, timeout=120)


def heat(name, lengths):
    """The temperature of the block, stored each second, in steps of these lengths."""
    steps = "".join(
        f"*STEP, INC=1000\n*HEAT TRANSFER, DIRECT\n1.,{length}\n"
        "*BOUNDARY, AMPLITUDE=CHILL\nALL,11,11,1000.\n*NODE FILE\nNT\n*END STEP\n"
        for length in lengths
    )
    solve(name, BLOCK + CHILL + steps)
    stored = [float(v) for v in re.findall(r"^ -1\s+1\s*([\d.E+-]+)$", frd(name), re.M)]
    return dict(zip(range(1, 11), stored, strict=True))


def frd(name):
    return Path(name + ".frd").read_text().split("NDTEMP", 1)[1]


def stress(source, lengths):
    """The temperatures that the stress calculation has, by time."""
    steps = "".join(
        f"*STEP, INC=1000, NLGEOM\n*STATIC, DIRECT\n1.,{length}\n"
        f"*TEMPERATURE, FILE={source}.frd, BSTEP={k + 1}\n*NODE PRINT, NSET=ALL\nNT\n*END STEP\n"
        for k, length in enumerate(lengths)
    )
    held = "*BOUNDARY\n1,1,3\n2,2,3\n3,3,3\n4,3,3\n4,1,1\n5,1,2\n6,2,2\n8,1,1\n"
    solve("stress", BLOCK + held + steps)
    rows = r"temperatures.*time\s+([\d.E+-]+)\s+1\s+([\d.E+-]+)"
    return {float(t): float(v) for t, v in re.findall(rows, Path("stress.dat").read_text())}


def tell(name, temperature):
    words = ", ".join(f"{t} s: {temperature[t]:.0f}" for t in (1, 2, 5, 10))
    print(f"{name:29s}{words}")
    return [round(temperature[t]) for t in (1, 2, 5, 10)]


one, ten = [10.0], [1.0] * 10
stored = tell("stored by the heat step", heat("heat", one))
static = tell("stress, one step of 10 s", stress("heat", one))
heat("steps", ten)
by_step = tell("stress, ten steps of 1 s", stress("steps", ten))
same = stored == by_step == [500, 500, 500, 800]
same = same and static == [980, 960, 900, 800]
sys.exit(0 if same else "CalculiX has changed")
EOF
