"""From the tables of a case to the machine that its slice passes."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.machine import Machine

if TYPE_CHECKING:
    from castfem.case.model import Case


def build_machine(case: Case) -> Machine:
    """Return the machine of a sound case."""
    return Machine(case.casting.travel, mould_length=case.mould_exit())
