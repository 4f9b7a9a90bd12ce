"""error.json: the error of each number of a case, what makes it, and where it is put.

    {"format": "castfem error", "case": HASH, "title": ..., "sizes": {"mesh.surface_size": ...},
     "runs": [{"name": "mesh_x0.707", "axis": "mesh", "factor": 0.707, "seconds": 12.1,
               "message": ""}, ...],
     "quantities": {NAME: {"label": ..., "unit": "mm", "value": 4.86, "error": 0.03,
                           "scale": 4.86,
                           "from": {"mesh": {"error": 0.02, "order": 1.3,
                                             "values": {"0.707": 4.85, "1": 4.86, ...}}, ...}}},
     "places": {"0.8": {NAME: as in quantities, ...}, ...}}

`quantities` are those at the end of the run, `places` those on its way, m below the meniscus.

The unit is that of the value, an error of a temperature in K. The hash is of all that the numbers
hang on but the sizes; with them (SI) a run with other sizes is known as one of the same case.
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
from castfem.runs.output.summary import SUMMARY_NAME, Summary
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.estimate import Estimate, estimate

if TYPE_CHECKING:
    from castfem.studies.accuracy.ladder import Level

Results = Mapping[str, Quantity]
_FORMAT = "castfem error"


@dataclass(frozen=True, slots=True)
class Ran:
    """A run of the ladder that has been done, or not."""

    name: str  #: of its folder
    axis: str  #: which of the sizes is scaled; "" for the case itself
    factor: float  #: by how much
    seconds: float = 0.0  #: what it took
    message: str = ""  #: why there is nothing of it, empty if there is


@dataclass(frozen=True, slots=True)
class Entry:
    """A number with its error."""

    label: str  #: what it is, for tables
    unit: str  #: of the value; errors of temperatures are in K
    value: float  #: of the case as it is
    parts: Mapping[str, Estimate]  #: what the error is made of, by axis
    scale: float = 0.0
    """What a percentage of it is of: the value, of a temperature its fall since the meniscus; 0
    where there is nothing."""

    def error(self, factors: Mapping[str, float] | None = None) -> float:
        """The sum of its parts; NaN where one is not known.

        Args:
            factors: Of other sizes than those of the case, by axis.
        """
        return math.fsum(
            part.scaled((factors or {}).get(axis, 1.0)) for axis, part in self.parts.items()
        )


@dataclass(frozen=True, slots=True)
class ErrorTable:
    """The errors of a case."""

    title: str  #: of the case
    case: str  #: hash of what its numbers depend on but the sizes
    sizes: Mapping[str, float]  #: those of the case
    runs: tuple[Ran, ...]  #: what was run for it
    quantities: Mapping[str, Entry] = field(default_factory=dict)  #: name to number with its error
    places: Mapping[float, Mapping[str, Entry]] = field(default_factory=dict)
    """The same at places on the way, by position, m."""

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
        """Return the error of each number of a case in its unit; None if it is another case.

        Args:
            case: That of the table, also with its mesh, step or window scaled.
        """
        factors = self._factors(case)
        return None if factors is None else _errors(self.quantities, factors)

    def errors_at(self, case: Case) -> dict[float, dict[str, float]]:
        """Return the errors on the way in SI, by position, m; none if it is another case."""
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
        """The sizes of a case over those of the table; None if it is another case."""
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

    Numbers that all runs agree on (the length that was followed, the liquidus) have none, nor have
    those that are zero but for rounding.

    Args:
        case: The case as it is.
        levels: All runs of its ladder.
        results: Of those that have come to their end, by name; that of the case itself among them.
        runs: How each of them went.
        places: Their results at places on the way, by position (m) and name of the run.
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
    """The numbers of the case itself with their errors; `poured` in K, NaN where not known."""
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
        # in the unit of the tables; else rounding
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
    """A number by the factor of one of the sizes, in its unit.

    Where the windows cut the thermal steps shorter windows have shorter steps, too: what these
    alone do to the number is known by the run with such steps, and is taken out.
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
    """Values by the mean size of the cells, instead of what was asked for.

    A length takes a whole number of cells: on a coarse mesh all sizes doubled may leave much of it
    as it is. Meshes with the same number of cells count once.
    """
    now = sizes.cell_count(case)
    cases = {1.0: case} | {one.factor: one.case for one in levels if one.axis == sizes.MESH}
    return {(now / sizes.cell_count(cases[f])) ** 0.5: value for f, value in values.items()}


def _scale(quantity: Quantity, poured: float) -> float:
    """What a percentage of a result is of, in its unit; `poured` in K, NaN where not known."""
    if quantity.unit != "K":
        return abs(quantity.shown)
    fall = abs(poured - quantity.value)
    return fall if math.isfinite(fall) else 0.0


def attach(table: ErrorTable, folder: Path) -> bool:
    """Put the errors beside the results of a finished run, in its summary.json.

    Returns:
        Whether it is a run of that case, its sizes scaled alike, that has come to its end.
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
