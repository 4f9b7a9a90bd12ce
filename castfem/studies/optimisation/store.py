"""Runs in a folder, as kept by `castfem sweep`, found by their case.

The results of a run depend on physics, followed length, solvers and on when fields are written
(which ends coupling windows). Cases that agree in these are the same run, whatever their titles and
other output, and it is made once, by any command.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.atomic_files import UNWRITTEN
from castfem.base.errors import CastfemError, InputError, differences
from castfem.base.shown_quantity import Quantity
from castfem.model.key_names import full_key
from castfem.model.load import portable
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs.output.folder import PROPERTIES_NAME, RunRecord
from castfem.runs.output.summary_file import CUT, Summary
from castfem.studies.sensitivity.result import Slopes, read_slopes
from castfem.studies.sweep.plan import Variant, run_name
from castfem.studies.sweep.record import (
    TABLE_NAME,
    Entry,
    Record,
    Row,
    check_own,
    rows,
    write_table,
)
from castfem.studies.sweep.work import Derivatives, Job, Outcome

if TYPE_CHECKING:
    from castfem.model import Case

_NO_RESULT = ("title", "reference", "verification", "optimise")  # tables without effect on results
_RESULT = ("every", "smooth")  # keys of [output] that affect the results
_NO_KEYS = ("fidelity", "mould")  # varied, but not keys of the case

Strand = dict[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The results of a run, or its failure."""

    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    """Results by name, as in summary.json; empty for a failed run."""
    share: float = 1.0  #: fraction of the followed length that it reached, 1 if it has finished
    message: str = ""  #: why it failed, one line
    seconds: float = 0.0  #: its duration; 0 if unknown
    folder: Path | None = None  #: folder of the run; None if it was made elsewhere
    #: its derivatives, empty if it can have none; None if not requested
    slopes: Slopes | None = None
    cut: int = 0  #: number of coupling windows that were shortened for their error

    @classmethod
    def of(
        cls, summary: Summary, seconds: float, folder: Path | None, slopes: Slopes | None = None
    ) -> Evaluation:
        """The results of a finished run; see the attributes."""
        cut = int(summary.steps.get(CUT, 0.0))
        return cls(summary.quantities, 1.0, "", seconds, folder, slopes, cut)

    @classmethod
    def of_failed(
        cls, folder: Path, record: RunRecord, length: float, message: str = "", seconds: float = 0.0
    ) -> Evaluation:
        """The state of a failed run; `length` is that of the case, m."""
        share = min(record.reached.get("position", 0.0) / length, 1.0)
        return cls({}, share, message or record.reason or record.status, seconds, folder)

    @property
    def failed(self) -> bool:
        """Whether it failed."""
        return bool(self.message)

    def has(self, derivatives: Derivatives | None) -> bool:
        """Whether it has some derivatives, or is known to have none."""
        if derivatives is None or self.failed or self.slopes == {}:
            return True
        slopes = self.slopes or {}
        return all(set(derivatives.to) <= set(slopes.get(name, ())) for name in derivatives.of)

    def __getitem__(self, name: str) -> float:
        """A result in SI.

        Raises:
            InputError: The run has no such result, or has failed.
        """
        if name not in self.quantities:
            if self.failed:
                raise InputError(f'"{name}": the run has failed: {self.message}; see `failed`')
            near = units.nearest(str(name), self.quantities)
            raise InputError(f'"{name}" is not a result of this run{near}')
        return self.quantities[name].value


def key_of(text: str, files: Mapping[str, bytes]) -> str:
    """Return the hash of all input of the results, from case.toml and the property files in it."""
    tables: dict[str, Any] = tomllib.loads(text)
    for name in _NO_RESULT:
        tables.pop(name, None)
    output = tables.get("output", {})
    tables["output"] = {key: output[key] for key in _RESULT if key in output}
    tables["output"].setdefault("every", None)
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    content = json.dumps([tables, hashes], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


class Store:
    """The runs in a folder.

    Attributes:
        record: Record of the folder, as kept by sweeps.
    """

    def __init__(self, folder: Path) -> None:
        check_own(folder, (TABLE_NAME,))
        self.record = Record(folder)
        self._known: dict[str, Evaluation] = {}
        self._variants: dict[str, Variant] = {}
        self._rows: dict[str, tuple[Entry, Row]] = {}  # rows of the table, with their runs
        self._strands: dict[str, Strand] = {}
        for name in self.record.entries:
            self._read_earlier(name)

    @property
    def folder(self) -> Path:
        """Folder that contains the folders of the runs."""
        return self.record.folder

    def check_is_of(self, case: Case) -> None:
        """Refuse a folder in which all runs have another section or steel than a case.

        Keys that earlier calls have varied are ignored.
        """
        text, _ = portable(case, PROPERTIES_NAME)
        own = _strand(tomllib.loads(text))
        for name, strand in self._strands.items():
            tables = {key: strand[key] for key in strand if not self._varied(name, key, case)}
            if tables == {key: own[key] for key in tables}:
                return
        if self._strands:
            what = differences(next(iter(self._strands.values())), own)
            raise InputError(
                f"{self.folder}: holds runs of another case ({what}); choose another folder"
            )

    def _varied(self, name: str, table: str, case: Case) -> bool:
        """Whether a key of a table was varied in a run."""
        for key in self.record.entries[name].given:
            if key in _NO_KEYS:
                continue
            try:
                full = full_key(type(case), case.document(), key)
            except ValueError:
                full = table  # a key of any table
            if full.partition(".")[0] == table:
                return True
        return False

    def find(self, case: Case, derivatives: Derivatives | None = None) -> Evaluation | None:
        """Return the results of the run of a case, if it has ended and has the derivatives."""
        found = self._known.get(_key(case))
        return found if found is not None and found.has(derivatives) else None

    def job(
        self, case: Case, given: Mapping[str, str], derivatives: Derivatives | None = None
    ) -> Job:
        """Return the run of a case, to be made or resumed; `given` has the varied keys."""
        name = f"{run_name(given)}_{_key(case)[:10]}".lstrip("_")
        self._variants[name] = Variant(name, given, case)
        return Job(name, self.folder / name, case, resume=True, derivatives=derivatives)

    def note(self, job: Job, outcome: Outcome) -> Evaluation:
        """Record the outcome of a run; return its results."""
        if job.name not in self.record.entries:
            self.record.expect([self._variants[job.name]])
        self.record.note(job, outcome)
        found = self._read(job.name, job.case.casting.length)
        if found is None:  # its process died without a record
            return Evaluation({}, 0.0, outcome.message or "left no results", outcome.seconds)
        self._known[_key(job.case)] = found
        return found

    def write_table(self) -> None:
        """Write sweep.csv: one row per run that has ended, including those of earlier calls."""
        done = [n for n, entry in self.record.entries.items() if entry.status != "waiting"]
        for name in done:
            entry = self.record.entries[name]
            if name not in self._rows or self._rows[name][0] != entry:
                self._rows[name] = replace(entry), rows([name], self.record)[0]
        write_table(self.folder / TABLE_NAME, [self._rows[name][1] for name in done])

    def _read_earlier(self, name: str) -> None:
        """Read a run of an earlier call, if it has ended."""
        place = self.folder / name
        try:
            text = (place / CASE_NAME).read_text(encoding="utf-8")
            files = {
                str(path.relative_to(place)): path.read_bytes()
                for path in sorted((place / PROPERTIES_NAME).rglob("*"))
                if path.is_file()
            }
            tables = tomllib.loads(text)
            self._strands[name] = _strand(tables)
            found = self._read(name, units.parse(tables["casting"]["length"], "m"))
        except (OSError, ValueError, KeyError, CastfemError):
            return  # not a usable run
        if found is not None:
            self._known[key_of(text, files)] = found

    def _read(self, name: str, length: float) -> Evaluation | None:
        """Return the results of the run in a folder, None if it has not ended."""
        place, entry = self.folder / name, self.record.entries[name]
        try:
            run = RunRecord.load(place)
            if run.status not in ("finished", "failed") or UNWRITTEN in run.reason:
                return None  # interrupted; a full disk is unrelated to the case
            if run.status == "failed":
                return Evaluation.of_failed(place, run, length, entry.message, entry.seconds)
            summary = Summary.load(place)
        except CastfemError:
            return None
        if summary is None:
            return None
        return Evaluation.of(summary, entry.seconds, place, read_slopes(place))


def _strand(tables: Mapping[str, Any]) -> Strand:
    """Section and name of the steel of a resolved case."""
    steel = tables.get("steel", {})
    return {"section": dict(tables.get("section", {})), "steel": {"name": steel.get("name", "")}}


def _key(case: Case) -> str:
    return key_of(*portable(case, PROPERTIES_NAME))
