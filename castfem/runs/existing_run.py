"""Decides whether a case may be run in a folder that already holds a run.

A new run replaces a run of the same physics, and a resumed run continues it. A run of other
physics, or one that has come further down than the new one will, is kept unless --overwrite is
given. `castfem.runs.output.folder` has the list of castfem's files, and changes no others.
"""

from __future__ import annotations

from pathlib import Path

from castfem.base import log
from castfem.base.constants import same_or_before
from castfem.base.errors import InputError, differences
from castfem.model import AnyCase, Case, read_case
from castfem.model.base import PROPERTY_FILES
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs.output.run_record import RUN_NAME, RunRecord

_NOT_PHYSICS = (
    "title",
    "output",
    "reference",
    "verification",
    "optimise",
    "caster",
    "casting.length",
)


_COMMAND = (
    "choose another with -o",
    "run without --resume into another folder (-o)",
    "choose another folder with -o, or --overwrite it",
)
_SCRIPT = (
    "choose another",
    "run without resume=True, into another folder",
    "choose another folder, or give overwrite=True",
)


def check(
    folder: Path,
    case: AnyCase,
    *,
    resume: bool,
    overwrite: bool,
    script: bool = False,
    goes_on: bool = False,
) -> None:
    """Refuse a folder whose run has other physics than the case, or has come further down.

    Args:
        folder: Intended output folder.
        case: Case to run.
        resume: Whether the existing run is continued.
        overwrite: Whether any existing run may be replaced.
        script: Whether messages address a script instead of the command line.
        goes_on: Whether an interrupted run there is continued in any case, as in a sweep.
    """
    other, fresh, replace = _SCRIPT if script else _COMMAND
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, a folder is needed; {other}")
    file = folder / CASE_NAME
    if overwrite or not file.is_file():
        return
    fix = fresh if resume else replace
    existing = read_case(file).sound
    if existing is None:
        raise InputError(f"{file}: is not a case of this version of castfem; {fix}")
    if existing.physics_hash() != case.physics_hash():
        changes = _changes(existing, case)
        raise InputError(f"{folder}: holds a run of another case ({changes}); {fix}")
    if isinstance(case, Case) and (folder / RUN_NAME).is_file():
        _check_length(folder, case, resume, fix, goes_on)


def _changes(there: AnyCase, here: AnyCase) -> str:
    """Keys in which two cases differ; property files are compared by content."""
    one, other = there.document(), here.document()
    if isinstance(there, Case) and isinstance(here, Case):
        before, now = there.physics(), here.physics()
        for table, key in PROPERTY_FILES:
            if key not in one.get(table, {}) or key not in other.get(table, {}):
                continue
            names = [Path(document[table][key]).name for document in (one, other)]
            alike = before[table][key] == now[table][key]
            one[table][key], other[table][key] = names[1] if alike else names[0], names[1]
            if not alike and names[0] == names[1]:
                one[table][key] = "other contents"
    return differences(one, other, _NOT_PHYSICS) or "a file that it names has changed"


def _check_length(folder: Path, case: Case, resume: bool, fix: str, goes_on: bool) -> None:
    """Refuse to replace a run by a shorter one, or to resume one to a position it has passed."""
    record, end = RunRecord.load(folder), case.casting.length
    reached = record.reached.get("position", 0.0)
    if not same_or_before(reached, end):
        if resume:
            fix = f"a resumed run must go further down: give at least {reached:g} m, or {fix}"
        raise InputError(
            f"{folder}: casting.length: {end:g} m is requested, but the run there has reached "
            f"{reached:g} m; {fix}"
        )
    if not (resume or goes_on) and record.status != "finished" and reached > 0.0:
        log.logger.warning(
            "%s: the run there had reached %g m (%s) and is replaced; --resume would continue it",
            folder, reached, record.status,
        )  # fmt: skip
