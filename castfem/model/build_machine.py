"""From the tables of a case to the machine that its slice passes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.model.machine import thickness_of
from castfem.physics.machine import Machine

if TYPE_CHECKING:
    from castfem.model.case import Case


def build_machine(case: Case) -> Machine:
    """Return the machine of a sound case."""
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None:
        return Machine(case.casting.travel, mould_length=case.mould_exit())
    thickness = thickness_of(case.section)
    assert thickness is not None
    return Machine(case.casting.travel, rolls.line(thickness), case.mould_exit())
