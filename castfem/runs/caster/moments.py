"""Writes the strand, bent through its machine, at the moments of a case, for ParaView.

strand.pvd lists the moments with their clock times, s; each is an unstructured grid in moments/.
Between two slices, and from the meniscus to the first, the temperature is linear in the position.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

import numpy as np

from castfem.base.atomic_files import saving, write_text
from castfem.base.constants import ROUNDING
from castfem.base.types import Array
from castfem.fem.rank_zero import on_root
from castfem.model.machine import thickness_of
from castfem.physics.machine.side import Side
from castfem.runs.caster.files import moment_files
from castfem.runs.output.folder import MOMENTS_NAME, STRAND_SERIES_NAME
from castfem.runs.output.layout import vtk_cells
from castfem.runs.output.stacked_slices import CORNERS, at_rows, between, write_stack

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.build.simulation import Simulation
    from castfem.runs.caster.strand import Slice

LONGEST = 0.1
"""Largest cell length along the strand, m."""


class Moments:
    """Writes the strand at each requested moment.

    Args:
        case: A case with a table [caster].
        model: Simulation of one of its slices.
        folder: Folder of the run.

    Attributes:
        asked: Requested clock times, s.
    """

    def __init__(self, case: Case, model: Simulation, folder: Path) -> None:
        assert case.caster is not None
        self._case, self._model, self._folder = case, model, folder
        self.asked = case.caster.moments

    def look(
        self,
        now: float,
        before: float,
        slices: Sequence[Slice],
        poured: float | None,
        comm: MPI.Comm,
    ) -> None:
        """Write the strand if a moment lies between the previous and this output time (collective).

        Args:
            now: This output time, s.
            before: The previous output time, s.
            slices: The slices of this rank.
            poured: Temperature of the steel at the meniscus, K; None if none is poured.
            comm: The communicator.
        """
        if not any(before < moment <= now for moment in self.asked):
            return
        own = [
            (one.run_state.position, one.run_state.state.thermal.point.temperature)
            for one in slices
            if not one.has_left
        ]
        found = comm.gather(own)
        on_root(comm, lambda: self._write(now, list(chain.from_iterable(found or [])), poured))

    def _write(self, now: float, found: list[tuple[float, Array]], poured: float | None) -> None:
        if found and poured is not None and min(place for place, _ in found) > ROUNDING:
            found.append((0.0, np.full_like(found[0][1], poured)))
        position = np.array([place for place, _ in found])
        if len(found) < 2:
            return
        order, section = np.argsort(position), self._model.section
        assert section.source is not None
        source = section.source
        table = vtk_cells(source.cells, source.cell, source.order)[:, : CORNERS[source.cell]]
        nodes, cells = np.unique(table, return_inverse=True)
        given = np.array([section.gather(found[i][1])[nodes] for i in order])  # type: ignore[index]
        rows = between(position[order], LONGEST)
        temperature = at_rows(rows, position[order], given)
        data = {
            "temperature": temperature,
            "solid_fraction": self._model.steel.solid_fraction(temperature),
            "position": np.repeat(rows[:, None], len(nodes), axis=1),
        }
        points = self._placed(rows, source.points[nodes, :2])
        target = self._folder / MOMENTS_NAME / f"strand_{now:g}s.vtu"
        with saving(target):
            target.parent.mkdir(exist_ok=True)
        write_stack(target, points, cells.reshape(table.shape), source.cell, data)
        self._list(now)

    def _placed(self, rows: Array, place: Array) -> Array:
        """Points of the slices (rows, n, 3): distance from mould, across, upwards."""
        if self._side is not None:
            return self._side.placed(rows, place)
        x, y = (np.broadcast_to(column, (len(rows), len(place))) for column in place.T)
        return np.stack([y, x, np.broadcast_to(-rows[:, None], x.shape)], axis=-1)

    @cached_property
    def _side(self) -> Side | None:
        """The strand between its rolls; None if it is straight."""
        table, thickness = self._case.machine, thickness_of(self._case.section)
        rolls = None if table is None else table.pairs()
        if rolls is None or thickness is None:
            return None
        return Side(rolls, thickness, self._case.casting.length)

    def _list(self, last: float) -> None:
        """Write the list of the files, up to that of an output time."""
        times = {clock: path for clock, path in moment_files(self._folder) if clock <= last}
        lines = [
            f'<DataSet timestep="{clock!r}" file="{MOMENTS_NAME}/{path.name}"/>'
            for clock, path in times.items()
        ]
        head = '<?xml version="1.0"?>\n<VTKFile type="Collection" version="0.1"><Collection>\n'
        text = head + "\n".join(lines) + "\n</Collection></VTKFile>\n"
        write_text(self._folder / STRAND_SERIES_NAME, text)
