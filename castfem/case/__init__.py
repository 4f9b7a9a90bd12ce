"""Case files: TOML in, a validated `Case` in SI out. No DOLFINx, no gmsh, no MPI."""

from __future__ import annotations

from castfem.case.casting import Casting, Output, Reference, Steel
from castfem.case.cooling import (
    Contact,
    Convection,
    Flux,
    HeatLaw,
    PrescribedTemperature,
    Radiation,
    Spray,
    Zone,
)
from castfem.case.load import AnyCase, Reading, from_document, load_any, load_case, read_case
from castfem.case.model import Case, Span
from castfem.case.section import (
    BeamBlank,
    Mesh,
    Rectangle,
    Round,
    Section,
    Strip,
    cooled_groups,
    outer_groups,
)
from castfem.case.tensile import TensileCase
from castfem.case.thermal import Adaptive, Stepping, Thermal
from castfem.values.tables import Table

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
