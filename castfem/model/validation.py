"""All checks of a case, which stand beside its tables."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.model import (  # noqa: F401 - each enters its checks
    bending,
    bounds,
    build_mould,
    check_cooling,
    check_secondary,
    effort,
    shown_units,
)
from castfem.model.case import Case
from castfem.model.checks import check, check_test
from castfem.model.problems import Problem
from castfem.model.tensile import TensileCase


def problems_of(case: Case | TensileCase, sound: bool = True) -> Iterator[Problem]:
    """Yield what does not fit together in a case; `sound`: all its values could be read."""
    return (check if isinstance(case, Case) else check_test).run(case, sound)
