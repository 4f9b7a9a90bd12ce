"""error.json: the error of each number of a case, and its parts.

    {"format": "castfem error", "case": HASH, "title": ..., "sizes": {"mesh.surface_size": ...},
     "runs": [{"name": "mesh_x0.707", "axis": "mesh", "factor": 0.707, "seconds": 12.1,
               "message": ""}, ...],
     "quantities": {NAME: {"label": ..., "unit": "mm", "value": 4.86, "error": 0.03,
                           "scale": 4.86,
                           "from": {"mesh": {"error": 0.02, "order": 1.3,
                                             "values": {"0.707": 4.85, "1": 4.86, ...}}, ...}}},
     "places": {"0.8": {NAME: as in quantities, ...}, ...}}

`quantities` are those at the end of the run, `places` those at positions along the strand, m below
the meniscus.

The unit is that of the value; errors of temperatures are in K. The hash is of all input that the
numbers depend on, except the sizes; with the sizes (SI) a run with other sizes is recognised as one
of the same case.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.atomic_files import write_json
from castfem.base.errors import InputError
from castfem.base.shown_quantity import Quantity, to_si, unit_of_difference
from castfem.model import Case, read_case
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs.output.folder import ERROR_NAME
from castfem.runs.output.run_record import RunRecord
from castfem.runs.output.summary_file import SUMMARY_NAME, Summary
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.estimate import Estimate, estimate

if TYPE_CHECKING:
    from castfem.studies.accuracy.ladder import Level

Results = Mapping[str, Quantity]
_FORMAT = "castfem error"


@dataclass(frozen=True, slots=True)
class Ran:
    """A run of the ladder, made or not."""

    name: str  #: name of its folder
    axis: str  #: scaled size; "" for the case itself
    factor: float  #: scale factor
    seconds: float = 0.0  #: its duration
    message: str = ""  #: why it has no results; "" if it has


@dataclass(frozen=True, slots=True)
class Entry:
    """A number with its error."""

    label: str  #: label for tables
    unit: str  #: unit of the value; errors of temperatures are in K
    value: float  #: value in the case itself
    parts: Mapping[str, Estimate]  #: parts of the error, by axis
    scale: float = 0.0
    """Reference of percentages: the value, for a temperature its fall since the meniscus; 0 for
    none."""

    def error(self, factors: Mapping[str, float] | None = None) -> float:
        """Sum of its parts; NaN if one is unknown.

        Args:
            factors: Relative sizes of another run, by axis.
        """
        return math.fsum(
            part.scaled((factors or {}).get(axis, 1.0)) for axis, part in self.parts.items()
        )


@dataclass(frozen=True, slots=True)
class ErrorTable:
    """The errors of a case."""

    title: str  #: title of the case
    case: str  #: hash of all input that its numbers depend on, except the sizes
    sizes: Mapping[str, float]  #: sizes of the case
    runs: tuple[Ran, ...]  #: the runs made for it
    #: numbers with their errors, by name
    quantities: Mapping[str, Entry] = field(default_factory=dict)
    places: Mapping[float, Mapping[str, Entry]] = field(default_factory=dict)
    """The same at positions along the strand, by position, m."""

    def write(self, folder: Path) -> Path:
        """Write error.json."""
        path = folder / ERROR_NAME
        content = {
            "format": _FORMAT,
            "case": self.case,
            "title": self.title,
            "sizes": dict(self.sizes),
            "runs": [asdict(run) for run in self.runs],
            "quantities": {name: _entry_json(e) for name, e in self.quantities.items()},
            "places": {
                f"{at!r}": {name: _entry_json(e) for name, e in entries.items()}
                for at, entries in self.places.items()
            },
        }
        write_json(path, content)
        return path

    @classmethod
    def load(cls, path: Path) -> ErrorTable:
        """Read error.json."""
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT:
                raise ValueError("not written by castfem")
            return cls(
                content["title"],
                content["case"],
                content["sizes"],
                tuple(Ran(**run) for run in content["runs"]),
                {name: _entry(e) for name, e in content["quantities"].items()},
                {
                    float(at): {name: _entry(e) for name, e in entries.items()}
                    for at, entries in content.get("places", {}).items()
                },
            )
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: cannot be read ({error}); repeat castfem error") from None

    def errors_of(self, case: Case) -> dict[str, float] | None:
        """Return the error of each number of a case in its unit; None for another case.

        Args:
            case: The case of the table, possibly with scaled mesh, step or window.
        """
        factors = self._factors(case)
        return None if factors is None else _errors(self.quantities, factors)

    def errors_at(self, case: Case) -> dict[float, dict[str, float]]:
        """Return the errors along the strand in SI, by position, m; empty for another case."""
        factors = self._factors(case)
        if factors is None:
            return {}
        return {
            at: {
                name: to_si(error, unit_of_difference(entries[name].unit))
                for name, error in _errors(entries, factors).items()
            }
            for at, entries in self.places.items()
        }

    def _factors(self, case: Case) -> Mapping[str, float] | None:
        """Sizes of the case relative to those of the table; None for another case."""
        if sizes.key(case) != self.case:
            return None
        return sizes.factors_between(self.sizes, sizes.described(case))


def _errors(entries: Mapping[str, Entry], factors: Mapping[str, float]) -> dict[str, float]:
    found = {name: entry.error(factors) for name, entry in entries.items()}
    return {name: error for name, error in found.items() if math.isfinite(error)}


def gather(
    case: Case,
    levels: Sequence[Level],
    results: Mapping[str, Summary],
    runs: Sequence[Ran],
    places: Mapping[float, Mapping[str, Results]] | None = None,
) -> ErrorTable:
    """Return the errors of a case from the results of its runs.

    Numbers that are equal in all runs (the followed length, the liquidus) have no error, nor have
    those that are zero up to rounding.

    Args:
        case: The case.
        levels: All runs of its ladder.
        results: Results of the finished runs by name, including that of the case.
        runs: Outcome of each run.
        places: Results at positions along the strand, by position (m) and name of the run.
    """
    base = next(level for level in levels if not level.axis)
    liquidus = results[base.name].quantities.get("liquidus")
    poured = case.casting.temperature or math.nan
    superheat = case.casting.poured_superheat
    if superheat is not None and liquidus is not None:
        poured = liquidus.value + superheat
    ends = {name: summary.quantities for name, summary in results.items()}
    return ErrorTable(
        case.title, sizes.key(case), sizes.described(case), tuple(runs),
        _entries(case, levels, ends, poured),
        {at: _entries(case, levels, found, poured) for at, found in (places or {}).items()},
    )  # fmt: skip


def _entries(
    case: Case, levels: Sequence[Level], results: Mapping[str, Results], poured: float
) -> dict[str, Entry]:
    """Numbers of the case with their errors; `poured` in K, NaN if unknown."""
    base = next(level for level in levels if not level.axis)
    found: dict[str, Entry] = {}
    for name, quantity in results[base.name].items():
        if not math.isfinite(quantity.shown):
            continue
        parts: dict[str, Estimate] = {}
        for axis in sizes.axes_of(case):
            values = _series(case, axis, levels, results, name)
            parts[axis] = replace(estimate(values), values=values)
        largest = max((abs(v) for part in parts.values() for v in part.values.values()), default=0)
        # in the unit of the tables; smaller differences are rounding
        if largest > 1e-9 and any(part.error != 0.0 for part in parts.values()):
            unit, value = quantity.shown_unit, quantity.shown
            found[name] = Entry(quantity.label, unit, value, parts, _scale(quantity, poured))
    return found


def _series(
    case: Case,
    axis: str,
    levels: Sequence[Level],
    results: Mapping[str, Results],
    name: str,
) -> dict[float, float]:
    """A number by the scale factor of one of the sizes, in its unit.

    If the windows limit the thermal steps, shorter windows have shorter steps, too: the effect of
    the steps alone is known from the run with such steps, and is subtracted.
    """

    def of(axis: str) -> dict[float, float]:
        return {
            level.factor: results[level.name][name].shown
            for level in levels
            if level.axis in ("", axis) and level.name in results and name in results[level.name]
        }

    found = of(axis)
    if axis == sizes.MESH:
        return _by_cells(case, levels, found)
    if axis == sizes.COUPLING and sizes.steps_fill_windows(case):
        steps = of(sizes.STEP)
        for factor in [factor for factor in found if factor < 1.0]:
            if factor in steps:
                found[factor] -= steps[factor] - steps[1.0]
            else:
                del found[factor]
    return found


def _by_cells(
    case: Case, levels: Sequence[Level], values: Mapping[float, float]
) -> dict[float, float]:
    """Values by the mean size of the cells instead of the requested one.

    A length has a whole number of cells: doubling all sizes of a coarse mesh may change it little.
    Meshes with the same number of cells count once.
    """
    now = sizes.cell_count(case)
    cases = {1.0: case} | {one.factor: one.case for one in levels if one.axis == sizes.MESH}
    return {(now / sizes.cell_count(cases[f])) ** 0.5: value for f, value in values.items()}


def _scale(quantity: Quantity, poured: float) -> float:
    """Reference of percentages of a result, in its unit; `poured` in K, NaN if unknown."""
    if quantity.unit != "K":
        return abs(quantity.shown)
    fall = abs(poured - quantity.value)
    return fall if math.isfinite(fall) else 0.0


def attach(table: ErrorTable, folder: Path) -> bool:
    """Add the errors to the results of a finished run, in its summary.json.

    Returns:
        Whether it is a finished run of that case, with uniformly scaled sizes.
    """
    path = folder / SUMMARY_NAME
    if not path.is_file() or RunRecord.load(folder).status != "finished":
        return False
    case = read_case(folder / CASE_NAME).sound
    errors = table.errors_of(case) if isinstance(case, Case) else None
    if errors is None:
        return False
    content = json.loads(path.read_text(encoding="utf-8"))
    for name, quantity in content["quantities"].items():
        quantity.pop("error", None)
        if name in errors and quantity["value"] is not None:
            quantity["error"] = errors[name]
    assert isinstance(case, Case), "it has errors"
    content["errors_at"] = {f"{at!r}": one for at, one in table.errors_at(case).items()}
    write_json(path, content)
    return True


def _entry_json(entry: Entry) -> dict[str, Any]:
    parts = {
        axis: {
            "error": part.error,
            "order": part.order,
            "values": {f"{size:.6g}": value for size, value in part.values.items()},
        }
        for axis, part in entry.parts.items()
    }
    return {
        "label": entry.label,
        "unit": entry.unit,
        "value": entry.value,
        "error": entry.error(),
        "scale": entry.scale,
        "from": parts,
    }


def _entry(content: Mapping[str, Any]) -> Entry:
    parts = {
        axis: Estimate(
            _number(part["error"]),
            part["order"],
            {float(size): _number(value) for size, value in part["values"].items()},
        )
        for axis, part in content["from"].items()
    }
    value = _number(content["value"])
    return Entry(content["label"], content["unit"], value, parts, content["scale"])


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
