"""Checks of [mechanics], its bulging, and [quality]."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from castfem.base.constants import ROUNDING
from castfem.base.units import in_mm
from castfem.model.base import Faults
from castfem.model.checks.registry import check
from castfem.model.mechanics import MOULD_EXIT, Bulging, Mechanics
from castfem.model.quality import FEEDING, Quality
from castfem.model.secondary import is_wide
from castfem.model.thermal import negative_options

if TYPE_CHECKING:
    from castfem.model.case import Case


@check("mechanics")
def _liquid_in_mould(case: Case, table: Mechanics) -> Faults:
    if case.mould is None:
        return
    if table.liquid == "fed" and table.ferrostatic in ("off", "none"):
        text = f'("{table.ferrostatic}"): nothing holds liquid that is fed at the wall of a mould'
        yield "ferrostatic", f'{text}; give ferrostatic = "full", or liquid = "elastic"'
    least = 1e-6  # relative to the solid: the liquid keeps its shape at large strain
    soft = table.liquid_has_modulus and table.liquid_stiffness < least
    if soft and table.strain == "large":
        text = f"({table.liquid_stiffness:g}): liquid this soft folds in a mould at large strain"
        yield "liquid_stiffness", f'{text}; at least {least:g}, or strain = "small"'


@check("mechanics")
def _solver(case: Case, table: Mechanics) -> Faults:
    yield from negative_options(table.solver)


@check("mechanics")
def _until(case: Case, table: Mechanics) -> Faults:
    """Report what cannot be combined with mechanics that end before the run does."""
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
    """Yield what needs mechanics to the end of the strand, and whether the case has it."""
    bulging, machine = mechanics.bulging, case.machine
    yield "mechanics.bulging", bulging is not None and bulging.model not in (None, "none")
    yield "[machine.extraction]", machine is not None and machine.extraction is not None
    yield "[verification]", case.verification is not None


@check("mechanics.bulging")
def _no_effect(case: Case, table: Bulging) -> Faults:
    if table.model == "none":
        # A case that was written out and is read again contains every default.
        for name, field in Bulging.model_fields.items():
            if name != "model" and getattr(table, name) != field.default:
                yield name, 'has no effect with model = "none"; leave one of the two out'
    if table.largest is not None and table.model not in ("thesis", "none"):
        yield "largest", f'is for model = "thesis", not "{table.model}"'
    if table.shear and table.model == "thesis":
        yield "shear", 'is for a strip, not for model = "thesis"'


@check("mechanics.bulging")
def _needs(case: Case, table: Bulging) -> Faults:
    mechanics = case.mechanics
    if not table.bears or mechanics is None:
        return
    if case.machine is None:
        yield "", "needs rolls, the table [machine]; add it, or leave bulging out"
        return
    if case.section.tag != "rectangle":
        fix = 'give section.shape = "rectangle", or leave it out'
        yield "", f"is for a section with wide faces; {fix}"
    if mechanics.ferrostatic == "off":
        fix = "leave one of the two out"
        yield "", f'needs the pressure of the liquid, and ferrostatic is "off"; {fix}'
    for index, held in enumerate(mechanics.held):
        if held.component == "y" and any(map(is_wide, held.on)):
            text = (
                "moves the wide faces, which the rolls bear; leave one of the two out (held = [])"
            )
            yield f"/mechanics.held.{index}", text
    pairs = case.machine.pairs()
    if pairs is not None and len(pairs.pairs) < 2:
        yield "", "needs two pairs of rolls at least"


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
