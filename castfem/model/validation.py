"""Checks across the keys of a case.

They run on sound cases and on the sound part of faulty ones: there, a faulty value is None and
the checks that need it are skipped.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from castfem.base import result_registry
from castfem.base.tables import Table
from castfem.base.units import in_mm
from castfem.model import bounds, effort
from castfem.model.bending import check_bending
from castfem.model.build_mould import check_mould
from castfem.model.bulging import check_bulging
from castfem.model.case import Case
from castfem.model.casting import CONTACT_FIELDS, MECHANICAL_FIELDS, Casting, Start
from castfem.model.check_cooling import check_cooling, is_complete, unknown_groups
from castfem.model.check_output import check_output
from castfem.model.check_secondary import check_secondary
from castfem.model.check_water import check_water
from castfem.model.defects import check_defects
from castfem.model.extraction import check_extraction
from castfem.model.machine import check_machine
from castfem.model.mechanics import GeneralizedPlaneStrain
from castfem.model.optimise import check_optimise
from castfem.model.problems import Problem
from castfem.model.section import Section, Strip
from castfem.model.verification import check_verification

_FINEST = 1e-5  # of half the section: smallest cell
_SOFTEST = 1e-6  # of the solid: liquid that keeps its shape at large strain


def check(case: Case) -> Iterator[Problem]:
    """Yield everything that does not fit together."""
    impossible = list(bounds.impossible(case))
    yield from impossible
    yield from _casting(case)
    yield from _section(case)
    yield from _mesh(case)
    yield from check_cooling(case)
    yield from check_output(case)
    yield from _stepping(case)
    known = {problem.path for problem in impossible}
    yield from (problem for problem in effort.too_many(case) if problem.path not in known)
    yield from _mechanics(case)
    yield from check_mould(case.mould, case.section)
    yield from check_machine(case)
    yield from check_bulging(case)
    yield from check_defects(case)
    yield from check_bending(case)
    yield from check_secondary(case)
    yield from check_water(case)
    yield from check_extraction(case)
    yield from _output(case)
    yield from _references(case)
    yield from check_verification(case)
    yield from check_optimise(case)


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
    yield from _meniscus(case, start)
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
            f'("mould_exit"), {in_mm(ends)}, does not lie above casting.length '
            f"({in_mm(casting.length)})",
        )


def _meniscus(case: Case, start: Start) -> Iterator[Problem]:
    """Yield what a meniscus that has met the wall does not go with."""
    height, path = start.meniscus, ("casting", "start", "meniscus")
    if height is None:
        return
    if start.profile is not None or start.at == "mould_exit":
        other = "profile" if start.profile is not None else 'at = "mould_exit"'
        yield Problem(path, f"and {other} both say what the run begins with; leave one of them out")
        return
    first = case.cooling[0] if case.cooling else None
    if first is not None and first.to is not None and not height < first.to:
        yield Problem(
            path,
            f"({in_mm(height)}) is not within the first zone of the cooling, which ends at "
            f"{in_mm(first.to)}; a meniscus is about 10 mm high",
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
                ("mesh", key),
                f"({in_mm(value)}) is larger than {what} the section ({in_mm(most)})",
            )
        # Curved cells so flat lose their shape in rounding, and DOLFINx finds no point in them.
        if value is not None and large is not None and value < _FINEST * large:
            yield Problem(
                ("mesh", key),
                f"({in_mm(value)}) is too fine to be told apart in the section; at least "
                f"{in_mm(_FINEST * large)}",
            )
    for small, big in (("surface_size", "core_size"), ("corner_size", "face_size")):
        fine, coarse = getattr(mesh, small), getattr(mesh, big)
        if None not in (fine, coarse) and fine > coarse:
            yield Problem(
                ("mesh", small),
                f"({in_mm(fine)}) is larger than {big} ({in_mm(coarse)}); cells grow from the "
                "surface to the core and from the corner to the middle of a face",
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
        fault = result_registry.fault(reference.quantity, reference.value)
        if fault is not None:
            yield Problem(("reference", index, fault[0]), fault[1])


def _mechanics(case: Case) -> Iterator[Problem]:
    table = case.mechanics
    if case.mould is not None and table is None and "mechanics" not in case.model_fields_set:
        yield Problem(
            ("mould",), "needs the table [mechanics]: it is the strained slice that touches it"
        )
    if table is None or case.section is None or not is_complete(case.section):
        return
    known = case.section.outer_groups()
    for index, held in enumerate(table.held or ()):
        if held is not None and held.on is not None:
            yield from unknown_groups(held.on, known, ("mechanics", "held", index, "on"))
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
    if soft and table.liquid_has_modulus and table.strain == "large" and case.mould is not None:
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
