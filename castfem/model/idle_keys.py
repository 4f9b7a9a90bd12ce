"""Keys that a sound case gives, and that change nothing in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from castfem.base.tables import Table
from castfem.base.tolerances import ROUNDING
from castfem.model.casting import Start
from castfem.model.checks import Faults, caution, own_caution
from castfem.model.extraction import COUPLED, Extraction
from castfem.model.mechanics import Coupling, Mechanics

if TYPE_CHECKING:
    from castfem.model.base import TableModel
    from castfem.model.case import Case

_REPEATED = ("passes", "settled", "window_error")


def _changed(table: TableModel) -> list[str]:
    """Keys with another value than their default: the case of a run names the defaults, too."""
    fields = type(table).model_fields
    needed = {name for name, field in fields.items() if field.is_required()}
    plain = type(table).model_validate(table.model_dump(mode="json", include=needed))
    return [n for n in fields if getattr(table, n) != getattr(plain, n)]


@caution()
def _longest_step(case: Case, _: object) -> Faults:
    """Yield a step that was asked for and is never taken, since fields are written within it."""
    time, every = case.thermal.time, case.output_every
    given: dict[tuple[str, ...], float | None] = {("step",): time.step}
    if time.adaptive is not None and "largest" in _changed(time.adaptive):
        given = {("adaptive", "largest"): time.adaptive.largest}
    for name, step in given.items():
        if case.output_fields and step is not None and step > every * (1.0 + ROUNDING):
            yield (
                ".".join(("thermal", "time", *name)),
                f"({step:.4g} s) is cut to output.every ({every:.4g} s): the states of the fields "
                "end a step; write them less often, or none (output.fields = [])",
            )


@caution("casting.start")
def _clock(case: Case, start: Start) -> Faults:
    """Yield a start by the clock, where nothing goes by it."""
    if not start.time:
        return
    water = [] if case.water is None else [case.water.flow]
    water += [getattr(law, "flow", None) for zone in case.cooling for law in zone.surface]
    water += [] if case.secondary is None else [c.flow for c in case.secondary.circuit]
    given = (case.casting.speed, case.casting.superheat, *water)
    if not any(isinstance(value, Table) and value.over == "time" for value in given):
        yield (
            "time",
            "has no effect: neither speed, nor superheat, nor a flow of water is over time",
        )


@caution("coupling")
def _coupling(case: Case, table: Coupling) -> Faults:
    """Yield what is told of windows that are not repeated, or of a coupling that is not there."""
    given = _changed(table)
    if case.mechanics is None:
        for name in given:
            yield name, "has no effect without [mechanics]"
        return
    if "strain_error" in given and (table.growth or 1.0) == 1.0:
        yield "strain_error", "has no effect without coupling.growth"
    for name in (n for n in _REPEATED if n in given):
        if case.mould is None:
            reason = "without [mould]: no gap opens, and a window is not repeated"
        elif table.order != "thermal_first":
            reason = f'with order = "{table.order}": a window is not repeated'
        elif name == "window_error" and table.passes == 1:
            reason = "with passes = 1: the error of a window is found by repeating it"
        else:
            continue
        yield name, f"has no effect {reason}"


@own_caution("mechanics")
def _liquid(case: Case, table: Mechanics) -> Faults:
    """Yield a modulus of liquid that is fed, where no mushy zone is stiffer than it."""
    if not table.liquid_has_modulus and "liquid_stiffness" in _changed(table):
        yield (
            "liquid_stiffness",
            "has no effect: liquid that is fed is as soft as its pressure allows; what has this "
            'modulus is liquid = "elastic", or a mushy zone that stiffens (mush)',
        )


@caution("machine.extraction")
def _extraction(case: Case, table: Extraction) -> Faults:
    """Yield friction and bending that a maker's curve has in it."""
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None or table.resistance == COUPLED:
        return
    locked = any(pair.locked for pair in rolls.pairs)
    for name in ("bending", *(() if locked else ("friction_axis", "friction_surface"))):
        if name in _changed(table):
            yield name, "has no effect beside a maker's curve, which has it in it"
