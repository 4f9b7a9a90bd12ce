"""Checks of [secondary] against the rolls and the section, and warnings about unusual values."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.errors import choices
from castfem.base.types import Array
from castfem.base.units import format, in_mm, nearest
from castfem.model.base import Faults, Unreadable
from castfem.model.checks.registry import caution, check, given, one_of, twice
from castfem.model.section import Rectangle
from castfem.model.water import Supply

if TYPE_CHECKING:
    from castfem.model.case import Case
    from castfem.model.secondary import Circuit, NozzleModel, RollContact, Secondary
    from castfem.physics.machine.rolls import Rolls


def _rolls(case: Case) -> Rolls | None:
    return None if case.machine is None else case.machine.pairs()


@check("secondary")
def _needs(case: Case, table: Secondary) -> Faults:
    if not isinstance(case.section, Rectangle):
        fix = f'a section of shape "{case.section.tag}" has none: give zones in [[cooling]]'
        yield "", f"needs wide and narrow faces; {fix}"
    elif case.machine is None:
        yield "", 'goes from roll to roll, and there are none; add [machine] rolls = "rolls.csv"'


@check("secondary")
def _falls_off(case: Case, table: Secondary) -> Faults:
    if table.falls_off is not None and table.run_off is None:
        yield "falls_off", "has no effect without run_off, the water that would fall; leave it out"


@check("secondary.contact")
def _contact(case: Case, contact: RollContact) -> Faults:
    yield from one_of(contact, {"share": "0.2", "coefficient": '"1000 W/(m^2 K)"'})
    has = given(contact, "share", "coefficient", "temperature")
    if has == ["coefficient"]:
        yield "", 'the temperature of the rolls is missing, such as "150 degC"'
    elif has == ["share", "temperature"]:
        fix = "leave it out"
        yield "temperature", f"has no effect beside share, which follows from the pitch; {fix}"


@check("secondary.nozzle.*")
def _model(case: Case, model: NozzleModel) -> Faults:
    yield from one_of(model, {"table": '{ file = "nozzle.csv" }', "correlation": '"nozaki"'})
    if model.table is not None and model.machine_factor != 1.0:
        yield "machine_factor", "is for a correlation; leave it out"


@check("secondary")
def _names(case: Case, table: Secondary) -> Faults:
    for array in ("nozzle", "circuit"):
        for key, text in twice([one.name for one in getattr(table, array)], "name"):
            yield f"{array}.{key}", text


@check("secondary.circuit.*")
def _known(case: Case, circuit: Circuit) -> Faults:
    models = () if case.secondary is None else case.secondary.nozzle
    names = [model.name for model in models if not isinstance(model.name, Unreadable)]
    if circuit.nozzle not in names:
        known = f"; there are {choices(names)}" if names else "; add [[secondary.nozzle]]"
        near = nearest(circuit.nozzle, names)
        yield "nozzle", f'("{circuit.nozzle}") is not a nozzle model{known}{near}'


@check("secondary")
def _contacts_apart(case: Case, table: Secondary) -> Faults:
    """Report a contact angle at which the strand would touch two rolls at once.

    Rolls that overlap, or are not in casting order, are reported elsewhere.
    """
    rolls = _rolls(case)
    if table.contact is None or rolls is None:
        return
    contacts, pairs = table.contacts(rolls), rolls.pairs
    for i in range(1, len(contacts)):
        both = 0.5 * (pairs[i].diameter + pairs[i - 1].diameter)
        apart = pairs[i].position - pairs[i - 1].position
        if both < apart and contacts[i][0] <= contacts[i - 1][1]:
            angle = format(table.contact.angle, "rad", "deg")
            text = f"({angle}) makes contact with rolls {i} and {i + 1} overlap"
            yield "contact.angle", f"{text}; some 10 degrees are usual"
            return


@check("secondary.circuit.*")
def _faces(case: Case, circuit: Circuit) -> Faults:
    """Report faces that do not exist, and nozzles that spray faces of two kinds."""
    if not isinstance(case.section, Rectangle):
        return
    known = tuple(g for g in case.section.outer_groups() if not g.startswith("corner"))
    for name in circuit.on:
        if not name or not any(group.startswith(name) for group in known):
            fix = f"allowed: {choices(known)} or how they begin{nearest(name, known)}"
            yield "on", f'no face "{name}" on this section; {fix}'
            return
    met = {g.partition("_")[0] for g in known if any(g.startswith(name) for name in circuit.on)}
    if len(met) > 1:
        yield "on", "wide and narrow faces in one circuit; give each a circuit of its own"


@check("secondary.circuit.*")
def _across(case: Case, circuit: Circuit) -> Faults:
    """Report nozzles outside their face or at the same place, and rows that are not symmetric."""
    section, ordered = case.section, sorted(circuit.across)
    if not isinstance(section, Rectangle):
        return
    half, far = _half(case, circuit), max(ordered, key=abs)
    same = 1e-6  # m: two nozzles at the same place
    if abs(far) > half:
        text = f"the nozzle at {in_mm(far)} stands outside of the face"
        yield "across", f"{text}, which ends {in_mm(half)} from its middle"
    for here, there in itertools.pairwise(ordered):
        if there - here < same:
            yield "across", f"two nozzles stand at {in_mm(there)}; give more flow instead"
            return
    mirrored = section.symmetry == "quarter" or (circuit.wide and section.symmetry == "half")
    if mirrored and any(abs(a + b) > same for a, b in zip(ordered, ordered[::-1], strict=True)):
        fix = 'give a nozzle on the other side, too, or symmetry = "whole"'
        at = f'the middle, as section.symmetry = "{section.symmetry}" takes them to be'
        yield "across", f"the nozzles are not mirrored at {at}; {fix}"


@check("secondary.circuit.*")
def _between(case: Case, circuit: Circuit) -> Faults:
    """Report rows between rolls that do not exist, and sprays too long for their gap."""
    from castfem.physics.machine.spray_layout import footprint, gap_below, longest_spray

    rolls, table = _rolls(case), case.secondary
    if rolls is None or table is None or not isinstance(case.section, Rectangle):
        return
    pairs, between = len(rolls.pairs), circuit.rolls
    if not 1 <= between[0] < between[1] <= pairs:
        fix = f"numbers from 1 to {pairs}, the first smaller"
        yield "rolls", f"({between[0]}, {between[1]}) are not the rolls above and below; {fix}"
        return
    model = next((m for m in table.nozzle if m.name == circuit.nozzle), None)
    if model is None:
        return
    length, contacts = footprint(circuit.stand_off, model.angle_along), table.contacts(rolls)
    for number in range(*between):
        gap = gap_below(rolls, number, case.section.height)
        if gap.clear <= 0.0:  # the rolls overlap: reported elsewhere
            continue
        where = f"between rolls {number} and {number + 1}"
        if circuit.wide and 2.0 * circuit.stand_off <= gap.diameter:
            yield (
                "stand_off",
                f"({in_mm(circuit.stand_off)}) puts the nozzles between the rolls, below their "
                f"axes ({in_mm(0.5 * gap.diameter)}), {where}: larger",
            )
            return
        most = rolls.pairs[number].position - rolls.pairs[number - 1].position
        if circuit.wide:
            room = 2.0 * min(gap.middle - contacts[number - 1][1], contacts[number][0] - gap.middle)
            most = min(longest_spray(gap.clear, circuit.stand_off, gap.diameter), room)
        if length > most > 0.0:  # overlapping arcs of contact are reported elsewhere
            yield (
                "stand_off",
                f"({in_mm(circuit.stand_off)}) and {format(model.angle_along, 'rad', 'deg')} along "
                f"the strand make a spray of {1e3 * length:.4g} mm, longer than the "
                f"{1e3 * most:.4g} mm that are free {where} (305); a narrower nozzle, or nearer",
            )
            return


@caution("secondary")
def _unused(case: Case, table: Secondary) -> Faults:
    used = {circuit.nozzle for circuit in table.circuit}
    for index, model in enumerate(table.nozzle):
        if model.name not in used:
            yield f"nozzle.{index}", "belongs to no circuit"


def _places(case: Case, circuit: Circuit) -> Array:
    """Positions across the face at which the water of a circuit is evaluated, m."""
    half = _half(case, circuit)
    return np.asarray(np.linspace(-half, half, 401))


def _half(case: Case, circuit: Circuit) -> float:
    width, height = case.section.outline()
    assert width is not None and height is not None, "the case has been checked"
    return 0.5 * (width if circuit.wide else height)


@caution("secondary.circuit.*")
def _lost(case: Case, circuit: Circuit) -> Faults:
    from castfem.physics.machine.spray_layout import footprint

    assert case.secondary is not None
    model, places = case.secondary.model_of(circuit), _places(case, circuit)
    width, half = footprint(circuit.stand_off, model.angle), places[-1]
    reached = float(np.trapezoid(_water(places, circuit, model), places)) / len(circuit.across)
    if reached < 0.98:
        size = f"sprays of {1e3 * width:.4g} mm on {2e3 * half:.4g} mm"
        yield "across", f"{100.0 * (1.0 - reached):.3g} % of the water misses the face: {size}"


def _water(places: Array, circuit: Circuit, model: NozzleModel) -> Array:
    from castfem.physics.machine.spray_layout import footprint
    from castfem.physics.thermal.spray_flux import water_across

    width = footprint(circuit.stand_off, model.angle)
    return water_across(places, circuit.across, width, model.edge)


@caution("secondary.circuit.*")
def _ranges(case: Case, circuit: Circuit) -> Faults:
    """Report water outside the range of the heat transfer coefficient of its nozzles."""
    from castfem.physics.machine.spray_layout import footprint
    from castfem.physics.thermal.spray_correlations import CORRELATIONS, WATER_DENSITY

    table = case.secondary
    assert table is not None
    model = table.model_of(circuit)
    supply, places = _about(case), _places(case, circuit)
    total = np.zeros(len(places))
    for other in table.circuit:  # other circuits on the same places
        gaps = set(range(*other.rolls)) & set(range(*circuit.rolls))
        shared = any(a.startswith(b) or b.startswith(a) for a in other.on for b in circuit.on)
        if not gaps or not shared:
            continue
        its = table.model_of(other)
        each = WATER_DENSITY * supply.most(other) / other.nozzles()
        total += each / footprint(other.stand_off, its.angle_along) * _water(places, other, its)
    most, known = float(total.max()), model.most_water()
    if math.isfinite(known) and most > known:
        yield (
            "flow",
            f"up to {most:.3g} L/(m^2 s) reach the surface, the coefficient of '{model.name}' is "
            f"known to {known:.3g}: beyond, it is "
            + ("that of its end" if model.correlation is None else "extrapolated"),
        )
    least = 0.0 if model.correlation is None else CORRELATIONS[model.correlation].water[0]
    if 0.0 < most < least:
        range_ = f"{model.correlation} was measured from {least:g} on: below, it falls to zero"
        yield "flow", f"at most {most:.3g} L/(m^2 s) reach the surface, {range_}"


def _about(case: Case) -> Supply:
    """Converts flows with a density that is approximate to the per cents by which steels differ."""
    density = 7300.0  # kg/m3, of steel at its solidus
    mass = density * case.section.width * case.section.height  # type: ignore[attr-defined]
    return Supply(mass, case.casting.travel, case.water, case.casting.clock)
