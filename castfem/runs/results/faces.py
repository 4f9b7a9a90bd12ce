"""The places of the surface that tables name, in their order, and which of them repeat another."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from castfem.base.shown_quantity import Quantity

_SAME = 1e-6  # relative; faces that are cooled alike differ by less
_TWINS = (
    ("_left", "_right"),
    ("_extrados", "_intrados"),
    ("_extrados", ""),  # of a straight strand the intrados has no addition
    ("_narrow_face", "_mid_face"),
)
"""Parts of names, and of the place before that may have the same number."""
_PLACES = tuple(
    f"{face}{side}{half}"
    for face in ("mid_face", "narrow_face", "corner")
    for side in ("", "_intrados", "_extrados")
    for half in ("", "_right", "_left")
)


def at_places(quantity: str) -> tuple[str, ...]:
    """Return the names of a quantity at all places that a section may have, mid-faces first."""
    return tuple(f"{quantity}_{place}" for place in _PLACES)


def repeats(name: str, runs: Iterable[Mapping[str, Quantity]]) -> bool:
    """Whether a quantity is in every run that of a place before: of a face that is cooled alike."""
    everything = list(runs)
    return any(all(_same(run, name, twin) for run in everything) for twin in _twins(name))


def _twins(name: str) -> Iterator[str]:
    for part, other in _TWINS:
        if part in name:
            yield name.replace(part, other)


def _same(run: Mapping[str, Quantity], name: str, twin: str) -> bool:
    this, other = run.get(name), run.get(twin)
    if this is None or other is None:
        return this is None
    return abs(this.value - other.value) <= _SAME * abs(other.value)
