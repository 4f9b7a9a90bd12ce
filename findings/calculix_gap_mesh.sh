#!/bin/bash
# Whether heat crosses a gap in CalculiX depends on the size of the cells beside it.
#
# Versions: CalculiX 2.20-1 of Debian 12.
#
# *GAP CONDUCTANCE gives a contact its heat-transfer coefficient. Two steel blocks with faces of
# 50 x 50 mm stand 9, 20 or 30 micrometres apart, as a strand and its mould. Where the gap is wider
# than a thousandth of the root of the area of a cell's face, nothing conducts, without a
# message: the gap of 20 micrometres lets through as much as closed contact with one cell of 50 mm,
# a seventh with cells of 25 mm, and nothing with cells of 10 mm. So a finer mesh insulates a mould.
# With surface-to-surface contact a gap of 1 micrometre insulates at any size of the cells. Steps of
# heat alone and coupled ones do the same.
# And a table of the coefficient over pressure takes an open gap for a pressed one: 0.1 to 3
# micrometres of air conduct like the highest pressure in the table.
# The third number of *SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR, is the factor. With 0.1,
# gaps up to a tenth of the cell conduct, by contact of the type node to surface.
#
# Output seen (kW/m2 between 400 and 1400 K, exact 428.6 through 1000 W/(m2 K)):
#   1 cell of 50 mm 0 um: 428.6, 9 um: 428.6, 20 um: 428.6, 30 um: 0.0
#   2 x 2 of 25 mm  0 um: 428.6, 9 um: 428.6, 20 um: 63.1, 30 um: 0.0
#   5 x 5 of 10 mm  0 um: 428.6, 9 um: 294.4, 20 um: 0.0, 30 um: 0.0
#   5 x 5, coupled  0 um: 428.6, 9 um: 294.4, 20 um: 0.0, 30 um: 0.0
#   5 x 5, 0.1      0 um: 428.6, 9 um: 428.6, 20 um: 428.6, 30 um: 428.6
#   1, surface      0 um: 428.6, 9 um: 0.0, 20 um: 0.0, 30 um: 0.0
#   100 to 1000 W/(m2 K) over 0 to 1 MPa, gap 3 um: 428.6, 30 um: 0.0
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

SIDE, HIGH, CONDUCTIVITY = 0.05, 0.02, 30.0


def blocks(gap, n):
    """Nodes, cells and sets of two blocks of n x n cells, one over the other."""
    m = n + 1
    heights = (0, HIGH, HIGH + gap, 2 * HIGH + gap)
    number = lambda layer, i, j: layer * m * m + j * m + i + 1
    nodes = [
        f"{number(k, i, j)},{i * SIDE / n:.9g},{j * SIDE / n:.9g},{z:.9g}"
        for k, z in enumerate(heights)
        for j in range(m)
        for i in range(m)
    ]
    cells = []
    for low in (0, 2):
        for j in range(n):
            for i in range(n):
                corners = [
                    number(low + k, i + a, j + b)
                    for k in (0, 1)
                    for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))
                ]
                cells.append(f"{len(cells) + 1}," + ",".join(map(str, corners)))
    lines = "\n".join
    return f"""*NODE, NSET=ALL
{lines(nodes)}
*ELEMENT, TYPE=C3D8, ELSET=STEEL
{lines(cells)}
*NSET, NSET=COLD, GENERATE
1,{m * m}
*NSET, NSET=HOT, GENERATE
{3 * m * m + 1},{4 * m * m}
*SURFACE, NAME=LOW
{lines(f"{k + 1},S2" for k in range(n * n))}
*SURFACE, NAME=HIGH
{lines(f"{n * n + k + 1},S1" for k in range(n * n))}
"""


def flux(gap, n, kind="NODE TO SURFACE", linear="1.E12", table="1000.", coupled=False):
    """The heat flux through the lower block, in kW/m2; gap in micrometres."""
    step = "COUPLED TEMPERATURE-DISPLACEMENT" if coupled else "HEAT TRANSFER"
    text = f"""{blocks(gap * 1e-6, n)}*MATERIAL, NAME=S
*DENSITY
7000.
*CONDUCTIVITY
{CONDUCTIVITY}
*SPECIFIC HEAT
700.
*ELASTIC
2.E11,.3
*SOLID SECTION, ELSET=STEEL, MATERIAL=S
*SURFACE INTERACTION, NAME=CONTACT
*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR
{linear}
*GAP CONDUCTANCE
{table}
*CONTACT PAIR, INTERACTION=CONTACT, TYPE={kind}
HIGH,LOW
*INITIAL CONDITIONS, TYPE=TEMPERATURE
ALL,600.
*STEP, INC=1000
*{step}, STEADY STATE
1.,1.
*BOUNDARY
ALL,1,3,0.
COLD,11,11,400.
HOT,11,11,1400.
*NODE PRINT, NSET=ALL
NT
*END STEP
"""
    if not coupled:
        text = text.replace("ALL,1,3,0.\n", "")
    Path("gap.inp").write_text(text)
    subprocess.run(["usr/bin/ccx", "gap"], check=True, capture_output=True, timeout=120)
    rows = re.findall(r"^\s+(\d+)\s+([\d.E+-]+)\s*$", Path("gap.dat").read_text(), re.M)
    temperature = [float(value) for _, value in rows]
    face = temperature[(n + 1) ** 2 : 2 * (n + 1) ** 2]
    return CONDUCTIVITY * (sum(face) / len(face) - 400.0) / HIGH / 1e3


GAPS = (0, 9, 20, 30)
seen = {}
for name, n, more in (
    ("1 cell of 50 mm", 1, {}),
    ("2 x 2 of 25 mm", 2, {}),
    ("5 x 5 of 10 mm", 5, {}),
    ("5 x 5, coupled", 5, {"coupled": True}),
    ("5 x 5, 0.1", 5, {"linear": "1.E12,0.,0.1"}),
    ("1, surface", 1, {"kind": "SURFACE TO SURFACE"}),
):
    seen[name] = [flux(gap, n, **more) for gap in GAPS]
    words = ", ".join(f"{gap} um: {q:.1f}" for gap, q in zip(GAPS, seen[name], strict=True))
    print(f"{name:16s}{words}")
table = "100.,0.\n1000.,1.E6"
pressed = [flux(gap, 1, table=table) for gap in (3, 30)]
print(f"100 to 1000 W/(m2 K) over 0 to 1 MPa, gap 3 um: {pressed[0]:.1f}, 30 um: {pressed[1]:.1f}")
exact = 1.0 / (2 * HIGH / CONDUCTIVITY + 1e-3)
mesh = [seen[name][2] for name in ("1 cell of 50 mm", "2 x 2 of 25 mm", "5 x 5 of 10 mm")]
same = abs(mesh[0] - exact) < 1.0 and 10.0 < mesh[1] < 200.0 and mesh[2] < 1.0
same = same and seen["5 x 5, coupled"][2] < 1.0 and min(seen["5 x 5, 0.1"]) > 428.0
same = same and seen["1, surface"][1] < 1.0 and pressed[0] > 400.0 and pressed[1] < 1.0
sys.exit(0 if same else "CalculiX has changed")
EOF
