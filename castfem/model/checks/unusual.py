"""Warnings about values of a sound case that are possible but probably mistakes.

A case with such values still runs; the limits are beyond casting practice, not beyond what can be
computed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

from castfem.base import ranges
from castfem.base.constants import ROUNDING
from castfem.base.tables import Table
from castfem.base.units import convert, format, in_mm
from castfem.model.base import Faults
from castfem.model.case import Case
from castfem.model.casting import Start
from castfem.model.checks.cooling import law_groups
from castfem.model.checks.registry import caution, own_caution
from castfem.model.cooling import Contact, HeatLaw, Radiation, Spray, Zone
from castfem.model.machine import Extraction
from castfem.model.mechanics import Coupling, Mechanics, Way
from castfem.model.mould import Mould
from castfem.model.problems import Problem
from castfem.physics.materials.phase_table import PhaseTable
from castfem.physics.thermal.spray_correlations import CORRELATIONS

if TYPE_CHECKING:
    from castfem.model.base import TableModel
    from castfem.physics.constitutive.base import Law
    from castfem.physics.materials import Steel


_SIGNED = {
    name: f"{name}_signed" for name in ("kozlowski_zhu", "norton_hoff_kozlowski")
}  # the same law with signed hardening


def warnings(case: Case) -> Iterator[Problem]:
    """Yield warnings about unusual values of a sound case."""
    yield from caution.run(case)
    yield from (replace(problem, inherited=False) for problem in own_caution.run(case))


def warnings_with(
    case: Case, steel: Steel, law_carbon: float | None = None, law: Law | None = None
) -> Iterator[Problem]:
    """Yield warnings about values of a sound case that do not fit its steel.

    Args:
        case: The case.
        steel: Steel of the case.
        law_carbon: Carbon content, wt%, of the steel that the mechanical law was fitted to; None if
            not stated.
        law: Mechanical law; None without mechanics.
    """
    if steel.left_out:
        names = ", ".join(steel.left_out)
        text = f"there are no data for {names}; the steel is computed without"
        yield Problem(("steel", "composition"), text)
    if isinstance(steel.diagram, PhaseTable) and (outside := steel.diagram.header.get("outside")):
        text = f"is beyond what {steel.diagram.header['database']} is stated to cover: {outside}"
        yield Problem(("steel", "composition"), f"{text} wt%; its phases are extrapolated")
    start = case.casting.temperature
    if start is not None and start < steel.liquidus:
        yield Problem(
            ("casting", "temperature"),
            f"({format(start, 'K', 'degC')}) lies below the liquidus of {steel.name} "
            f"({convert(steel.liquidus, 'K', 'degC'):.6g} degC): the slice begins with "
            f"{100.0 * float(steel.solid_fraction(start)):.3g} % of solid",
        )
    yield from _hot(case, steel)
    from castfem.physics.materials.plausible import unusual

    for problem in unusual(steel):
        yield Problem(("steel", "name"), f"{steel.name}: {problem.path[-1]}: {problem.text}")
    if law is not None and case.mechanics is not None:
        from castfem.physics.constitutive import parameters

        if text := parameters.unusual(case.mechanics.law, law):
            yield Problem(("mechanics", "law"), text)
        yield from _hardens_for_good(case, law)
        yield from _limit_of_signed_strain(case, law)
    # A composition gives the carbon content exactly; a set of fixed numbers represents a class of
    # steels.
    carbon = case.steel.composition.get("C")
    if case.mechanics is None or carbon is None or law_carbon is None:
        return
    if abs(carbon - law_carbon) > 0.03:  # wt%
        name = str(case.mechanics.law).rpartition("/")[2]
        yield Problem(
            ("mechanics", "law"),
            f'("{name}") has the numbers of a steel of {law_carbon:g} %C, {steel.name} has '
            f'{carbon:g} %C; "kozlowski_zhu" goes by the carbon of the steel',
        )


def _hot(case: Case, steel: Steel) -> Iterator[Problem]:
    """Report an unusually hot pour, and a start hotter than the poured steel."""
    start = case.casting.temperature
    superheat = ranges.RANGES["casting.superheat"]
    if start is not None and start - steel.liquidus > superheat.usual[1]:
        yield Problem(
            ("casting", "temperature"),
            f"{start - steel.liquidus:.4g} K above the liquidus of {steel.name} are far from what "
            f"metal is poured with, at most {superheat.usual[1]:g} K; are number and unit right?",
        )
    profile = None if case.casting.start is None else case.casting.start.profile
    above = case.casting.poured_superheat
    poured = start if above is None else steel.liquidus + above
    if isinstance(profile, Table) and poured is not None and max(profile.values) > poured + 1.0:
        yield Problem(
            ("casting", "start", "profile"),
            f"({format(max(profile.values), 'K', 'degC')}) is hotter than the steel was poured "
            f"({convert(poured, 'K', 'degC'):.6g} degC); are number and unit right?",
        )


def _hardens_for_good(case: Case, law: Law) -> Iterator[Problem]:
    """Report a law with which a strip creeping from roll to roll never becomes periodic."""
    bulging = None if case.mechanics is None else case.mechanics.bulging
    if case.mechanics is None or bulging is None or bulging.model != "creep":
        return
    from castfem.physics.machine.bulging.creep import VIRGIN_PITCHES, accumulates

    if accumulates(law):
        name = str(case.mechanics.law).rpartition("/")[2]
        fix = _SIGNED.get(name.removesuffix(".toml").removesuffix("_p1"))
        yield Problem(
            ("mechanics", "law"),
            f'("{name}") hardens further in each pitch: the bulge is what {VIRGIN_PITCHES} pitches '
            "make of virgin steel; "
            + (f'give "{fix}"' if fix else 'give it hardening = "signed"')
            + ', or bulging = "elastic"',
        )


def _limit_of_signed_strain(case: Case, law: Law) -> Iterator[Problem]:
    """Report a law whose yield limit uses the strain rate of another direction of flow."""
    from castfem.physics.constitutive.hardening_laws import NortonHoff

    if isinstance(law, NortonHoff) and law.signed and law.yield_limit is None and case.mechanics:
        name = str(case.mechanics.law).rpartition("/")[2]
        yield Problem(
            ("mechanics", "law"),
            f'("{name}") has signed strain and finds its '
            "yield limit automatically: bent and straightened, a slab finds no equilibrium with "
            'both; give it yield_limit = "0 MPa"',
        )


@caution("coupling")
def _long_windows(case: Case, coupling: Coupling) -> Faults:
    if case.mechanics is None:
        return
    window, given = coupling.interval, case.casting.speed
    speed = max(given.values) if isinstance(given, Table) else given
    fastest = ranges.RANGES["casting.speed"].usual[1]
    length = window.length if isinstance(window, Way) else window * min(speed, fastest)
    if length > 0.25:  # m of strand: a narrow roll pitch, a third of a mould
        text = f"({length:.4g} m of strand) is longer than what a gap opens or a pitch bulges in"
        yield "interval", f"{text}; 0.1 s or 5 mm is usual"


@caution()
def _short_tables(case: Case, _: object) -> Faults:
    """Report heat tables over position that end, while still changing, long before their zone."""
    start = 0.0
    for index, zone in enumerate(case.cooling):
        end = case.casting.length if zone.to is None else min(zone.to, case.casting.length)
        for place, law in enumerate(zone.surface):
            for key in type(law).model_fields:
                table = getattr(law, key)
                if not isinstance(table, Table) or table.over != "position":
                    continue
                last, settled = table.arguments[-1], table.values[-1] == table.values[-2]
                if not settled and start < end and last < end - 0.2 * (end - start):
                    text = f"the table ends at {in_mm(last)}, the zone at {in_mm(end)}"
                    where = f"cooling.{index}.surface.{place}.{key}"
                    yield where, f"{text}: give the row at the end of the zone"
        start = end


@caution("cooling.*")
def _nearly_at_rolls(case: Case, zone: Zone) -> Faults:
    """Report zones that end next to a roll, which would make very short windows."""
    rolls = None if case.machine is None else case.machine.pairs()
    if case.mechanics is None or rolls is None or zone.to is None:
        return
    if (end := case.mechanics_end()) is not None and zone.to > end:
        return
    for number, pair in enumerate(rolls.pairs, start=1):
        # m: the zone was meant to end at the roll
        if ROUNDING < abs(zone.to - pair.position) < 1e-3:
            yield (
                "to",
                f"({zone.to:.9g} m) is {1e3 * abs(zone.to - pair.position):.3g} mm off roll "
                f'{number}: strain rates between them mean nothing; give "{pair.position:.9g} m"',
            )


@caution("cooling.*.surface.*")
def _sprays(case: Case, law: HeatLaw) -> Faults:
    """Report sprays outside the range in which their correlation was measured."""
    if not isinstance(law, Spray) or not law.water:
        return  # no water per area, or that of the whole zone
    of = CORRELATIONS[law.correlation]
    low, high = of.water
    if not low <= law.water <= high:
        reach = f"{low:g} to {high:g}" if low else f"at most {high:g}"
        how = "below, it falls to zero" if law.water < low else of.held or "extrapolated"
        yield (
            "water",
            f"({law.water:.4g} L/(m^2 s)) is outside of what {law.correlation} was measured for, "
            f"{reach} L/(m^2 s): {how}",
        )


@caution("cooling.*")
def _radiates(case: Case, zone: Zone) -> Faults:
    sprays = any(isinstance(law, Spray) for law in zone.surface)
    if sprays and not any(isinstance(law, Radiation) for law in zone.surface):
        fix = 'its correlation is that of water alone; add a surface with law = "radiation"'
        yield "", f"a spray without radiation; {fix}"


@caution("cooling.*")
def _wasted(case: Case, zone: Zone) -> Faults:
    """Report radiation and convection beside contact without a gap."""
    touching: set[str] = set()
    for law in zone.surface:
        if isinstance(law, Contact) and (law.gap == 0.0 or (law.gap is None and not case.mould)):
            touching |= law_groups(case.section, law)
    for index, law in enumerate(zone.surface):
        if law.crosses_gap and touching & law_groups(case.section, law):
            yield (
                f"surface.{index}",
                f"{law.tag} has no effect beside contact without a gap: where the strand touches "
                "there is contact alone (eq. 35); what is meant as a mean of both is convection "
                "with a mean coefficient",
            )


@caution("cooling.*")
def _uncooled(case: Case, zone: Zone) -> Faults:
    """Report a part of the surface without cooling where the rest is cooled."""
    cooled = {group for law in zone.surface for group in law_groups(case.section, law)}
    left_out = [group for group in case.section.cooled_groups() if group not in cooled]
    if cooled and left_out:
        yield (
            "surface",
            f"no heat law holds on {', '.join(left_out)}: no heat leaves there; add to a law's "
            "`on`, or leave `on` out for the whole surface",
        )


@caution("mechanics")
def _elastic(case: Case, table: Mechanics) -> Faults:
    """Report changed moduli of the steel beside a named elasticity."""
    for name in ("youngs_modulus", "poisson_ratio"):
        if table.elasticity is not None and name in case.steel.overrides:
            yield (
                f"/steel.overrides.{name}",
                "has no effect beside mechanics.elasticity, which holds it; leave one of them out",
            )


@caution("mould")
def _fixed(case: Case, mould: Mould) -> Faults:
    """Report heat in the mould that does not depend on the gap that opens there."""
    start = 0.0
    for number, zone in enumerate(case.cooling):
        if start >= mould.length:
            return
        following = [law for law in zone.surface if isinstance(law, Contact) and law.gap is None]
        met = {group for law in following for group in law_groups(case.section, law)}
        for index, law in enumerate(zone.surface):
            crosses = law.crosses_gap and law_groups(case.section, law) <= met
            if law not in following and not crosses:
                fix = 'heat that is to follow it is law = "contact" without the key gap'
                text = f"{law.called or law.tag} is not changed by the gap that opens in the mould"
                yield f"/cooling.{number}.surface.{index}", f"{text}; {fix}"
        start = case.casting.length if zone.to is None else zone.to


_REPEATED = ("passes", "settled", "window_error")


def _changed(table: TableModel) -> list[str]:
    """Keys that differ from the default (a run's case also lists the defaults)."""
    fields = type(table).model_fields
    needed = {name for name, field in fields.items() if field.is_required()}
    plain = type(table).model_validate(table.model_dump(mode="json", include=needed))
    return [n for n in fields if getattr(table, n) != getattr(plain, n)]


@caution()
def _longest_step(case: Case, _: object) -> Faults:
    """Report a requested step that is never taken, since fields are written within it."""
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
    """Report a start time where nothing depends on the clock."""
    if not start.time:
        return
    if not (case.tables_by_clock() or case.output.by_clock):
        yield "time", "has no effect: no speed, superheat or water flow varies in time"


@caution("coupling")
def _coupling(case: Case, table: Coupling) -> Faults:
    """Report keys for iterated windows without iteration, or for a coupling that does not exist."""
    given = _changed(table)
    if case.mechanics is None:
        for name in given:
            yield name, "has no effect without [mechanics]"
        return
    if "strain_error" in given and table.growth is None:  # 1 switches off that of a base file
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
    """Report a modulus of fed liquid that has no effect."""
    if not table.liquid_has_modulus and "liquid_stiffness" in _changed(table):
        fix = 'what has this modulus is liquid = "elastic", or a mushy zone that stiffens (mush)'
        yield "liquid_stiffness", f"has no effect: liquid that is fed has none; {fix}"


@caution("machine.extraction")
def _extraction(case: Case, table: Extraction) -> Faults:
    """Report friction and bending beside a maker's curve that already contains them."""
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None or table.coupled:
        return
    locked = any(pair.locked for pair in rolls.pairs)
    for name in ("bending", *(() if locked else ("friction_axis", "friction_surface"))):
        if name in _changed(table):
            yield name, "has no effect beside a maker's curve, which includes it"
