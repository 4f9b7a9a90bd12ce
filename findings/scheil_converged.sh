#!/bin/bash
# scheil calls a complete Scheil-Gulliver path that ends at a eutectic not converged.
#
# Versions: scheil 0.3.0, pycalphad 0.11.2, NumPy 2.5.5 (Python 3.13).
#
# SolidificationResult.converged is False for paths that have come to the eutectic and to a solid
# fraction of 1: the step below the eutectic has no liquid, the interval is halved down to it, and
# what is left is frozen there in the last entry, with the right phases. So `converged` does not
# tell a path that is complete from one that broke off; look at fraction_solid[-1], and at the jump
# to it, which is the eutectic. x_liquid is NaN in that entry. simulate_equilibrium_solidification
# of the same alloy has converged = True.
#
# Output seen (28 November 2026; databases of pycalphad's own tests):
#   Pb-Sn, 30 at% Sn: Scheil converged False, solid 0.7806 then 1.0000 at 454.2 K; equilibrium True
#   Al-Zn, 30 at% Zn: Scheil converged False, solid 0.8734 then 1.0000 at 653.9 K; equilibrium True
#   Fe-C, 1 at% C: Scheil converged False, solid 0.9877 then 1.0000 at 1426.2 K; equilibrium True
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q scheil==0.3.0 pycalphad==0.11.2 numpy==2.5.5
cd "$work"
venv/bin/python -W ignore - <<'EOF'
import sys
from pathlib import Path

import numpy as np
import pycalphad
from pycalphad import Database
from pycalphad import variables as v
from scheil import simulate_equilibrium_solidification, simulate_scheil_solidification

FOLDER = Path(pycalphad.__file__).parent / "tests" / "databases"
ALLOYS = {
    "Pb-Sn, 30 at% Sn": ("pbsn.tdb", "PB", "SN", 0.3, 600.0, None),
    "Al-Zn, 30 at% Zn": ("alzn_mey.tdb", "AL", "ZN", 0.3, 900.0, None),
    "Fe-C, 1 at% C": (
        "cfe_broshe.tdb", "FE", "C", 0.01, 1830.0, ["LIQUID", "BCC_A2", "FCC_A1", "GRAPHITE"],
    ),
}
as_seen = True
for name, (file, base, other, share, start, phases) in ALLOYS.items():
    database = Database(str(FOLDER / file))
    given = (
        database, [base, other, "VA"], phases or sorted(database.phases),
        {v.X(other): share}, start,
    )
    path = simulate_scheil_solidification(*given, step_temperature=2.0)
    whole = simulate_equilibrium_solidification(*given, step_temperature=2.0)
    before, end = path.fraction_solid[-2:]
    print(
        f"{name}: Scheil converged {path.converged}, solid {before:.4f} then {end:.4f} "
        f"at {path.temperatures[-1]:.1f} K; equilibrium {whole.converged}"
    )
    frozen = sum(amounts[-1] for amounts in path.cum_phase_amounts.values())
    as_seen &= end == 1.0 and abs(frozen - 1.0) < 1e-6 and 0.5 < before < 0.995
    as_seen &= not path.converged and whole.converged
    as_seen &= bool(np.isnan(next(iter(path.x_liquid.values()))[-1]))
sys.exit(0 if as_seen else "scheil has changed")
EOF
