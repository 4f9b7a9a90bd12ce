"""Axes in the chosen units: figures are drawn in documented units, and their numbers converted.

The label of an axis ends with its unit in brackets. If another unit is shown, the ticks are at
round numbers in that unit, and the label has it. Curves and limits are unchanged.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, Formatter, Locator, LogLocator, NullLocator

from castfem.base.constants import ROUNDING
from castfem.base.shown_units import Scale, documented, plain_unit, scale_of

_UNIT = re.compile(r"\[([^\[\]]+)\](?=\s*$)")


class ScaledLocator(Locator):
    """Ticks of another locator, at round numbers of the shown unit."""

    def __init__(self, inner: Locator, scale: Scale) -> None:
        self._inner, self._scale = inner, scale

    def __call__(self) -> Sequence[float]:
        """The ticks of the axis, in the drawn unit."""
        assert self.axis is not None
        low, high = self.axis.get_view_interval()
        return self.tick_values(low, high)

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """The ticks between two values, in the drawn unit."""
        inner = self._inner.tick_values(self._scale(vmin), self._scale(vmax))
        return [float(self._scale.back(value)) for value in inner]

    def set_params(self, **options: object) -> None:
        """Settings of the other locator."""
        self._inner.set_params(**options)


class ScaledFormatter(Formatter):
    """Numbers of ticks in the shown unit."""

    def __init__(self, scale: Scale) -> None:
        self._scale = scale

    def __call__(self, x: float, pos: int | None = None) -> str:
        """The number of a tick, with four digits if it is not round in this unit."""
        assert self.axis is not None
        low, high = (self._scale(end) for end in self.axis.get_view_interval())
        shown = float(self._scale(x))
        return f"{0.0 if abs(shown) < ROUNDING * abs(high - low) else shown:.4g}"


def in_chosen_units(figure: Figure) -> None:
    """Convert all axes of a figure whose labels name a unit; may be called twice."""
    for axes in figure.axes:
        for one in _with_children(axes):
            turn(one.xaxis)
            turn(one.yaxis)


def turn(axis: Axis) -> None:
    """Show an axis in the unit chosen for the quantity in its label.

    The unit of a single quantity, if there is one, is found by the name of its column, which is the
    label's `gid`.
    """
    text = axis.get_label_text()
    found = _UNIT.search(text)
    if found is None:
        return
    unit = documented(found[1])
    try:
        scale = scale_of(unit, str(axis.label.get_gid() or ""))
    except ValueError:  # not a unit: "1e-5 1/s"
        return
    if scale.unit == unit:
        return
    axis.set_label_text(text[: found.start(1)] + plain_unit(scale.unit) + text[found.end(1) :])
    inner = axis.get_major_locator()
    if isinstance(inner, LogLocator):
        axis.set_minor_locator(NullLocator())
    if not isinstance(inner, FixedLocator | NullLocator):
        axis.set_major_locator(ScaledLocator(inner, scale))
    if not isinstance(inner, NullLocator):
        axis.set_major_formatter(ScaledFormatter(scale))


def _with_children(axes: Any) -> Iterator[Axes]:
    """Axes and those inside them, such as colour scales and a second axis."""
    yield axes
    for child in axes.child_axes:
        yield from _with_children(child)
