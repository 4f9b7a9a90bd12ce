"""Hot ductility: critical strain of steel by temperature and strain rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array


def fracture_strain(reduction_of_area: Array) -> Array:
    """True fracture strain of a bar, ln(A0/A), from its reduction of area, 0 ... 1 (n,)."""
    return np.asarray(-np.log1p(-np.asarray(reduction_of_area, float)))


@dataclass(frozen=True, slots=True)
class Ductility:
    """Critical strain over temperature and strain rate, from a table.

    Linear in the temperature and in the logarithm of the rate. Rates outside the table take the
    nearest row; outside its temperatures nothing is known, and no damage is counted.
    """

    temperatures: tuple[float, ...]  #: temperatures, K, increasing
    rates: tuple[float, ...]  #: strain rates, 1/s, increasing
    strains: tuple[tuple[float, ...], ...]  #: critical strain, a row for each temperature

    @property
    def span(self) -> tuple[float, float]:
        """Lowest and highest temperature, K."""
        return self.temperatures[0], self.temperatures[-1]

    def critical_strain(self, temperature: Array, rate: Array) -> Array:
        """Critical strain at temperatures (n,), K, and strain rates (n,), 1/s."""
        table = np.asarray(self.strains)
        i, across = _between(np.asarray(self.temperatures), temperature)
        logs = np.log(np.asarray(self.rates))
        least = np.full_like(temperature, logs[0])
        known = np.log(np.maximum(rate, self.rates[0]), out=least, where=rate > 0.0)
        if len(logs) == 1:
            ends = [table[i, 0], table[i + 1, 0]]
        else:
            j, along = _between(logs, known)
            ends = [(1.0 - along) * table[k, j] + along * table[k, j + 1] for k in (i, i + 1)]
        return np.asarray((1.0 - across) * ends[0] + across * ends[1])


def _between(knots: Array, at: Array) -> tuple[np.ndarray, Array]:
    """Interval of increasing knots that contains each value, and the position in it, 0 to 1."""
    i = np.clip(np.searchsorted(knots, at, side="right") - 1, 0, len(knots) - 2)
    return i, np.clip((at - knots[i]) / (knots[i + 1] - knots[i]), 0.0, 1.0)
