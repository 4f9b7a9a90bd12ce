"""Mandel vectors [xx, yy, zz, sqrt(2) xy] of a point: trial stress, strain tensor, tangent.

A signed law has its viscoplastic strain tensor E as its state, xx, yy and sqrt(2) xy.

Arrays over points come with the number of a row: to take the row out of an array costs numba as
much as what is done with it here.
"""

from __future__ import annotations

import math

from castfem.base.compiled import compiled
from castfem.physics.constitutive.kernel.constants import (
    BULK,
    CARRY_DEVIATOR,
    CARRY_MEAN,
    DELTA_WEIGHT,
    HARDENING,
    HARDENING_EXPONENT,
    SHARE,
    SHEAR,
    STEEL,
)
from castfem.physics.constitutive.kernel.flow_stress import back_stress_gain

FLOW, ACROSS, BACK, CARRIED = range(4)
"""Rows of the vectors of a point: direction of the flow, strain tensor and then what of it lies
across the flow, back stress, deviator carried along."""


@compiled
def recovered_strain(state_old, i, left, vectors):  # type: ignore[no-untyped-def]
    """Viscoplastic strain of the state times what recovery leaves of it; its equivalent strain."""
    vectors[ACROSS, 0], vectors[ACROSS, 1] = left * state_old[i, 0], left * state_old[i, 1]
    vectors[ACROSS, 3] = left * state_old[i, 2]
    vectors[ACROSS, 2] = -(vectors[ACROSS, 0] + vectors[ACROSS, 1])
    square = 0.0
    for k in range(4):
        square += vectors[ACROSS, k] ** 2
    return math.sqrt(2.0 / 3.0 * square)


@compiled
def split_along_flow(vectors):  # type: ignore[no-untyped-def]
    """Part of the strain tensor along the flow, as equivalent strain; leaves what is across it.

    Returns:
        The part along the flow, and the equivalent strain of what is across.
    """
    along, square = 0.0, 0.0
    for k in range(4):
        along += vectors[ACROSS, k] * vectors[FLOW, k]
    for k in range(4):
        vectors[ACROSS, k] -= along * vectors[FLOW, k]
        square += vectors[ACROSS, k] ** 2
    return math.sqrt(2.0 / 3.0) * along, math.sqrt(2.0 / 3.0 * square)


@compiled
def set_back_stress(kind, c, strain, vectors):  # type: ignore[no-untyped-def]
    """Back stress of a point along its strain tensor, of the equivalent `strain`."""
    level = 0.0
    if kind == STEEL and strain > 0.0:
        # sqrt(2/3) of the equivalent stress is the length, sqrt(3/2) of the strain the tensor's.
        level = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * strain ** c[HARDENING_EXPONENT]
        level *= 2.0 / 3.0 / strain
    for k in range(4):
        vectors[BACK, k] = level * vectors[ACROSS, k]


@compiled
def hardened_strain(vectors, carried):  # type: ignore[no-untyped-def]
    """Strain that has hardened the flow along the carried stress."""
    along = 0.0
    for k in range(4):
        along += vectors[ACROSS, k] * vectors[CARRIED, k]
    return max(along / carried, 0.0) if carried > 0.0 else 0.0


@compiled
def trial_stress(c, i, strain, thermal, stress_old, vectors):  # type: ignore[no-untyped-def]
    """Trial stress of a point; writes its direction and the deviator carried along.

    Returns:
        Mean stress, length of the deviator less `back`, and the carried equivalent stress.
    """
    share, shear2 = c[SHARE], 2.0 * c[SHEAR]
    mean_old = (stress_old[i, 0] + stress_old[i, 1] + stress_old[i, 2]) / 3.0
    mean_strain = share * (strain[i, 0] + strain[i, 1] + strain[i, 2]) / 3.0
    mean = c[CARRY_MEAN] * mean_old + 3.0 * c[BULK] * (mean_strain - thermal)
    square, square_old = 0.0, 0.0
    for k in range(4):
        deviator_old = stress_old[i, k] - (mean_old if k < 3 else 0.0)
        deviator = share * strain[i, k] - (mean_strain if k < 3 else 0.0)
        vectors[CARRIED, k] = c[CARRY_DEVIATOR] * deviator_old
        vectors[FLOW, k] = vectors[CARRIED, k] + shear2 * deviator - vectors[BACK, k]
        square += vectors[FLOW, k] ** 2
        square_old += vectors[CARRIED, k] ** 2
    length = math.sqrt(square)
    if length > 0.0:
        for k in range(4):
            vectors[FLOW, k] /= length
    return mean, length, math.sqrt(1.5 * square_old)


@compiled
def keep_strain(  # type: ignore[no-untyped-def]
    kind, c, vectors, old, aside, gain, state, row
):
    """Write the new strain tensor of a point.

    Returns:
        What of the flow stress its back stress has gained.
    """
    along = math.sqrt(1.5) * (old + gain)
    state[row, 0] = vectors[ACROSS, 0] + along * vectors[FLOW, 0]
    state[row, 1] = vectors[ACROSS, 1] + along * vectors[FLOW, 1]
    state[row, 2] = vectors[ACROSS, 3] + along * vectors[FLOW, 3]
    if kind == STEEL and c[DELTA_WEIGHT] < 1.0 and gain > 0.0:
        return (1.0 - c[DELTA_WEIGHT]) * back_stress_gain(c, old, aside, gain)[0]
    return 0.0


@compiled
def fill_stress(stress, row, length, vectors, mean):  # type: ignore[no-untyped-def]
    """Write the stress of a point: what is left of its deviator, back stress and mean stress."""
    for k in range(4):
        stress[row, k] = length * vectors[FLOW, k] + vectors[BACK, k] + (mean if k < 3 else 0.0)


@compiled
def fill_tangent(tangent, i, vectors, shear2, bulk, scale, kept):  # type: ignore[no-untyped-def]
    """2G (scale P + (kept - scale) n n) + K 1 1, with P the deviatoric projector."""
    for k in range(4):
        for m in range(4):
            part = (kept - scale) * vectors[FLOW, k] * vectors[FLOW, m]
            if k == m:
                part += scale
            if k < 3 and m < 3:
                part -= scale / 3.0
            part *= shear2
            if k < 3 and m < 3:
                part += bulk
            tangent[i, k, m] = part


@compiled
def turn_tangent(tangent, i, vectors, factor):  # type: ignore[no-untyped-def]
    """What the tangent has of the flow's turning against the strain tensor."""
    for k in range(4):
        for m in range(4):
            tangent[i, k, m] += factor * vectors[FLOW, k] * vectors[ACROSS, m]
