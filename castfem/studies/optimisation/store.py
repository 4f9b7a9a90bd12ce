"""Runs in a folder, as `castfem sweep` keeps them, found again by the case they are of.

The results of a run depend on its case: physics, followed length, when fields are written (that
ends coupling windows), solvers. Two cases that agree in these are the same run, whatever their
titles and their other output, and it is run once, by whichever command.
"""

from __future__ import annotations

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.atomic_files import UNWRITTEN
from castfem.base.errors import CastfemError, InputError
from castfem.base.messages import differences
from castfem.base.shown_quantity import Quantity
from castfem.model.key_names import full_key
from castfem.model.load import portable
from castfem.runs.output.folder import CASE_NAME, PROPERTIES_NAME, RunRecord
from castfem.runs.output.summary import CUT, Summary
from castfem.studies.sensitivity.slopes import Slopes, read_slopes
from castfem.studies.sweep.plan import Variant, run_name
from castfem.studies.sweep.record import Record, check_own
from castfem.studies.sweep.results import TABLE_NAME, rows, write_table
from castfem.studies.sweep.work import Derivatives, Job, Outcome

if TYPE_CHECKING:
    from castfem.model import Case

_NO_RESULT = ("title", "reference", "verification", "optimise")
_RESULT = ("every", "smooth")
_NO_KEYS = ("fidelity", "mould")  # of what is varied: how well a run is computed, the ideal mould
_DIGITS = 10  # of the key in the name of a run


Strand = dict[str, dict[str, Any]]


@dataclass(frozen=True, slots=True)
class _Run:
    """A run as its row has it; see `castfem.studies.sweep.results.Named`."""

    name: str
    given: Mapping[str, str]
    label: str


@dataclass(frozen=True, slots=True)
class Evaluation:
    """The results of a run, or how it failed.

    Attributes:
        quantities: Name to result, as in summary.json; empty of a run that has failed.
        share: How far it came, of the followed length: 1 of a run that has come to its end.
        message: Why it failed, one line; empty if it did not.
        seconds: How long it took; 0 where that is not known.
        folder: Of the run; None of one that was made elsewhere.
        slopes: Derivatives that it has carried along, empty where it can have none; None of one
            that was made without.
    """

    quantities: Mapping[str, Quantity] = field(default_factory=dict)
    share: float = 1.0
    message: str = ""
    seconds: float = 0.0
    folder: Path | None = None
    slopes: Slopes | None = None
    cut: int = 0

    @classmethod
    def of(
        cls, summary: Summary, seconds: float, folder: Path | None, slopes: Slopes | None = None
    ) -> Evaluation:
        """What a run that has finished has given; see the attributes."""
        cut = int(summary.steps.get(CUT, 0.0))
        return cls(summary.quantities, 1.0, "", seconds, folder, slopes, cut)

    @property
    def failed(self) -> bool:
        """Whether it ended before its end."""
        return bool(self.message)

    def has(self, derivatives: Derivatives | None) -> bool:
        """Whether it tells some derivatives, or that there are none."""
        if derivatives is None or self.failed or self.slopes == {}:
            return True
        slopes = self.slopes or {}
        return all(set(derivatives.to) <= set(slopes.get(name, ())) for name in derivatives.of)

    def __getitem__(self, name: str) -> float:
        """A result in SI.

        Raises:
            InputError: The run has none of that name, or has failed.
        """
        if name not in self.quantities:
            if self.failed:
                raise InputError(f'"{name}": the run has failed: {self.message}; see `failed`')
            near = units.nearest(str(name), self.quantities)
            raise InputError(f'"{name}" is no result of this run{near}')
        return self.quantities[name].value


def key_of(text: str, files: Mapping[str, bytes]) -> str:
    """Return what a run hangs on as a hash.

    Args:
        text: Its case.toml.
        files: Contents of the property files in it by their names there.
    """
    tables: dict[str, Any] = tomllib.loads(text)
    for name in _NO_RESULT:
        tables.pop(name, None)
    output = tables.get("output", {})  # of which few keys change the results
    tables["output"] = {key: output[key] for key in _RESULT if key in output}
    tables["output"].setdefault("every", None)
    hashes = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    content = json.dumps([tables, hashes], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()


class Store:
    """The runs in a folder.

    Attributes:
        record: Of the folder, as sweeps keep it.
    """

    def __init__(self, folder: Path) -> None:
        """Looks at the runs that are there.

        Raises:
            InputError: The folder holds something else.
        """
        check_own(folder, (TABLE_NAME,))
        self.record = Record(folder)
        self._known: dict[str, Evaluation] = {}
        self._variants: dict[str, Variant] = {}
        self._strands: dict[str, Strand] = {}
        for name in self.record.entries:
            self._look_at(name)

    @property
    def folder(self) -> Path:
        """Where the folders of the runs lie."""
        return self.record.folder

    def check_is_of(self, case: Case) -> None:
        """Refuse a folder of which every run is of another section or steel than a case.

        Whatever else the runs differ in may have been varied by an earlier call.

        Raises:
            InputError: It is one.
        """
        text, _ = portable(case, PROPERTIES_NAME)
        here, there = _strand(tomllib.loads(text)), list(self._strands.items())
        for name, other in there:
            tables = {k: other[k] for k in other if not self._varied(name, k, case)}
            if tables == {k: here[k] for k in tables}:
                return
        if there:
            what = differences(there[0][1], here)
            raise InputError(
                f"{self.folder}: holds runs of another case ({what}); choose another folder"
            )

    def _varied(self, name: str, table: str, case: Case) -> bool:
        """Whether a run has another value of a key within a table than its case had."""
        for key in self.record.entries[name].given:
            if key in _NO_KEYS:
                continue
            try:
                full = full_key(type(case), case.document(), key)
            except ValueError:
                full = table  # of whatever table
            if full.partition(".")[0] == table:
                return True
        return False

    def find(self, case: Case, derivatives: Derivatives | None = None) -> Evaluation | None:
        """Return what the run of a case has given, None where there is none that has ended.

        Args:
            case: The case.
            derivatives: What it must have carried along; None for nothing.
        """
        found = self._known.get(_key(case))
        return found if found is not None and found.has(derivatives) else None

    def job(
        self, case: Case, given: Mapping[str, str], derivatives: Derivatives | None = None
    ) -> Job:
        """Return the run of a case, and note that it is to be; what was cut short goes on.

        Args:
            case: The case.
            given: Key to value of what is varied, as tables show it.
            derivatives: What it is to carry along; None for nothing.
        """
        name = f"{run_name(given)}_{_key(case)[:_DIGITS]}".lstrip("_")
        self._variants[name] = Variant(name, given, case)
        return Job(name, self.folder / name, case, resume=True, derivatives=derivatives)

    def note(self, job: Job, outcome: Outcome) -> Evaluation:
        """Write down how a run has ended, and return what it has given.

        Raises:
            RunFailure: A file cannot be written.
        """
        entry = self.record.entries.get(job.name)
        if entry is None:
            self.record.expect([self._variants[job.name]])
        self.record.note(job, outcome)
        found = self._read(job.name, job.case.casting.length)
        if found is None:  # its process died, and has left no word
            found = Evaluation({}, 0.0, outcome.message or "left no results", outcome.seconds)
        else:
            self._known[_key(job.case)] = found
        return found

    def write_table(self) -> None:
        """Write sweep.csv: the runs that have ended, a row each, those of earlier calls too.

        Raises:
            RunFailure: It cannot be written.
        """
        entries = self.record.entries.items()
        done = {name: entry for name, entry in entries if entry.message or entry.physics}
        keys = list(dict.fromkeys(key for entry in done.values() for key in entry.given))
        even = [
            _Run(name, {key: entry.given.get(key, "") for key in keys}, entry.label)
            for name, entry in done.items()
        ]
        write_table(self.folder / TABLE_NAME, rows(even, self.record))

    def _look_at(self, name: str) -> None:
        """Take in a run of an earlier call, if it has ended."""
        place = self.folder / name
        try:
            text = (place / CASE_NAME).read_text(encoding="utf-8")
            beside = place / PROPERTIES_NAME
            files = {
                str(path.relative_to(place)): path.read_bytes()
                for path in sorted(beside.rglob("*"))
                if path.is_file()
            }
            tables = tomllib.loads(text)
            length = _length(tables)
            self._strands[name] = _strand(tables)
            found = self._read(name, length)
        except (OSError, ValueError, KeyError, CastfemError):
            return  # whatever it is, it is no run that could be used
        if found is not None:
            self._known[key_of(text, files)] = found

    def _read(self, name: str, length: float) -> Evaluation | None:
        """Return what the run in a folder has given, None if it has not ended."""
        place, entry = self.folder / name, self.record.entries[name]
        try:
            run = RunRecord.load(place)
            if run.status not in ("finished", "failed") or UNWRITTEN in run.reason:
                return None  # cut short: a full disk says nothing of the case
            summary = Summary.load(place)
        except CastfemError:
            return None
        if run.status == "failed":
            share = min(run.reached.get("position", 0.0) / length, 1.0)
            message = entry.message or run.reason or "failed"
            return Evaluation({}, share, message, entry.seconds, place)
        if summary is None:
            return None
        return Evaluation.of(summary, entry.seconds, place, read_slopes(place))


def _strand(tables: Mapping[str, Any]) -> Strand:
    """What is cast: the section, and the name of the steel, of a resolved case."""
    steel = tables.get("steel", {})
    return {"section": dict(tables.get("section", {})), "steel": {"name": steel.get("name", "")}}


def _length(tables: Mapping[str, Any]) -> float:
    """The followed length of a resolved case, m."""
    return units.parse(tables["casting"]["length"], "m")


def _key(case: Case) -> str:
    return key_of(*portable(case, PROPERTIES_NAME))
