"""Checks across the keys of a case.

They run on sound cases and on the sound part of faulty ones: there, a faulty value is None and
the checks that need it are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

from castfem.case import effort, result_names
from castfem.case.bending import check_bending
from castfem.case.build_mould import check_mould
from castfem.case.bulging import check_bulging
from castfem.case.casting import CONTACT_FIELDS, MECHANICAL_FIELDS, Casting
from castfem.case.check_secondary import check_secondary
from castfem.case.cooling import MOULD, Contact, Flux, HeatLaw, PrescribedTemperature, Zone
from castfem.case.defects import check_defects
from castfem.case.extraction import check_extraction
from castfem.case.machine import check_machine
from castfem.case.mechanics import GeneralizedPlaneStrain
from castfem.case.model import Case
from castfem.case.problems import Problem
from castfem.case.section import Section, Strip
from castfem.case.verification import check_verification
from castfem.support.messages import choices
from castfem.values.same_place import ROUNDING
from castfem.values.tables import Table
from castfem.values.units import format, nearest

_FINEST = 1e-5  # of half the section: smallest cell
_SHORTEST = 1e-6  # m: of a zone; less is what rounding makes of one and the same place
_THINNEST = (
    1e-7  # m: a gap that halves the heat; the roughness of the surfaces is a hundred times that
)
_SOFTEST = 1e-6  # of the solid: liquid that keeps its shape at large strain


def check(case: Case) -> Iterator[Problem]:
    """Yield everything that does not fit together."""
    yield from _casting(case)
    yield from _section(case)
    yield from _mesh(case)
    yield from _zones(case)
    yield from _laws(case)
    yield from _stepping(case)
    yield from effort.too_many(case)
    yield from _mechanics(case)
    yield from check_mould(case.mould, case.section)
    yield from _mould_and_zones(case)
    yield from check_machine(case)
    yield from check_bulging(case)
    yield from check_defects(case)
    yield from check_bending(case)
    yield from check_secondary(case)
    yield from check_extraction(case)
    yield from _output(case)
    yield from _references(case)
    yield from check_verification(case)


def _mm(length: float) -> str:
    return format(length, "m", "mm")


def _casting(case: Case) -> Iterator[Problem]:
    casting = case.casting
    if casting is None:
        return
    given = casting.model_fields_set & {"superheat", "temperature"}
    if len(given) != 1:
        problem = "both are given" if given else "neither is given"
        yield Problem(
            ("casting",),
            f'{problem}; exactly one of superheat = "40 K" and temperature = "1540 degC"',
        )
    yield from _standing(casting)
    yield from _start(case, casting)


def _start(case: Case, casting: Casting) -> Iterator[Problem]:
    """Yield what a start below the mould, or from a profile, does not go with."""
    start, path = casting.start, ("casting", "start")
    if start is None:
        return
    if case.verification is not None:
        yield Problem(
            path, "a closed form begins at the meniscus, at one temperature; leave it out"
        )
    if start.at != "mould_exit" or case.cooling is None or None in case.cooling:
        return
    if case.mould is not None:
        yield Problem(
            (*path, "at"),
            '("mould_exit") begins below the mould, which [mould] takes the strained slice '
            "through; leave one of the two out",
        )
        return
    ends = case.mould_exit()
    if ends is None:
        yield Problem(
            (*path, "at"),
            '("mould_exit"): there is no mould; name a zone of [[cooling]] so, with its end',
        )
    elif casting.length is not None and not ends < casting.length:
        yield Problem(
            (*path, "at"),
            f'("mould_exit"), {_mm(ends)}, does not lie above casting.length '
            f"({_mm(casting.length)})",
        )


def _standing(casting: Casting) -> Iterator[Problem]:
    """Yield a strand that stands for good before it has come to the end."""
    table = casting.speed
    if not isinstance(table, Table) or casting.length is None or math.isfinite(casting.duration):
        return
    last = table.arguments[-1]
    yield Problem(
        ("casting", "speed"),
        f"the strand stands for good after {last:g} s, {casting.travel.position(last):.6g} m below "
        f"the meniscus: it never comes to casting.length ({casting.length:g} m); let the last row "
        "of the table be above 0 m/min, or shorten the length",
    )


def _section(case: Case) -> Iterator[Problem]:
    if case.section is not None:
        yield from case.section.problems()


def _mesh(case: Case) -> Iterator[Problem]:
    mesh, section = case.mesh, case.section
    if mesh is None or section is None:
        return
    thin, large = section.halves()
    for key in ("surface_size", "corner_size", "face_size", "core_size", "core_depth"):
        value, most = getattr(mesh, key), thin if key == "surface_size" else large
        if value is not None and most is not None and value > most:
            what = "half the thickness of" if key == "surface_size" else "half"
            yield Problem(
                ("mesh", key), f"({_mm(value)}) is larger than {what} the section ({_mm(most)})"
            )
        # Curved cells so flat lose their shape in rounding, and DOLFINx finds no point in them.
        if value is not None and large is not None and value < _FINEST * large:
            yield Problem(
                ("mesh", key),
                f"({_mm(value)}) is too fine to be told apart in the section; at least "
                f"{_mm(_FINEST * large)}",
            )
    for small, big in (("surface_size", "core_size"), ("corner_size", "face_size")):
        fine, coarse = getattr(mesh, small), getattr(mesh, big)
        if None not in (fine, coarse) and fine > coarse:
            yield Problem(
                ("mesh", small),
                f"({_mm(fine)}) is larger than {big} ({_mm(coarse)}); cells grow from the surface "
                "to the core and from the corner to the middle of a face",
            )
    straight = mesh.cell == "quadrilateral" and mesh.order == 1
    if case.mould is not None and straight and section.is_curved():
        yield Problem(
            ("mesh", "order"),
            "(1) makes a polygon of the round surface, which its mould is not; give order = 2",
        )
    if case.mould is not None and mesh.cell == "triangle" and mesh.order == 1:
        yield Problem(
            ("mesh", "order"),
            "(1) makes triangles too stiff for a freezing shell in its mould; give order = 2, "
            'or cell = "quadrilateral"',
        )
    if not section.has_corner and mesh.corner_size is not None:
        yield Problem(("mesh", "corner_size"), f'a section of shape "{section.tag}" has no corner')


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
                f"({_mm(zone.to)}) does not lie beyond the end of the zone before "
                f"({_mm(reached)}); zones follow one another in casting order",
            )
        elif zone.to - reached < _SHORTEST:
            yield Problem(
                ("cooling", index, "to"),
                f"({_mm(zone.to)}) lies {1e9 * (zone.to - reached):.3g} nm below the end of the "
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
            f"({_mm(reached)}) ends before casting.length ({_mm(length)}); "
            "add a zone, or leave out 'to' in the last",
        )


def _laws(case: Case) -> Iterator[Problem]:
    known = case.section.outer_groups() if _complete(case.section) else ()
    for i, zone in enumerate(case.cooling or ()):
        laws = (zone.surface if zone else None) or ()
        for j, law in enumerate(laws):
            path = ("cooling", i, "surface", j)
            if isinstance(law, Contact):
                yield from _contact(case, law, path)
            if known:
                yield from _names(law.on, known, (*path, "on"))
                yield from _clash(law, laws[:j], case.section.cooled_groups(), known, path)


def _contact(case: Case, law: Contact, path: tuple[str | int, ...]) -> Iterator[Problem]:
    """Yield what a contact law lacks, given the mould there is."""
    gapless = law.gap == 0.0 or (law.gap is None and case.mould is None)
    if not gapless and "gap_conductivity" not in law.model_fields_set:
        yield Problem(path, 'a gap needs its gap_conductivity, such as "0.15 W/(m K)"')
    mould, conductivity = case.mould, law.gap_conductivity
    if not gapless and None not in (conductivity, law.coefficient):
        assert conductivity is not None
        halving = conductivity / law.coefficient if law.coefficient > 0.0 else _THINNEST
        if law.gap is None and halving < _THINNEST:
            yield Problem(
                (*path, "gap_conductivity"),
                f"({conductivity:g} W/(m K)): a gap of {1e9 * halving:.3g} nm would halve the "
                "heat, and rounding decide on it; gases and slags have 0.02 to 2 W/(m K)",
            )
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
            f"{'goes on' if zone.to is None else f'({_mm(zone.to)}) lies'} below the end of the "
            f"mould ({_mm(mould.length)}), where there is no wall to take the heat; give "
            f'to = "{_mm(mould.length)}" and add a zone, make mould.length longer, or give the '
            'contact law a gap of its own, gap = "0 mm"',
        )
    after = zones[index + 1] if index + 1 < len(zones) else None
    walled = (Contact, Flux, PrescribedTemperature)
    if after is None or not after.surface or any(isinstance(w, walled) for w in after.surface):
        return
    if last * (1 + ROUNDING) < min(mould.length, length):
        yield Problem(
            ("mould", "length"),
            f"({_mm(mould.length)}) goes on below the contact of zone '{zone.name}' "
            f"({_mm(last)}), where zone '{after.name}' cools the strand as if it were in the open; "
            f'give mould.length = "{_mm(last)}" or the zone to = "{_mm(mould.length)}"',
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


def _complete(section: Any) -> bool:
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


def _names(
    on: tuple[str, ...] | None, known: tuple[str, ...], path: tuple[str | int, ...]
) -> Iterator[Problem]:
    for name in on or ():
        if not name or not any(group.startswith(name) for group in known):
            yield Problem(
                path,
                f'no boundary group "{name}" on this section; allowed: {choices(known)} '
                f"or how they begin{nearest(name, known)}",
            )


def _stepping(case: Case) -> Iterator[Problem]:
    time = case.thermal.time if case.thermal else None
    if time is None:
        return
    if {"step", "adaptive"} <= time.model_fields_set:
        yield Problem(
            ("thermal", "time"), "step and adaptive exclude each other; give one of the two"
        )
    bounds = time.adaptive
    if bounds is None or None in (bounds.smallest, bounds.first, bounds.largest):
        return
    if not bounds.smallest <= bounds.first <= bounds.largest:
        yield Problem(
            ("thermal", "time", "adaptive"),
            f"smallest ({bounds.smallest:g} s) <= first ({bounds.first:g} s) <= largest "
            f"({bounds.largest:g} s) does not hold",
        )


def _output(case: Case) -> Iterator[Problem]:
    fields = case.output.fields if case.output else None
    for index, name in enumerate(fields or ()):
        if name in (fields or ())[:index]:
            yield Problem(("output", "fields"), f"'{name}' stands there twice")
        if name in MECHANICAL_FIELDS and "mechanics" not in case.model_fields_set:
            yield Problem(
                ("output", "fields"), f"'{name}' needs the table [mechanics], which is missing"
            )
        if name in CONTACT_FIELDS and "mould" not in case.model_fields_set:
            yield Problem(
                ("output", "fields"), f"'{name}' needs the table [mould], which is missing"
            )


def _references(case: Case) -> Iterator[Problem]:
    """Yield references that no run could ever be compared with."""
    for index, reference in enumerate(case.reference or ()):
        if reference is None or None in (reference.quantity, reference.value):
            continue
        fault = result_names.fault(reference.quantity, reference.value)
        if fault is not None:
            yield Problem(("reference", index, fault[0]), fault[1])


def _mechanics(case: Case) -> Iterator[Problem]:
    table = case.mechanics
    if case.mould is not None and table is None and "mechanics" not in case.model_fields_set:
        yield Problem(
            ("mould",), "needs the table [mechanics]: it is the strained slice that touches it"
        )
    if table is None or case.section is None or not _complete(case.section):
        return
    known = case.section.outer_groups()
    for index, held in enumerate(table.held or ()):
        if held is not None and held.on is not None:
            yield from _names(held.on, known, ("mechanics", "held", index, "on"))
    if table.planes is not None:
        yield from _planes(table.planes, case.section)
        yield from _thinned(table.planes)
    if table.liquid == "fed" and table.ferrostatic in ("off", "none") and case.mould is not None:
        yield Problem(
            ("mechanics", "ferrostatic"),
            f'("{table.ferrostatic}"): in a mould liquid that is fed resists nothing, and without '
            "its pressure nothing holds a surface at the wall until it has frozen, nor says where "
            'it freezes; give ferrostatic = "full", or liquid = "elastic"',
        )
    soft = table.liquid_stiffness is not None and table.liquid_stiffness < _SOFTEST
    if soft and table.strain == "large" and case.mould is not None:
        yield Problem(
            ("mechanics", "liquid_stiffness"),
            f"({table.liquid_stiffness:g}): liquid this soft folds in a mould, and at large strain "
            f"the equations are those of the folded slice; at least {_SOFTEST:g}, or "
            'strain = "small"',
        )


def _thinned(planes: GeneralizedPlaneStrain) -> Iterator[Problem]:
    """Yield an imposed axial strain that leaves the slice no thickness."""
    given = planes.a0
    values = given.values if isinstance(given, Table) else (given,)
    least = min((v for v in values if isinstance(v, float)), default=0.0)
    if least <= -1.0:
        yield Problem(
            ("mechanics", "planes", "a0"),
            f"({least:g}) leaves the slice no thickness: it is the axial strain, above -1",
        )


def _planes(planes: GeneralizedPlaneStrain, section: Section) -> Iterator[Problem]:
    """Yield generalized strains, and moments, that the section does not have."""
    path = ("mechanics", "planes")
    if planes.across is not None and not isinstance(section, Strip):
        yield Problem(
            (*path, "across"), "is for a strip; other sections widen by their displacements"
        )
    for strain, moment, mirror, enough in (
        ("a1", "moment_x", "x = 0", '"whole"'),
        ("a2", "moment_y", "y = 0", '"half" or "whole"'),
    ):
        if strain not in section.barred():
            continue
        mend = f"leave it out, or give section.symmetry = {enough}"
        for name in (strain, moment):
            if getattr(planes, name) not in (None, 0.0):
                yield Problem((*path, name), f"the section is mirrored at {mirror}; {mend}")
