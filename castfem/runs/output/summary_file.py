"""summary.json: the results of a run as numbers, with reference numbers.

    {"title": ..., "status": "finished" | "failed" | "interrupted",
     "quantities": {NAME: {"value": 4.75, "unit": "mm", "label": "shell, mid-face"}, ...},
     "references": [{"quantity": NAME, "value": 4.75, "unit": "mm", "kind": "value",
                     "source": ..., "note": ..., "at": null, "changed": [], "ours": 4.9,
                     "difference": 0.15, "relative": 0.032, "met": null, "missing": ""}, ...],
     "balances": {NAME: {NAME: {"value", "unit", "label"}, ...}, ...},
     "steps": {"accepted": 412, ...}, "wall_time": {STAGE: seconds, ...},
     "zones": [{"name": "mould", "start": 0.0, "end": 0.6, "whole": true}, ...],
     "mould_exit": 0.6, "unchecked": ["density: SOURCE", ...],
     "warnings": ["the heat balance does not close: ...", ...],
     "errors_at": {"0.6": {NAME: 0.08e-3, ...}, ...}}

A quantity whose error `castfem error` has computed has an `error` in the same unit (K for
temperatures); `errors_at` has the errors at positions along the strand (m below the meniscus), in
SI. In the file each value is in the unit beside it. In Python `value` and `unit` are SI, `shown`
and `shown_unit` as in the file. Zones, `at` (null: the end of the run) and `mould_exit` (null: no
mould) are in metres below the meniscus. A missing value is null in the file, NaN in Python. The
difference of two temperatures is in K and has no relative value, since the zero of the scale is a
convention. `met` is whether a bound holds; it is null for a value. If keys of the case were
`changed` after a reference was written, it belongs to the unchanged case, and no difference is
given. Summaries without `kind` were written when all references were values; their `note` is now
called `missing`.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from castfem.base import result_registry, units
from castfem.base.constants import ROUNDING
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity, from_si, si_shown, to_si, unit_of_difference

if TYPE_CHECKING:
    from castfem.model.casting import Reference as GivenReference

SUMMARY_NAME = "summary.json"


Kind = Literal["value", "at_least", "at_most"]
SIGNS: Mapping[Kind, str] = {"value": "", "at_least": "≥ ", "at_most": "≤ "}


RENAMED = {
    "intervals": "coupling windows",
    "intervals cut back": "coupling windows cut back",
    "passes through intervals": "coupling iterations",
    "intervals not settled": "coupling windows not converged",
    "march": "time loop",
}
"""Counts and stages: names in older result folders, and present names."""

CUT = "coupling windows cut for their error"
"""One of the counts of steps."""


def renamed(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Replace old names of counts or stages by the present ones."""
    return {RENAMED.get(name, name): value for name, value in entries.items()}


@dataclass(frozen=True, slots=True)
class Reference:
    """A reference number."""

    quantity: str  #: name of the computed quantity
    value: float  #: in SI
    shown_unit: str  #: unit in which it is shown, "-" for none
    source: str  #: source of the number
    #: position at which it holds, below the meniscus [m]; None at the end of the run
    at: float | None = None
    kind: Kind = "value"  #: whether it is a value or a bound
    note: str = ""  #: remark for the reader
    #: keys of the case changed since then: the number belongs to the unchanged case
    changed: tuple[str, ...] = ()

    @classmethod
    def of(cls, given: GivenReference, at: float | None = None) -> Reference:
        """Make the reference of a case, at a position."""
        return cls(
            given.quantity, given.si, given.unit or "-", given.source, at, given.kind, given.note,
            given.changed or (),
        )  # fmt: skip

    @property
    def unit(self) -> str:
        """SI unit of `value`; "-" for none."""
        return si_shown(self.shown_unit)


@dataclass(frozen=True, slots=True)
class Comparison:
    """A reference and the computed value."""

    reference: Reference  #: the reference number
    ours: float = math.nan  #: computed value in SI; NaN if there is none
    missing: str = ""  #: why there is nothing to compare

    @property
    def difference(self) -> float:
        """Computed minus reference value, in SI; NaN for a reference of the unchanged case."""
        return math.nan if self.reference.changed else self.ours - self.reference.value

    @property
    def shown_difference(self) -> float:
        """The difference in the unit of `unit_of_difference`."""
        return from_si(self.difference, unit_of_difference(self.reference.shown_unit))

    @property
    def relative(self) -> float:
        """The difference relative to the reference; NaN for temperatures and for a zero."""
        theirs = self.reference.value
        if self.reference.unit == "K" or theirs == 0:
            return math.nan
        return self.difference / abs(theirs)

    @property
    def met(self) -> bool | None:
        """Whether a bound holds; None for a value, a changed case, or without computed value."""
        if self.reference.changed:
            return None
        return met(self.ours, self.reference.value, self.reference.kind)


@dataclass(frozen=True, slots=True)
class Zone:
    """A cooling zone between two positions below the meniscus [m]."""

    name: str  #: name of the zone
    start: float  #: start of the zone
    end: float  #: its end, or the end of the run within it
    whole: bool = True  #: whether the zone itself ends there


@dataclass(frozen=True, slots=True)
class Summary:
    """The content of summary.json, in SI."""

    title: str  #: title of the case
    status: str  #: "finished", "failed" or "interrupted"
    #: results by name, including `solidus` and `liquidus` of the steel
    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    references: tuple[Comparison, ...] = ()  #: comparisons from `compare`
    #: terms of each balance, by the name of the conserved quantity
    balances: Mapping[str, Mapping[str, Quantity]] = field(default_factory=dict)
    steps: Mapping[str, float] = field(default_factory=dict)  #: numbers and sizes [s] of the steps
    wall_time: Mapping[str, float] = field(default_factory=dict)  #: seconds by stage
    zones: tuple[Zone, ...] = ()  #: the cooling zones, in casting order
    #: end of the mould below the meniscus [m], even if the run ends above it; None without a mould
    mould_exit: float | None = None
    #: data of steel, law and cooling used in the run that are quoted from memory (status M), each
    #: with its source
    unchecked: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()  #: warnings about a finished run, one line each
    #: errors at positions along the strand, in SI (K for temperatures), by position [m] and name
    errors_at: Mapping[float, Mapping[str, float]] = field(default_factory=dict)

    @property
    def ends_below_mould(self) -> bool:
        """Whether the run has passed the end of a mould."""
        end = self.quantities.get("position")
        if end is None or self.mould_exit is None:
            return False
        return end.value > self.mould_exit * (1 + ROUNDING)

    def errors_near(self, position: float) -> Mapping[str, float]:
        """Errors at a position (m), by name; empty where they were not computed."""
        for place, errors in self.errors_at.items():
            if math.isclose(place, position, rel_tol=1e-6):
                return errors
        end = self.quantities.get("position")
        if end is None or not math.isclose(end.value, position, rel_tol=1e-6):
            return {}
        known = {name: quantity.error for name, quantity in self.quantities.items()}
        return {name: error for name, error in known.items() if error is not None}

    def to_json(self) -> dict[str, Any]:
        """The content of the file, for `castfem.base.atomic_files.write_json`."""
        return {
            "title": self.title,
            "status": self.status,
            "quantities": {name: _quantity_json(q) for name, q in self.quantities.items()},
            "references": [_comparison_json(comparison) for comparison in self.references],
            "balances": {
                name: {term: _quantity_json(q) for term, q in terms.items()}
                for name, terms in self.balances.items()
            },
            "steps": dict(self.steps),
            "wall_time": dict(self.wall_time),
            "zones": [asdict(zone) for zone in self.zones],
            "mould_exit": self.mould_exit,
            "unchecked": list(self.unchecked),
            "warnings": list(self.warnings),
            "errors_at": {f"{at!r}": dict(errors) for at, errors in self.errors_at.items()},
        }

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Summary:
        """Inverse of `to_json`.

        Raises:
            KeyError, TypeError, ValueError: The content is not that of a summary.
        """
        return cls(
            title=content["title"],
            status=content["status"],
            quantities={name: _quantity(q) for name, q in content["quantities"].items()},
            references=tuple(_comparison(entry) for entry in content["references"]),
            balances={
                name: {term: _quantity(q) for term, q in terms.items()}
                for name, terms in content["balances"].items()
            },
            steps=renamed(content["steps"]),
            wall_time=renamed(content["wall_time"]),
            zones=tuple(Zone(**zone) for zone in content["zones"]),
            mould_exit=content.get("mould_exit"),
            unchecked=tuple(content.get("unchecked", ())),
            warnings=tuple(content.get("warnings", ())),
            errors_at={float(at): dict(e) for at, e in content.get("errors_at", {}).items()},
        )

    @classmethod
    def load(cls, folder: Path | str) -> Summary | None:
        """Read summary.json; None if the folder has none yet."""
        path = Path(folder) / SUMMARY_NAME
        if not path.is_file():
            return None
        try:
            return cls.from_json(json.loads(path.read_text(encoding="utf-8")))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: cannot be read ({error!r}); repeat the run") from error


def compare(
    references: Iterable[Reference], quantities: Mapping[str, Quantity]
) -> tuple[Comparison, ...]:
    """Look up the computed value of each reference.

    A reference to a quantity that the run does not have, or one of another dimension, gives a
    comparison that says what is missing: a finished run is not discarded for it.
    """
    found = []
    for reference in references:
        quantity = quantities.get(reference.quantity)
        if quantity is None:
            note = "not a result of this run"
            if result_registry.find(reference.quantity) is None:
                note = "no such quantity" + units.nearest(reference.quantity, quantities)
            found.append(Comparison(reference, missing=note))
        elif quantity.unit != reference.unit:
            note = f"{reference.shown_unit} is not a unit of it; it is in {quantity.shown_unit}"
            found.append(Comparison(reference, missing=note))
        else:
            found.append(Comparison(reference, quantity.value))
    return tuple(found)


def met(ours: float, theirs: float, kind: Kind) -> bool | None:
    """Whether a value satisfies a bound, both in SI; None for a value or if one is unknown."""
    if kind == "value" or not (math.isfinite(ours) and math.isfinite(theirs)):
        return None
    excess = ours - theirs if kind == "at_most" else theirs - ours
    return excess <= ROUNDING * abs(theirs)


def _quantity_json(quantity: Quantity) -> dict[str, Any]:
    found = {"value": quantity.shown, "unit": quantity.shown_unit, "label": quantity.label}
    known = {"error": quantity.shown_error, "resolution": quantity.shown_resolution}
    return found | {name: part for name, part in known.items() if part is not None}


def _quantity(content: Mapping[str, Any]) -> Quantity:
    unit = content["unit"]
    known = (content.get("error"), content.get("resolution"))
    parts = (None if one is None else to_si(one, unit_of_difference(unit)) for one in known)
    return Quantity(to_si(content["value"], unit), unit, content["label"], *parts)


def _comparison_json(comparison: Comparison) -> dict[str, Any]:
    reference = comparison.reference
    return {
        "quantity": reference.quantity,
        "value": from_si(reference.value, reference.shown_unit),
        "unit": reference.shown_unit,
        "kind": reference.kind,
        "source": reference.source,
        "note": reference.note,
        "at": reference.at,
        "changed": list(reference.changed),
        "ours": from_si(comparison.ours, reference.shown_unit),
        "difference": comparison.shown_difference,
        "relative": comparison.relative,
        "met": comparison.met,
        "missing": comparison.missing,
    }


def _comparison(content: Mapping[str, Any]) -> Comparison:
    unit = content["unit"]
    value = to_si(content["value"], unit)
    kind, note, missing = content.get("kind", "value"), content["note"], content.get("missing")
    if missing is None:
        note, missing = "", note
    if kind not in SIGNS:
        raise ValueError(f"unknown kind of reference: {kind}")
    changed = tuple(content.get("changed", ()))
    reference = Reference(
        content["quantity"], value, unit, content["source"], content.get("at"), kind, note, changed
    )
    return Comparison(reference, to_si(content["ours"], unit), missing)
