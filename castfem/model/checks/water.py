"""Checks of [water] and of what takes a share of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from castfem.model.base import Faults
from castfem.model.checks.registry import check, given, one_of
from castfem.model.water import Water

if TYPE_CHECKING:
    from castfem.model.case import Case


_SAMPLES = {
    "water": '"5 L/(m^2 s)"', "flow": '"240 L/min"', "specific": '"0.3 L/kg"', "share": "0.3",
}  # fmt: skip


@check("water")
def _total(case: Case, water: Water) -> Faults:
    yield from one_of(water, {"specific": '"0.8 L/kg"', "flow": '"1200 L/min"'})


@check()
def _told(case: Case, _: object) -> Faults:
    """Report water that is given twice or not at all."""
    for key, place in _places(case):
        ways = {way: text for way, text in _SAMPLES.items() if way in type(place).model_fields}
        for below, text in one_of(place, ways):
            yield key + below, text
        if getattr(place, "area", None) is not None and given(place, "water"):
            yield f"{key}.area", "is the sprayed area of the water of a zone; water is per area"


@check()
def _shares(case: Case, _: object) -> Faults:
    shares = [(key, place.share) for key, place in _places(case) if place.share is not None]
    whole = sum(share for _, share in shares)
    if case.water is None:
        for key, _ in shares:
            fix = 'add [water] with specific = "0.8 L/kg" or flow = "1200 L/min"'
            yield f"{key}.share", f"is a share of [water], which is missing; {fix}"
    elif not shares:
        yield "water", "no zone and no circuit takes a share of it; give share = 0.3"
    elif not math.isclose(whole, 1.0, rel_tol=0.0, abs_tol=2e-3):  # shares have three digits
        yield "water", f"the shares of its zones and circuits make {whole:.6g}, not 1"


def _places(case: Case) -> Iterator[tuple[str, Any]]:
    """Sprays of zones, and circuits."""
    for i, zone in enumerate(case.cooling):
        for j, law in enumerate(zone.surface):
            if law.tag == "spray":
                yield f"cooling.{i}.surface.{j}", law
    for i, circuit in enumerate(case.secondary.circuit if case.secondary is not None else ()):
        yield f"secondary.circuit.{i}", circuit
