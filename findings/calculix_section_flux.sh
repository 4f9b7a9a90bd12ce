#!/bin/bash
# CalculiX prints half of the heat through a surface for some plane elements, all of it for others.
#
# Versions: CalculiX 2.20-1 of Debian 12.
#
# *SECTION PRINT gives the heat (FLUX) or the force (SOF) through a surface. Of a plane section, as
# that of a strand, with CPE4 or CPE8R it is half of what it should be. With CPE4R and CPE8 it is
# right, and so it is with solid elements. Temperatures and the heat at the nodes (RFL) are right in
# all of them. So a switch from full to reduced integration, or back, doubles the heat of a mould or
# halves it. Where a body is axisymmetric the same kinds of elements give half, beside a second
# factor: what is printed, RFL, RF and *SECTION PRINT, is that of a sector of 2 degrees, 1/180 of
# the whole, while a force of *CLOAD is that of the whole circle: the reaction to 2100 N is 11.67 N.
# Sum RFL or RF over the nodes of the surface, and multiply by 180 where it is axisymmetric.
#
# Output seen (share of the exact heat or force, from the nodes and from *SECTION PRINT):
#   CPE4  heat 1.0000 and 0.5000, force 1.0000 and 0.5000
#   CPE4R heat 1.0000 and 1.0000, force 1.0000 and 1.0000
#   CPE8  heat 1.0000 and 1.0000, force 1.0000 and 1.0001
#   CPE8R heat 1.0000 and 0.5000, force 1.0000 and 0.5000
#   CAX4  heat 0.0056 and 0.0029, force 0.0056 and 0.0028
#   CAX4R heat 0.0056 and 0.0057, force 0.0056 and 0.0056
#   CAX8  heat 0.0056 and 0.0056, force 0.0056 and 0.0056
#   CAX8R heat 0.0056 and 0.0028, force 0.0056 and 0.0028
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
import math
import re
import subprocess
import sys
from pathlib import Path

CELLS, HEIGHT, THICK, CONDUCTIVITY, DROP, LOAD = 10, 0.1, 0.5, 30.0, 700.0, 100.0


def strip(element):
    """A strip from x = 1 to 2, with sets of its ends and of its top and bottom."""
    numbers = {}
    cells = []

    def node(x, y):
        return numbers.setdefault((round(x, 6), round(y, 6)), len(numbers) + 1)

    d = 1.0 / CELLS
    for i in range(CELLS):
        x, h = 1 + i * d, HEIGHT
        corners = [node(x, 0), node(x + d, 0), node(x + d, h), node(x, h)]
        if "8" in element:
            corners += [node(x + d / 2, 0), node(x + d, h / 2), node(x + d / 2, h), node(x, h / 2)]
        cells.append(f"{i + 1}," + ",".join(map(str, corners)))
    lines = "\n".join
    text = "*NODE, NSET=ALL\n" + lines(f"{n},{x},{y},0" for (x, y), n in numbers.items())
    text += f"\n*ELEMENT, TYPE={element}, ELSET=STRIP\n" + lines(cells)
    sides = {"IN": (0, 1.0), "OUT": (0, 2.0), "BOTTOM": (1, 0.0), "TOP": (1, HEIGHT)}
    for name, (axis, place) in sides.items():
        members = (f"{n}," for p, n in numbers.items() if abs(p[axis] - place) < 1e-9)
        text += f"\n*NSET, NSET={name}\n" + lines(members)
    return text, sum(abs(y - HEIGHT) < 1e-9 for _, y in numbers)


def solve(element, step, what):
    """The sum over the nodes and that of *SECTION PRINT, without their signs."""
    mesh, loaded = strip(element)
    thickness = "" if element.startswith("CAX") else f"{THICK}\n"
    Path("plane.inp").write_text(f"""{mesh}
*SURFACE, NAME=END
{CELLS},S2
*SURFACE, NAME=BASE
""" + "\n".join(f"{k + 1},S1" for k in range(CELLS)) + f"""
*MATERIAL, NAME=S
*ELASTIC
1.E11,0.
*CONDUCTIVITY
{CONDUCTIVITY}
*DENSITY
7000.
*SPECIFIC HEAT
700.
*SOLID SECTION, ELSET=STRIP, MATERIAL=S
{thickness}*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL,300.
*STEP
{step}*END STEP
""")
    subprocess.run(["usr/bin/ccx", "plane"], check=True, capture_output=True, timeout=120)
    told = Path("plane.dat").read_text()
    rows = [line.split() for line in told.splitlines() if re.match(r"^\s+-?\d\.\d+E", line)]
    return [abs(float(row[what])) for row in rows[:2]], loaded


HEAT = f"""*HEAT TRANSFER, STEADY STATE
*BOUNDARY
IN,11,11,{300 + DROP}
OUT,11,11,300.
*NODE PRINT, NSET=OUT, TOTALS=ONLY
RFL
*SECTION PRINT, SURFACE=END, NAME=HEAT
FLUX
"""
FORCE = f"""*STATIC
*BOUNDARY
BOTTOM,2,2
*CLOAD
TOP,2,{LOAD}
*NODE PRINT, NSET=BOTTOM, TOTALS=ONLY
RF
*SECTION PRINT, SURFACE=BASE, NAME=FORCE
SOF
"""
shares = {}
for element in ("CPE4", "CPE4R", "CPE8", "CPE8R", "CAX4", "CAX4R", "CAX8", "CAX8R"):
    if element.startswith("CAX"):
        exact = 2 * math.pi * CONDUCTIVITY * DROP / math.log(2.0) * HEIGHT
    else:
        exact = CONDUCTIVITY * DROP * HEIGHT * THICK
    heat, _ = solve(element, HEAT, 0)
    force, loaded = solve(element, FORCE, 1)
    heat = [q / exact for q in heat]
    force = [f / (LOAD * loaded) for f in force]
    shares[element] = (*heat, *force)
    print(
        f"{element:6s}heat {heat[0]:.4f} and {heat[1]:.4f}, force {force[0]:.4f} and {force[1]:.4f}"
    )


def near(element, *expected):
    found = shares[element][:3]
    return all(abs(a - b) < 0.03 * b for a, b in zip(found, expected, strict=True))


whole, sector = 1.0, 1 / 180
same = near("CPE4", whole, whole / 2, whole) and near("CPE4R", whole, whole, whole)
same = same and near("CPE8", whole, whole, whole) and near("CPE8R", whole, whole / 2, whole)
same = same and near("CAX8", sector, sector, sector) and near("CAX8R", sector, sector / 2, sector)
sys.exit(0 if same else "CalculiX has changed")
EOF
