#!/bin/bash
# Kratos turns an axisymmetric section about x for the temperature and about y for the stress.
#
# Versions: Kratos Multiphysics 10.4.4 with its applications ConvectionDiffusion and
# StructuralMechanics of the same number (Python 3.11, 3.12).
#
# A round bar of 200 mm, 1500 K, cools for 300 s with 500 W/(m2 K) to 300 K. With the radius of its
# section along x, as the axisymmetric structural elements want it, the element
# AxisymmetricEulerianConvectionDiffusion gives it the temperatures of a slab: 97 K too hot at the
# surface and 120 K at the axis. With the radius along y the temperatures are right, but there the
# structural elements give no hoop strain to a ring that grows. Both are accepted without a message.
# So no mesh serves both, and the coupled solver, which has one set of nodes, is wrong in one of
# them. Draw the radius along y for the temperature, and for the stress a second mesh with x and y
# exchanged.
#
# Output seen (axis and surface in K; a ring grown by 0.001):
#   exact: bar 1308 and 828, slab 1428 and 924
#   radius along x: 1428 and 925, hoop strain 0.0010
#   radius along y: 1310 and 830, hoop strain 0.0000
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q KratosMultiphysics==10.4.4 \
    KratosConvectionDiffusionApplication==10.4.4 KratosStructuralMechanicsApplication==10.4.4 \
    KratosLinearSolversApplication==10.4.4 numpy==2.4.6 scipy==1.17.1
cd "$work"
OMP_NUM_THREADS=1 venv/bin/python - <<'EOF' | grep -E "^(exact|radius)"
import json
import sys
from pathlib import Path

import KratosMultiphysics as kratos
import numpy as np
from KratosMultiphysics import StructuralMechanicsApplication as structure
from KratosMultiphysics.ConvectionDiffusionApplication import convection_diffusion_analysis as heat
from scipy.optimize import brentq
from scipy.special import j0, j1

CELLS, RADIUS, WIDE, SECONDS, COOLING = 50, 0.1, 0.004, 300.0, 500.0
STEEL = {"CONDUCTIVITY": 30.0, "DENSITY": 7000.0, "SPECIFIC_HEAT": 700.0}


def mesh(along):
    """A strip of the bar from its axis to its surface, the radius along x or along y."""
    last = 2 * CELLS + 2
    places = [(RADIUS * i / CELLS, WIDE * j) for i in range(CELLS + 1) for j in (0, 1)]
    corners = [(a, a + 2, a + 3) for a in range(1, last - 2, 2)]
    corners += [(a, a + 3, a + 1) for a in range(1, last - 2, 2)]
    if along == "y":
        places = [(z, r) for r, z in places]
        corners = [(a, c, b) for a, b, c in corners]
    nodes = [f"{n} {x:.6f} {y:.6f} 0" for n, (x, y) in enumerate(places, 1)]
    cells = [f"{n} 0 {a} {b} {c}" for n, (a, b, c) in enumerate(corners, 1)]
    text = "Begin Properties 0\nEnd Properties\n"
    for name, lines in (
        ("Nodes", nodes), ("Elements Element2D3N", cells),
        ("Conditions LineCondition2D2N", [f"1 0 {last - 1} {last}"]),
    ):  # fmt: skip
        text += "\n".join([f"Begin {name}", *lines, f"End {name.split()[0]}\n"])
    for name, numbers, faces in (
        ("Body", range(1, last + 1), ()), ("Surface", (last - 1, last), (1,)),
    ):  # fmt: skip
        text += f"Begin SubModelPart {name}\n"
        cells = range(1, 2 * CELLS + 1) if name == "Body" else ()
        for what, those in (("Nodes", numbers), ("Elements", cells), ("Conditions", faces)):
            what = f"SubModelPart{what}"
            text += "\n".join([f"Begin {what}", *map(str, those), f"End {what}\n"])
        text += "End SubModelPart\n"
    Path("bar.mdpa").write_text(text)


def assign(part, variable, value, until="End"):
    return {
        "python_module": "assign_scalar_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": f"Bar.{part}", "variable_name": variable, "value": value,
            "constrained": False, "interval": [0.0, until],
        },
    }  # fmt: skip


def cooled(along):
    """Temperatures of the axis and the surface after cooling, in K."""
    mesh(along)
    part = {"model_part_name": "Bar.Body", "properties_id": 1}
    part["Material"] = {"Variables": STEEL, "Tables": {}}
    Path("steel.json").write_text(json.dumps({"properties": [part]}))
    face = {"python_module": "apply_thermal_face_process"}
    face["kratos_module"] = "KratosMultiphysics.ConvectionDiffusionApplication"
    face["Parameters"] = {
        "model_part_name": "Bar.Surface", "ambient_temperature": 300.0,
        "add_ambient_convection": True, "convection_coefficient": COOLING,
    }  # fmt: skip
    settings = {
        "problem_data": {
            "problem_name": "bar", "parallel_type": "OpenMP", "echo_level": 0,
            "start_time": 0.0, "end_time": SECONDS,
        },
        "solver_settings": {
            "solver_type": "transient", "time_integration_method": "implicit",
            "analysis_type": "linear", "model_part_name": "Bar", "domain_size": 2,
            "time_stepping": {"time_step": 5.0},
            "model_import_settings": {"input_type": "mdpa", "input_filename": "bar"},
            "material_import_settings": {"materials_filename": "steel.json"},
            "linear_solver_settings": {"solver_type": "skyline_lu_factorization"},
            "problem_domain_sub_model_part_list": ["Body"],
            "processes_sub_model_part_list": ["Surface"],
            "element_replace_settings": {
                "element_name": "AxisymmetricEulerianConvectionDiffusion",
                "condition_name": "AxisymmetricThermalFace",
            },
        },
        "processes": {
            "initial": [assign("Body", "TEMPERATURE", 1500.0, until=0.0)], "conditions": [face],
        },
    }  # fmt: skip
    model = kratos.Model()
    heat.ConvectionDiffusionAnalysis(model, kratos.Parameters(json.dumps(settings))).Run()
    at = [node.GetSolutionStepValue(kratos.TEMPERATURE) for node in model["Bar"].Nodes]
    return at[0], at[-1]

def hoop_strain(along):
    """Of a ring whose radius of 80 to 100 mm has grown by a thousandth."""
    model = kratos.Model()
    part = model.CreateModelPart("Ring")
    part.AddNodalSolutionStepVariable(kratos.DISPLACEMENT)
    part.AddNodalSolutionStepVariable(kratos.VOLUME_ACCELERATION)
    steel = part.GetProperties()[1]
    steel[kratos.YOUNG_MODULUS], steel[kratos.POISSON_RATIO] = 2e11, 0.3
    steel[kratos.CONSTITUTIVE_LAW] = structure.LinearElasticAxisym2DLaw()
    corners = [(0.08, 0.3), (0.1, 0.3), (0.1, 0.32), (0.08, 0.32)]
    if along == "y":
        corners = [(r, z) for z, r in corners][::-1]
    for number, (x, y) in enumerate(corners, 1):
        node = part.CreateNewNode(number, x, y, 0.0)
        move = [1e-3 * x, 0.0, 0.0] if along == "x" else [0.0, 1e-3 * y, 0.0]
        node.SetSolutionStepValue(kratos.DISPLACEMENT, move)
    name = "AxisymSmallDisplacementElement2D4N"
    cell = part.CreateNewElement(name, 1, [1, 2, 3, 4], steel)
    cell.Initialize(part.ProcessInfo)
    kind = kratos.GREEN_LAGRANGE_STRAIN_VECTOR
    return cell.CalculateOnIntegrationPoints(kind, part.ProcessInfo)[0][2]


def exact(round_bar):
    """Series for a bar or a slab of the same half thickness: axis and surface, in K."""
    biot = COOLING * RADIUS / STEEL["CONDUCTIVITY"]
    diffusivity = STEEL["CONDUCTIVITY"] / STEEL["DENSITY"] / STEEL["SPECIFIC_HEAT"]
    at, slope = (j0, j1) if round_bar else (np.cos, np.sin)
    characteristic = lambda z: z * slope(z) - biot * at(z)
    places = np.linspace(0.0, 40.0, 4001)
    pairs = zip(places[:-1], places[1:], strict=True)
    z = np.array([
        brentq(characteristic, a, b) for a, b in pairs if characteristic(a) * characteristic(b) < 0
    ])  # fmt: skip
    if round_bar:
        factor = 2.0 * j1(z) / (z * (j0(z) ** 2 + j1(z) ** 2))
    else:
        factor = 4.0 * np.sin(z) / (2.0 * z + np.sin(2.0 * z))
    factor *= np.exp(-(z**2) * diffusivity * SECONDS / RADIUS**2)
    return [300.0 + 1200.0 * float(np.sum(factor * at(z * r))) for r in (0.0, 1.0)]


bar, slab = exact(True), exact(False)
print(f"exact: bar {bar[0]:.0f} and {bar[1]:.0f}, slab {slab[0]:.0f} and {slab[1]:.0f}")
seen = {along: (cooled(along), hoop_strain(along)) for along in "xy"}
for along, ((axis, surface), strain) in seen.items():
    print(f"radius along {along}: {axis:.0f} and {surface:.0f}, hoop strain {strain:.4f}")
(plane, right), (round_, none) = seen["x"], seen["y"]
same = max(abs(plane[0] - slab[0]), abs(plane[1] - slab[1])) < 4.0
same = same and max(abs(round_[0] - bar[0]), abs(round_[1] - bar[1])) < 4.0
sys.exit(0 if same and abs(right - 1e-3) < 1e-9 and abs(none) < 1e-9 else "Kratos has changed")
EOF
