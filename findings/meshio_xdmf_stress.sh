#!/bin/bash
# A stress of six components becomes another stress in an XDMF file of meshio, not in a VTU file.
#
# Versions: meshio 5.3.5, VTK 9.7.2, h5py 3.16.0 (Python 3.12).
#
# VTK takes six components for xx, yy, zz, xy, yz, xz. An array in this order, written by meshio to
# VTU, gives the right von Mises stress in VTK and ParaView. In XDMF, meshio calls the same array
# "Tensor6", whose order is xx, xy, xz, yy, yz, zz, and writes it as it is. VTK follows the order of
# XDMF when it reads the file and makes a full tensor of nine: what was yy stands on xy, what was
# zz on xz. The tensor is symmetric and of the right shape, and no message is given.
# meshio itself reads its XDMF file back as it was, so that a test by reading again finds nothing.
# Write the components one by one, or all nine of them.
#
# Output seen (stress xx 100, yy 20, zz 30, xy 5 MPa):
#   von Mises stress: true 76.0, from VTU 76.0, from XDMF 115.9
#   in XDMF: xx 100, yy 5, zz 0, xy 20, yz 0, xz 30
#   with nine components: 76.0; meshio reads its XDMF file as it was: True
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q meshio==5.3.5 vtk==9.7.2 h5py==3.16.0 lxml
cd "$work"
venv/bin/python - <<'END'
import sys

import meshio
import numpy as np
from vtkmodules.vtkIOXdmf2 import vtkXdmfReader
from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

SIX = np.array([100.0, 20.0, 30.0, 5.0, 0.0, 0.0])
PLACES = [(0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2)]
NINE = np.array([100.0, 5.0, 0.0, 5.0, 20.0, 0.0, 0.0, 0.0, 30.0])


def von_mises(stress):
    """Von Mises stress of a tensor, or of VTK's six components."""
    full = np.zeros((3, 3))
    if len(stress) == 6:
        for value, (i, j) in zip(stress, PLACES):
            full[i, j] = full[j, i] = value
    else:
        full = np.reshape(stress, (3, 3))
    deviator = full - np.trace(full) / 3.0 * np.eye(3)
    return float(np.sqrt(1.5 * (deviator**2).sum())), full


def through(name, reader, stress):
    """The stress that VTK reads from a file of meshio."""
    corners = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]
    mesh = meshio.Mesh(corners, [("triangle", [[0, 1, 2]])], {"stress": np.tile(stress, (3, 1))})
    mesh.write(name)
    reader.SetFileName(name)
    reader.Update()
    return reader.GetOutputDataObject(0).GetPointData().GetArray("stress").GetTuple(0)


true, _ = von_mises(SIX)
vtu, _ = von_mises(through("a.vtu", vtkXMLUnstructuredGridReader(), SIX))
xdmf, full = von_mises(through("a.xdmf", vtkXdmfReader(), SIX))
nine, _ = von_mises(through("b.xdmf", vtkXdmfReader(), NINE))
print(f"von Mises stress: true {true:.1f}, from VTU {vtu:.1f}, from XDMF {xdmf:.1f}")
names = ("xx", "yy", "zz", "xy", "yz", "xz")
print("in XDMF:", ", ".join(f"{n} {full[place]:.0f}" for n, place in zip(names, PLACES)))
again = bool((meshio.read("a.xdmf").point_data["stress"] == SIX).all())
print(f"with nine components: {nine:.1f}; meshio reads its XDMF file as it was: {again}")
right = max(abs(vtu - true), abs(nine - true)) < 1e-6
sys.exit(0 if right and again and xdmf > 1.3 * true else "meshio or VTK has changed")
END
