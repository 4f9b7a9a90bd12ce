"""Functions for scripts: load a case, change it, run it, and get the results as arrays.

    import castfem

    case = castfem.load("billet125/idealised")
    result = castfem.run(case.with_(speed="3 m/min"))
    result.quantities["shell_mid_face"]      # m
    result.history                           # pandas

DOLFINx is imported by the first `run`, pandas and h5py when needed.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import InputError
from castfem.base.process import collected, one_at_a_time
from castfem.model import load as reading
from castfem.model.load import as_case
from castfem.runs.run_result import RunResult, Snapshot, nearest_index

if TYPE_CHECKING:
    from mpi4py import MPI

    from matplotlib.axes import Axes

    from castfem.model import Case
    from castfem.runs.caster.files import CasterResult
    from castfem.studies.sensitivity.result import Sensitivity

__all__ = ["Result", "Snapshot", "caster", "load", "run", "sensitivities"]


def load(name: str | Path, accuracy: str = "default") -> Case:
    """Return a checked case from a file, or one shipped with castfem.

    Args:
        name: Path of a case file, with or without .toml, or the name of a shipped case
            ("billet125/thermal").
        accuracy: That of cells, steps and windows, as for --accuracy: "coarse", "default" for the
            case's own, or "fine".

    Raises:
        InputError: There is no such case or accuracy, or the case is faulty; all faults, one line
            each.
    """
    case = reading.load(name)
    if accuracy == "default":
        return case
    from castfem.studies.accuracy.sizes import at_accuracy

    return at_accuracy(case, accuracy)


@one_at_a_time()
def run(
    case: Case | str | Path,
    folder: Path | str | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    comm: MPI.Intracomm | None = None,
    progress: bool = False,
) -> Result:
    """Run a case and return its result (collective).

    Args:
        case: A case, or its path or name as for `load`.
        folder: Output folder (docs/output.md); a run of the same physics in it is replaced. None
            for a temporary folder, which is removed when the result is closed or no longer used.
        resume: Continue from the checkpoint in `folder`.
        overwrite: Also replace a run of another case, or one that has come further down.
        comm: Ranks of the run; None for all.
        progress: Show a progress bar, or lines without a terminal.

    Returns:
        The result; on ranks other than 0 only its summary.

    Raises:
        InputError: Case, folder or checkpoint cannot be used (the message names the keys that
            differ), or another thread of this process is running a case.
        RunFailure: The run failed; its last good state is in `folder`.
    """
    from mpi4py import MPI

    from castfem.base import log
    from castfem.base.progress import Progress
    from castfem.fem.rank_zero import on_root
    from castfem.runs import loop

    comm = MPI.COMM_WORLD if comm is None else comm
    sound = as_case(case, "castfem.run")
    made = None if folder is not None else on_root(comm, tempfile.mkdtemp)
    # Only rank 0 needs the files and the name of a temporary folder.
    target = Path(made or folder or ".")
    bar = Progress(0 if progress else -1) if comm.rank == 0 else None
    with collected():
        try:
            if folder is not None:
                on_root(comm, lambda: _may_run_in(target, sound, resume, overwrite))
            summary = loop.run(sound, target, comm=comm, resume=resume, progress=bar)
        except BaseException:
            if made is not None:
                shutil.rmtree(made, ignore_errors=True)
            raise
        finally:
            if bar is not None:
                bar.stop()
            log.end_file()
    return Result(target, summary, temporary=made is not None)


def caster(
    case: Case | str | Path,
    folder: Path | str | None = None,
    *,
    resume: bool = False,
    overwrite: bool = False,
    comm: MPI.Intracomm | None = None,
    progress: bool = False,
) -> CasterResult:
    """Follow a whole strand through changes of speed, superheat and water (collective).

    See docs/caster.md.

    Args:
        case: A case with a table [caster], or its path or name as for `load`.
        folder: Output folder. None for a temporary folder, which is removed when the result is no
            longer used.
        resume: Continue from the checkpoint in `folder`.
        overwrite: Also replace a run of another case.
        comm: Ranks that share the slices; None for all.
        progress: Show a progress bar, or lines without a terminal.

    Returns:
        The results at each output time, as tables.

    Raises:
        InputError: Case, folder or checkpoint cannot be used.
        RunFailure: A slice failed; its last good state is in `folder`.
    """
    from mpi4py import MPI

    from castfem.base import log
    from castfem.base.progress import Progress
    from castfem.fem.rank_zero import on_root
    from castfem.runs.caster.files import CasterResult
    from castfem.runs.caster.run import run_caster

    comm = MPI.COMM_WORLD if comm is None else comm
    sound = as_case(case, "castfem.caster")
    made = None if folder is not None else on_root(comm, tempfile.mkdtemp)
    target = Path(comm.bcast(made) or folder or ".")
    bar = Progress(0 if progress else -1, unit="s of slices") if comm.rank == 0 else None
    found = CasterResult(target, temporary=made is not None)
    with collected():
        try:
            if folder is not None:
                on_root(comm, lambda: _may_run_in(target, sound, resume, overwrite))
            run_caster(sound, target, comm=comm, resume=resume, progress=bar)
        finally:
            if bar is not None:
                bar.stop()
            log.end_file()
    return found


@one_at_a_time()
def sensitivities(
    case: Case | str | Path,
    to: str | Sequence[str],
    of: str | Sequence[str] = (),
    *,
    folder: Path | str | None = None,
    resume: bool = False,
    comm: MPI.Intracomm | None = None,
    progress: bool = False,
) -> Sensitivity:
    """Run a case and compute the derivatives of its results (docs/sensitivity.md).

    Args:
        case: A case, or its path or name as for `load`.
        to: The parameters: keys of the case ("casting.superheat"), "steel.conductivity" and others.
        of: Names of results; by default heat removed, shell and surface temperature.
        folder: Folder for tables and checkpoints; None writes nothing.
        resume: Continue from the checkpoint in `folder`.
        comm: Ranks of the run; None for all.
        progress: Show a progress bar, or lines without a terminal.

    Returns:
        The results with their derivatives (`gradient` by name), on all ranks.

    Raises:
        InputError: Case, results or parameters cannot be used; the message names them.
        RunFailure: The run failed.
    """
    from mpi4py import MPI

    from castfem.base.progress import Progress
    from castfem.studies.sensitivity.run import sensitivity

    comm = MPI.COMM_WORLD if comm is None else comm
    sound = as_case(case, "sensitivities")
    bar = Progress(0 if progress else -1) if comm.rank == 0 else None
    names, keys = ([one] if isinstance(one, str) else list(one) for one in (of, to))
    target = None if folder is None else Path(folder)
    with collected():
        try:
            return sensitivity(
                sound, names, keys, folder=target, resume=resume, comm=comm, progress=bar
            )
        finally:
            if bar is not None:
                bar.stop()


def _may_run_in(folder: Path, case: Case, resume: bool, overwrite: bool) -> None:
    """Refuse a folder whose run would be lost; see `existing_run.check`."""
    from castfem.runs import existing_run

    existing_run.check(folder, case, resume=resume, overwrite=overwrite, script=True)


class Result(RunResult):
    """The results of a run, with figures for notebooks."""

    def plot(self, *names: str, axes: Axes | None = None) -> Axes:
        """Plot columns of the history over the position.

        Args:
            *names: Columns with the same unit, such as "shell_mid_face".
            axes: matplotlib axes to draw in; None for new ones.

        Raises:
            InputError: There is no such column, or the units differ.
        """
        from castfem.base.shown_units import shown_in
        from castfem.post.plots.interactive import plot_columns
        from castfem.runs.results.run_case import units_of_run

        with shown_in(units_of_run(self.folder)):
            return plot_columns(self.history, names, axes)

    def section(
        self, name: str = "temperature", *, at: float | str | None = None, axes: Axes | None = None
    ) -> Axes:
        """Plot a scalar field over the section.

        Args:
            name: Name of a written field.
            at: Position, "300 mm" or a number in m; the nearest written one is used. None for the
                end.
            axes: matplotlib axes to draw in; None for new ones.

        Raises:
            InputError: There is no such field, or the run has not reached the position.
        """
        from castfem.base.shown_units import shown_in
        from castfem.post.plots.interactive import plot_field
        from castfem.runs.results.labels import read_number
        from castfem.runs.results.run_case import units_of_run

        place = read_number("at", at, "m")
        with self.open_fields() as file:
            if not len(file.times):
                raise InputError(f"{self.folder}: the run has written no fields")
            last = len(file.times) - 1
            index = last if place is None else nearest_index(file.positions, place, "position", "m")
            with shown_in(units_of_run(self.folder)):
                return plot_field(file, name, index, axes)
