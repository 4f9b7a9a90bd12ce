"""Case files: TOML in, a validated `Case` in SI out. No DOLFINx, no gmsh, no MPI."""

from __future__ import annotations

from castfem.base.tables import Table
from castfem.model.case import Case, Span
from castfem.model.casting import Casting, Output, Reference, Steel
from castfem.model.cooling import (
    Contact,
    Convection,
    Flux,
    HeatLaw,
    PrescribedTemperature,
    Radiation,
    Spray,
    Zone,
)
from castfem.model.load import AnyCase, Reading, from_document, load_any, load_case, read_case
from castfem.model.section import (
    BeamBlank,
    Mesh,
    Rectangle,
    Round,
    Section,
    Strip,
    cooled_groups,
    outer_groups,
)
from castfem.model.tensile import TensileCase
from castfem.model.thermal import Adaptive, Stepping, Thermal

__all__ = [
    "Adaptive",
    "AnyCase",
    "BeamBlank",
    "Case",
    "Casting",
    "Contact",
    "Convection",
    "Flux",
    "HeatLaw",
    "Mesh",
    "Output",
    "PrescribedTemperature",
    "Radiation",
    "Reading",
    "Rectangle",
    "Reference",
    "Round",
    "Section",
    "Span",
    "Spray",
    "Steel",
    "Stepping",
    "Strip",
    "Table",
    "TensileCase",
    "Thermal",
    "Zone",
    "cooled_groups",
    "from_document",
    "load_any",
    "load_case",
    "outer_groups",
    "read_case",
]
