#!/bin/bash
# One failed run of 4096, and SALib reports that no parameter has any influence at all.
#
# Versions: SALib 1.6.0 (Python 3.12).
#
# A model runs at the 4096 points of a Sobol sample; one run fails and its result is NaN.
# sobol.analyze then returns 0 for all first-order and all total indices, with intervals of zero
# width, and gives no warning: a table like that of parameters that do nothing. The methods of
# Morris, PAWN and FAST return NaN for such results. One infinite result does the same harm, with
# a warning about a subtraction only; a number of 1e6 in its place hides all influences too.
# Check np.isfinite(Y).all() before the analysis.
#
# Output seen (y = a + b^2 / 2, c unused):
#   all runs finite: S1 [0.789 0.211 0.   ], ST [0.79  0.211 0.   ]
#   one run NaN:     S1 [0. 0. 0.], ST [0. 0. 0.], widths [0. 0. 0.], warnings 0
#   one run inf:     S1 [0. 0. 0.], ST [0. 0. 0.]
#   Morris with one run NaN: mu_star [nan nan nan]
set -euo pipefail
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
"${PYTHON:-python3}" -m venv "$work/venv"
"$work/venv/bin/pip" install -q SALib==1.6.0
"$work/venv/bin/python" - <<'END'
import sys
import warnings

import numpy as np
from SALib.analyze import morris, sobol
from SALib.sample import morris as morris_sample
from SALib.sample import sobol as sobol_sample

PROBLEM = {"num_vars": 3, "names": ["a", "b", "c"], "bounds": [[0.0, 1.0]] * 3}


def model(x, failed=None):
    """Results of all runs, that of the eighth replaced."""
    y = x[:, 0] + 0.5 * x[:, 1] ** 2
    if failed is not None:
        y[7] = failed
    return y


def indices(failed=None):
    """First-order and total indices, widths of the latter, number of warnings."""
    with warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always")
        found = sobol.analyze(PROBLEM, model(SAMPLE, failed), seed=1)
    return [np.round(found[k], 3) for k in ("S1", "ST", "ST_conf")] + [len(raised)]


SAMPLE = sobol_sample.sample(PROBLEM, 512, seed=1)
first, total, _, _ = indices()
print(f"all runs finite: S1 {first}, ST {total}")
nan = indices(np.nan)
print(f"one run NaN:     S1 {nan[0]}, ST {nan[1]}, widths {nan[2]}, warnings {nan[3]}")
infinite = indices(np.inf)
print(f"one run inf:     S1 {infinite[0]}, ST {infinite[1]}")
paths = morris_sample.sample(PROBLEM, 100, seed=1)
effects = np.asarray(morris.analyze(PROBLEM, paths, model(paths, np.nan), seed=1)["mu_star"])
print(f"Morris with one run NaN: mu_star {effects}")
zero = not any(a.any() for a in (*nan[:3], *infinite[:3])) and nan[3] == 0
right = len(SAMPLE) == 4096 and total[0] > 0.7 and np.isnan(effects).all()
sys.exit(0 if zero and right else "SALib has changed")
END
