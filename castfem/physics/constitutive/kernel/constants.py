"""Columns of the coefficients of a point, numbers of the laws, and solver limits.

numba treats them as compile-time constants.
"""

from __future__ import annotations

import math

# Columns of the coefficients that all laws have; those of a law follow.
SHEAR, BULK, YOUNG, CARRY_DEVIATOR, CARRY_MEAN, SHARE, FRESH, RECOVERY, OWN = range(9)
# Numbers of the laws.
ELASTIC, PLASTIC, CREEP, CURVE_GIVEN, CURVE_AUTOMATIC, STEEL = range(6)
# Columns of each law, counted from OWN.
LN_LEVEL, SOFTENING, RATE_EXPONENT, STRAIN_EXPONENT, YIELD, LARGEST_STRAIN = range(OWN, OWN + 6)
YIELD_STRESS = OWN
LN_FACTOR, EXPONENT = OWN, OWN + 1
(HARDENING, HARDENING_EXPONENT, LN_GAMMA_RATE, GAMMA_EXPONENT,
 LN_DELTA_LEVEL, DELTA_HARDENING, DELTA_EXPONENT, DELTA_WEIGHT) = range(OWN, OWN + 8)  # fmt: skip
COLUMNS = OWN + 8  # largest number of columns
LAST = {
    ELASTIC: OWN - 1, PLASTIC: YIELD_STRESS, CREEP: EXPONENT, CURVE_GIVEN: LARGEST_STRAIN,
    CURVE_AUTOMATIC: LARGEST_STRAIN, STEEL: DELTA_WEIGHT,
}  # fmt: skip
"""Last column of each law."""
DELTA_STRAIN_SCALE = 1000.0  # in (1 + 1000 p)^m of the delta-ferrite law
LN_SQRT3 = 0.5 * math.log(3.0)

# Knowledge of the increment dp of a point: nothing, or a nearby value (0: elastic).
SEEK = -1.0

# Limits of the safeguarded Newton methods for the scalar problems.
NOTHING = -1e300  # represents the logarithm of zero
ROUNDING = 1e-14
# Excess of the trial stress over the flow stress, relative to it, up to which a point is elastic.
# A point that flowed begins its next step on its flow curve: without this margin rounding errors
# would choose between the elastic and the plastic tangent.
ON_CURVE = 1e-12
LAST_STEP = 1e-8  # last step of a quadratically convergent Newton method: the rest is rounding
STEPS = 200  # limit of a safeguarded Newton method; convex problems take about 6
