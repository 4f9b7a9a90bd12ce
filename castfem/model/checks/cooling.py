"""Checks of the cooling: zones and their laws, the wall of the mould, [water], [thermal]."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from castfem.base.constants import ROUNDING
from castfem.base.errors import choices
from castfem.base.tables import Table
from castfem.base.units import format, in_mm, nearest
from castfem.model.base import Faults, Unreadable
from castfem.model.case import Case
from castfem.model.checks.registry import check, given, one_of, twice
from castfem.model.cooling import MOULD, Contact, Flux, PrescribedTemperature, Spray, Zone
from castfem.model.heat_law import TOTALS, HeatLaw, ScaledLaw
from castfem.model.mould import Mould
from castfem.model.section import Section, Strip
from castfem.model.thermal import Adaptive, Stepping, Thermal, Verification, negative_options
from castfem.model.water import Water
from castfem.physics.thermal.mould_flux import MOULD_FLUXES


@check("cooling")
def _zone_names(case: Case, zones: tuple[Zone, ...]) -> Faults:
    yield from twice([zone.name for zone in zones], "name")


@check()
def _zones(case: Case, _: object) -> Faults:
    zones, reached = case.cooling, 0.0
    shortest = 1e-6  # m: less is rounding of the same position
    for index, zone in enumerate(zones):
        key = f"cooling.{index}.to"
        if isinstance(zone, Unreadable) or isinstance(zone.to, Unreadable):
            continue
        if zone.to is None:
            if index < len(zones) - 1:
                yield f"cooling.{index}", "'to' is missing; only the last zone may leave it out"
            continue
        if zone.to <= reached:
            end = f"the end of the previous zone ({in_mm(reached)}); give zones in casting order"
            yield key, f"({in_mm(zone.to)}) does not lie beyond {end}"
        elif zone.to - reached < shortest:
            least = f"a zone is at least {1e6 * shortest:g} um long: leave it out"
            yield key, f"lies {1e9 * (zone.to - reached):.3g} nm below the previous zone; {least}"
        reached = max(reached, zone.to)
    last, length = len(zones) - 1, case.casting.length
    if case.secondary is not None:
        if zones[-1].to is None:
            fix = "it is where [secondary] begins, such as the end of the mould; "
            fix += "what [secondary] cools needs no zone"
            yield f"cooling.{last}", f"'to' is missing; {fix}"
    elif zones[-1].to is not None and reached < length:
        text = f"({in_mm(reached)}) ends before casting.length ({in_mm(length)}); "
        yield f"cooling.{last}.to", text + "add a zone, or leave out 'to' in the last"


@check("cooling.*")
def _without_end(case: Case, zone: Zone) -> Faults:
    """Report a total over a zone without end: the flux would depend on the followed length."""
    for j, law in enumerate(zone.surface if zone.to is None else ()):
        if law.asks_extent and getattr(law, "area", None) is None:
            spray = isinstance(law, Spray)
            yield (
                f"surface.{j}",
                f"the {'water' if spray else 'heat'} is that of the whole zone, which has no end; "
                'give the zone its end, to = "5 m"' + (", or the sprayed area" if spray else ""),
            )


@check("cooling.*")
def _factor(case: Case, zone: Zone) -> Faults:
    """Report a factor on a table over the surface temperature."""
    for j, law in enumerate(zone.surface):
        if not isinstance(law, ScaledLaw) or law.factor is None:
            continue
        given = (law.curve, getattr(law, "coefficient", None))
        if any(isinstance(it, Table) and it.over == "temperature" for it in given):
            yield f"surface.{j}.factor", "does not go with a table over temperature; leave it out"


@check("cooling.*.surface.*")
def _groups(case: Case, law: HeatLaw) -> Faults:
    for key, text in unknown_groups(law.on, case.section.outer_groups()):
        yield key, text + _of_more(case.section, law.on)


@check("cooling.*")
def _clash(case: Case, zone: Zone) -> Faults:
    """Report a prescribed temperature together with another law on the same boundary group."""
    for j, law in enumerate(zone.surface):
        for other in zone.surface[:j]:
            shared = law_groups(case.section, law) & law_groups(case.section, other)
            if shared and any(isinstance(it, PrescribedTemperature) for it in (law, other)):
                text = f"a given temperature on {choices(sorted(shared))} excludes other laws there"
                yield f"surface.{j}", text
                break


def _of_more(section: Any, on: tuple[str, ...] | None) -> str:
    """Name the largest symmetry whose section has these faces as separate groups."""
    here = getattr(section, "symmetry", "whole")
    for more in {"quarter": ("half", "whole"), "half": ("whole",)}.get(here, ()):
        known = section.model_copy(update={"symmetry": more}).outer_groups()
        if all(any(group.startswith(name) for group in known) for name in on or ()):
            alike = f"; the faces of a {here} are alike: section.symmetry"
            return f'{alike} = "{more}" has {choices(known)}'
    return ""


@check("cooling.*.surface.*")
def _contact(case: Case, law: HeatLaw) -> Faults:
    """Report what a contact law lacks, given the mould of the case."""
    if not isinstance(law, Contact):
        return
    yield from one_of(law, {"coefficient": '"1600 W/(m^2 K)"', "flux": '"2 MW/m^2"'})
    if law.gap != 0.0 and (law.gap is not None or case.mould is not None):
        if law.gap_conductivity is None:
            yield "", 'a gap needs its gap_conductivity, such as "0.15 W/(m K)"'
        elif law.gap is None and law.coefficient is not None:
            yield from _thin_gap(law.gap_conductivity, law.coefficient)


@check("cooling.*.surface.*")
def _wall(case: Case, law: HeatLaw) -> Faults:
    """Report a wall whose temperature is missing or given twice."""
    if not isinstance(law, Contact):
        return
    of_mould = None if case.mould is None else case.mould.wall_temperature
    if law.wall in (None, MOULD):
        if of_mould is None:
            fix = 'wall = "160 degC" here, or wall_temperature = "160 degC" in [mould]'
            takes = 'wall = "mould" takes mould.wall_temperature, which is not given'
            what = "the temperature of the mould's wall is missing" if law.wall is None else takes
            yield "", f"{what}; give {fix}"
    elif of_mould is not None and law.wall != of_mould:
        fix = 'leave one of the two out, or set this to "mould"'
        there = f"{_degrees(of_mould)} as mould.wall_temperature"
        yield "wall", f"{_degrees(law.wall)} here, {there}; {fix}"


def _thin_gap(conductivity: float, coefficient: float | Table) -> Faults:
    """Report a gap conductivity at which rounding in the gap determines the heat flux."""
    best = max(coefficient.values) if isinstance(coefficient, Table) else coefficient
    halving = conductivity / best if best > 0.0 else math.inf
    if halving < 1e-7:  # m: the roughness of surfaces is a hundred times larger
        text = f"({conductivity:g} W/(m K)): a gap of {1e9 * halving:.3g} nm would halve the heat"
        yield "gap_conductivity", f"{text}; gases and slags have 0.02 to 2 W/(m K)"


@check("cooling.*.surface.*")
def _scaled(case: Case, law: HeatLaw) -> Faults:
    """Report a measured total that cannot be used."""
    if not isinstance(law, ScaledLaw) or not (has := given(law, *TOTALS)):
        return
    if "power" in has and len(has) > 1:
        yield "power+water", "power and water exclude each other; give one of the two"
        return
    if len(has) == 1 and "power" not in has:
        other, sample = ("water", "1800 L/min") if "water" not in has else ("water_rise", "7 K")
        yield "", f'{has[0]} needs {other}, such as {other} = "{sample}"'
    value, key = getattr(law, law.curve_key), law.curve_key
    of_surface = isinstance(value, Table) and value.over == "temperature"
    if of_surface or getattr(law, "coefficient", None) is not None:
        what = "the table over temperature" if of_surface else "a coefficient"
        fix = f"cannot be scaled to a measured total; leave out {' and '.join(has)}, or give {key} "
        fix += "over position or time"
        yield "", f"the heat of {what} is known after the run alone and {fix}"


@check("cooling.*.surface.*")
def _measured_at(case: Case, law: HeatLaw) -> Faults:
    """Report a measured_at without effect, or beside totals that follow the speed."""
    if not isinstance(law, ScaledLaw) or law.measured_at is None:
        return
    totals, value = given(law, *TOTALS), getattr(law, law.curve_key)
    tables = [one for one in totals if isinstance(getattr(law, one), Table)]
    if tables:
        fix = "leave one of the two out"
        yield "measured_at", f"excludes {tables[0]} as a table over the casting speed; {fix}"
    if not totals and not (isinstance(value, Table) and value.over == "position"):
        needs = "a measured total (power, or water with water_rise)"
        yield "measured_at", f"needs {needs} or {law.curve_key} over position; leave it out"


@check("cooling.*")
def _range_of_formula(case: Case, zone: Zone) -> Faults:
    """Report a published flux outside its range, at the speed of the case or measured_at."""
    end = case.casting.length if zone.to is None else zone.to
    for j, law in enumerate(zone.surface):
        curve = law.curve if isinstance(law, ScaledLaw) else None
        if not isinstance(law, ScaledLaw) or not isinstance(curve, str):
            continue
        travel, until = case.casting.travel, MOULD_FLUXES[curve].until
        passes = [("", travel.time_at(end), travel.position(until))]
        if isinstance(law.measured_at, float):
            at = ", at the speed of measured_at"
            passes.append((at, end / law.measured_at, until * law.measured_at))
        for at, time, most in passes:
            if time > until * (1 + ROUNDING):
                long = [n for n, f in MOULD_FLUXES.items() if time <= f.until * (1 + ROUNDING)]
                takes = [*(f'{law.curve_key} = "{name}"' for name in long), "a table"]
                text = f'"{curve}" holds for {until:g} s from the meniscus, and the slice leaves'
                fix = f"{_shorter(case, most)}take {' or '.join(takes)}"
                yield (
                    f"surface.{j}.{law.curve_key}",
                    f"{text} this zone after {time:.4g} s{at}; {fix}",
                )
                break


def _shorter(case: Case, most: float) -> str:
    """Say where a zone must end so as not to exceed `most` (m); "" if the zones of its mould do."""
    if case.mould is None:
        whole = math.floor(1e3 * most * (1 + ROUNDING))
        return f'if the mould ends before, give the zone its end, to = "{whole} mm" at most; else '
    if case.mould.length > most * (1 + ROUNDING):
        return ""
    return f'end the zone with the mould, to = "{in_mm(case.mould.length)}", or '


def _degrees(wall: Any) -> str:
    return "a table" if isinstance(wall, Table) else format(wall, "K", "degC")


@check("mould")
def _mould_and_zones(case: Case, mould: Mould) -> Faults:
    """Report where the zones and the mould of the mechanics end at different positions."""
    zones, length = case.cooling, case.casting.length
    contact = [any(isinstance(w, Contact) and w.gap is None for w in z.surface) for z in zones]
    if not any(contact):
        return
    index = max(i for i, follows in enumerate(contact) if follows)
    zone, ends = zones[index], mould.length * (1 + ROUNDING)
    start = max((z.to for z in zones[:index] if z.to is not None), default=0.0)
    last = length if zone.to is None else min(zone.to, length)
    if start < length and last > ends:
        yield (
            f"/cooling.{index}" if zone.to is None else f"/cooling.{index}.to",
            f"{'goes on' if zone.to is None else f'({in_mm(zone.to)}) lies'} below the end of the "
            f"mould ({in_mm(mould.length)}), where there is no wall to take the heat; give "
            f'to = "{in_mm(mould.length)}" and add a zone, make mould.length longer, or give the '
            'contact law a gap of its own, gap = "0 mm"',
        )
    after = zones[index + 1] if index + 1 < len(zones) else None
    walled = (Contact, Flux, PrescribedTemperature)
    if after is None or not after.surface or any(isinstance(w, walled) for w in after.surface):
        return
    if last * (1 + ROUNDING) < min(mould.length, length):
        yield (
            "length",
            f"({in_mm(mould.length)}) goes on below the contact of zone '{zone.name}' "
            f"({in_mm(last)}), where zone '{after.name}' cools the strand as if it were in the "
            f'open; give mould.length = "{in_mm(last)}" or the zone to = "{in_mm(mould.length)}"',
        )


def law_groups(section: Section, law: HeatLaw) -> set[str]:
    """Return the boundary groups of a section on which a heat law holds."""
    on = law.on or section.cooled_groups()
    return {group for group in section.outer_groups() if any(group.startswith(n) for n in on)}


def unknown_groups(on: tuple[str, ...] | None, known: tuple[str, ...]) -> Faults:
    """Report names in `on` that match no boundary group."""
    for name in on or ():
        if not name or not any(group.startswith(name) for group in known):
            fix = f"allowed: {choices(known)} or how they begin{nearest(name, known)}"
            yield "on", f'no boundary group "{name}" on this section; {fix}'


@check("thermal")
def _solver(case: Any, thermal: Thermal) -> Faults:
    yield from negative_options(thermal.solver)


@check("thermal.time")
def _one_stepping(case: Any, time: Stepping) -> Faults:
    yield from one_of(time, {"step": '"50 ms"', "adaptive": "{}"})


@check("thermal.time.adaptive")
def _bounds(case: Any, bounds: Adaptive) -> Faults:
    if not bounds.smallest <= bounds.first <= bounds.largest:
        ends = f"smallest ({bounds.smallest:g} s) <= first ({bounds.first:g} s)"
        yield "", f"{ends} <= largest ({bounds.largest:g} s) does not hold"


@check("verification")
def _is_that_case(case: Case, table: Verification) -> Faults:
    """Report differences between the case and that of its closed form."""
    key, name = "closed_form", table.closed_form
    if not isinstance(case.section, Strip):
        yield key, f'("{name}") is for a half-space: give section.shape = "strip"'
    laws = [law for zone in case.cooling for law in zone.surface]
    if len(laws) != 1 or not isinstance(laws[0], PrescribedTemperature):
        fix = 'give one cooling zone with one law = "temperature"'
        yield key, f'("{name}") is for a surface held at one temperature: {fix}'
    if name != "weiner_boley":
        return
    if case.mechanics is None:
        yield key, f'("{name}") is for stress: give the table [mechanics]'
    elif case.mechanics.law != name:
        yield key, f'("{name}") needs its own law: give mechanics.law = "{name}"'
    elif case.mechanics.strain != "small":
        yield key, f'("{name}") is for small strains: give mechanics.strain = "small"'
    elif case.coupling.follow_shape:
        yield key, f'("{name}") is for the undeformed slice: give coupling.follow_shape = false'
    elif case.coupling.dissipation:
        yield key, f'("{name}") has no heat of flow: give coupling.dissipation = 0'


_SAMPLES = {
    "water": '"5 L/(m^2 s)"', "flow": '"240 L/min"', "specific": '"0.3 L/kg"', "share": "0.3",
}  # fmt: skip


@check("water")
def _total(case: Case, water: Water) -> Faults:
    yield from one_of(water, {"specific": '"0.8 L/kg"', "flow": '"1200 L/min"'})


@check()
def _amounts(case: Case, _: object) -> Faults:
    """Report water that is given twice or not at all."""
    for key, place in _places(case):
        ways = {way: text for way, text in _SAMPLES.items() if way in type(place).model_fields}
        for below, text in one_of(place, ways):
            yield f"{key}.{below}" if below else key, text
        if getattr(place, "area", None) is not None and given(place, "water"):
            yield f"{key}.area", "is the sprayed area of the water of a zone; water is per area"


@check()
def _shares(case: Case, _: object) -> Faults:
    shares = [(key, place.share) for key, place in _places(case) if place.share is not None]
    total = sum(share for _, share in shares)
    if case.water is None:
        for key, _ in shares:
            fix = 'add [water] with specific = "0.8 L/kg" or flow = "1200 L/min"'
            yield f"{key}.share", f"is a share of [water], which is missing; {fix}"
    elif not shares:
        yield "water", "no zone and no circuit takes a share of it; give share = 0.3"
    elif not math.isclose(total, 1.0, rel_tol=0.0, abs_tol=2e-3):  # shares have three digits
        yield "water", f"the shares of its zones and circuits make {total:.6g}, not 1"


def _places(case: Case) -> Iterator[tuple[str, Any]]:
    """Sprays of zones, and circuits."""
    for i, zone in enumerate(case.cooling):
        for j, law in enumerate(zone.surface):
            if law.tag == "spray":
                yield f"cooling.{i}.surface.{j}", law
    for i, circuit in enumerate(case.secondary.circuit if case.secondary is not None else ()):
        yield f"secondary.circuit.{i}", circuit
