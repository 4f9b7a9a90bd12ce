"""A run of a caster: its files, its checkpoint, and how far it has come by its clock."""

from __future__ import annotations

import hashlib
import json
import math
import time
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from castfem.base import log
from castfem.base.errors import RunFailure
from castfem.base.process import one_at_a_time
from castfem.base.progress import Progress, clock
from castfem.base.stopwatch import peak_memory
from castfem.base.types import Array
from castfem.model.build.simulation import build_mesh
from castfem.model.caster import EVENT
from castfem.model.load import portable
from castfem.runs import restart
from castfem.runs.caster.demand import demand
from castfem.runs.caster.files import GrowingTable, Row, definition
from castfem.runs.caster.strand import Slice, Strand
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.output.checkpoint import CHECKPOINT_NAME, load_checkpoint, save_checkpoint
from castfem.runs.output.folder import (
    CASTER_NAME,
    PROPERTIES_NAME,
    SLICES_NAME,
    STRAND_ROWS_NAME,
    OutputFolder,
)
from castfem.runs.results.registry import Columns

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.model.build.simulation import Simulation
    from castfem.runs.caster.plant_file import PlantFile
    from castfem.runs.results.sample import Sample

CENTRE = "centre_solid_fraction"
HEADING = [
    ("time", "s"), ("speed", "m/min"), ("superheat", "K"), ("slices", "-"),
    ("metallurgical_length", "m"), ("cooling_power", "kW"), ("energy_error", "-"), ("event", ""),
]  # fmt: skip
"""Columns of caster.csv, a row an instant; the time is that of the clock."""
SAVED_EVERY = 30.0
"""s of the wall clock between two checkpoints, at least."""


@dataclass(slots=True)
class Heat:
    """Heat of slices of the whole strand.

    Attributes:
        removed: By the cooling, J. gained: Change of their enthalpy since the meniscus, J.
    """

    removed: float = 0.0
    gained: float = 0.0

    def add(self, one: Slice) -> None:
        """Add a slice, with the length that it stands for."""
        sampler, state = one.run_state.sampler, one.run_state.state.thermal
        whole = one.length * one.loop.simulation.section.multiplicity
        self.removed += whole * state.removed
        self.gained += whole * sampler.heat_gained(state)


class CasterRun:
    """Takes a strand from instant to instant and keeps its files.

    Args:
        case: With a table [caster], sound.
        output: Its folder, begun.
        goes_on: Whether to go on from the checkpoint in it.
        save_every: Of the wall clock, s.
        source: The file that its plant grows with; None where that is known from the beginning.

    Attributes:
        latest: The row of the last instant, and those of the slices inside; None before the first.
        is_saved: Whether the checkpoint has the last instant.
    """

    def __init__(
        self,
        case: Case,
        output: OutputFolder,
        goes_on: bool,
        save_every: float = SAVED_EVERY,
        source: PlantFile | None = None,
    ) -> None:
        assert case.caster is not None
        self._case, self._output, self._every, self._source = case, output, save_every, source
        self._physics = _physics(case, grows=source is not None)
        self.latest: tuple[Row, list[Row]] | None = None
        self.is_saved = goes_on
        self.strand = Strand(case, MPI.COMM_SELF)
        self._columns = _Rows(self.strand.model)
        self._index = 0
        self._rows: dict[int, dict[str, float]] = {}
        self._left, self._before = Heat(), math.nan
        meta: dict[str, Any] = {}
        if goes_on:
            meta, arrays = load_checkpoint(output / CHECKPOINT_NAME, **self._physics)
            if source is not None:
                source.expect(*meta["plant"])
            self._restore(meta, arrays)
        own = self._columns.heading
        slices = [("slice", "-"), ("start", "s"), ("left", "s"), ("metallurgical_length", "m")]
        self._files = {
            name: GrowingTable(output / name, heading, meta.get("sizes", {}).get(name))
            for name, heading in (
                (CASTER_NAME, HEADING),
                (STRAND_ROWS_NAME, self.heading),
                (SLICES_NAME, [*slices, *own]),
            )
        }
        self._saved, self._begun = time.monotonic(), time.monotonic()
        self._done = 0.0  # s of all slices together

    def grow(self, case: Case) -> None:
        """Go on by a longer history of the plant, which begins as that so far."""
        self.strand.grow(case)
        self._case = case

    @property
    def heading(self) -> list[tuple[str, str]]:
        """Name and unit of the columns of the strand at an instant."""
        return [("clock", "s"), ("slice", "-"), *self._columns.heading]

    @property
    def is_saved_lately(self) -> bool:
        """Whether a checkpoint is not due yet."""
        return time.monotonic() - self._saved < self._every

    def go(self, interrupt: Interrupt, progress: Progress | None) -> None:
        """Go through all instants, and save; see `advance`."""
        self.advance(interrupt, progress)
        self.save()

    def advance(self, interrupt: Interrupt, progress: Progress | None) -> None:
        """Go through all instants that are left.

        Raises:
            RunFailure: A slice cannot go on.
            Stopped: It was asked to stop; all is saved.
        """
        strand, work = self.strand, self.strand.work
        ages = {one.number: one.age for one in strand.inside}
        gone = strand.begun - len(strand.inside)
        self._done = sum(work[:gone]) + sum(ages.values())
        if progress is not None:
            progress.start(sum(work), self._done)
        try:
            while self._index < len(strand.instants):
                now = strand.instants[self._index]
                for one in strand.advance(now, interrupt, passed=self._rows):
                    assert one.run_state.sample is not None
                    self._rows[one.number] = self._columns.row(one.run_state.sample)
                    passed = one.age - ages.get(one.number, 0.0)
                    ages[one.number] = one.age
                    self._tell(one, now, passed, progress)
                    if not self.is_saved_lately:
                        self.save()
                self._write(now)
                self._index += 1
        except (Stopped, RunFailure):  # within a slice, between two of its steps
            self.save()
            raise

    def _tell(self, one: Slice, now: float, passed: float, progress: Progress | None) -> None:
        """Tell that a slice has come to an instant; of the first, how long it took."""
        strand = self.strand
        if not self._done and passed > 0.0:
            taken = time.monotonic() - self._begun
            left = taken / passed * sum(strand.work)
            log.logger.info(
                "%.0f s of a slice take %s; all take about %s", passed, clock(taken), clock(left)
            )
        self._done += passed
        if progress is not None:
            note = f"slice {one.number}, {len(strand.inside)} at once"
            progress.update(self._done, now, 0, passed, note)

    def _write(self, now: float) -> None:
        """Write the strand at an instant, and let go of what has left it."""
        strand, caster = self.strand, self._case.caster
        assert caster is not None
        ended = [one for one in strand.inside if one.has_left]
        inside = [one for one in strand.inside if not one.has_left]
        pool = strand.pool_end(now)
        for one in ended:
            self._left.add(one)
        heat = Heat(self._left.removed, self._left.gained)
        for one in inside:
            heat.add(one)
        apart = caster.every if self._index else math.nan
        plant = {name: float(caster.plant.table(name)(now)) for name in caster.plant.values}
        superheat = plant.get("superheat", self.strand.base.casting.poured_superheat)
        self._files[SLICES_NAME].append(
            {
                "slice": one.number, "start": one.start, "left": one.start + one.lasts,
                **self._rows[one.number], "metallurgical_length": _length(one),
            }
            for one in ended
        )  # fmt: skip
        rows: list[Row] = [
            {"clock": now, "slice": one.number, **self._rows[one.number]} for one in inside[::-1]
        ]
        self._files[STRAND_ROWS_NAME].append(rows)
        row: dict[str, float | str] = {
            "time": now, "speed": 60.0 * plant["speed"], "slices": len(inside),
            "superheat": math.nan if superheat is None else superheat,
            "metallurgical_length": pool,
            "cooling_power": 1e-3 * (heat.removed - self._before) / apart,
            "energy_error": (heat.removed + heat.gained) / max(abs(heat.removed), 1e-300),
            "event": _events(caster.plant, now - (apart if self._index else math.inf), now),
        }  # fmt: skip
        self._files[CASTER_NAME].append([row])
        self.latest, self.is_saved = (row, rows), False
        self._before, self._rows = heat.removed, {}
        strand.release()

    def save(self) -> None:
        """Replace the checkpoint by what there is; rows that were written later are cut off."""
        arrays: dict[str, Array] = {}
        slices = {}
        for one in self.strand.inside:
            run = one.run_state
            run.restored = ({}, {})  # results of a slice on its way are asked for by nobody
            if run.sample is None:
                continue  # it has not left the meniscus yet
            slices[str(one.number)] = restart.description(run)
            arrays |= {
                f"{one.number}/{name}": values
                for name, values in restart.arrays(run).items()
                if values is not None
            }
        for file in self._files.values():
            file.sync()
        meta = {
            "index": self._index, "slices": slices,
            "begun": self.strand.begun - len(self.strand.inside) + len(slices),
            "rows": {str(number): row for number, row in self._rows.items()},
            "closed": {str(number): age for number, age in self.strand.closed.items()},
            "left": [self._left.removed, self._left.gained], "before": self._before,
            "sizes": {name: file.size for name, file in self._files.items()},
        }  # fmt: skip
        if self._source is not None:
            meta["plant"] = [len(self._source), self._source.digest(len(self._source))]
        save_checkpoint(self._output / CHECKPOINT_NAME, meta, arrays, **self._physics)
        instants = self.strand.instants
        self._output.update(reached={"time": instants[max(self._index - 1, 0)]})
        self._saved, self.is_saved = time.monotonic(), True

    def _restore(self, meta: dict[str, Any], arrays: dict[str, Any]) -> None:
        strand = self.strand
        for number, description in meta["slices"].items():
            one = strand.enter(int(number))
            mine = f"{number}/"
            own = {k.removeprefix(mine): v for k, v in arrays.items() if k.startswith(mine)}
            one.loop.simulation.probes.conducts = one.loop.simulation.problem.curve
            restart.restore(one.run_state, description, own)
        strand.begun = meta["begun"]
        self._index = meta["index"]
        self._rows = {int(number): row for number, row in meta["rows"].items()}
        strand.closed = {int(number): age for number, age in meta["closed"].items()}
        self._left, self._before = Heat(*meta["left"]), meta["before"]

    def close(self) -> None:
        """Close the files and free the PETSc objects."""
        for file in self._files.values():
            file.close()
        self.strand.destroy()


def _length(one: Slice) -> float:
    length = one.run_state.sampler.metallurgical_length
    return math.nan if length is None else length


def _events(plant: Any, after: float, until: float) -> str:
    """What happened after an instant, up to another."""
    pairs = zip(plant.times, plant.events, strict=True)
    return "; ".join(event for at, event in pairs if event and after < at <= until)


class _Rows:
    """A row of a slice: the columns of its history, and the solid fraction in the centre."""

    def __init__(self, model: Simulation) -> None:
        self._model, self._columns = model, Columns(model)
        self.heading = list(self._columns.heading)
        self._adds = CENTRE not in dict(self.heading)
        if self._adds:
            self.heading.append((CENTRE, definition(CENTRE)[0].unit))

    def row(self, sample: Sample) -> dict[str, float]:
        """One row in its units."""
        found = self._columns.row(sample)
        if self._adds:
            centre = next(iter(sample.profiles.values())).temperature[-1]
            found[CENTRE] = float(np.asarray(self._model.steel.solid_fraction(centre)))
        return found


def _physics(case: Case, grows: bool = False) -> dict[str, str]:
    """What a checkpoint holds of the case: that of a slice, and what they are."""
    written = case.document()
    if grows:  # its rows are compared by themselves
        names = {name for name in written["caster"]["plant"] if name != EVENT}
        written["caster"] |= {"plant": sorted(names), "end": None}
    tables = {**case.physics(), "caster": written["caster"], "casting": written["casting"]}
    text = json.dumps(tables, sort_keys=True)
    return {"physics": hashlib.sha256(text.encode()).hexdigest()[:16], "case": text}


@one_at_a_time()
def run_caster(
    case: Case,
    folder: Path | str,
    *,
    comm: MPI.Intracomm | None = None,
    resume: bool = False,
    progress: Progress | None = None,
    save_every: float = SAVED_EVERY,
    source: PlantFile | None = None,
) -> None:
    """Run the caster of a case and write everything into `folder`.

    Args:
        case: With a table [caster].
        folder: Where the results go; see docs/caster.md.
        comm: Communicator, of one rank; all when None.
        resume: Go on from the checkpoint in `folder`; where there is none yet, begin.
        progress: Told of each slice that has come to an instant.
        save_every: Time between two checkpoints by the wall clock, s.
        source: The file that the plant of the case grows with, after its first row; the run follows
            it until it is stopped, or to the end that the case has.

    Raises:
        InputError: The case, the folder or the checkpoint cannot be used.
        RunFailure: A slice cannot go on; the last checkpoint is on disk.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    line = demand(case, len(build_mesh(case).points), comm.size)
    from castfem.runs.caster.following import first_looked_at, follow

    output, asked = OutputFolder(folder), case
    if source is not None:
        case = first_looked_at(case, source)
    text, files = portable(case, PROPERTIES_NAME)
    goes_on = output.begin(text, files=files, resume=resume)
    with output, ExitStack() as closed:
        log.to_file(output / "run.log", append=goes_on)
        if resume and not goes_on:
            log.logger.warning("%s: no checkpoint to go on from; the run begins anew", folder)
        log.logger.info("%s", line)
        begun = time.monotonic()
        caster = CasterRun(case, output, goes_on, save_every, source)
        closed.callback(caster.close)
        interrupt = Interrupt(MPI.COMM_SELF)
        with interrupt:
            if source is None:
                caster.go(interrupt, progress)
            else:
                follow(caster, asked, source, output, interrupt)
        watch = {"time loop": time.monotonic() - begun}
        output.finish(wall_time=watch, memory_mb=round(1e-6 * peak_memory(), 1))
