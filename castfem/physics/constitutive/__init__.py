"""Constitutive laws of steel from cold solid to liquid: plain arrays in, stress and tangent out."""

from __future__ import annotations

from castfem.physics.constitutive.base import (
    Law,
    MaterialStep,
    Response,
    equivalent_strain,
    equivalent_stress,
)
from castfem.physics.constitutive.elasticity import Elasticity, Solidity
from castfem.physics.constitutive.flow_laws import NortonCreep, PerfectlyPlastic, ThermoElastic
from castfem.physics.constitutive.hardening_laws import NortonHoff, UnifiedSteel
from castfem.physics.constitutive.parameters import (
    available_laws,
    law_from,
    load_elasticity,
    load_law,
)

__all__ = [
    "Elasticity",
    "Law",
    "MaterialStep",
    "NortonCreep",
    "NortonHoff",
    "PerfectlyPlastic",
    "Response",
    "Solidity",
    "ThermoElastic",
    "UnifiedSteel",
    "available_laws",
    "equivalent_strain",
    "equivalent_stress",
    "law_from",
    "load_elasticity",
    "load_law",
]
