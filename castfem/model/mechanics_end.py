"""Checks of the place where the mechanics of a case end, mechanics.until."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.base.tolerances import ROUNDING
from castfem.base.units import in_mm
from castfem.model.case import Case
from castfem.model.mechanics import MOULD_EXIT
from castfem.model.problems import Problem

_KEY = ("mechanics", "until")


def check_mechanics_end(case: Case) -> Iterator[Problem]:
    """Yield what does not go with mechanics that end before the run does."""
    table = case.mechanics
    if table is None or table.until is None:
        return
    for what, there in _below(case):
        if there:
            yield Problem(_KEY, f"and {what} exclude each other; leave one of the two out")
    zones_known = case.cooling is not None and None not in case.cooling
    exit_ = case.mould_exit() if zones_known or case.mould is not None else None
    if table.until == MOULD_EXIT and exit_ is None and zones_known:
        yield Problem(
            _KEY, f'("{MOULD_EXIT}"): there is no mould; give a length, such as until = "1 m"'
        )
    end = exit_ if table.until == MOULD_EXIT else table.until
    if not isinstance(end, float) or exit_ is None:
        return
    if case.mould is not None and end < exit_ * (1.0 - ROUNDING):
        yield Problem(
            _KEY,
            f"({in_mm(end)}) lies in the mould, which ends at {in_mm(exit_)}: its gap, which "
            f'decides the heat, comes from the mechanics; give until = "{MOULD_EXIT}", or more',
        )
    start = case.casting.start if case.casting is not None else None
    if start is not None and start.at == MOULD_EXIT and end <= exit_ * (1.0 + ROUNDING):
        yield Problem(
            _KEY,
            f"({in_mm(end)}) does not lie below casting.start.at, {in_mm(exit_)}, where the "
            "mechanics begin; leave it out, or give a larger length",
        )


def _below(case: Case) -> Iterator[tuple[str, bool]]:
    """Yield what is of the strand below the end of its mechanics, and whether the case has it."""
    mechanics, machine = case.mechanics, case.machine
    bulging = None if mechanics is None else mechanics.bulging
    yield "mechanics.bulging", bulging is not None and bulging.model not in (None, "none")
    yield "[machine.extraction]", machine is not None and machine.extraction is not None
    yield "[verification]", case.verification is not None
