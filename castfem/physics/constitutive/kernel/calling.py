"""Python interface of the compiled integration; numba is needed only for the first compilation."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_bool, c_double, c_int64, c_void_p
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.shared_code import addresses, loaded
from castfem.base.types import Array, Flags
from castfem.physics.constitutive.kernel.constants import LAST

SOURCES = tuple(sorted(Path(__file__).parent.glob("*.py")))
"""All source files of the compiled code."""
_ARGUMENTS = (*[c_int64] * 4, c_bool, c_double, *[c_void_p] * 11)


def integrate_points(
    kind: int,
    signed: bool,
    coefficients: Array,
    strain: Array,
    thermal: Array,
    stress_old: Array,
    state_old: Array,
    dt: float,
    stress: Array,
    tangent: Array,
    state: Array,
    dissipation: Array,
    flows: Flags,
) -> None:
    """Integrate all points over a step.

    Args:
        kind: One of the laws of `constants`.
        signed: Whether the viscoplastic strain tensor determines hardening; its xx, yy and
            sqrt(2) xy are then the first three columns of the state.
        coefficients: Coefficients of the law (n, columns).
        strain: Total strain increments (n, 4).
        thermal: Isotropic thermal strain increments (n,).
        stress_old: Stress at the start (n, 4), Pa.
        state_old: State variables at the start (n, states).
        dt: Length of the step, s.
        stress: Output, stress at the end (n, 4), Pa.
        tangent: Output, d stress / d strain (n, 4, 4), Pa.
        state: Output, state variables at the end (n, states).
        dissipation: Output, viscoplastic work without that stored by a back stress (n,), J/m3.
        flows: Output, whether each point flows (n,).

    Raises:
        ValueError: Shapes of arrays differ from each other or from the law's, or an array is not
            contiguous, has another type, or is read-only.
    """
    n, columns, states = len(strain), coefficients.shape[1], state_old.shape[1]
    inputs = [
        np.ascontiguousarray(array, dtype=float)
        for array in (coefficients, strain, thermal, stress_old, state_old)
    ]
    shapes = (n, columns), (n, 4), (n,), (n, 4), (n, states)
    outputs = stress, tangent, state, dissipation, flows
    sizes = (n, 4), (n, 4, 4), (n, states), (n,), (n,)
    if [array.shape for array in (*inputs, *outputs)] != [*shapes, *sizes]:
        raise ValueError(f"arrays of a law that do not belong together: {n} points")
    if not all(array.flags.writeable for array in outputs):
        raise ValueError("arrays for what a law answers must not be closed")
    if columns <= LAST[kind]:
        raise ValueError(f"a law needs {LAST[kind] + 1} coefficients a point, not {columns}")
    vectors = np.zeros((4, 4))
    places = addresses(vectors, *inputs, *outputs[:-1]) + addresses(flows, of=bool)
    _function()(n, columns, states, kind, signed, dt, *places)


@cache
def _function() -> Callable[..., None]:
    return loaded("integrate_points", SOURCES, _compiled, _ARGUMENTS)


def _compiled() -> Any:
    from castfem.physics.constitutive.kernel.loop import integrate_at

    return integrate_at()
