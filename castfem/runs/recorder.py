"""Writes the output of a run on rank 0: history, fields, checkpoints."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import cached_property
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import saving
from castfem.base.constants import same_instant, same_or_before
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.rank_zero import on_root
from castfem.model.build.start import starting_time
from castfem.runs import restart
from castfem.runs.output.checkpoint import CHECKPOINT_NAME, load_checkpoint, save_checkpoint
from castfem.runs.output.folder import WALL_FLUX_NAME, OutputFolder
from castfem.runs.output.history import HISTORY_NAME, History
from castfem.runs.output.xdmf import FieldWriter
from castfem.runs.results.registry import Columns
from castfem.runs.results.run_state import Counts, RunState
from castfem.runs.results.sample import Sample

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.runs.output.surface_maps import MapWriter
    from castfem.runs.results.probes import ProbeSampler
    from castfem.runs.results.wall_flux import WallFlux

PAUSE = 1.0
"""Default for the shortest wall-clock time between two checkpoints, s."""


class Recorder:
    """The output files of one run."""

    def __init__(self, simulation: Simulation, folder: OutputFolder, resume: bool = False) -> None:
        self.simulation, self.folder, self.comm = simulation, folder, simulation.section.comm
        asked = simulation.case.output
        self._every = asked.steps_to_checkpoint
        self._pause = PAUSE if asked.checkpoint_every is None else 0.0
        self._saved = -math.inf
        self._columns = Columns(simulation)
        self._history: History | None = None
        self._fields: FieldWriter | None = None
        self._maps: list[MapWriter] = []
        self._followed: list[ProbeSampler | WallFlux] = []
        self._followed_files: dict[str, History] = {}
        self.checkpoint: tuple[dict[str, Any], dict[str, Array]] | None = None
        on_root(self.comm, self._open_for_resume if resume else self._open)
        if resume:
            self.checkpoint = self.comm.bcast(self.checkpoint)

    @cached_property
    def _physics(self) -> dict[str, str]:
        """The constant part of this run's checkpoints: its case (rank 0)."""
        return self.simulation.case.physics_record()

    def _open(self) -> None:
        self._history = History(self.folder / HISTORY_NAME, self._columns.heading)
        source = self.simulation.section.source
        if self.simulation.case.output_fields and source is not None:
            steel = self.simulation.steel
            facts: dict[str, float | str] = {"solidus": steel.solidus, "liquidus": steel.liquidus}
            symmetry = getattr(self.simulation.case.section, "symmetry", None)
            if symmetry:
                facts["symmetry"] = symmetry
            self._fields = FieldWriter(
                self.folder.path,
                source.points,
                source.cells,
                source.cell,
                source.order,
                attributes=facts,
            )

    def _open_for_resume(self) -> None:
        """Read the checkpoint, and cut off what was written after it."""
        case = self.simulation.case
        self.checkpoint = load_checkpoint(self.folder / CHECKPOINT_NAME, **self._physics)
        time = float(self.checkpoint[0]["time"])
        if not same_or_before(time, case.casting.duration):
            come, length = self.simulation.machine.position(time), case.casting.length
            raise InputError(
                f"{self.folder / CHECKPOINT_NAME}: casting.length: {length:g} m is requested, but "
                f"the run has reached {come:g} m; give at least that, or run without "
                "--resume into another folder"
            )
        taken = Counts.restored(self.checkpoint[0]["counts"]).taken
        self._history = History.resume(
            self.folder / HISTORY_NAME, time, self._columns.heading, rows=taken + 1
        )
        if names := self.simulation.case.output_fields:
            self._fields = FieldWriter.resume(self.folder.path, time, names)

    def step(self, run: RunState, sample: Sample) -> None:
        """Write one committed step: always a row, fields at output times, a checkpoint when due.

        Raises:
            RunFailure: A file cannot be written; raised on every rank.
        """
        cells, fields = self._columns.row(sample), self._due_fields(run, sample)
        judged = run.sampler.quality
        mapped = [] if judged is None else judged.rows()
        followed = [one.rows(run.state, sample) for one in self._followed]
        taken = run.counts.taken
        turn = self._every > 0 and taken % self._every == 0  # also at the meniscus
        due = turn and self._pause_is_over()
        checkpoint = self._checkpoint(run) if due else None

        def write() -> None:
            assert self._history is not None
            self._history.append(cells)
            if self._fields is not None and fields:
                self._fields.write(sample.time, sample.position, fields)
            for maps, values in zip(self._maps, mapped, strict=True):
                maps.append(sample.time, sample.position, values)
            for rows in followed:
                for name, row in rows.items():
                    self._followed_files[name].append(row)
            if checkpoint is not None:
                self._save(run, *checkpoint)

        on_root(self.comm, write)

    def _pause_is_over(self) -> bool:
        """Whether the last checkpoint is old enough, by the clock of rank 0 (collective)."""
        over: bool = self.comm.bcast(monotonic() - self._saved >= self._pause)
        if over:
            self._saved = monotonic()
        return over

    def begin_maps(self, run: RunState) -> None:
        """Start or continue the maps; a case without [quality] has none."""
        judged = run.sampler.quality
        if judged is None:
            return
        from castfem.runs.output.surface_maps import MapWriter

        def begin() -> None:
            for names, heading in judged.headings().items():
                if self.checkpoint is None:
                    maps = MapWriter(self.folder.path, heading, names=names)
                else:
                    taken = Counts.restored(self.checkpoint[0]["counts"]).taken
                    maps = MapWriter.resume(self.folder.path, heading, taken + 1, names)
                self._maps.append(maps)

        on_root(self.comm, begin)

    def begin_followed(self, run: RunState) -> None:
        """Start or continue the files of probes and of the flux into the wall."""
        case = self.simulation.case
        files: dict[str, Sequence[tuple[str, str]]] = {}
        if case.output.probe:
            from castfem.runs.results.probes import ProbeSampler, probe_file

            probes = ProbeSampler(self.simulation, run.sampler.mechanics)
            files |= dict.fromkeys(map(probe_file, probes.names), probes.columns)
            self._followed.append(probes)
        tube = None if case.mould is None else case.mould.tube
        if tube is not None and tube.thermocouple and tube.heated_by_strand:
            from castfem.runs.results.wall_flux import WallFlux

            wall = WallFlux(self.simulation)
            files[WALL_FLUX_NAME] = wall.columns
            self._followed.append(wall)

        def begin() -> None:
            for name, columns in files.items():
                path = self.folder / name
                if self.checkpoint is None:
                    with saving(path):
                        path.parent.mkdir(exist_ok=True)
                    file = History(path, columns)
                else:
                    meta = self.checkpoint[0]
                    rows = Counts.restored(meta["counts"]).taken + 1
                    file = History.resume(path, float(meta["time"]), columns, rows=rows)
                self._followed_files[name] = file

        on_root(self.comm, begin)

    def _due_fields(self, run: RunState, sample: Sample) -> dict[str, Array] | None:
        """Fields at the nodes on rank 0 if this is an output time, otherwise None (collective)."""
        names = self.simulation.case.output_fields
        if not names or not self._is_due(sample.time):
            return None
        state, gather = run.state, self.simulation.section.gather
        kelvin = state.thermal.point.temperature
        owned = {"temperature": kelvin}
        if "solid_fraction" in names:
            owned["solid_fraction"] = np.asarray(self.simulation.steel.solid_fraction(kelvin))
        if run.sampler.mechanics is not None and state.mechanical is not None:
            strained = run.sampler.mechanics.fields(state.mechanical, names)
            if state.strained is None:  # after the end of the mechanics only the shape is left
                strained = {n: v if n == "displacement" else np.full_like(v, np.nan)
                            for n, v in strained.items()}  # fmt: skip
            owned |= strained
        gathered = {name: _by_component(gather, owned[name]) for name in names}
        return {name: values for name, values in gathered.items() if values is not None}

    def _is_due(self, time: float) -> bool:
        """Whether `time` is the start, a multiple of the output interval, or the end."""
        case, end = self.simulation.case, self.simulation.control.end
        every, clock = case.output_every, case.output_clock
        nearest = round((time + clock) / every) * every - clock
        begun = starting_time(self.simulation)
        return time <= begun or same_instant(time, nearest, end) or same_instant(time, end, end)

    def _checkpoint(self, run: RunState) -> tuple[dict[str, Any], dict[str, Array | None]]:
        """The content of a checkpoint of the committed state (collective: results may be sums)."""
        return restart.description(run), restart.arrays(run)

    def _save(
        self, run: RunState, description: dict[str, Any], state: dict[str, Array | None]
    ) -> None:
        """Save a checkpoint, and record how far the run has come (rank 0)."""
        arrays = {name: values for name, values in state.items() if values is not None}
        if self._history is not None:
            self._history.sync()
        for maps in self._maps:
            maps.sync()
        for file in self._followed_files.values():
            file.sync()
        save_checkpoint(self.folder / CHECKPOINT_NAME, description, arrays, **self._physics)
        self.folder.update(reached=run.reached)

    def save(self, run: RunState) -> None:
        """Save a checkpoint of the committed state now (collective)."""
        checkpoint = self._checkpoint(run)
        on_root(self.comm, lambda: self._save(run, *checkpoint))

    def close(self) -> None:
        """Close the files; what was written is complete without this."""
        for thing in (self._history, self._fields, *self._maps, *self._followed_files.values()):
            if thing is not None:
                thing.close()


def _by_component(gather: Callable[[Array], Array | None], owned: Array) -> Array | None:
    """Gather vertex values (owned, ...) on rank 0, one component at a time (collective)."""
    if owned.ndim == 1:
        return gather(owned)
    parts = [gather(np.ascontiguousarray(component)) for component in owned.T]
    whole = [part for part in parts if part is not None]
    return np.column_stack(whole) if whole else None
