"""castfem for those who script: load a case, change it, run it, and have the results as arrays.

    import castfem

    case = castfem.load("billet125/idealised")
    result = castfem.run(case.with_(speed="3 m/min"))
    result.quantities["shell_mid_face"]      # m
    result.history                           # pandas

DOLFINx is imported by the first `run`, pandas and h5py when they are needed.
"""

from __future__ import annotations

import gc
import shutil
import tempfile
import weakref
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from castfem.base.closing import Closing
from castfem.base.errors import InputError
from castfem.base.one_at_a_time import one_at_a_time
from castfem.runs.output.summary import Summary

if TYPE_CHECKING:
    from mpi4py import MPI

    import pandas
    from matplotlib.axes import Axes

    from castfem.model import Case
    from castfem.runs.output.fields import Fields
    from castfem.studies.sensitivity.result import Sensitivity


def load(name: str | Path) -> Case:
    """Return a case of a file, or one shipped with castfem, checked.

    Args:
        name: Path of a case file, with or without .toml, or the name of a shipped case
            ("billet125/thermal").

    Raises:
        InputError: There is no such case, or it is wrong: all mistakes, one line each.
    """
    from castfem.model import load_case
    from castfem.model.shipped_cases import find

    return load_case(find(str(name)))


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
        case: A case, or what `load` takes.
        folder: Where the files go (docs/output.md); a run of the same physics in it is replaced.
            None takes a temporary folder, which is removed when the result is closed or no longer
            used.
        resume: Go on from the checkpoint in `folder`.
        overwrite: Replace a run of another case, too, or one that has come further down.
        comm: Ranks of the run; all when None.
        progress: Draw a bar, or write lines where there is no terminal.

    Returns:
        The result. On ranks other than 0 it has the summary alone.

    Raises:
        InputError: Case, folder or checkpoint cannot be used, it names keys in which they differ;
            or another thread of this process runs a case.
        RunFailure: The run cannot go on; its last good state is in `folder`.
    """
    from mpi4py import MPI

    from castfem.base import log
    from castfem.base.progress import Progress
    from castfem.fem.root import on_root
    from castfem.model import Case
    from castfem.runs import loop

    comm = MPI.COMM_WORLD if comm is None else comm
    sound = load(case) if isinstance(case, str | Path) else case
    if not isinstance(sound, Case):
        raise InputError(
            f"castfem.run: a case is needed, its path or the name of a shipped one, not {sound!r}"
        )
    made = None if folder is not None else on_root(comm, tempfile.mkdtemp)
    # Only rank 0 looks at files; the name of a temporary folder is no concern of the others.
    target = Path(made or folder or ".")
    bar = Progress(0 if progress else -1) if comm.rank == 0 else None
    try:
        if made is None:
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
        # Meshes and communicators stand in cycles: large, and to be freed by all ranks at once.
        gc.collect()
    return Result(target, summary, temporary=made is not None)


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
    """Run a case with the derivatives of its results by some of its keys (docs/sensitivity.md).

    Args:
        case: A case, or what `load` takes.
        to: The parameters: keys of the case ("casting.superheat"), "steel.conductivity" and the
            like.
        of: Names of results; by default heat removed, shell and surface temperature.
        folder: Where tables and checkpoints go; None writes nothing.
        resume: Go on from the checkpoint in `folder`.
        comm: Ranks of the run; all when None.
        progress: Draw a bar, or write lines where there is no terminal.

    Returns:
        The results with their derivatives, `gradient` by name, on all ranks.

    Raises:
        InputError: Case, results or parameters cannot be used; it names each.
        RunFailure: The run cannot go on.
    """
    from mpi4py import MPI

    from castfem.base.progress import Progress
    from castfem.studies.sensitivity.run import sensitivity

    comm = MPI.COMM_WORLD if comm is None else comm
    sound = load(case) if isinstance(case, str | Path) else case
    bar = Progress(0 if progress else -1) if comm.rank == 0 else None
    names, keys = ([one] if isinstance(one, str) else list(one) for one in (of, to))
    target = None if folder is None else Path(folder)
    try:
        return sensitivity(
            sound, names, keys, folder=target, resume=resume, comm=comm, progress=bar
        )
    finally:
        if bar is not None:
            bar.stop()
        gc.collect()


def _may_run_in(folder: Path, case: Case, resume: bool, overwrite: bool) -> None:
    """Refuse a folder with a run that would be lost, see `existing_run.check`."""
    from castfem.runs import existing_run

    existing_run.check(folder, case, resume=resume, overwrite=overwrite, script=True)


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The fields of a run at one time.

    Attributes:
        time: Since the meniscus, s.
        position: Below the meniscus, m.
        points: (n, 3) nodes, m.
        cells: (m, k) nodes of the cells, in VTK order.
        values: Name to field, in SI: (n,) of a scalar, (n, 3) of a vector, (n, 9) of a tensor; m
            rows instead of n where a field lives in the cells.
    """

    time: float
    position: float
    points: NDArray[np.float64]
    cells: NDArray[np.int32]
    values: dict[str, NDArray[np.float64]]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """One field by its name."""
        if name not in self.values:
            raise InputError(f"no field {name}; there are {', '.join(self.values) or 'none'}")
        return self.values[name]


class Result(Closing):
    """The results of a run, read from its folder when they are asked for.

    `Result(folder)` opens an earlier run. One with a temporary folder is a context manager and has
    `close`; the folder is removed, too, when nothing refers to the result any more. `summary` and
    what has been read stay.

    Attributes:
        folder: Of the run.
    """

    def __init__(
        self, folder: Path | str, summary: Summary | None = None, *, temporary: bool = False
    ) -> None:
        """Open a folder; `summary` if it is known already, `temporary` to remove the folder later.

        Raises:
            InputError: The folder holds no summary of a run.
        """
        self.folder = Path(folder)
        found = summary or Summary.load(self.folder)
        if found is None:
            raise InputError(f"{self.folder}: holds no run that has ended (no summary.json)")
        self._summary = found
        self._remove = (
            weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
            if temporary
            else None
        )

    @property
    def summary(self) -> Summary:
        """Results, references, balances, counts and wall time; values in SI."""
        return self._summary

    @property
    def quantities(self) -> dict[str, float]:
        """Name to result in SI (`summary.quantities` has units and labels too)."""
        return {name: quantity.value for name, quantity in self._summary.quantities.items()}

    @cached_property
    def case(self) -> Case:
        """The case that was run."""
        from castfem.model import load_case

        return load_case(self.folder / "case.toml")

    @cached_property
    def history(self) -> pandas.DataFrame:
        """One row a step; `history.attrs["units"]` has the unit of each column."""
        from castfem.runs.output.history import HISTORY_NAME, read_history

        return read_history(self.folder / HISTORY_NAME)

    def at(self, position: float | str) -> dict[str, float]:
        """Name to result in SI where the slice reached a position.

        Linear between two rows of the history; results without a column there are left out.

        Args:
            position: "800 mm", or a number in m.

        Raises:
            InputError: It is no position, or the run has not been there.
        """
        from castfem.runs.results.places import quantities_at, read_number

        place = read_number("at", position, "m")
        if place is None:
            raise InputError('at: a position is needed, such as "800 mm"')
        found = quantities_at(self.history, place, self.folder)
        return {name: quantity.value for name, quantity in found.items()}

    @cached_property
    def probes(self) -> dict[str, pandas.DataFrame]:
        """Name of each [[output.probe]] to its table, one row a step, as `history` has them."""
        from castfem.runs.output.folder import PROBES_NAME
        from castfem.runs.output.history import read_history

        return {
            probe.name: read_history(self.folder / PROBES_NAME / f"{probe.name}.csv")
            for probe in self.case.output.probe
        }

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the fields, s."""
        with self._fields() as fields:
            return fields.times

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions of the fields below the meniscus, m."""
        with self._fields() as fields:
            return fields.positions

    def fields(
        self, *, time: float | str | None = None, position: float | str | None = None
    ) -> Snapshot:
        """The fields at the written time that is nearest; `output.every` says how near that is.

        Args:
            time: Since the meniscus, "5 s" or a number in s.
            position: Below the meniscus, "300 mm" or a number in m; with neither, the end of the
                run.

        Raises:
            InputError: Both are given, one is none or beyond the run, or there are no fields.
        """
        from castfem.runs.results.places import read_number

        if time is not None and position is not None:
            raise InputError("fields: give the time or the position, not both")
        time = read_number("fields: time", time, "s")
        position = read_number("fields: position", position, "m")
        with self._fields() as file:
            if not len(file.times):
                raise InputError(f"{self.folder}: the run has written no fields")
            index = len(file.times) - 1
            if time is not None:
                index = _nearest(file.times, time, "time", "s")
            elif position is not None:
                index = _nearest(file.positions, position, "position", "m")
            values = {name: file.values(name, index) for name in file.names}
            at = float(file.times[index]), float(file.positions[index])
            return Snapshot(*at, file.points, file.cells, values)

    def plot(self, *names: str, axes: Axes | None = None) -> Axes:
        """Columns of the history over the position, as matplotlib axes.

        Args:
            *names: Of columns with one unit, such as "shell_mid_face".
            axes: Where to draw; new ones if None.

        Raises:
            InputError: There is no such column, or units differ.
        """
        from castfem.base.shown_units import shown_in
        from castfem.post.plots.interactive import plot_columns
        from castfem.runs.output.chosen_units import units_of_run

        with shown_in(units_of_run(self.folder)):
            return plot_columns(self.history, names, axes)

    def section(
        self, name: str = "temperature", *, at: float | str | None = None, axes: Axes | None = None
    ) -> Axes:
        """A scalar field over the section, as matplotlib axes.

        Args:
            name: Of a field that was written.
            at: "300 mm", or a number in m: the written place nearest to it; None for the end.
            axes: Where to draw; new ones if None.

        Raises:
            InputError: There is no such field, or the run has not been there.
        """
        from castfem.base.shown_units import shown_in
        from castfem.post.plots.interactive import plot_field
        from castfem.runs.output.chosen_units import units_of_run
        from castfem.runs.results.places import read_number

        place = read_number("at", at, "m")
        with self._fields() as file:
            if not len(file.times):
                raise InputError(f"{self.folder}: the run has written no fields")
            last = len(file.times) - 1
            index = last if place is None else _nearest(file.positions, place, "position", "m")
            with shown_in(units_of_run(self.folder)):
                return plot_field(file, name, index, axes)

    def close(self) -> None:
        """Remove the folder if it is a temporary one."""
        if self._remove is not None:
            self._remove()

    def __repr__(self) -> str:
        return f"Result({str(self.folder)!r}: {self._summary.title}, {self._summary.status})"

    def _repr_html_(self) -> str:
        """The results as a notebook shows them."""
        from html import escape

        from castfem.base.shown_units import label_shown, plain_unit, scale_of, shown_in
        from castfem.runs.output.chosen_units import units_of_run

        rows = ""
        with shown_in(units_of_run(self.folder)):
            for name, one in self._summary.quantities.items():
                if np.isfinite(one.value):
                    scale = scale_of(one.shown_unit, name)
                    cells = f"{scale(one.shown):.5g}</td><td>{escape(plain_unit(scale.unit))}"
                    rows += f"<tr><th>{escape(label_shown(one.label))}</th><td>{cells}</td></tr>"
        title = escape(f"{self._summary.title}: {self._summary.status}")
        return f"<table><caption>{title}</caption>{rows}</table>"

    def _fields(self) -> Fields:
        from castfem.runs.output.fields import Fields

        return Fields(self.folder)


def _nearest(written: NDArray[np.float64], wanted: float, name: str, unit: str) -> int:
    """Index of the value nearest to one that was asked for.

    Raises:
        InputError: It lies outside of what was written.
    """
    low, high = float(written[0]), float(written[-1])
    slack = 1e-9 * max(abs(high), abs(low))
    if not low - slack <= wanted <= high + slack:
        raise InputError(
            f"{name} {wanted:g} {unit}: fields were written from {low:g} to {high:g} {unit}"
        )
    return int(np.argmin(np.abs(written - wanted)))
