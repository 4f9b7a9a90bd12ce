"""Checks of the spray water: told in one way each, and shares that make up the whole."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from castfem.model.problems import Path, Problem
from castfem.model.spray import Spray

if TYPE_CHECKING:
    from castfem.model.case import Case

WAYS = ("water", "flow", "specific", "share")
_SAMPLES = {
    "water": '"5 L/(m^2 s)"', "flow": '"240 L/min"', "specific": '"0.3 L/kg"', "share": "0.3",
}  # fmt: skip
_ROUNDED = 2e-3  # shares of three digits


def check_water(case: Case) -> Iterator[Problem]:
    """Yield water that is told twice or not at all, and shares that do not make up the whole."""
    yield from _total(case)
    places = list(_places(case))
    for path, place in places:
        yield from _told(path, place)
    shares = [
        (path, place.share)
        for path, place in places
        if "share" in place.model_fields_set and place.share is not None
    ]
    if "water" not in case.model_fields_set:
        for path, _ in shares:
            yield Problem(
                (*path, "share"), 'is a share of [water], which is missing; add [water] with '
                'specific = "0.8 L/kg" or flow = "1200 L/min"'
            )  # fmt: skip
        return
    whole = sum(share for _, share in shares)
    if not shares:
        yield Problem(("water",), "no zone and no circuit takes a share of it; give share = 0.3")
    elif not math.isclose(whole, 1.0, rel_tol=0.0, abs_tol=_ROUNDED):
        yield Problem(("water",), f"the shares of its zones and circuits make {whole:.6g}, not 1")


def _total(case: Case) -> Iterator[Problem]:
    if case.water is None:
        return
    given = case.water.model_fields_set & {"specific", "flow"}
    if len(given) != 1:
        how = "both are given" if given else "neither is given"
        yield Problem(
            ("water",), f'{how}; exactly one of specific = "0.8 L/kg" and flow = "1200 L/min"'
        )


def _places(case: Case) -> Iterator[tuple[Path, Any]]:
    """Sprays of zones, and circuits."""
    for i, zone in enumerate(case.cooling or ()):
        for j, law in enumerate((zone.surface if zone else None) or ()):
            if isinstance(law, Spray):
                yield ("cooling", i, "surface", j), law
    circuits = None if case.secondary is None else case.secondary.circuit
    for i, circuit in enumerate(circuits or ()):
        if circuit is not None:
            yield ("secondary", "circuit", i), circuit


def _told(path: Path, place: Any) -> Iterator[Problem]:
    ways = [way for way in WAYS if way in type(place).model_fields]
    given = [way for way in ways if way in place.model_fields_set]
    if not given:
        samples = ", ".join(f"{way} = {_SAMPLES[way]}" for way in ways)
        words = f"{', '.join(ways[:-1])} or {ways[-1]}"
        yield Problem(path, f"{words} is missing; one of {samples}")
    if len(given) > 1:
        yield Problem(path, f"{' and '.join(given)} exclude each other; give one of them")
    if "area" in place.model_fields_set and "water" in given:
        yield Problem(
            (*path, "area"), "is the sprayed area of the water of a zone; water is per area"
        )
