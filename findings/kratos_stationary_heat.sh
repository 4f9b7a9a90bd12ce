#!/bin/bash
# Kratos calls one time step of 1 s a stationary temperature, and ignores tables of properties.
#
# Versions: Kratos Multiphysics and its ConvectionDiffusionApplication 10.4.4 (Python 3.11, 3.12).
#
# A copper plate of 40 mm takes 2 MW/m2 from a strand and gives it to water of 300 K through
# 35 kW/(m2 K). The solver "stationary" with its defaults returns one implicit step of "time_step",
# 1 s, from the initial temperature, without a message: the hot face is 228 K too cold. Its default
# element has a storage term. With "element_name": "LaplacianElement" in "element_replace_settings"
# the result is the exact one at any time step.
# A material file with a table of the conductivity or the heat capacity over the temperature and a
# table_accessor for it, as the structural elements take them, is read; the heat elements use the
# constant under "Variables". So latent heat in such a table is lost, without a message too. The
# elements read CONDUCTIVITY and SPECIFIC_HEAT of the nodes: set those in each step.
#
# Output seen (hot and cold face in K; a table of 60 to 20 W/(m K) from 300 to 1500 K; a heat
# capacity of 390 J/(kg K) under "Variables", ten times as much in its table):
#   plate: exact 585.7 and 357.1
#   plate: defaults 357.3 and 301.1
#   plate: step of 100 s 564.4 and 351.0
#   plate: Laplacian 585.7 and 357.1
#   conductivity by a table: middle 900.0, exact 758.4
#   heat capacity by a table: heated by 28.81 K, exact 2.88
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q \
    KratosMultiphysics==10.4.4 KratosConvectionDiffusionApplication==10.4.4
cd "$work"
OMP_NUM_THREADS=1 venv/bin/python - <<'EOF' | grep -E "^(plate|conductivity|heat)"
import json
import sys
from pathlib import Path

import KratosMultiphysics as kratos
from KratosMultiphysics.ConvectionDiffusionApplication import convection_diffusion_analysis as heat

CELLS, THICK, WATER, FLUX = 40, 0.04, 35e3, 2e6
COPPER = {"CONDUCTIVITY": 350.0, "DENSITY": 8900.0, "SPECIFIC_HEAT": 390.0}
LAPLACIAN = {"element_name": "LaplacianElement", "condition_name": "ThermalFace"}


def mesh():
    """A strip of triangles across the plate, with its two faces."""
    last = 2 * CELLS + 2
    nodes = [
        f"{2 * i + j + 1} {THICK * i / CELLS:.6f} {0.001 * j} 0"
        for i in range(CELLS + 1)
        for j in (0, 1)
    ]
    corners = [(a, a + 2, a + 3) for a in range(1, last - 2, 2)]
    corners += [(a, a + 3, a + 1) for a in range(1, last - 2, 2)]
    cells = [f"{n} 0 {a} {b} {c}" for n, (a, b, c) in enumerate(corners, 1)]
    faces = ["1 0 2 1", f"2 0 {last - 1} {last}"]
    text = "Begin Properties 0\nEnd Properties\n"
    for name, lines in (
        ("Nodes", nodes), ("Elements Element2D3N", cells), ("Conditions LineCondition2D2N", faces),
    ):  # fmt: skip
        text += "\n".join([f"Begin {name}", *lines, f"End {name.split()[0]}\n"])
    for name, numbers, faces in (
        ("Body", range(1, last + 1), ()), ("Hot", (1, 2), (1,)), ("Cold", (last - 1, last), (2,)),
    ):  # fmt: skip
        text += f"Begin SubModelPart {name}\n"
        cells = range(1, 2 * CELLS + 1) if name == "Body" else ()
        for what, those in (("Nodes", numbers), ("Elements", cells), ("Conditions", faces)):
            what = f"SubModelPart{what}"
            text += "\n".join([f"Begin {what}", *map(str, those), f"End {what}\n"])
        text += "End SubModelPart\n"
    Path("plate.mdpa").write_text(text)


def assign(part, variable, value, fixed=False, until="End"):
    return {
        "python_module": "assign_scalar_variable_process",
        "kratos_module": "KratosMultiphysics",
        "Parameters": {
            "model_part_name": f"Plate.{part}", "variable_name": variable, "value": value,
            "constrained": fixed, "interval": [0.0, until],
        },
    }  # fmt: skip


COOLED = [
    assign("Hot", "FACE_HEAT_FLUX", FLUX),
    {
        "python_module": "apply_thermal_face_process",
        "kratos_module": "KratosMultiphysics.ConvectionDiffusionApplication",
        "Parameters": {
            "model_part_name": "Plate.Cold", "ambient_temperature": 300.0,
            "add_ambient_convection": True, "convection_coefficient": WATER,
        },
    },
]  # fmt: skip


def tabulated(of, data):
    """The entries of a material file for a property over temperature."""
    names = {"table_input_variable": "TEMPERATURE", "table_output_variable": of}
    names["table_input_variable_type"] = "node_historical"
    return {
        "Tables": {"t": {"input_variable": "TEMPERATURE", "output_variable": of, "data": data}},
        "accessors": {"a": {"accessor_type": "table_accessor", "properties": names}},
    }


def temperatures(conditions, table=None, kind="stationary", step=1.0, **more):
    """Of the hot face, the middle and the cold face after one step of the solver, in K."""
    material = {"Variables": COPPER, "Tables": {}, **(table or {})}
    part = {"model_part_name": "Plate.Body", "properties_id": 1, "Material": material}
    Path("copper.json").write_text(json.dumps({"properties": [part]}))
    settings = {
        "problem_data": {
            "problem_name": "plate", "parallel_type": "OpenMP", "echo_level": 0,
            "start_time": 0.0, "end_time": step,
        },
        "solver_settings": {
            "solver_type": kind, "analysis_type": "non_linear", "model_part_name": "Plate",
            "domain_size": 2, "time_stepping": {"time_step": step},
            "model_import_settings": {"input_type": "mdpa", "input_filename": "plate"},
            "material_import_settings": {"materials_filename": "copper.json"},
            "linear_solver_settings": {"solver_type": "skyline_lu_factorization"},
            "problem_domain_sub_model_part_list": ["Body"],
            "processes_sub_model_part_list": ["Hot", "Cold"], **more,
        },
        "processes": {
            "initial": [assign("Body", "TEMPERATURE", 300.0, until=0.0)], "conditions": conditions,
        },
    }  # fmt: skip
    model = kratos.Model()
    heat.ConvectionDiffusionAnalysis(model, kratos.Parameters(json.dumps(settings))).Run()
    at = [node.GetSolutionStepValue(kratos.TEMPERATURE) for node in model["Plate"].Nodes]
    return at[0], at[CELLS], at[-1]


mesh()
cold = 300.0 + FLUX / WATER
exact = cold + FLUX * THICK / COPPER["CONDUCTIVITY"], cold
plain = temperatures(COOLED)
long = temperatures(COOLED, step=100.0)
right = temperatures(COOLED, element_replace_settings=LAPLACIAN)
print(f"plate: exact {exact[0]:.1f} and {exact[1]:.1f}")
for name, (hot, _, cold) in (("defaults", plain), ("step of 100 s", long), ("Laplacian", right)):
    print(f"plate: {name} {hot:.1f} and {cold:.1f}")
ends = [assign("Hot", "TEMPERATURE", 1500.0, True), assign("Cold", "TEMPERATURE", 300.0, True)]
conductivity = tabulated("CONDUCTIVITY", [[300.0, 60.0], [1500.0, 20.0]])
middle = temperatures(ends, conductivity, element_replace_settings=LAPLACIAN)[1]
# The integral of the conductivity is halved: 60 s - 20 s**2 = 20 at the share s of the range.
true = 300.0 + 1200.0 * (1.5 - 1.25**0.5)
print(f"conductivity by a table: middle {middle:.1f}, exact {true:.1f}")
source = [assign("Body", "HEAT_FLUX", 1e8)]
capacity = tabulated("SPECIFIC_HEAT", [[300.0, 3900.0], [1500.0, 3900.0]])
rise = temperatures(source, capacity, "transient", time_integration_method="implicit")[1] - 300.0
print(f"heat capacity by a table: heated by {rise:.2f} K, exact {1e8 / 8900.0 / 3900.0:.2f}")
same = plain[0] < 360.0 and 560.0 < long[0] < 570.0 and abs(right[0] - exact[0]) < 0.1
same = same and abs(middle - 900.0) < 0.1 and abs(rise - 1e8 / 8900.0 / 390.0) < 0.01
sys.exit(0 if same else "Kratos has changed")
EOF
