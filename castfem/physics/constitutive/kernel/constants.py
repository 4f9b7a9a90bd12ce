"""Columns of the coefficients of a point, the laws, and limits of the scalar problems.

numba treats them as constants when it compiles.
"""

from __future__ import annotations

import math

# Columns of the coefficients that all laws share; those of a law follow.
SHEAR, BULK, YOUNG, CARRY_DEVIATOR, CARRY_MEAN, SHARE, FRESH, RECOVERY, OWN = range(9)
# Laws.
ELASTIC, PLASTIC, CREEP, CURVE_GIVEN, CURVE_AUTOMATIC, STEEL = range(6)
# Own columns of each law, counted from OWN.
LN_LEVEL, SOFTENING, RATE_EXPONENT, STRAIN_EXPONENT, YIELD, LARGEST_STRAIN = range(OWN, OWN + 6)
YIELD_STRESS = OWN
LN_FACTOR, EXPONENT = OWN, OWN + 1
(HARDENING, HARDENING_EXPONENT, LN_GAMMA_RATE, GAMMA_EXPONENT,
 LN_DELTA_LEVEL, DELTA_HARDENING, DELTA_EXPONENT, DELTA_WEIGHT) = range(OWN, OWN + 8)  # fmt: skip
COLUMNS = OWN + 8  # of all, at most
LAST = {
    ELASTIC: OWN - 1, PLASTIC: YIELD_STRESS, CREEP: EXPONENT, CURVE_GIVEN: LARGEST_STRAIN,
    CURVE_AUTOMATIC: LARGEST_STRAIN, STEEL: DELTA_WEIGHT,
}  # fmt: skip
"""Last column of each law."""
DELTA_STRAIN_SCALE = 1000.0  # in (1 + 1000 p)^m of the delta-ferrite law
LN_SQRT3 = 0.5 * math.log(3.0)

# What is known of the increment dp of a point: nothing, or what it is near to (0: elastic).
SEEK = -1.0

# Of the safeguarded Newton methods for the scalar problems.
NOTHING = -1e300  # stands for the logarithm of zero
ROUNDING = 1e-14
LAST_STEP = 1e-8  # of a Newton that converges quadratically: what follows is rounding
STEPS = 200  # of a safeguarded Newton; convex problems take about 6
