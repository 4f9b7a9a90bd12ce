"""Results of a run, read from its folder on request."""

from __future__ import annotations

import shutil
import weakref
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from castfem.base.atomic_files import Closing
from castfem.base.errors import InputError
from castfem.runs.output.summary_file import Summary

if TYPE_CHECKING:
    import pandas

    from castfem.model import Case
    from castfem.runs.output.fields import Fields


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """The fields of a run at one time."""

    time: float  #: since the meniscus, s
    position: float  #: position below the meniscus, m
    points: NDArray[np.float64]  #: (n, 3) nodes, m
    cells: NDArray[np.int32]  #: (m, k) nodes of the cells, in VTK order
    #: fields by name, in SI: (n,) for a scalar, (n, 3) for a vector, (n, 9) for a tensor; m rows
    #: instead of n for values in the cells
    values: dict[str, NDArray[np.float64]]

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """Return one field."""
        if name not in self.values:
            raise InputError(f"no field {name}; there are {', '.join(self.values) or 'none'}")
        return self.values[name]


class RunResult(Closing):
    """The results of a run, read from its folder on request.

    `RunResult(folder)` opens an earlier run. A result with a temporary folder is a context manager
    and has `close`; the folder is also removed when the result is no longer referenced. `summary`
    and data already read remain.

    Attributes:
        folder: Folder of the run.
    """

    def __init__(
        self, folder: Path | str, summary: Summary | None = None, *, temporary: bool = False
    ) -> None:
        """Open a folder; `summary` if known, `temporary` if the folder is to be removed later.

        Raises:
            InputError: The folder holds no summary of a run.
        """
        self.folder = Path(folder)
        found = summary or Summary.load(self.folder)
        if found is None:
            raise InputError(f"{self.folder}: holds no finished run (no summary.json)")
        self._summary = found
        self._remove = (
            weakref.finalize(self, shutil.rmtree, self.folder, ignore_errors=True)
            if temporary
            else None
        )

    @property
    def summary(self) -> Summary:
        """Results, references, balances, counts and wall-clock times; values in SI."""
        return self._summary

    @property
    def quantities(self) -> dict[str, float]:
        """Results in SI by name (`summary.quantities` also has units and labels)."""
        return {name: quantity.value for name, quantity in self._summary.quantities.items()}

    @cached_property
    def case(self) -> Case:
        """The case that was run."""
        from castfem.model import load_case

        return load_case(self.folder / "case.toml")

    @cached_property
    def history(self) -> pandas.DataFrame:
        """One row per step; `history.attrs["units"]` has the unit of each column."""
        from castfem.runs.output.history import HISTORY_NAME, read_history

        return read_history(self.folder / HISTORY_NAME)

    def at(self, position: float | str) -> dict[str, float]:
        """Return the results at a position of the slice, in SI, by name.

        Values are linear between two rows of the history; results without a column are left out.

        Raises:
            InputError: The position is invalid, or the run has not reached it.
        """
        from castfem.runs.results.labels import quantities_at, read_number

        place = read_number("at", position, "m")
        if place is None:
            raise InputError('at: a position is needed, such as "800 mm"')
        found = quantities_at(self.history, place, self.folder)
        return {name: quantity.value for name, quantity in found.items()}

    @cached_property
    def probes(self) -> dict[str, pandas.DataFrame]:
        """Tables of the [[output.probe]] by name, one row per step, like `history`."""
        from castfem.runs.output.folder import PROBES_NAME
        from castfem.runs.output.history import read_history

        return {
            probe.name: read_history(self.folder / PROBES_NAME / f"{probe.name}.csv")
            for probe in self.case.output.probe
        }

    @property
    def times(self) -> NDArray[np.float64]:
        """Times of the fields, s."""
        with self.open_fields() as fields:
            return fields.times

    @property
    def positions(self) -> NDArray[np.float64]:
        """Positions of the fields below the meniscus, m."""
        with self.open_fields() as fields:
            return fields.positions

    def fields(
        self, *, time: float | str | None = None, position: float | str | None = None
    ) -> Snapshot:
        """Return the fields at the nearest written time; `output.every` sets their distance.

        Args:
            time: Time since the meniscus, "5 s" or a number in s.
            position: Position below the meniscus, "300 mm" or a number in m; without either, the
                end of the run.

        Raises:
            InputError: Both are given, one is invalid or beyond the run, or there are no fields.
        """
        from castfem.runs.results.labels import read_number

        if time is not None and position is not None:
            raise InputError("fields: give the time or the position, not both")
        time = read_number("fields: time", time, "s")
        position = read_number("fields: position", position, "m")
        with self.open_fields() as file:
            if not len(file.times):
                raise InputError(f"{self.folder}: the run has written no fields")
            index = len(file.times) - 1
            if time is not None:
                index = nearest_index(file.times, time, "time", "s")
            elif position is not None:
                index = nearest_index(file.positions, position, "position", "m")
            values = {name: file.values(name, index) for name in file.names}
            at = float(file.times[index]), float(file.positions[index])
            return Snapshot(*at, file.points, file.cells, values)

    def close(self) -> None:
        """Remove the folder if it is temporary."""
        if self._remove is not None:
            self._remove()

    def __repr__(self) -> str:
        kind, summary = type(self).__name__, self._summary
        return f"{kind}({str(self.folder)!r}: {summary.title}, {summary.status})"

    def _repr_html_(self) -> str:
        """The results for a notebook."""
        from html import escape

        from castfem.base.shown_units import label_shown, plain_unit, scale_of, shown_in
        from castfem.runs.results.run_case import units_of_run

        rows = ""
        with shown_in(units_of_run(self.folder)):
            for name, one in self._summary.quantities.items():
                if np.isfinite(one.value):
                    scale = scale_of(one.shown_unit, name)
                    cells = f"{scale(one.shown):.5g}</td><td>{escape(plain_unit(scale.unit))}"
                    rows += f"<tr><th>{escape(label_shown(one.label))}</th><td>{cells}</td></tr>"
        title = escape(f"{self._summary.title}: {self._summary.status}")
        return f"<table><caption>{title}</caption>{rows}</table>"

    def open_fields(self) -> Fields:
        """Return the file of the fields; close it after use."""
        from castfem.runs.output.fields import Fields

        return Fields(self.folder)


def nearest_index(written: NDArray[np.float64], wanted: float, name: str, unit: str) -> int:
    """Return the index of the value nearest to the wanted one.

    Raises:
        InputError: It is outside the written range.
    """
    low, high = float(written[0]), float(written[-1])
    slack = 1e-9 * max(abs(high), abs(low))
    if not low - slack <= wanted <= high + slack:
        raise InputError(
            f"{name} {wanted:g} {unit}: fields were written from {low:g} to {high:g} {unit}"
        )
    return int(np.argmin(np.abs(written - wanted)))
