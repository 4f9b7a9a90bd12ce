"""What [secondary] may ask for, given the rolls and the section; what is probably not meant."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.messages import choices
from castfem.base.units import format, in_mm, nearest
from castfem.model.machine import thickness_of
from castfem.model.problems import Path, Problem
from castfem.model.section import Rectangle
from castfem.model.water import Supply

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.secondary import Circuit, NozzleModel, Secondary
    from castfem.physics.machine.rolls import Rolls

_TABLE = ("secondary",)
_SAME = 1e-6  # m: two nozzles at one place
_MISSING = 0.02  # of the water of a row: what may miss its face without a word
_DENSITY = 7300.0  # kg/m3, of steel at its solidus
_POINTS = 401  # across a face, at which its water is looked at


def check_secondary(case: Case) -> Iterator[Problem]:
    """Yield what keeps [secondary] from being built; of a faulty case what can be told."""
    table = case.secondary
    if table is None:
        return
    yield from _beginning(case)
    yield from _contact(table)
    yield from _models(table)
    section = case.section
    if section is not None and not isinstance(section, Rectangle):
        yield Problem(
            _TABLE,
            f'needs wide and narrow faces; a section of shape "{section.tag}" has none: give zones '
            "in [[cooling]]",
        )
        return
    rolls = None if case.machine is None else case.machine.pairs()
    if rolls is None:
        if "machine" not in case.model_fields_set:
            yield Problem(
                _TABLE, 'goes from roll to roll, and there are none; add [machine] with rolls = '
                '"rolls.csv"'
            )  # fmt: skip
        return
    if section is None or None in (section.width, section.height, section.symmetry):
        return
    yield from _contacts_apart(table, rolls)
    names: list[str] = []
    for index, circuit in enumerate(table.circuit or ()):
        if circuit is None or circuit.name is None:
            continue
        path = (*_TABLE, "circuit", index)
        if circuit.name in names:
            yield Problem((*path, "name"), f'("{circuit.name}") is used twice')
        names.append(circuit.name)
        yield from _faces(circuit, section, path)
        yield from _across(circuit, section, path)
        yield from _between(table, circuit, rolls, section.height, path)


def _beginning(case: Case) -> Iterator[Problem]:
    """Yield zones of [[cooling]] that leave no place for what is below them."""
    zones = case.cooling
    if not zones or zones[-1] is None:
        return
    if "to" not in zones[-1].model_fields_set:
        yield Problem(
            ("cooling", len(zones) - 1),
            "'to' is missing; it is where [secondary] begins, such as the end of the mould",
        )


def _contact(table: Secondary) -> Iterator[Problem]:
    contact = table.contact
    if table.falls_off is not None and "run_off" not in table.model_fields_set:
        yield Problem(
            (*_TABLE, "falls_off"), "has no effect without run_off, the coefficient of the water "
            "that would fall; leave it out"
        )  # fmt: skip
    if contact is None:
        return
    path, given = (*_TABLE, "contact"), contact.model_fields_set
    if len(given & {"share", "coefficient"}) != 1:
        both = "both are given" if "share" in given else "neither is given"
        yield Problem(
            path, f'{both}; exactly one of share = 0.2 and coefficient = "1000 W/(m^2 K)"'
        )
    elif "coefficient" in given and "temperature" not in given:
        yield Problem(path, 'the temperature of the rolls is missing, such as "150 degC"')
    elif "share" in given and "temperature" in given:
        yield Problem(
            (*path, "temperature"), "has no effect beside share, which follows from the pitch; "
            "leave it out"
        )  # fmt: skip


def _models(table: Secondary) -> Iterator[Problem]:
    """Yield models of nozzles that are not told, told twice or not known."""
    names = [model.name for model in table.nozzle or () if model is not None and model.name]
    for index, model in enumerate(table.nozzle or ()):
        if model is None:
            continue
        path, given = (*_TABLE, "nozzle", index), model.model_fields_set
        if model.name in names[:index]:
            yield Problem((*path, "name"), f'("{model.name}") is used twice')
        if len(given & {"table", "correlation"}) != 1:
            both = "both are given" if "table" in given else "neither is given"
            yield Problem(
                path, f'{both}; exactly one of table = {{ file = "nozzle.csv" }} and correlation'
            )
        elif "table" in given and model.machine_factor != 1.0:
            yield Problem((*path, "machine_factor"), "is for a correlation; leave it out")
    for index, circuit in enumerate(table.circuit or ()):
        if circuit is not None and circuit.nozzle is not None and circuit.nozzle not in names:
            known = f"; there are {choices(names)}" if names else "; add [[secondary.nozzle]]"
            yield Problem(
                (*_TABLE, "circuit", index, "nozzle"),
                f'("{circuit.nozzle}") is no model of nozzle{known}'
                f"{nearest(circuit.nozzle, names)}",
            )


def _contacts_apart(table: Secondary, rolls: Rolls) -> Iterator[Problem]:
    """Yield an angle of contact at which the strand would touch two rolls at once.

    Rolls that overlap, or are not in casting order, have been told by themselves.
    """
    if table.contact is None or table.contact.angle is None:
        return
    contacts, pairs = table.contacts(rolls), rolls.pairs
    for i in range(1, len(contacts)):
        both = 0.5 * (pairs[i].diameter + pairs[i - 1].diameter)
        if (
            both < pairs[i].position - pairs[i - 1].position
            and contacts[i][0] <= contacts[i - 1][1]
        ):
            yield Problem(
                (*_TABLE, "contact", "angle"),
                f"({format(table.contact.angle, 'rad', 'deg')}) makes contact with rolls {i} and "
                f"{i + 1} overlap; some 10 degrees are usual",
            )
            return


def _faces(circuit: Circuit, section: Rectangle, path: Path) -> Iterator[Problem]:
    """Yield faces that there are not, and nozzles that stand before two kinds of them."""
    if circuit.on is None:
        return
    known = tuple(g for g in section.outer_groups() if not g.startswith("corner"))
    for name in circuit.on:
        if not name or not any(group.startswith(name) for group in known):
            yield Problem(
                (*path, "on"),
                f'no face "{name}" on this section; allowed: {choices(known)} or how they begin'
                f"{nearest(name, known)}",
            )
            return
    met = {g.partition("_")[0] for g in known if any(g.startswith(name) for name in circuit.on)}
    if len(met) > 1:
        yield Problem(
            (*path, "on"), "wide and narrow faces in one circuit; give each a circuit of its own"
        )


def _across(circuit: Circuit, section: Rectangle, path: Path) -> Iterator[Problem]:
    """Yield nozzles outside of their face, two at one place, and rows that are not mirrored."""
    places = circuit.across
    if not places or circuit.on is None or None in places:
        return
    half = 0.5 * (section.width if circuit.wide else section.height)
    ordered = sorted(places)
    if max(abs(place) for place in places) > half:
        far = max(places, key=abs)
        yield Problem(
            (*path, "across"),
            f"the nozzle at {in_mm(far)} stands outside of the face, which ends {in_mm(half)} "
            "from its middle",
        )
    for here, there in itertools.pairwise(ordered):
        if there - here < _SAME:
            yield Problem(
                (*path, "across"), f"two nozzles stand at {in_mm(there)}; give more flow instead"
            )
            return
    mirrored = section.symmetry == "quarter" or (circuit.wide and section.symmetry == "half")
    if mirrored and any(abs(a + b) > _SAME for a, b in zip(ordered, ordered[::-1], strict=True)):
        yield Problem(
            (*path, "across"),
            "the nozzles are not mirrored at the middle, as section.symmetry = "
            f'"{section.symmetry}" takes them to be; give a nozzle on the other side, too, or '
            'symmetry = "whole"',
        )


def _between(
    table: Secondary, circuit: Circuit, rolls: Rolls, thickness: float, path: Path
) -> Iterator[Problem]:
    """Yield rows between rolls that are not there, and sprays that are too long for their gap."""
    from castfem.physics.machine.sprays import footprint, gap_below, longest_spray

    pairs, given = len(rolls.pairs), circuit.rolls
    if given is None:
        return
    if not 1 <= given[0] < given[1] <= pairs:
        yield Problem(
            (*path, "rolls"),
            f"({given[0]}, {given[1]}) are not the rolls above and below rows of nozzles; numbers "
            f"from 1 to {pairs}, the first smaller",
        )
        return
    model = next(
        (m for m in table.nozzle or () if m is not None and m.name == circuit.nozzle), None
    )
    if model is None or None in (model.angle_along, circuit.stand_off, circuit.on):
        return
    length = footprint(circuit.stand_off, model.angle_along)
    contacts = table.contacts(rolls) if table.contact is None or table.contact.angle else None
    for number in range(*given):
        gap = gap_below(rolls, number, thickness)
        if gap.clear <= 0.0:  # the rolls overlap: told with them
            continue
        where = f"between rolls {number} and {number + 1}"
        if circuit.wide and 2.0 * circuit.stand_off <= gap.diameter:
            yield Problem(
                (*path, "stand_off"),
                f"({in_mm(circuit.stand_off)}) puts the nozzles between the rolls, below their "
                f"axes ({in_mm(0.5 * gap.diameter)}), {where}: larger",
            )
            return
        most = longest_spray(gap.clear, circuit.stand_off, gap.diameter) if circuit.wide else (
            rolls.pairs[number].position - rolls.pairs[number - 1].position
        )  # fmt: skip
        if contacts is not None and circuit.wide:
            room = 2.0 * min(gap.middle - contacts[number - 1][1], contacts[number][0] - gap.middle)
            most = min(most, room)
        if length > most > 0.0:  # arcs of contact that overlap are told by themselves
            yield Problem(
                (*path, "stand_off"),
                f"({in_mm(circuit.stand_off)}) and {format(model.angle_along, 'rad', 'deg')} along "
                f"the strand make a spray of {1e3 * length:.4g} mm, longer than the "
                f"{1e3 * most:.4g} mm that are free {where} (305); a narrower nozzle, or nearer",
            )
            return


def secondary_warnings(case: Case) -> Iterator[Problem]:
    """Yield water that misses its face, and more or less of it than its nozzles are known for."""
    table = case.secondary
    rolls = None if case.machine is None else case.machine.pairs()
    thickness = thickness_of(case.section)
    if table is None or rolls is None or thickness is None:
        return
    used = {circuit.nozzle for circuit in table.circuit}
    for index, model in enumerate(table.nozzle):
        if model.name not in used:
            yield Problem((*_TABLE, "nozzle", index), "belongs to no circuit")
    for index, circuit in enumerate(table.circuit):
        path, model = (*_TABLE, "circuit", index), table.model_of(circuit)
        yield from _lost(case, circuit, model, path)
        yield from _ranges(case, circuit, model, path)


def _half(case: Case, circuit: Circuit) -> float:
    """Half the size of the face that a circuit sprays, m."""
    width, height = case.section.outline()
    assert width is not None and height is not None, "the case has been checked"
    return 0.5 * (width if circuit.wide else height)


def _lost(case: Case, circuit: Circuit, model: NozzleModel, path: Path) -> Iterator[Problem]:
    from castfem.physics.machine.sprays import footprint

    width = footprint(circuit.stand_off, model.angle)
    half = _half(case, circuit)
    places = np.linspace(-half, half, _POINTS)
    reached = float(np.trapezoid(_water(places, circuit, model), places)) / len(circuit.across)
    if reached < 1.0 - _MISSING:
        yield Problem(
            (*path, "across"),
            f"{100.0 * (1.0 - reached):.3g} % of the water misses the face: sprays of "
            f"{1e3 * width:.4g} mm on {2e3 * half:.4g} mm",
        )


def _water(places: np.ndarray, circuit: Circuit, model: NozzleModel) -> np.ndarray:
    from castfem.physics.machine.sprays import footprint
    from castfem.physics.thermal.spray_water import water_across

    width = footprint(circuit.stand_off, model.angle)
    return water_across(places, circuit.across, width, model.edge)


def _ranges(case: Case, circuit: Circuit, model: NozzleModel, path: Path) -> Iterator[Problem]:
    """Yield water outside of what the coefficient of its nozzles is known for."""
    from castfem.physics.machine.sprays import footprint
    from castfem.physics.thermal.sprays import WATER_DENSITY

    table, rolls = case.secondary, case.machine.pairs() if case.machine is not None else None
    assert table is not None and rolls is not None
    half, supply = _half(case, circuit), _about(case)
    places, total = np.linspace(-half, half, _POINTS), np.zeros(_POINTS)
    for other in table.circuit:  # what falls on the same places besides
        gaps = set(range(*other.rolls)) & set(range(*circuit.rolls))
        shared = any(a.startswith(b) or b.startswith(a) for a in other.on for b in circuit.on)
        if not gaps or not shared:
            continue
        its = table.model_of(other)
        each = WATER_DENSITY * supply.most(other) / other.nozzles()
        total += each / footprint(other.stand_off, its.angle_along) * _water(places, other, its)
    most, known = float(total.max()), model.most_water()
    if math.isfinite(known) and most > known:
        yield Problem(
            (*path, "flow"),
            f"up to {most:.3g} L/(m^2 s) reach the surface, the coefficient of '{model.name}' is "
            f"known to {known:.3g}: beyond, it is "
            + ("that of its end" if model.correlation is None else "extrapolated"),
        )
    least = 0.0 if model.correlation is None else _least(model)
    if 0.0 < most < least:
        yield Problem(
            (*path, "flow"),
            f"at most {most:.3g} L/(m^2 s) reach the surface, {model.correlation} was measured "
            f"from {least:g} on: below, it falls to zero with the water",
        )


def _about(case: Case) -> Supply:
    """What tells flows, but for the per cents by which steels differ in density."""
    mass = _DENSITY * case.section.width * case.section.height  # type: ignore[attr-defined]
    return Supply(mass, case.casting.travel, case.water, case.casting.clock)


def _least(model: NozzleModel) -> float:
    from castfem.physics.thermal.sprays import CORRELATIONS

    assert model.correlation is not None
    return CORRELATIONS[model.correlation].water[0]
