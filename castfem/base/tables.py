"""Functions of temperature, time or position: constant, or linear between rows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, overload

import numpy as np
import numpy.typing as npt

from castfem.base import units
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.quantities import Kind
from castfem.base.types import Array

Side = Literal["above", "below"]
"""The side on which the value is taken at an argument where it jumps."""

ARGUMENTS = {
    "temperature": Kind("K", "degC"),
    "time": Kind("s", "s", least=0.0),
    "position": Kind("m", "mm", least=0.0),
    "speed": Kind("m/s", "m/min", least=0.0),
    "depth": Kind("m", "mm", least=0.0),
    "way": Kind("m", "mm", least=0.0),
}
"""Possible arguments of a table, with their units."""


@dataclass(frozen=True, slots=True)
class Constant:
    """The same value everywhere, without kinks or end."""

    value: float
    kinks: tuple[float, ...] = ()
    jumps: tuple[float, ...] = ()
    curved: bool = False
    span: tuple[float, float] = (0.0, math.inf)

    @property
    def values(self) -> tuple[float, ...]:
        """The value."""
        return (self.value,)

    @overload
    def __call__(  # type: ignore[overload-overlap]
        self, argument: float, side: Side = "above"
    ) -> float: ...

    @overload
    def __call__(self, argument: npt.ArrayLike, side: Side = "above") -> Array: ...

    def __call__(self, argument: Any, side: Side = "above") -> Any:
        """Return the value in the shape of the argument."""
        return np.full(np.shape(argument), self.value)[()]


@dataclass(frozen=True, slots=True)
class Table:
    """A quantity given in rows; it or its logarithm is linear between them.

    Raises:
        ValueError: Arguments and values differ in number, arguments do not increase, or a value has
            no logarithm.
    """

    over: str  #: its argument, one of `ARGUMENTS`
    arguments: tuple[float, ...]  #: strictly increasing, SI
    values: tuple[float, ...]  #: SI, one per argument, at least one
    #: the logarithm is linear: for values that fall by a factor per row (strengths, creep rates)
    logarithmic: bool = False
    #: refuse arguments outside the rows; otherwise the end values hold there
    refuse_outside: bool = False
    _rows: tuple[Array, Array] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        x, over = self.arguments, f"{self.over}s"
        if not x or len(x) != len(self.values):
            raise ValueError(f"a table needs as many values as {over}, and at least one")
        if any(a >= b for a, b in itertools.pairwise(x)):
            raise ValueError(f"the {over} of a table must increase")
        if self.logarithmic and min(self.values) <= 0.0:
            raise ValueError("only positive values have a logarithm")
        y = np.array(self.values)
        rows = np.array(x), np.log(y) if self.logarithmic else y
        object.__setattr__(self, "_rows", rows)  # avoids conversion of long tuples at each call

    @property
    def kinks(self) -> tuple[float, ...]:
        """Arguments at which the slope jumps: the rows."""
        return self.arguments

    @property
    def jumps(self) -> tuple[float, ...]:
        """Arguments at which the value jumps: none."""
        return ()

    @property
    def curved(self) -> bool:
        """Whether it is not linear between its kinks."""
        return self.logarithmic

    @property
    def span(self) -> tuple[float, float]:
        """First and last argument for which it is known."""
        return (self.arguments[0], self.arguments[-1]) if self.refuse_outside else (0.0, math.inf)

    @overload
    def __call__(  # type: ignore[overload-overlap]
        self, argument: float, side: Side = "above"
    ) -> float: ...

    @overload
    def __call__(self, argument: npt.ArrayLike, side: Side = "above") -> Array: ...

    def __call__(self, argument: Any, side: Side = "above") -> Any:
        """Return the value at one argument (K, s or m), or at each of an array.

        Raises:
            ValueError: An argument is outside the rows of a table that refuses this.
        """
        if self.refuse_outside:
            self._refuse(np.asarray(argument, float))
        found = np.interp(argument, *self._rows)
        return np.exp(found) if self.logarithmic else found

    def _refuse(self, argument: Array) -> None:
        ends = self.arguments[0], self.arguments[-1]
        if not argument.size or (ends[0] <= argument.min() and argument.max() <= ends[1]):
            return
        kind = ARGUMENTS[self.over]
        low, high, least, most = (
            f"{units.convert(float(x), kind.unit, kind.shown):g}"
            for x in (*ends, argument.min(), argument.max())
        )
        raise ValueError(
            f"the table goes from {low} to {high} {kind.shown}, "
            f"but values from {least} to {most} {kind.shown} are needed"
        )


Tabled = float | Table
"""A number, or a table of it over an argument."""


def as_function(value: Tabled) -> Constant | Table:
    """Return a number or table as a function of its argument."""
    return value if isinstance(value, Table) else Constant(value)


def celsius(
    temperature: Sequence[float], value: Sequence[float], logarithmic: bool = False
) -> Table:
    """Return a table from values (SI) at temperatures in degC."""
    return Table(
        "temperature", tuple(t + ZERO_CELSIUS for t in temperature), tuple(value), logarithmic
    )
