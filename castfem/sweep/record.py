"""sweep.json: the runs of a folder of runs, and which of them need not be run again."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

from castfem.case.portable import portable
from castfem.errors import InputError
from castfem.output.folder import CASE_NAME, PROPERTIES_NAME
from castfem.output.run_record import RUN_NAME, RunRecord
from castfem.support.atomic_files import write_json
from castfem.sweep.plan import Variant
from castfem.sweep.work import Job, Outcome

SWEEP_NAME = "sweep.json"
_FORMAT = "castfem sweep"


@dataclass(slots=True)
class Entry:
    """A run of the sweep, now or in an earlier call.

    Attributes:
        given: Key to value of what is varied.
        label: What tables and figures call it, if not what is varied.
        physics: Hash of all its fields depend on, property files too.
        message: Why it failed.
        seconds: How long it took.
    """

    given: dict[str, str] = field(default_factory=dict)
    label: str = ""
    physics: str = ""
    message: str = ""
    seconds: float = 0.0


def _untitled(case: str) -> list[str]:
    """A resolved case without its title, in which no result is."""
    return [line for line in case.splitlines() if not line.startswith("title = ")]


class Record:
    """The runs in a folder, by name.

    Attributes:
        folder: Of the sweep; the folders of its runs lie in it.
        entries: Name to run.
    """

    def __init__(self, folder: Path) -> None:
        """Reads sweep.json if it is there.

        Raises:
            InputError: It is not castfem's.
        """
        self.folder = folder
        self.entries: dict[str, Entry] = {}
        path = folder / SWEEP_NAME
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

    def expect(self, variants: Iterable[Variant]) -> None:
        """Take in the runs that are to be; of those that are not finished nothing is known."""
        for variant in variants:
            job = Job(variant.name, self.folder / variant.name, variant.case)
            if not self.is_finished(job):
                self.entries[variant.name] = Entry()
            entry = self.entries[variant.name]
            entry.given, entry.label = dict(variant.given), variant.label

    def is_finished(self, job: Job) -> bool:
        """Return whether the very same run has ended well: case, output and property files."""
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

    def note(self, job: Job, outcome: Outcome) -> None:
        """Write down how a run has ended.

        Raises:
            RunFailure: The file cannot be written.
        """
        entry = self.entries.setdefault(job.name, Entry())
        entry.physics = "" if outcome.failed else job.case.physics_hash()
        entry.message, entry.seconds = outcome.message, round(outcome.seconds, 3)
        self.save()

    def save(self) -> None:
        """Write sweep.json.

        Raises:
            RunFailure: It cannot be written.
        """
        runs: dict[str, Any] = {name: asdict(entry) for name, entry in self.entries.items()}
        write_json(self.folder / SWEEP_NAME, {"format": _FORMAT, "runs": runs})
