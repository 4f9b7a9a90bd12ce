#!/bin/bash
# Prisms of a CalculiX result count negative in VTK after ccx2paraview, a twelfth after frd2vtu.
#
# Versions: CalculiX 2.20-1 of Debian 12, ccx2paraview 3.2.0, frd2vtu 0.2.1, pyvista-frd-reader
# 0.3.1, PyVista 0.49.1, VTK 9.7.2 (Python 3.11).
#
# A piece of steel, 50 x 50 x 100 mm, has one brick in one half and two prisms in the other, with
# temperatures from 1000 to 1500 K along z. CalculiX writes them to its frd file.
# ccx2paraview turns the two triangles of a prism round, as the documentation of VTK has them;
# VTK itself takes such a prism for one of negative volume. In an integral (Integrate Variables in
# ParaView, integrate_data in PyVista) the prisms are then subtracted: the piece has no volume and
# no heat. The same with prisms of second order, which also lose their nodes between the corners.
# frd2vtu keeps the order of CalculiX for the 15 nodes of a second-order prism. VTK wants the nodes
# at half height last, so each prism has a twelfth of its volume, and a point inside it is in no
# cell: the value sampled there is 0. Bricks and tetrahedra are right. There is no message.
# pyvista-frd-reader reads all of them rightly.
#
# Output seen (volume in cm3, exact 250; temperature in K at a point in a prism, exact 1375):
#   first order, ccx2paraview:  volume   0.0, bricks 125.0, prisms -125.0, at the point 1375.0
#   first order, frd2vtu:       volume 250.0, bricks 125.0, prisms 125.0, at the point 1375.0
#   first order, frd reader:    volume 250.0, bricks 125.0, prisms 125.0, at the point 1375.0
#   second order, ccx2paraview: volume   0.0, bricks 125.0, prisms -125.0, at the point 1375.0
#   second order, frd2vtu:      volume 135.4, bricks 125.0, prisms 10.4, at the point 0.0
#   second order, frd reader:   volume 250.0, bricks 125.0, prisms 125.0, at the point 1375.0
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# shellcheck disable=SC2046
apt-get download -q calculix-ccx=2.20-1 \
    $(apt-get install -s calculix-ccx=2.20-1 | awk '/^Inst/ && $2 != "calculix-ccx" {print $2}') \
    >download.log 2>&1
for package in *.deb; do dpkg -x "$package" .; done
"${PYTHON:-python3}" -m venv venv
venv/bin/pip install -q ccx2paraview==3.2.0 frd2vtu==0.2.1 pyvista-frd-reader==0.3.1 \
    pyvista==0.49.1 vtk==9.7.2
cat >run.py <<'END'
import os
import subprocess
import sys
from pathlib import Path

import frd2vtu
import numpy as np
import pyvista as pv
import pyvista_frd

SIDE = 0.05
POINT = np.array([[0.7, 0.4, 1.5]]) * SIDE
BRICK_EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4)]
BRICK_EDGES += [(0, 4), (1, 5), (2, 6), (3, 7)]
PRISM_EDGES = [(0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)]
SQUARE = [(0, 0), (1, 0), (1, 1), (0, 1)]
BRICK = [(x, y, z) for z in (0, 1) for x, y in SQUARE]
PRISMS = [
    [(SQUARE[i][0], SQUARE[i][1], z) for z in (1, 2) for i in corners]
    for corners in ((0, 1, 2), (0, 2, 3))
]
CELLS = [("C3D8", "C3D20", BRICK, BRICK_EDGES)]
CELLS += [("C3D6", "C3D15", prism, PRISM_EDGES) for prism in PRISMS]


def piece(name, second, binary):
    """Let CalculiX write the piece with its temperatures to NAME.frd."""
    numbers, cells = {}, []
    for number, (linear, quadratic, corners, edges) in enumerate(CELLS, 1):
        points = [np.array(c, dtype=float) for c in corners]
        if second:
            points += [(points[a] + points[b]) / 2 for a, b in edges]
        ids = [numbers.setdefault(tuple(p), len(numbers) + 1) for p in points]
        cells.append(f"*ELEMENT, TYPE={quadratic if second else linear}, ELSET=STEEL")
        first, rest = ids[:10], ids[10:]
        cells.append(f"{number}," + ",".join(map(str, first)) + ("," if rest else ""))
        if rest:
            cells.append(",".join(map(str, rest)))
    nodes = [f"{n},{x * SIDE},{y * SIDE},{z * SIDE}" for (x, y, z), n in numbers.items()]
    fixed = [f"{n},11,11,{1000 + 250 * z}" for (_, _, z), n in numbers.items()]
    deck = ["*NODE, NSET=ALL", *nodes, *cells, "*MATERIAL, NAME=STEEL", "*CONDUCTIVITY", "30."]
    deck += ["*SOLID SECTION, ELSET=STEEL, MATERIAL=STEEL", "*STEP", "*HEAT TRANSFER, STEADY STATE"]
    deck += ["*BOUNDARY", *fixed, "*NODE OUTPUT" if binary else "*NODE FILE", "NT", "*END STEP"]
    Path(f"{name}.inp").write_text("\n".join(deck) + "\n")
    lib = Path("usr/lib") / f"{os.uname().machine}-linux-gnu"
    paths = ":".join(str((lib / part).resolve()) for part in ("", "blas", "lapack"))
    settings = {**os.environ, "LD_LIBRARY_PATH": paths, "OMP_NUM_THREADS": "1"}
    subprocess.run(["usr/bin/ccx", name], check=True, capture_output=True, env=settings)


def converted(name, second, tool):
    """The result as VTK has it after this tool."""
    piece(name, second, tool == "frd2vtu")
    if tool == "frd reader":
        return pyvista_frd.read(f"{name}.frd")
    if tool == "frd2vtu":
        frd2vtu.frdbin2vtu(f"{name}.frd")
    else:
        command = ["venv/bin/ccx2paraview", f"{name}.frd", "vtu"]
        subprocess.run(command, check=True, capture_output=True)
    return pv.read(f"{name}.vtu")


def volume(grid):
    """Volume in cm3 by VTK's integral."""
    return 1e6 * float(grid.integrate_data()["Volume"][0])


same = True
for second in (False, True):
    for tool in ("ccx2paraview", "frd2vtu", "frd reader"):
        grid = converted(f"{tool[:4].strip()}{second:d}{tool[-3:]}", second, tool)
        name = next(k for k in grid.point_data if k.startswith(("NT", "NDTEMP")))
        grid["T"] = np.asarray(grid[name], dtype=float).ravel()
        whole = volume(grid)
        bricks, prisms = volume(grid.extract_cells([0])), volume(grid.extract_cells([1, 2]))
        at = float(pv.PolyData(POINT).sample(grid)["T"][0])
        label = f"{'second' if second else 'first'} order, {tool}:"
        print(
            f"{label:27} volume {whole:5.1f}, bricks {bricks:.1f}, prisms {prisms:.1f},"
            f" at the point {at:.1f}"
        )
        share, seen = 1.0, 1375.0
        if tool == "ccx2paraview":
            share = -1.0
        elif tool == "frd2vtu" and second:
            share, seen = 1.0 / 12.0, 0.0
        same = same and abs(bricks - 125.0) < 0.1 and abs(prisms - 125.0 * share) < 0.1
        same = same and abs(whole - bricks - prisms) < 0.1 and abs(at - seen) < 1.0
sys.exit(0 if same else "the converters have changed")
END
venv/bin/python run.py
