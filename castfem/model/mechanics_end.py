"""Checks of the place where the mechanics of a case end, mechanics.until."""

from __future__ import annotations

from collections.abc import Iterator

from castfem.base.tolerances import ROUNDING
from castfem.base.units import in_mm
from castfem.model.case import Case
from castfem.model.checks import Faults, check
from castfem.model.mechanics import MOULD_EXIT, Mechanics


@check("mechanics")
def _until(case: Case, table: Mechanics) -> Faults:
    """Yield what does not go with mechanics that end before the run does."""
    if table.until is None:
        return
    for what, there in _below(case, table):
        if there:
            yield "until", f"and {what} exclude each other; leave one of the two out"
    exit_ = case.mould_exit()
    if table.until == MOULD_EXIT and exit_ is None:
        yield "until", f'("{MOULD_EXIT}"): there is no mould; give a length, such as "1 m"'
    end = exit_ if table.until == MOULD_EXIT else table.until
    if not isinstance(end, float) or exit_ is None:
        return
    if case.mould is not None and end < exit_ * (1.0 - ROUNDING):
        yield (
            "until",
            f"({in_mm(end)}) lies in the mould, which ends at {in_mm(exit_)}: its gap, which "
            f'decides the heat, comes from the mechanics; give "{MOULD_EXIT}", or more',
        )
    start = case.casting.start
    if start is not None and start.at == MOULD_EXIT and end <= exit_ * (1.0 + ROUNDING):
        yield (
            "until",
            f"({in_mm(end)}) does not lie below casting.start.at, {in_mm(exit_)}, where the "
            "mechanics begin; leave it out, or give a larger length",
        )


def _below(case: Case, mechanics: Mechanics) -> Iterator[tuple[str, bool]]:
    """Yield what is of the strand below the end of its mechanics, and whether the case has it."""
    bulging, machine = mechanics.bulging, case.machine
    yield "mechanics.bulging", bulging is not None and bulging.model not in (None, "none")
    yield "[machine.extraction]", machine is not None and machine.extraction is not None
    yield "[verification]", case.verification is not None
