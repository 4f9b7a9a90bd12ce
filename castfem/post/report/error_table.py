"""Which numbers of a table of errors are shown."""

from __future__ import annotations

from collections.abc import Mapping

from castfem.base.shown_quantity import Quantity, to_si
from castfem.runs.results.headline import headline
from castfem.studies.accuracy.table import Entry


def main_names(entries: Mapping[str, Entry]) -> list[str]:
    """Return the headline numbers that have an error."""
    return headline([{n: quantity_of(e) for n, e in entries.items()}])


def quantity_of(entry: Entry) -> Quantity:
    """Return a number as results have it, without its error."""
    return Quantity(to_si(entry.value, entry.unit), entry.unit, entry.label)
