"""Continuous casting of steel: one slice of the strand followed from the meniscus."""

from __future__ import annotations

__version__ = "0.1.0"
