"""The law of the shell integrated through its thickness for a given history of the moment."""

from __future__ import annotations

from collections.abc import Callable
from ctypes import c_bool, c_double, c_int64, c_void_p
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from castfem.base.errors import RunFailure
from castfem.base.shared_code import addresses, loaded
from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.constitutive.kernel.calling import SOURCES
from castfem.physics.machine.bulging.shell import Points, stiffness

_OWN_SOURCE = Path(__file__).with_name("layer_steps.py")
_ARGUMENTS = (*[c_int64] * 5, c_bool, *[c_double] * 2, *[c_void_p] * 17)


@cache
def _lead() -> Callable[..., None]:
    return loaded("lead_layers", (*SOURCES, _OWN_SOURCE), _compiled, _ARGUMENTS)


def _compiled() -> Any:
    from castfem.physics.machine.bulging.layer_steps import lead_at

    return lead_at()


@dataclass(frozen=True, slots=True)
class Condition:
    """Stress and state of all layers at one position."""

    stress: Array  #: Mandel vectors, Pa, (n, 4)
    state: Array  #: state of the law, (n, states)


@dataclass(frozen=True, slots=True)
class LayerHistory:
    """Layers over a history of the moment."""

    curvature: Array  #: since the start, 1/m, (m+1,)
    axial_strain: Array  #: strain of the neutral axis since the start, (m+1,)
    compliance: Array  #: d curvature / d moment of each step, 1/(N m), (m,)
    end: Condition  #: stress and state at the end


class Layers:
    """The layers of a shell, integrated over histories of the moment.

    Args:
        law: Law of the steel.
        points: Points through the thickness.

    Attributes:
        law: Law of the steel.
        points: Points through the thickness.
        stiffness: Elastic stiffness.
        arm: Depth of the neutral axis minus depth (n,), m.
    """

    def __init__(self, law: Law, points: Points) -> None:
        self.law, self.points = law, points
        self.stiffness = stiffness(law.elasticity, points)
        self.arm = self.stiffness.neutral - points.depth
        self._coefficients = law.coefficients(points.temperature, points.temperature)

    def virgin(self) -> Condition:
        """Return stress-free, unstrained layers."""
        n = len(self.points.depth)
        return Condition(np.zeros((n, 4)), self.law.initial_state(n))

    def advance(self, start: Condition, moment: Array, dt: Array) -> LayerHistory:
        """Integrate the layers over a history of the moment.

        Args:
            start: Initial condition; it is not modified.
            moment: Moments at the ends of the steps (m,), N per metre of width.
            dt: Durations of the steps (m,), s.

        Raises:
            RunFailure: No state of the layers carries a moment.
        """
        steps, points, (n, states) = len(dt), self.points, start.state.shape
        curvature, axial, compliance = np.zeros(steps + 1), np.zeros(steps + 1), np.zeros(steps)
        stress, state, ended = start.stress.copy(), start.state.copy(), np.zeros(2)
        given = [
            np.ascontiguousarray(one, dtype=float)
            for one in (
                self._coefficients,
                points.thermal_rate,
                points.weight,
                self.arm,
                moment,
                dt,
            )
        ]
        out = stress, state, curvature, axial, compliance, ended
        room = [np.zeros(shape) for shape in ((5, n, 4), (n, 4, 4), (n, states), (3, n), (11, 4))]
        columns, most = self._coefficients.shape[1], max(float(np.abs(moment).max()), 1e-300)
        _lead()(
            n, columns, states, steps, self.law.kind, self.law.signed, points.thickness, most,
            *addresses(*given, *out, *room),
        )  # fmt: skip
        taken, rest = int(ended[0]), ended[1]
        if taken < steps:
            raise RunFailure(
                f"the shell of {1e3 * points.thickness:.3g} mm cannot carry the moment of "
                f"{moment[taken]:.3g} N per metre of width that the pressure of the liquid brings "
                f"about between the rolls (out of balance by {rest:.1e} of the largest)"
            )
        return LayerHistory(curvature, axial, compliance, Condition(stress, state))
