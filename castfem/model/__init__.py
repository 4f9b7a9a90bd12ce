"""Case files: TOML in, a validated `Case` in SI out.

No DOLFINx, gmsh or MPI, except in `castfem.model.build`, which makes a simulation from a case.
"""

from __future__ import annotations

from castfem.base.tables import Table
from castfem.model.case import Case
from castfem.model.cooling import Contact
from castfem.model.load import AnyCase, Reading, from_document, load_any, load_case, read_case
from castfem.model.tensile import TensileCase
from castfem.model.thermal import Adaptive

__all__ = [
    "Adaptive",
    "AnyCase",
    "Case",
    "Contact",
    "Reading",
    "Table",
    "TensileCase",
    "from_document",
    "load_any",
    "load_case",
    "read_case",
]
