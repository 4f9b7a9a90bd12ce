"""The conditions that the data behind a law cover; beyond them it is an extrapolation."""

from __future__ import annotations

from dataclasses import dataclass

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.types import Array, Flags

KINDS = ("colder", "hotter", "faster")


@dataclass(frozen=True, slots=True)
class DataRange:
    """Of a law's data.

    Attributes:
        temperature: Lowest and highest, K.
        rate: Lowest and highest strain rate, 1/s.
    """

    temperature: tuple[float, float]
    rate: tuple[float, float]

    def beyond(self, temperature: Array, rate: Array) -> dict[str, Flags]:
        """Which points (n,) are colder, hotter or strained faster than the data, by kind."""
        low, high = self.temperature
        return {
            "colder": temperature < low,
            "hotter": temperature > high,
            "faster": rate > self.rate[1],
        }

    def limit(self, kind: str) -> str:
        """Return the end of the range that a kind is beyond, in words."""
        if kind == "faster":
            return f"{self.rate[1]:.3g} 1/s"
        return f"{self.temperature[kind == 'hotter'] - ZERO_CELSIUS:.4g} degC"
