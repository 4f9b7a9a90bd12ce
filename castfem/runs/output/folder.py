"""The output folder of a run, and the lock on it.

    case.toml      the resolved case, including extended files, --set and defaults
    properties/    copies of the user's property files that it names
    run.json       status, versions, ranks, wall time (`castfem.runs.output.run_record`)
    run.log        log messages
    history.csv    one row per step (`castfem.runs.output.history`)
    probes/        results at the probes, one row per step
    wall_flux.csv  heat into the wall of a mould with thermocouples, one row per step
    surface_maps.h5   the surface unrolled over time (`castfem.runs.output.surface_maps`);
    surface_maps.rows its rows in a run that has not ended
    depth_maps.h5 .rows  criteria of hot tearing over the depth, in the same form
    fields.xdmf    the fields over time, for ParaView (`castfem.runs.output.xdmf`) ...
    fields.h5      ... and their numbers (`castfem.runs.output.field_files`);
    fields/        in a run that has not ended one file per time
    checkpoint.h5  the state to resume from (`castfem.runs.output.checkpoint`)
    summary.json   the results in numbers (`castfem.runs.output.summary_file`)
    caster.csv     a caster's history: one row per instant (`castfem.runs.caster.files`)
    strand.csv     ... the strand at each instant, one row per slice ...
    slices.csv     ... and each slice at its exit
    now.json       a caster that follows its plant: the strand at the last instant ...
    now.csv        ... and its slices, for other programs
    pyrometers.csv ... the surface at fixed positions, one row for each slice that passes
    strand.pvd     ... the strand at moments, for ParaView, with a file each in moments/
    figures/       figures of `castfem show` (`castfem.post.plots.figures`)

castfem starts a new run only in a folder without any of these names, or in one with its own
run.json; then it removes these files and no others. run.json exists throughout the run, and a
locked `.castfem.lock` shows that a run is at work; the lock ends with the process in any case. No
host name is written, and no path outside the folder except those of the command line.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base.atomic_files import (
    Closing,
    replacing,
    saving,
    system_reason,
    taken,
    temporary_name,
    write_json,
)
from castfem.base.errors import CastfemError, FolderInUse, InputError
from castfem.base.process import reason_of
from castfem.model.shipped_cases import CASE_NAME
from castfem.runs.output.checkpoint import CHECKPOINT_NAME
from castfem.runs.output.field_files import HDF5_NAME, remove_singles, singles
from castfem.runs.output.history import HISTORY_NAME
from castfem.runs.output.run_record import RUN_NAME, RunRecord, command, versions
from castfem.runs.output.summary_file import SUMMARY_NAME, Summary
from castfem.runs.output.xdmf import XDMF_NAME

if TYPE_CHECKING:
    from filelock import FileLock

LOG_NAME = "run.log"
FIGURES_NAME = "figures"
PROPERTIES_NAME = "properties"
PROBES_NAME = "probes"
WALL_FLUX_NAME = "wall_flux.csv"
DERIVATIVES_NAME = "derivatives.json"  # computed during a run
MAPS_NAME, ROWS_NAME = "surface_maps.h5", "surface_maps.rows"
DEPTHS_NAME, DEPTH_ROWS_NAME = "depth_maps.h5", "depth_maps.rows"
ERROR_NAME, ERROR_ENDING = "error.json", "_error"
"""File of the errors of a case, and the suffix of its folder."""
CASTER_NAME, STRAND_ROWS_NAME, SLICES_NAME = "caster.csv", "strand.csv", "slices.csv"
NOW_NAME, NOW_ROWS_NAME = "now.json", "now.csv"
PYROMETERS_NAME = "pyrometers.csv"
STRAND_SERIES_NAME, MOMENTS_NAME = "strand.pvd", "moments"
STRAND_NAME = "strand.vtu"  # written on request, from the others
FIGURES = ("temperature", "states", "stack", "surface_temperature", "shell", "heat", "steps")
MECHANICS_FIGURES = ("von_mises", "shape", "stress", "size", "axial", "contact")
BENDING_FIGURES = ("slice", "bulging", "extraction", "maps", "depths", "caster", "roll_to_roll")
TENSILE_FIGURES = ("tensile",)
ALL_FIGURES = FIGURES + MECHANICS_FIGURES + BENDING_FIGURES + TENSILE_FIGURES
CASTER_FIGURES = "strand_over_time", "strand_maps", "strand_moments"
_LOCK_NAME = ".castfem.lock"
# Copies of property files: of the files named in run.json only these are removed.
_COPY = re.compile(rf"{PROPERTIES_NAME}/\w+/[^/]*\w[^/]*")
# The checkpoint is removed first: a partly removed run must not be resumed.
ARTEFACTS = (
    *(CHECKPOINT_NAME, CASE_NAME, RUN_NAME, LOG_NAME, HISTORY_NAME, XDMF_NAME, HDF5_NAME),
    *(SUMMARY_NAME, DERIVATIVES_NAME, MAPS_NAME, ROWS_NAME, STRAND_NAME, WALL_FLUX_NAME),
    *(DEPTHS_NAME, DEPTH_ROWS_NAME),
    *(CASTER_NAME, STRAND_ROWS_NAME, SLICES_NAME, NOW_NAME, NOW_ROWS_NAME),
    *(PYROMETERS_NAME, STRAND_SERIES_NAME),
    *(f"{FIGURES_NAME}/{name}.png" for name in (*ALL_FIGURES, *CASTER_FIGURES)),
)


def _probe_files(case: bytes) -> list[str]:
    """Files of the probes in a resolved case; none if it cannot be read."""
    if b"probe" not in case:
        return []
    try:
        output = tomllib.loads(case.decode()).get("output", {})
        return [f"{PROBES_NAME}/{probe['name']}.csv" for probe in output.get("probe", ())]
    except (ValueError, KeyError, TypeError, AttributeError):
        return []


class OutputFolder(Closing):
    """The output folder of one run; only on rank 0.

    As a context manager it records in run.json how the block ended, and releases the lock.
    """

    def __init__(self, path: Path | str) -> None:
        """Store the path; nothing is touched before `begin`."""
        self.path = Path(path)
        self.record = RunRecord()
        self._earlier: Mapping[str, float] = {}
        self._before: tuple[RunRecord, dict[str, bytes]] | None = None
        self._lock: FileLock | None = None

    def __truediv__(self, name: str) -> Path:
        """Return the path of a file in the folder."""
        return self.path / name

    def begin(
        self,
        case: str,
        *,
        files: Mapping[str, bytes] | None = None,
        ranks: int = 1,
        resume: bool = False,
    ) -> bool:
        """Take the folder for a run: lock it, remove the previous run, write the first files.

        Args:
            case: The resolved case as TOML.
            files: Name, below `PROPERTIES_NAME`, and content of its property files.
            ranks: Number of MPI processes.
            resume: Continue the run in the folder; nothing of it is removed, unless it ended before
                its first checkpoint.

        Returns:
            Whether there is a checkpoint to continue from; False for a run from the beginning.

        Raises:
            InputError: Another run is active there, files there are not castfem's, a finished run
                has no checkpoint to resume from, or the folder cannot be written.
        """
        try:
            self.path.mkdir(parents=True, exist_ok=True)
            self._acquire()
        except OSError as error:
            raise self._unusable(error) from error
        try:
            inputs = {CASE_NAME: case.encode(), **(files or {})}
            return self._take_over(inputs, ranks, resume)
        except CastfemError as error:
            self.close()
            cause = error.__cause__
            raise (self._unusable(cause) if isinstance(cause, OSError) else error) from error
        except OSError as error:
            self.close()
            raise self._unusable(error) from error

    def update(self, **changes: Any) -> None:
        """Change entries of run.json, named as in `RunRecord`.

        wall_time is that of this process; the time before a resume is added to it.
        """
        if changes:
            self._before = None  # the run is under way
        if "wall_time" in changes:
            own = changes["wall_time"]
            stages = [*self._earlier, *(name for name in own if name not in self._earlier)]
            changes["wall_time"] = {
                name: self._earlier.get(name, 0.0) + own.get(name, 0.0) for name in stages
            }
        self.record = replace(self.record, **changes)
        self.record.write(self.path)

    def write_summary(self, summary: Summary) -> None:
        """Write summary.json."""
        write_json(self / SUMMARY_NAME, summary.to_json())

    def finish(self, **changes: Any) -> None:
        """Record in run.json that the run has finished."""
        self.update(status="finished", reason="", ended=_now(), **changes)

    def interrupt(self, reason: str, **changes: Any) -> None:
        """Record in run.json that the run was stopped, and by what; it can be resumed."""
        self.update(status="interrupted", reason=reason, ended=_now(), **changes)

    def fail(self, reason: str, **changes: Any) -> None:
        """Record why the run failed in run.json: the first line, without the folder's path."""
        first = reason.strip().splitlines()[0] if reason.strip() else "unknown reason"
        inside = first.replace(f"{self.path}/", "")
        self.update(status="failed", reason=inside, ended=_now(), **changes)

    def _begin_no_more(self, record: RunRecord, inputs: Mapping[str, bytes]) -> None:
        """Restore the folder to its state before a resume that turned out to be impossible."""
        self.write_inputs(inputs)
        self.record = record
        self.update()

    def write_inputs(self, inputs: Mapping[str, bytes]) -> None:
        """Write the case and its property files; remove property files that it no longer names.

        They are replaced, never removed first: the case may have been read from these files.
        """
        for name, content in inputs.items():
            path = self / name
            with saving(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as temporary:
                temporary.write_bytes(content)
        for name in self.record.files:
            if name not in inputs and _COPY.fullmatch(name):
                path = self / name
                with saving(path):
                    path.unlink(missing_ok=True)
                for parent in (path.parent, path.parent.parent):
                    with suppress(OSError):  # not empty
                        parent.rmdir()
        hashes = {name: sha256(content).hexdigest() for name, content in inputs.items()}
        self.update(files=hashes)

    def close(self) -> None:
        """Release the lock."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def leave(self, error: BaseException) -> None:
        """Record why the run ends, or undo its beginning."""
        if self._before is not None and isinstance(error, InputError):
            with suppress(CastfemError):
                self._begin_no_more(*self._before)
        elif self._lock is not None and self.record.status == "running":
            with suppress(CastfemError):  # a full disk must not hide the error
                if isinstance(error, KeyboardInterrupt):
                    self.interrupt(reason_of(error))
                else:
                    self.fail(str(error) or type(error).__name__)

    def is_running(self) -> bool:
        """Whether a run is active in the folder now."""
        if self._lock is not None:
            return True
        from filelock import FileLock, Timeout

        lock = self / _LOCK_NAME
        if not lock.is_file():
            return False
        probe = FileLock(lock, timeout=0)
        try:
            locked = taken(probe)
        except Timeout:
            return True
        except OSError:  # no permission to open the file: assume no run
            return False
        if locked:
            probe.release()
        return False

    def _acquire(self) -> None:
        """Take the lock, or report that another process holds it."""
        from filelock import FileLock, Timeout

        lock = FileLock(self / _LOCK_NAME, timeout=0)
        try:
            locked = taken(lock)
        except Timeout as error:
            raise FolderInUse(
                f"{self.path}: another run is writing here; wait for it, or choose another folder"
            ) from error
        if locked:
            self._lock = lock

    def _take_over(self, inputs: Mapping[str, bytes], ranks: int, resume: bool) -> bool:
        """Prepare the folder under the lock; return whether there is something to resume."""
        present = [name for name in ARTEFACTS if (self / name).exists()]
        present += [str(path.relative_to(self.path)) for path in singles(self.path)]
        present += [name for name in _probe_files(inputs[CASE_NAME]) if (self / name).exists()]
        if (self / RUN_NAME).exists():
            earlier = RunRecord.load(self.path)
            strangers = self._strangers(inputs, earlier)
        else:
            earlier, strangers = RunRecord(), [*present, *self._strangers(inputs)]
        if strangers:
            raise InputError(
                f"{self.path}: holds {', '.join(strangers)}, not of a run of castfem; "
                "choose another folder or move them away"
            )
        if resume and CHECKPOINT_NAME not in present:
            if earlier.status == "finished":
                raise InputError(
                    f"{self / CHECKPOINT_NAME}: no such file, nothing to resume from; "
                    "run again without --resume"
                )
            resume = False
        if resume:
            self._earlier = dict(earlier.wall_time)
            began, count, commands = earlier.started, earlier.resumed + 1, earlier.commands
            kept = {CASE_NAME, *filter(_COPY.fullmatch, earlier.files)}
            before = {n: (self / n).read_bytes() for n in kept if (self / n).is_file()}
        else:
            began, count, commands, before = _now(), 0, (), {}
        self.record = RunRecord(
            started=began, resumed=count, ranks=ranks, versions=versions(), wall_time=self._earlier,
            commands=(*commands, command()), files=earlier.files,
            reached=earlier.reached if resume else {},
        )  # fmt: skip
        self.update()
        if not resume:
            self._remove_artefacts()
        self.write_inputs(inputs)
        self._before = (earlier, before) if resume else None
        return resume

    def _strangers(
        self, inputs: Mapping[str, bytes], earlier: RunRecord | None = None
    ) -> list[str]:
        """User files in the place of copies that would be written."""
        ours = {CASE_NAME, *(earlier.files if earlier else ())}
        paths = {name: self / name for name in inputs if name not in ours}
        return [
            name
            for name, path in paths.items()
            if path.exists() and path.read_bytes() != inputs[name]
        ]

    def _remove_artefacts(self) -> None:
        """Remove the output of the previous run, except for files that are replaced at once."""
        for name in ARTEFACTS:
            path = self / name
            for leftover in (path, temporary_name(path), path.with_name(f".{path.name}.tmp2")):
                if name not in (CASE_NAME, RUN_NAME) or leftover != path:
                    with saving(path):
                        leftover.unlink(missing_ok=True)
        remove_singles(self.path)
        for path in (self / MOMENTS_NAME).glob("strand_*s.vtu"):
            with saving(path):
                path.unlink()
        before = self / CASE_NAME
        for name in _probe_files(before.read_bytes() if before.is_file() else b""):
            with saving(self / name):
                (self / name).unlink(missing_ok=True)
        for name in (FIGURES_NAME, PROBES_NAME):
            with suppress(OSError):  # may contain user files
                (self / name).rmdir()

    def _unusable(self, error: BaseException) -> InputError:
        """Return the error for a folder that cannot be written, with the fix."""
        _, reason = system_reason(error)
        return InputError(
            f"{self.path}: cannot be used as output folder ({reason}); choose another with -o"
        )


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
