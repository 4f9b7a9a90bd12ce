"""A parameter of a law over temperature: constant, or rows that are joined linearly or by powers.

Beyond its ends a table is constant.  Levels that fall by a factor from row to row (strengths, creep
rates) are interpolated in their logarithm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.constitutive.base import Array


@dataclass(frozen=True, slots=True)
class Constant:
    """The same value at every temperature."""

    value: float

    def __call__(self, temperature: Array) -> Array:
        """Return the value in the shape of `temperature`."""
        return np.full(np.shape(temperature), self.value)


@dataclass(frozen=True, slots=True)
class Rows:
    """Values at temperatures.

    Attributes:
        temperature: Increasing, K.
        value: As many, SI.
        logarithmic: Interpolate the logarithm.

    Raises:
        ValueError: If the rows do not match, do not increase, or have no logarithm.
    """

    temperature: tuple[float, ...]
    value: tuple[float, ...]
    logarithmic: bool = False

    def __post_init__(self) -> None:
        if not self.temperature or len(self.temperature) != len(self.value):
            raise ValueError("a table needs as many values as temperatures, and at least one")
        if any(a >= b for a, b in zip(self.temperature[:-1], self.temperature[1:], strict=True)):
            raise ValueError("the temperatures of a table must increase")
        if self.logarithmic and min(self.value) <= 0.0:
            raise ValueError("only positive values have a logarithm")

    def __call__(self, temperature: Array) -> Array:
        """Interpolate at temperatures in K."""
        if self.logarithmic:
            return np.asarray(np.exp(np.interp(temperature, self.temperature, np.log(self.value))))
        return np.asarray(np.interp(temperature, self.temperature, self.value))


def celsius(temperature: list[float], value: list[float], logarithmic: bool = False) -> Rows:
    """Rows at temperatures in degC."""
    return Rows(tuple(t + 273.15 for t in temperature), tuple(value), logarithmic)
