"""Mandel vectors [xx, yy, zz, sqrt(2) xy] of a point: trial stress, strain tensor, tangent.

A signed law has its viscoplastic strain tensor E as its state, xx, yy and sqrt(2) xy.
"""

from __future__ import annotations

import math

from castfem.constitutive.kernel.constants import (
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
from castfem.constitutive.kernel.flow_stress import back_stress_gain
from castfem.support.compiled import compiled


@compiled
def recovered_strain(state_old, left, tensor):  # type: ignore[no-untyped-def]
    """Viscoplastic strain of the state times what recovery leaves of it; its equivalent strain."""
    tensor[0], tensor[1], tensor[3] = left * state_old[0], left * state_old[1], left * state_old[2]
    tensor[2] = -(tensor[0] + tensor[1])
    square = 0.0
    for k in range(4):
        square += tensor[k] ** 2
    return math.sqrt(2.0 / 3.0 * square)


@compiled
def split_along_flow(tensor, normal):  # type: ignore[no-untyped-def]
    """Part of the strain tensor along the flow, as equivalent strain; leaves what is across it.

    Returns:
        The part along the flow, and the equivalent strain of what is across.
    """
    along, square = 0.0, 0.0
    for k in range(4):
        along += tensor[k] * normal[k]
    for k in range(4):
        tensor[k] -= along * normal[k]
        square += tensor[k] ** 2
    return math.sqrt(2.0 / 3.0) * along, math.sqrt(2.0 / 3.0 * square)


@compiled
def set_back_stress(kind, c, strain, tensor, back):  # type: ignore[no-untyped-def]
    """Back stress of a point along its strain tensor, of the equivalent `strain`."""
    level = 0.0
    if kind == STEEL and strain > 0.0:
        # sqrt(2/3) of the equivalent stress is the length, sqrt(3/2) of the strain the tensor's.
        level = (1.0 - c[DELTA_WEIGHT]) * c[HARDENING] * strain ** c[HARDENING_EXPONENT]
        level *= 2.0 / 3.0 / strain
    for k in range(4):
        back[k] = level * tensor[k]


@compiled
def hardened_strain(tensor, carried_part, carried):  # type: ignore[no-untyped-def]
    """Strain that has hardened the flow along the carried stress."""
    along = 0.0
    for k in range(4):
        along += tensor[k] * carried_part[k]
    return max(along / carried, 0.0) if carried > 0.0 else 0.0


@compiled
def trial_stress(c, strain, thermal, stress_old, back, normal, carried_part):  # type: ignore[no-untyped-def]
    """Trial stress of a point; writes its direction and the deviator carried along.

    Returns:
        Mean stress, length of the deviator less `back`, and the carried equivalent stress.
    """
    share, shear2 = c[SHARE], 2.0 * c[SHEAR]
    mean_old = (stress_old[0] + stress_old[1] + stress_old[2]) / 3.0
    mean_strain = share * (strain[0] + strain[1] + strain[2]) / 3.0
    mean = c[CARRY_MEAN] * mean_old + 3.0 * c[BULK] * (mean_strain - thermal)
    square, square_old = 0.0, 0.0
    for k in range(4):
        deviator_old = stress_old[k] - (mean_old if k < 3 else 0.0)
        deviator = share * strain[k] - (mean_strain if k < 3 else 0.0)
        carried_part[k] = c[CARRY_DEVIATOR] * deviator_old
        normal[k] = carried_part[k] + shear2 * deviator - back[k]
        square += normal[k] ** 2
        square_old += carried_part[k] ** 2
    length = math.sqrt(square)
    if length > 0.0:
        for k in range(4):
            normal[k] /= length
    return mean, length, math.sqrt(1.5 * square_old)


@compiled
def keep_strain(  # type: ignore[no-untyped-def]
    kind, c, tensor, normal, old, aside, gain, state
):
    """Write the new strain tensor of a point.

    Returns:
        What of the flow stress its back stress has gained.
    """
    along = math.sqrt(1.5) * (old + gain)
    state[0] = tensor[0] + along * normal[0]
    state[1] = tensor[1] + along * normal[1]
    state[2] = tensor[3] + along * normal[3]
    if kind == STEEL and c[DELTA_WEIGHT] < 1.0 and gain > 0.0:
        return (1.0 - c[DELTA_WEIGHT]) * back_stress_gain(c, old, aside, gain)[0]
    return 0.0


@compiled
def fill_stress(stress, length, normal, back, mean):  # type: ignore[no-untyped-def]
    """Write the stress of a point: what is left of its deviator, back stress and mean stress."""
    for k in range(4):
        stress[k] = length * normal[k] + back[k] + (mean if k < 3 else 0.0)


@compiled
def fill_tangent(tangent, normal, shear2, bulk, scale, kept):  # type: ignore[no-untyped-def]
    """2G (scale P + (kept - scale) n n) + K 1 1, with P the deviatoric projector."""
    for k in range(4):
        for m in range(4):
            part = (kept - scale) * normal[k] * normal[m]
            if k == m:
                part += scale
            if k < 3 and m < 3:
                part -= scale / 3.0
            part *= shear2
            if k < 3 and m < 3:
                part += bulk
            tangent[k, m] = part


@compiled
def turn_tangent(tangent, normal, across, factor):  # type: ignore[no-untyped-def]
    """What the tangent has of the flow's turning against the strain tensor."""
    for k in range(4):
        for m in range(4):
            tangent[k, m] += factor * normal[k] * across[m]
