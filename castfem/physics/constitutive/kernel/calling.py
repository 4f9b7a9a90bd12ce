"""What Python calls to integrate the points; it needs numba only where nothing is compiled yet."""

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
"""All files that the compiled code is made of."""
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
        signed: Whether hardening goes by the viscoplastic strain tensor; the first three columns of
            the state are then its xx, yy and sqrt(2) xy.
        coefficients: (n, columns).
        strain: Total strain increments (n, 4).
        thermal: Isotropic thermal strain increments (n,).
        stress_old: (n, 4), Pa.
        state_old: (n, states).
        dt: s.
        stress: Out, (n, 4), Pa.
        tangent: Out, (n, 4, 4), d stress / d strain, Pa.
        state: Out, (n, states).
        dissipation: Out, viscoplastic work (n,), J/m3, but for what a back stress stores.
        flows: Out, whether the point flows (n,).

    Raises:
        ValueError: Arrays do not belong together or to the law, are not in one piece, of other
            numbers, or closed.
    """
    n, columns, states = len(strain), coefficients.shape[1], state_old.shape[1]
    given = [
        np.ascontiguousarray(one, dtype=float)
        for one in (coefficients, strain, thermal, stress_old, state_old)
    ]
    shapes = (n, columns), (n, 4), (n,), (n, 4), (n, states)
    written = stress, tangent, state, dissipation, flows
    sizes = (n, 4), (n, 4, 4), (n, states), (n,), (n,)
    if [one.shape for one in (*given, *written)] != [*shapes, *sizes]:
        raise ValueError(f"arrays of a law that do not belong together: {n} points")
    if not all(one.flags.writeable for one in written):
        raise ValueError("arrays for what a law answers must not be closed")
    if columns <= LAST[kind]:
        raise ValueError(f"a law needs {LAST[kind] + 1} coefficients a point, not {columns}")
    vectors = np.zeros((4, 4))
    places = addresses(vectors, *given, *written[:-1]) + addresses(flows, of=bool)
    _function()(n, columns, states, kind, signed, dt, *places)


@cache
def _function() -> Callable[..., None]:
    return loaded("integrate_points", SOURCES, _compiled, _ARGUMENTS)


def _compiled() -> Any:
    from castfem.physics.constitutive.kernel.loop import integrate_at

    return integrate_at()
