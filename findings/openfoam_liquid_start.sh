#!/bin/bash
# OpenFOAM takes liquid steel for solid at the start: its strip freezes 2.5 times as deep in 100 s.
#
# Versions: OpenFOAM 1912.200626-1 of Debian 12, solver buoyantPimpleFoam.
#
# The source solidificationMeltingSource adds latent heat and keeps the liquid fraction in a field
# of its own, here melt:alpha1. If the folder 0 has no such file, the fraction starts at 0 at any
# temperature, without a message: steel cast 20 K above its melting point is solid, loses its
# superheat by melting a twentieth of itself, and freezes without the rest of its latent heat. Of
# a strip of 100 mm with one face at 1000 K, 97 mm are solid after 100 s; exact are 39 mm.
# With a file 0/melt:alpha1 of 1 the source is right to 0.4 mm with steps of 0.5 s and to 0.1 mm
# with a tenth of them. Write that file, and look at the fraction after the first step.
#
# Output seen (solid after 100 s, in mm; temperature at the far end, in K):
#   exact: 39.1
#   without a file, step of 0.5 s: 97.3, 1800
#   with the file, step of 0.5 s: 38.7, 1819
#   with the file, step of 0.05 s: 39.0, 1819
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
version=1912.200626-1+b1
# shellcheck disable=SC2046
apt-get download -q "openfoam=$version" \
    $(apt-get install -s --no-install-recommends "openfoam=$version" |
        awk '/^Inst/ && $2 != "openfoam" {print $2}') >download.log 2>&1
for package in *.deb; do dpkg -x "$package" .; done
lib=$work/usr/lib/$(uname -m)-linux-gnu
export LD_LIBRARY_PATH=$work/usr/lib:$lib:$lib/openmpi/lib OPAL_PREFIX=$work/usr
export WM_PROJECT_DIR=$work/usr/share/openfoam PATH=$work/usr/bin:$PATH
export FOAM_ETC=$WM_PROJECT_DIR/etc
"${PYTHON:-python3}" - <<'END'
import math
import re
import shutil
import subprocess
import sys
from pathlib import Path

DENSITY, CAPACITY, CONDUCTIVITY, LATENT, MELTING = 7000.0, 700.0, 30.0, 270e3, 1800.0
WALL, START, LENGTH, CELLS, SECONDS = 1000.0, 1820.0, 0.1, 100, 100.0
FIXED = {
    "system/blockMeshDict": f"""convertToMeters 1;
vertices ((0 0 0) ({LENGTH} 0 0) ({LENGTH} 0.01 0) (0 0.01 0)
          (0 0 0.01) ({LENGTH} 0 0.01) ({LENGTH} 0.01 0.01) (0 0.01 0.01));
blocks (hex (0 1 2 3 4 5 6 7) ({CELLS} 1 1) simpleGrading (1 1 1));
edges ();
boundary (cold {{ type wall; faces ((0 4 7 3)); }}
          other {{ type wall; faces ((1 2 6 5) (0 1 5 4) (3 7 6 2) (0 3 2 1) (4 5 6 7)); }});""",
    "system/fvSchemes": """ddtSchemes { default Euler; }
gradSchemes { default Gauss linear; }
divSchemes { default Gauss linear; }
laplacianSchemes { default Gauss linear corrected; }
interpolationSchemes { default linear; }
snGradSchemes { default corrected; }""",
    "system/fvSolution": """solvers
{ ".*" { solver PBiCGStab; preconditioner DILU; tolerance 1e-12; relTol 0; }
  "(p_rgh|rho).*" { solver PCG; preconditioner DIC; tolerance 1e-10; relTol 0; } }
PIMPLE { nOuterCorrectors 1; nCorrectors 1; pRefCell 0; pRefValue 1e5; }""",
    "constant/g": "dimensions [0 1 -2 0 0 0 0]; value (0 0 0);",
    "constant/turbulenceProperties": "simulationType laminar;",
    "constant/thermophysicalProperties": f"""thermoType
{{ type heRhoThermo; mixture pureMixture; transport const; thermo hConst;
   equationOfState rhoConst; specie specie; energy sensibleEnthalpy; }}
mixture {{ specie {{ molWeight 55.8; }} equationOfState {{ rho {DENSITY}; }}
  thermodynamics {{ Cp {CAPACITY}; Hf 0; }}
  transport {{ mu 1e-3; Pr {1e-3 * CAPACITY / CONDUCTIVITY}; }} }}""",
    "constant/fvOptions": f"""melt {{ type solidificationMeltingSource; active yes;
  solidificationMeltingSourceCoeffs {{ selectionMode all; Tmelt {MELTING}; L {LATENT};
    thermoMode thermo; beta 0; rhoRef {DENSITY}; }} }}""",
}


def field(kind, dimensions, value, boundary):
    return f"""dimensions [{dimensions}]; internalField uniform {value};
boundaryField {{ {boundary} }}""", f"vol{kind}Field"


FIELDS = {
    "T": field(
        "Scalar", "0 0 0 1 0 0 0", START,
        f"cold {{ type fixedValue; value uniform {WALL}; }} other {{ type zeroGradient; }}",
    ),
    "U": field("Vector", "0 1 -1 0 0 0 0", "(0 0 0)", '".*" { type noSlip; }'),
    "p": field(
        "Scalar", "1 -1 -2 0 0 0 0", 1e5, '".*" { type calculated; value uniform 1e5; }'
    ),
    "p_rgh": field(
        "Scalar", "1 -1 -2 0 0 0 0", 1e5, '".*" { type fixedFluxPressure; value uniform 1e5; }'
    ),
    "alphat": field(
        "Scalar", "1 -1 -1 0 0 0 0", 0, '".*" { type calculated; value uniform 0; }'
    ),
}  # fmt: skip
FRACTION = field("Scalar", "0 0 0 0 0 0 0", 1, '".*" { type zeroGradient; }')


def values(name):
    """Of a field after the last step, cell by cell."""
    text = (Path("case") / f"{SECONDS:g}" / name).read_text()
    many = re.search(r"internalField\s+nonuniform List<scalar>\s*\d+\s*\(([^)]*)\)", text)
    if many:
        return [float(word) for word in many[1].split()]
    return [float(re.search(r"internalField\s+uniform ([^;]+);", text)[1])] * CELLS


def frozen(step, fraction):
    """Thickness that is solid, in mm, and the temperature at the far end, in K."""
    shutil.rmtree("case", ignore_errors=True)
    files = {name: (text, "dictionary") for name, text in FIXED.items()}
    files["constant/g"] = FIXED["constant/g"], "uniformDimensionedVectorField"
    files |= {f"0/{name}": given for name, given in FIELDS.items()}
    files["system/controlDict"] = (
        f"startFrom startTime; startTime 0; stopAt endTime; endTime {SECONDS}; deltaT {step}; "
        f"writeControl runTime; writeInterval {SECONDS}; writePrecision 10;",
        "dictionary",
    )
    if fraction:
        files["0/melt:alpha1"] = FRACTION
    for name, (text, kind) in files.items():
        path = Path("case") / name
        path.parent.mkdir(parents=True, exist_ok=True)
        head = f"version 2.0; format ascii; class {kind}; object {path.name};"
        path.write_text(f"FoamFile {{ {head} }}\n{text}\n")
    for program in ("blockMesh", "buoyantPimpleFoam"):
        subprocess.run([program], cwd="case", check=True, capture_output=True, timeout=300)
    solid = sum(1.0 - liquid for liquid in values("melt:alpha1"))
    return 1e3 * LENGTH / CELLS * solid, values("T")[-1]


def neumann():
    """The exact thickness of a strip without an end, in mm."""
    stefan, above = CAPACITY * (MELTING - WALL) / LATENT, (START - MELTING) / (MELTING - WALL)
    low, high = 0.01, 3.0
    for _ in range(60):
        s = 0.5 * (low + high)
        flux = math.exp(-s * s) * (1.0 / math.erf(s) - above / math.erfc(s))
        low, high = (s, high) if stefan / math.sqrt(math.pi) * flux > s else (low, s)
    return 2e3 * low * math.sqrt(CONDUCTIVITY / DENSITY / CAPACITY * SECONDS)


exact = neumann()
print(f"exact: {exact:.1f}")
seen = {}
for step, fraction in ((0.5, False), (0.5, True), (0.05, True)):
    solid, far = seen[step, fraction] = frozen(step, fraction)
    words = "with the file" if fraction else "without a file"
    print(f"{words}, step of {step:g} s: {solid:.1f}, {far:.0f}")
same = seen[0.5, False][0] > 90.0 and abs(seen[0.5, False][1] - MELTING) < 1.0
right = max(abs(solid - exact) for (_, fraction), (solid, _) in seen.items() if fraction)
sys.exit(0 if same and right < 1.0 else "OpenFOAM has changed")
END
