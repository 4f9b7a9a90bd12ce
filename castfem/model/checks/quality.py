"""Checks of [quality]."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.model.base import Faults
from castfem.model.checks.registry import check
from castfem.model.quality import FEEDING, Quality

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("quality")
def _followed(case: Case, quality: Quality) -> Faults:
    """Report missing data of the criteria."""
    criteria = quality.hot_tearing or ()
    strained = [name for name in criteria if name != "clyne_davies"]
    if strained and (case.mechanics is None or case.mechanics_end() is not None):
        which = "is missing" if case.mechanics is None else "ends above (mechanics.until)"
        text = 'a run of the temperature alone can have "clyne_davies"'
        yield "hot_tearing", f'("{strained[0]}") needs strain, and [mechanics] {which}; {text}'
    if criteria and not (quality.brittle[0] > FEEDING and quality.brittle[1] < 1.0):
        text = f"hot_tearing needs a range between {FEEDING:g} and 1, such as [0.9, 0.99]"
        yield "brittle", text
    for name, table in (("won", quality.won), ("rdg", quality.rdg)):
        if table is not None and name not in criteria:
            yield name, f'belongs to the criterion "{name}"; name it, hot_tearing = ["{name}"]'
    if quality.ductility is not None and case.mechanics is None:
        yield "ductility", "is compared with strain; add [mechanics], or leave it out"
