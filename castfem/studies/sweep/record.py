"""A folder of runs: sweep.json records which are finished; sweep.csv has the table."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Literal

from castfem.base import units
from castfem.base.atomic_files import folder_refused, taken, write_json
from castfem.base.errors import CastfemError, InputError, RunFailure
from castfem.base.shown_quantity import Quantity
from castfem.base.table import Table
from castfem.model.load import portable
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs import existing_run
from castfem.runs.output.folder import PROPERTIES_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, read_columns
from castfem.runs.output.run_record import RUN_NAME, RunRecord
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import derived
from castfem.runs.results.labels import quantities_at
from castfem.studies.sweep.plan import Variant
from castfem.studies.sweep.work import Job, Outcome

SWEEP_NAME = "sweep.json"
_LOCK_NAME = ".sweep.lock"
_FORMAT = "castfem sweep"


Status = Literal["finished", "failed", "waiting"]


@dataclass(slots=True)
class Entry:
    """A run of the sweep, of this or an earlier call."""

    given: dict[str, str] = field(default_factory=dict)  #: values of the varied keys
    label: str = ""  #: name in tables and figures, if not the varied values
    #: hash of all input of its fields, including property files; "" until it finishes
    physics: str = ""
    message: str = ""  #: why it failed
    seconds: float = 0.0  #: duration

    @property
    def status(self) -> Status:
        """Status of the run."""
        return "failed" if self.message else "finished" if self.physics else "waiting"


def _untitled(case: str) -> list[str]:
    """Lines of a resolved case without its title, which affects no result."""
    return [line for line in case.splitlines() if not line.startswith("title = ")]


def _is_of(folder: Path, job: Job) -> bool:
    """Whether a run belongs to a case, with equal copies of property files.

    Raises:
        OSError, InputError: A file cannot be read.
    """
    text, files = portable(job.case, PROPERTIES_NAME)
    existing = (folder / CASE_NAME).read_text(encoding="utf-8")
    same = all((folder / name).read_bytes() == content for name, content in files.items())
    return same and _untitled(existing) == _untitled(text)


def check_own(folder: Path, names: Iterable[str]) -> None:
    """Refuse a folder with files whose names castfem would use, but that it has not written."""
    if (folder / SWEEP_NAME).is_file():
        return
    for name in names:
        if (folder / name).exists():
            raise InputError(
                f"{folder}: {name} was not written by castfem and would be overwritten; choose "
                "another folder, or move the file"
            )


def check_folder(folder: Path | str, caller: str = "") -> Path:
    """Return the path of a folder for many runs.

    Args:
        folder: The folder, which need not exist.
        caller: Name of the calling function; "" for the command line.
    """
    where, other = (f"{caller}: folder: ", "") if caller else ("", " with -o")
    if not isinstance(folder, str | Path):
        raise InputError(f"{caller}: folder must be a path, got {folder!r}")
    path = Path(folder)
    if path.exists() and not path.is_dir():
        raise InputError(f"{where}{path}: is a file, a folder is needed; choose another{other}")
    if (path / RUN_NAME).is_file():
        raise InputError(f"{where}{path}: holds a single run; choose another{other}")
    return path


def prepare(
    folder: Path,
    variants: Sequence[Variant],
    mine: Sequence[Variant] | None = None,
    *,
    resume: bool = True,
    overwrite: bool = False,
    after: Callable[[Path], object] | None = None,
) -> tuple[Record, tuple[Job, ...]]:
    """Check which runs in a folder are finished; prepare and return the rest.

    Args:
        folder: Folder of the runs.
        variants: All runs.
        mine: Those to be made here; None for all.
        resume: Whether interrupted runs continue from their checkpoints.
        overwrite: Repeat all runs, also over runs of other cases.
        after: Called with the folder of each finished run; see `Job`.
    """
    record, own = Record(folder), variants if mine is None else mine
    if not overwrite:
        record.find(own)  # runs that ended without being recorded
    jobs = [Job(one.name, folder / one.name, one.case, resume, after) for one in own]
    missing = record.unfinished(jobs, overwrite=overwrite)
    record.begin(variants, {one.name for one in own})
    return record, missing


class Record:
    """The runs in a folder, by name.

    Attributes:
        folder: Folder of the sweep, which contains the folders of its runs.
        entries: Runs by name.
    """

    def __init__(self, folder: Path) -> None:
        """Read sweep.json if it exists."""
        self.folder = folder
        self.entries: dict[str, Entry] = {}
        self._read()

    def _read(self) -> None:
        """Replace the entries of this record by those of sweep.json."""
        path = self.folder / SWEEP_NAME
        if not path.is_file():
            return
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != _FORMAT:
                raise ValueError("not written by castfem")
            known = {f.name for f in fields(Entry)}
            for name, entry in content["runs"].items():
                self.entries[name] = Entry(**{k: v for k, v in entry.items() if k in known})
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise InputError(f"{path}: cannot be read ({error}); choose another folder") from None

    def reload(self) -> None:
        """Read the entries written by other processes."""
        mine, self.entries = self.entries, {}
        self._read()
        self.entries = mine | self.entries

    @contextmanager
    def shared(self) -> Iterator[None]:
        """Change entries while other processes do the same: their entries are kept.

        On a file system without locks the last writer wins; `find` repairs that.
        """
        from filelock import FileLock

        self.folder.mkdir(parents=True, exist_ok=True)
        with ExitStack() as held:
            lock = FileLock(self.folder / _LOCK_NAME)
            if taken(lock):
                held.callback(lock.release)
            self.reload()
            yield
            self.save()

    def begin(self, variants: Iterable[Variant] = (), mine: Container[str] | None = None) -> None:
        """Make the folder, and write the expected runs; see `expect`."""
        try:
            with self.shared():
                self.expect(variants, mine)
        except (OSError, RunFailure) as error:
            raise InputError(folder_refused(self.folder, error)) from None

    def expect(self, variants: Iterable[Variant], mine: Container[str] | None = None) -> None:
        """Add the expected runs; those run here (`mine`) have no known results."""
        for variant in variants:
            job = Job(variant.name, self.folder / variant.name, variant.case)
            here = mine is None or variant.name in mine or variant.name not in self.entries
            if here and not self.is_finished(job):
                self.entries[variant.name] = Entry()
            entry = self.entries[variant.name]
            entry.given, entry.label = dict(variant.given), variant.label

    def is_finished(self, job: Job) -> bool:
        """Return whether exactly this run has finished: case, output and property files."""
        entry = self.entries.get(job.name)
        if entry is None or not (job.folder / RUN_NAME).is_file():
            return False
        if entry.physics != job.case.physics_hash():
            return False
        try:
            existing = (job.folder / CASE_NAME).read_text(encoding="utf-8")
            status = RunRecord.load(job.folder).status
        except (OSError, InputError):
            return False
        now, _ = portable(job.case, PROPERTIES_NAME)
        return status == "finished" and _untitled(existing) == _untitled(now)

    def unfinished(self, jobs: Iterable[Job], *, overwrite: bool) -> tuple[Job, ...]:
        """Return the jobs still to be run, after checking the folder of each."""
        found, problems = list[Job](), list[str]()
        for job in jobs:
            if not overwrite and self.is_finished(job):
                continue
            try:
                existing_run.check(
                    job.folder, job.case, resume=False, overwrite=overwrite, goes_on=job.resume
                )
                if job.folder.is_dir() and OutputFolder(job.folder).is_running():
                    raise InputError(f"{job.folder}: a run is in progress there; wait for it")
            except InputError as error:
                problems += error.problems
            found.append(job)
        if problems:
            raise InputError(problems)
        return tuple(found)

    def note(self, job: Job, outcome: Outcome) -> None:
        """Record the outcome of a run, while other processes may do the same."""
        with self.shared():
            entry = self.entries.setdefault(job.name, Entry())
            entry.physics = "" if outcome.failed else job.case.physics_hash()
            entry.message, entry.seconds = outcome.message, round(outcome.seconds, 3)

    def find(self, variants: Iterable[Variant]) -> None:
        """Add the information in the folders of runs, whoever made them.

        A run counts as finished if it has ended well with the same case and property files.
        """
        for variant in variants:
            folder = self.folder / variant.name
            job = Job(variant.name, folder, variant.case)
            if self.is_finished(job):
                continue
            entry = self.entries.setdefault(variant.name, Entry())
            entry.given, entry.label = dict(variant.given), variant.label
            entry.physics = ""
            try:
                record = RunRecord.load(folder)
                same = _is_of(folder, job)
            except (OSError, InputError):
                continue
            if not same:
                continue
            entry.message = record.reason if record.status == "failed" else ""
            if record.status == "finished":
                entry.physics = variant.case.physics_hash()
                entry.seconds = round(sum(record.wall_time.values()), 3)

    def save(self) -> None:
        """Write sweep.json."""
        runs: dict[str, Any] = {name: asdict(entry) for name, entry in self.entries.items()}
        write_json(self.folder / SWEEP_NAME, {"format": _FORMAT, "runs": runs})


TABLE_NAME = "sweep.csv"


@dataclass(frozen=True, slots=True)
class Row:
    """A run and its results."""

    name: str  #: name of the run
    given: Mapping[str, str]  #: values of the varied keys
    status: Status
    quantities: Mapping[str, Quantity]  #: its results, empty if there are none
    seconds: float  #: duration
    message: str  #: why it failed
    label: str = ""  #: its name, if not the varied values


def rows(names: Iterable[str], record: Record, at: Sequence[float] = ()) -> list[Row]:
    """Return the rows of a sweep in its present state.

    Args:
        names: Names of its runs.
        record: Record of their outcomes.
        at: Positions, m; the results there come before those at the end.
    """
    found = []
    for name in names:
        entry, folder = record.entries[name], record.folder / name
        quantities: Mapping[str, Quantity] = {}
        message = entry.message
        if entry.status == "finished":
            try:
                summary = Summary.load(folder)
                quantities = {**summary.quantities, **derived(folder, summary)} if summary else {}
                quantities = {**_results_at(folder, at), **quantities}
            except CastfemError as error:
                message = str(error)
        found.append(
            Row(name, entry.given, entry.status, quantities, entry.seconds, message, entry.label)
        )
    return found


def _results_at(folder: Path, at: Sequence[float]) -> dict[str, Quantity]:
    """Results of a run at some positions, m, by name and position."""
    if not at:
        return {}
    table = read_columns(folder / HISTORY_NAME)
    found = {}
    for position in at:
        place = f"at {1e3 * position:.6g} mm"
        for name, quantity in quantities_at(table, position, folder).items():
            if name != "position":
                found[f"{name} {place}"] = replace(quantity, label=f"{quantity.label}, {place}")
    return found


def write_table(path: Path, table: Sequence[Row]) -> None:
    """Write all quantities of the runs in documented units as CSV, one row per run."""
    keys, cells = varied(table)
    names = {name: q.shown_unit for row in table for name, q in row.quantities.items()}
    results = [f"{name} [{unit}]" for name, unit in names.items()]
    found = []
    for row, own in zip(table, cells, strict=True):
        values = [row.quantities.get(name) for name in names]
        numbers = [f"{q.shown:.12g}" if q and math.isfinite(q.shown) else "" for q in values]
        took = f"{row.seconds:.3f}" if row.seconds else ""
        found.append((row.name, *own, row.status, *numbers, took, row.message))
    heads = ("run", *keys, "status", *results, "wall_time [s]", "message")
    Table(heads, found).write_csv(path)


def varied(table: Sequence[Row]) -> tuple[list[str], list[list[str]]]:
    """Return the headers of the varied keys, and their cells row by row.

    The unit is in the header if all values have the same one.
    """
    headers, columns = [], []
    for key in dict.fromkeys(key for row in table for key in row.given):
        values = [row.given.get(key, "") for row in table]
        parts = [_split(value) if value else ("", None) for value in values]
        shared = {part[1] for part in parts if part} - {None}
        if len(shared) == 1 and all(parts):
            (unit,) = shared
            headers.append(f"{key} [{unit}]" if unit else key)
            columns.append([part[0] if part else "" for part in parts])
        else:
            headers.append(key)
            columns.append([value.strip("\"'") for value in values])
    return headers, [[column[row] for column in columns] for row in range(len(table))]


def _split(value: str) -> tuple[str, str] | None:
    """Return number and unit of a value, None if it is something else."""
    try:
        return units.split(value.strip("\"'"))
    except ValueError:
        return None
