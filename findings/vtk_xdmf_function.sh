#!/bin/bash
# VTK reads 1 - $0 in an XDMF file as $0 - 1, 1800 / $0 as $0 / 1800, and SQRT($0) as $0.
#
# Versions: VTK 9.7.2, NumPy 2.4.6 (Python 3.11, 3.12).
#
# XDMF can derive an array from others by a data item of the type Function, so that a file has a
# liquid fraction or a von Mises stress without storing it. vtkXdmfReader, which is ParaView's XDMF
# Reader, exchanges the two sides of - and / if a number stands before an array: a liquid fraction
# made of the solid fraction is negative, and the conductivity of the mushy zone, mixed by it, is
# -7.8 instead of 31.8 W/(m K). Names of functions in capitals are passed over, abs in any spelling:
# what stands in the brackets is the value. No message is given.
# Write -1 * $0 + 1, and sqrt, exp and log in small letters, or store the array. Powers of ten need
# a point (1.0e3), and operators a blank on both sides, otherwise the array is missing.
#
# Output seen (first of two values; solid fraction 0.4, conductivity 30 solid and 33 liquid):
#   1 - $0: 0.6 becomes -0.6
#   $0 * $1 + (1 - $0) * $2: 31.8 becomes -7.8
#   1800 / $1: 60 becomes 0.0166667
#   SQRT($1 * $1): 30 becomes 900
#   ABS($0 - 1): 0.6 becomes -0.6
#   -1 * $0 + 1: 0.6 becomes 0.6
#   sqrt($1 * $1): 30 becomes 30
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q vtk==9.7.2 numpy==2.4.6
cd "$work"
venv/bin/python - <<'END'
import sys
from pathlib import Path

from vtkmodules.vtkIOXdmf2 import vtkXdmfReader

SOLID, OF_SOLID, OF_LIQUID = 0.4, 30.0, 33.0
CASES = {
    "1 - $0": (1.0 - SOLID, SOLID - 1.0),
    "$0 * $1 + (1 - $0) * $2": (
        SOLID * OF_SOLID + (1.0 - SOLID) * OF_LIQUID, SOLID * OF_SOLID + (SOLID - 1.0) * OF_LIQUID,
    ),
    "1800 / $1": (1800.0 / OF_SOLID, OF_SOLID / 1800.0),
    "SQRT($1 * $1)": (OF_SOLID, OF_SOLID**2),
    "ABS($0 - 1)": (1.0 - SOLID, SOLID - 1.0),
    "-1 * $0 + 1": (1.0 - SOLID,) * 2,
    "sqrt($1 * $1)": (OF_SOLID,) * 2,
}  # fmt: skip


def item(values, dimensions):
    """A data item with these values in the XDMF itself."""
    text = " ".join(map(str, values))
    kind = 'NumberType="Float" Precision="8" Format="XML"'
    return f'<DataItem Dimensions="{dimensions}" {kind}>{text}</DataItem>'


def read(function):
    """Value at the first point of the array that the function makes of the three arrays."""
    arrays = "".join(item([v, v, v], 3) for v in (SOLID, OF_SOLID, OF_LIQUID))
    made = f'<DataItem ItemType="Function" Dimensions="3" Function="{function}">{arrays}</DataItem>'
    corners = '<DataItem Dimensions="1 3" NumberType="Int" Format="XML">0 1 2</DataItem>'
    Path("a.xdmf").write_text(
        '<?xml version="1.0"?>\n<Xdmf Version="2.0"><Domain><Grid Name="a" GridType="Uniform">'
        f'<Topology TopologyType="Triangle" NumberOfElements="1">{corners}</Topology>'
        f'<Geometry GeometryType="XYZ">{item([0, 0, 0, 1, 0, 0, 0, 1, 0], "3 3")}</Geometry>'
        f'<Attribute Name="made" AttributeType="Scalar" Center="Node">{made}</Attribute>'
        "</Grid></Domain></Xdmf>\n"
    )
    reader = vtkXdmfReader()
    reader.SetFileName("a.xdmf")
    reader.Update()
    return reader.GetOutputDataObject(0).GetPointData().GetArray("made").GetValue(0)


same = True
for function, (true, wrong) in CASES.items():
    seen = read(function)
    print(f"{function}: {true:g} becomes {seen:g}")
    same = same and abs(seen - wrong) <= 1e-6 * abs(wrong)
sys.exit(0 if same else "VTK has changed")
END
