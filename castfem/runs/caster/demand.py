"""Estimates the size of a caster run (slices, output times, memory) without importing a solver."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ROUNDING
from castfem.base.errors import CaseError
from castfem.base.types import Indices
from castfem.model.caster_slices import by_plant, cast_of, starts_of
from castfem.model.mechanics import Way

if TYPE_CHECKING:
    from castfem.model import Case

_VERTEX, _SLICE, _PROCESS = 130.0, 3.6e6, 1.5e8
"""Measured memory of a vertex of a slice, of the rest of a slice, and of a process, bytes."""
_STRAINED = 6e4, 3.6e6, 2.8e8
"""The same with mechanics, where each slice has its own equations; measured on a bulging slab."""
_MOST = 0.8
"""Largest fraction of the machine's memory that a caster may use."""


def demand(case: Case, vertices: Indices, ranks: int = 1) -> str:
    """Return the size of a caster run as one line.

    Args:
        case: A valid case.
        vertices: Vertices of the cells of its mesh (m, k).
        ranks: Number of ranks that share the slices.

    Raises:
        InputError: The case has no caster, or needs more memory than there is.
    """
    if case.caster is None:
        fix = "add [caster] with plant, spacing and every (docs/caster.md)"
        raise CaseError(f"caster: the table is missing; {fix}")
    inside = _most_inside(case)
    vertex, slice_, process = (_VERTEX, _SLICE, _PROCESS) if case.mechanics is None else _STRAINED
    each = slice_ + vertex * len(np.unique(vertices))
    memory = ranks * process + inside * each
    there = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if memory > _MOST * there:
        raise CaseError(
            f"caster.spacing: {inside} slices at once take about {1e-9 * memory:.3g} GB, and this "
            f"machine has {1e-9 * there:.3g} GB; give a larger spacing"
        )
    by_plant(case)
    return (
        f"{len(starts_of(case))} slices, {inside} at once, {len(case.caster.instants)} instants; "
        f"about {1e-6 * memory:.0f} MB"
    )


def _most_inside(case: Case) -> int:
    """Largest number of slices in the machine at one time."""
    caster, length = case.caster, case.casting.length
    assert caster is not None
    if isinstance(caster.spacing, Way):
        return 1 + math.floor(length / caster.spacing.length * (1.0 + ROUNDING))
    cast = cast_of(case)
    stays = [at - cast.when(max(cast.length(at) - length, 0.0)) for at in caster.instants]
    return 1 + math.floor(max(stays) / caster.spacing * (1.0 + ROUNDING))
