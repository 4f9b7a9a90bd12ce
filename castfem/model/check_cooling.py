"""Checks of the cooling: its zones, the laws on the surface, the wall of the mould."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from castfem.base.messages import choices
from castfem.base.tables import Table
from castfem.base.tolerances import ROUNDING
from castfem.base.units import format, in_mm, nearest
from castfem.model.case import Case
from castfem.model.cooling import PrescribedTemperature, Zone
from castfem.model.heat_law import HeatLaw
from castfem.model.measured_heat import ScaledLaw
from castfem.model.mould_laws import MOULD, Contact, Flux
from castfem.model.problems import Problem
from castfem.model.section import Section
from castfem.model.spray import Spray
from castfem.physics.thermal.mould_flux import MOULD_FLUXES

_SHORTEST = 1e-6  # m: of a zone; less is what rounding makes of one and the same place
_THINNEST = 1e-7  # m: a gap that halves the heat; surfaces are a hundred times as rough


def check_cooling(case: Case) -> Iterator[Problem]:
    """Yield what of the cooling does not fit together, or to mould and section."""
    yield from _zones(case)
    yield from _laws(case)
    yield from _mould_and_zones(case)


def _zones(case: Case) -> Iterator[Problem]:
    zones = case.cooling
    if zones is None:
        return
    names: list[str] = []
    reached = 0.0
    for index, zone in enumerate(zones):
        if zone is None:
            continue
        if zone.name in names:
            yield Problem(("cooling", index, "name"), f'("{zone.name}") is used twice')
        names.append(zone.name)
        if zone.to is None:
            if "to" not in zone.model_fields_set and index < len(zones) - 1:
                yield Problem(
                    ("cooling", index), "'to' is missing; only the last zone may leave it out"
                )
            continue
        if zone.to <= reached:
            yield Problem(
                ("cooling", index, "to"),
                f"({in_mm(zone.to)}) does not lie beyond the end of the zone before "
                f"({in_mm(reached)}); zones follow one another in casting order",
            )
        elif zone.to - reached < _SHORTEST:
            yield Problem(
                ("cooling", index, "to"),
                f"({in_mm(zone.to)}) lies {1e9 * (zone.to - reached):.3g} nm below the end of the "
                f"zone before; a zone is at least {1e6 * _SHORTEST:g} um long: leave it out",
            )
        reached = max(reached, zone.to)
    last = zones[-1]
    length = case.casting.length if case.casting else None
    open_end = last is None or "to" not in last.model_fields_set or last.to is None
    if case.secondary is not None or "secondary" in case.model_fields_set:
        return  # it holds below them
    if not open_end and length is not None and reached < length:
        yield Problem(
            ("cooling", len(zones) - 1, "to"),
            f"({in_mm(reached)}) ends before casting.length ({in_mm(length)}); "
            "add a zone, or leave out 'to' in the last",
        )


def _laws(case: Case) -> Iterator[Problem]:
    known = case.section.outer_groups() if is_complete(case.section) else ()
    for i, zone in enumerate(case.cooling or ()):
        laws = (zone.surface if zone else None) or ()
        for j, law in enumerate(laws):
            path = ("cooling", i, "surface", j)
            if isinstance(law, Contact):
                yield from _contact(case, law, path)
            if isinstance(law, ScaledLaw):
                key = "flux" if isinstance(law, Contact) else "value"
                yield from _scaled(law, key, path)
                yield from _measured_at(law, key, path)
                yield from _range_of_formula(case, zone, law, (*path, key))
            if zone is not None and law.asks_extent:
                yield from _without_end(zone, law, path)
            if known:
                for problem in unknown_groups(law.on, known, (*path, "on")):
                    yield replace(problem, text=problem.text + _of_more(case.section, law.on))
                yield from _clash(law, laws[:j], case.section.cooled_groups(), known, path)


def _without_end(zone: Zone, law: HeatLaw, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield a total over a zone without end: what a place gets would hang on the run's length."""
    if "to" in zone.model_fields_set or getattr(law, "area", None) is not None:
        return
    what = "water" if isinstance(law, Spray) else "heat"
    yield Problem(
        path,
        f'the {what} is that of the whole zone, which has no end; give the zone its end, to = "5 m"'
        + (", or the sprayed area" if what == "water" else ""),
    )


def _of_more(section: Any, on: tuple[str, ...] | None) -> str:
    """Say on how much of the section faces are told apart which symmetry makes one: the least."""
    here = getattr(section, "symmetry", "whole")
    for more in {"quarter": ("half", "whole"), "half": ("whole",)}.get(here, ()):
        known = section.model_copy(update={"symmetry": more}).outer_groups()
        if all(any(group.startswith(name) for group in known) for name in on or ()):
            alike = f"; the faces of a {here} are alike: section.symmetry"
            return f'{alike} = "{more}" has {choices(known)}'
    return ""


def _contact(case: Case, law: Contact, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield what a contact law lacks, given the mould there is."""
    yield from _one_of(
        law, ("coefficient", "flux"), path, 'the heat without a gap, coefficient = "1600 '
        'W/(m^2 K)" or a measured flux = "2 MW/m^2"'
    )  # fmt: skip
    gapless = law.gap == 0.0 or (law.gap is None and case.mould is None)
    if not gapless and "gap_conductivity" not in law.model_fields_set:
        yield Problem(path, 'a gap needs its gap_conductivity, such as "0.15 W/(m K)"')
    if not gapless:
        yield from _thin_gap(law, path)
    mould = case.mould
    of_mould = None if mould is None else mould.wall_temperature
    own = "wall" in law.model_fields_set and law.wall != MOULD
    if own and None not in (law.wall, of_mould) and law.wall != of_mould:
        here, there = _degrees(law.wall), _degrees(of_mould)
        yield Problem(
            (*path, "wall"), f"{here} here, {there} as mould.wall_temperature; leave one of the "
            'two out, or set this to "mould"'
        )  # fmt: skip
    if not own and (mould is None or "wall_temperature" not in mould.model_fields_set):
        yield Problem(
            path, 'wall is missing; the temperature of the wall, such as "160 degC", here or as '
            "mould.wall_temperature"
        )  # fmt: skip


def _one_of(
    law: HeatLaw, keys: tuple[str, str], path: tuple[str | int, ...], samples: str
) -> Iterator[Problem]:
    """Yield that none of two keys is given, or both."""
    one, other = keys
    if not law.model_fields_set & {*keys}:
        yield Problem(path, f"{one} or {other} is missing; {samples}")
    if law.model_fields_set >= {*keys}:
        yield Problem(path, f"{one} and {other} exclude each other; give one of the two")


def _thin_gap(law: Contact, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield a gap so thin that rounding decides on the heat."""
    conductivity, coefficient = law.gap_conductivity, law.coefficient
    if conductivity is None or law.gap is not None or coefficient is None:
        return
    best = max(coefficient.values) if isinstance(coefficient, Table) else coefficient
    halving = conductivity / best if best > 0.0 else _THINNEST
    if halving < _THINNEST:
        yield Problem(
            (*path, "gap_conductivity"),
            f"({conductivity:g} W/(m K)): a gap of {1e9 * halving:.3g} nm would halve the "
            "heat, and rounding decide on it; gases and slags have 0.02 to 2 W/(m K)",
        )


def _scaled(law: ScaledLaw, key: str, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield a measured total that cannot be used."""
    has = law.model_fields_set
    if "power" in has and has & {"water", "water_rise"}:
        yield Problem(path, "power and water exclude each other; give one of the two")
        return
    for one, other, sample in (
        ("water", "water_rise", "7 K"),
        ("water_rise", "water", "1800 L/min"),
    ):
        if one in has and other not in has:
            yield Problem(path, f'{one} needs {other}, such as {other} = "{sample}"')
    if not has & {"power", "water", "water_rise"}:
        return
    value = getattr(law, key)
    of_surface = isinstance(value, Table) and value.over == "temperature"
    if of_surface or "coefficient" in has:
        what = "the table over temperature" if of_surface else "a coefficient"
        yield Problem(
            path,
            f"the heat of {what} is known after the run alone and cannot be scaled to a measured "
            f"total; give {key} over position or time",
        )


def _measured_at(law: ScaledLaw, key: str, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield a speed of measurement that changes nothing, or beside totals that follow the speed."""
    if "measured_at" not in law.model_fields_set:
        return
    totals = [one for one in ("power", "water", "water_rise") if one in law.model_fields_set]
    tables = [one for one in totals if isinstance(getattr(law, one), Table)]
    if tables:
        yield Problem(
            (*path, "measured_at"),
            f"excludes {tables[0]} as a table over the casting speed; leave one of the two out",
        )
    given = getattr(law, key)
    if not totals and not (isinstance(given, Table) and given.over == "position"):
        yield Problem(
            (*path, "measured_at"),
            f"needs a measured total (power, or water with water_rise) or {key} over position; "
            "leave it out here",
        )


def _range_of_formula(
    case: Case, zone: Zone | None, law: ScaledLaw, path: tuple[str | int, ...]
) -> Iterator[Problem]:
    """Yield a published flux that is used beyond its range, at the speed of the case or of it."""
    given = law.curve
    if not isinstance(given, str) or zone is None or case.casting is None:
        return
    casting, until = case.casting, MOULD_FLUXES[given].until
    if None in (casting.speed, casting.length):
        return
    end = casting.length if zone.to is None else zone.to
    ends = {"": casting.travel.time_at(end)}
    if isinstance(law.measured_at, float):
        ends[", at the speed of measured_at,"] = end / law.measured_at
    for at, time in ends.items():
        if time > until * (1 + ROUNDING):
            long = [n for n, flux in MOULD_FLUXES.items() if time <= flux.until * (1 + ROUNDING)]
            longer = f" take {' or '.join(long)}, which is valid so long," if long else ""
            yield Problem(
                path,
                f'("{given}") goes to {until:g} s, the zone{at} to {time:.4g} s after the '
                f"meniscus;{longer} end the zone with the mould, or give a table",
            )
            return


def _degrees(wall: Any) -> str:
    return "a table" if isinstance(wall, Table) else format(wall, "K", "degC")


def _follows(zone: Zone | None) -> bool:
    """Return whether heat crosses the gap that opens in the mould, in a zone of a case with one."""
    laws = (zone.surface if zone else None) or ()
    return any(isinstance(law, Contact) and "gap" not in law.model_fields_set for law in laws)


def _mould_and_zones(case: Case) -> Iterator[Problem]:
    """Yield where the heat still has, or has no longer, the wall that the mechanics has."""
    zones, mould = case.cooling, case.mould
    length = None if case.casting is None else case.casting.length
    if zones is None or mould is None or mould.length is None or length is None:
        return
    index = max((i for i, zone in enumerate(zones) if _follows(zone)), default=None)
    if index is None:
        return
    zone, ends = zones[index], mould.length * (1 + ROUNDING)
    if zone.to is None and "to" in zone.model_fields_set:
        return
    start = max((z.to for z in zones[:index] if z is not None and z.to is not None), default=0.0)
    last = length if zone.to is None else min(zone.to, length)
    if start < length and last > ends:
        yield Problem(
            ("cooling", index) if zone.to is None else ("cooling", index, "to"),
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
        yield Problem(
            ("mould", "length"),
            f"({in_mm(mould.length)}) goes on below the contact of zone '{zone.name}' "
            f"({in_mm(last)}), where zone '{after.name}' cools the strand as if it were in the "
            f'open; give mould.length = "{in_mm(last)}" or the zone to = "{in_mm(mould.length)}"',
        )


def _clash(
    law: Any,
    before: tuple[Any, ...],
    default: tuple[str, ...],
    known: tuple[str, ...],
    path: tuple[str | int, ...],
) -> Iterator[Problem]:
    """Yield a problem if a given temperature meets another law on the same boundary group."""
    own = set(_matching(law.on or default, known))
    for other in before:
        shared = own & set(_matching(other.on or default, known))
        if shared and any(isinstance(it, PrescribedTemperature) for it in (law, other)):
            yield Problem(
                path, f"a given temperature on {choices(sorted(shared))} excludes other laws there"
            )
            return


def is_complete(section: Any) -> bool:
    """Return whether all that decides on the section's boundary groups is sound."""
    return section is not None and None not in (
        getattr(section, "symmetry", "whole"),
        getattr(section, "corner_radius", 0.0),
    )


def law_groups(section: Section, law: HeatLaw) -> set[str]:
    """Return the boundary groups of a sound section on which a heat law holds."""
    return set(_matching(law.on or section.cooled_groups(), section.outer_groups()))


def _matching(on: tuple[str, ...], known: tuple[str, ...]) -> list[str]:
    return [group for group in known if any(group.startswith(name) for name in on)]


def unknown_groups(
    on: tuple[str, ...] | None, known: tuple[str, ...], path: tuple[str | int, ...]
) -> Iterator[Problem]:
    """Yield names that stand for no boundary group."""
    for name in on or ():
        if not name or not any(group.startswith(name) for group in known):
            yield Problem(
                path,
                f'no boundary group "{name}" on this section; allowed: {choices(known)} '
                f"or how they begin{nearest(name, known)}",
            )
