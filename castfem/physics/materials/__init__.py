"""Steels: iron-carbon equilibrium, and property data with their sources.

`load_steel` is the entry point; the sets shipped with castfem are the TOML files in `data/`.
"""

from __future__ import annotations

from castfem.physics.materials.describe import describe_steel
from castfem.physics.materials.library import available_steels, load_steel
from castfem.physics.materials.steel import Steel

__all__ = ["Steel", "available_steels", "describe_steel", "load_steel"]
