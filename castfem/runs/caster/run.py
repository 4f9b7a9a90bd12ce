"""A run of a caster: its time loop, its files and its checkpoint."""

from __future__ import annotations

import hashlib
import json
import math
import time
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from mpi4py import MPI

from castfem.base import log
from castfem.base.errors import InputError, RunFailure
from castfem.base.process import one_at_a_time
from castfem.base.progress import Progress, clock
from castfem.base.stopwatch import peak_memory
from castfem.base.types import Array
from castfem.fem.rank_zero import Together, on_root
from castfem.model.build.simulation import build_mesh
from castfem.model.caster import EVENT
from castfem.runs.caster import pyrometers
from castfem.runs.caster.demand import demand
from castfem.runs.caster.files import GrowingTable, Row, SliceRows
from castfem.runs.caster.look import Look, events_between, heat_of, pool_end
from castfem.runs.caster.moments import Moments
from castfem.runs.caster.strand import Slice, Strand
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.loop import begin_folder, reason_to_end
from castfem.runs.output.checkpoint import CHECKPOINT_NAME, load_checkpoint, save_checkpoint
from castfem.runs.output.folder import (
    CASTER_NAME,
    PYROMETERS_NAME,
    SLICES_NAME,
    STRAND_ROWS_NAME,
    OutputFolder,
)

if TYPE_CHECKING:
    from castfem.model import Case
    from castfem.runs.caster.plant_file import PlantFile

T = TypeVar("T")

HEADING = [
    ("time", "s"), ("speed", "m/min"), ("superheat", "K"), ("slices", "-"),
    ("metallurgical_length", "m"), ("cooling_power", "kW"), ("energy_error", "-"), ("event", ""),
]  # fmt: skip
"""Columns of caster.csv, one row per output time; times are clock times."""
SAVED_EVERY = 30.0
"""Shortest time between two checkpoints, s of wall-clock time."""


class CasterRun:
    """Advances a strand from one output time to the next and writes its files (all collective).

    Args:
        case: A valid case with a table [caster].
        output: Its output folder, begun.
        comm: Ranks that share the slices; rank 0 writes the files.
        goes_on: Whether to continue from the checkpoint in the folder.
        save_every: Wall-clock time between two checkpoints, s.
        source: The growing file of the plant record; None for a complete record.

    Attributes:
        latest: The rows of the last output time and of its slices; None before the first.
        is_saved: Whether the checkpoint contains the last output time.
    """

    def __init__(
        self,
        case: Case,
        output: OutputFolder,
        comm: MPI.Comm,
        goes_on: bool,
        save_every: float = SAVED_EVERY,
        source: PlantFile | None = None,
    ) -> None:
        assert case.caster is not None
        self._case, self._output, self._every, self._comm = case, output, save_every, comm
        self._asked, self._source, self.is_saved = case.caster, source, goes_on
        self.latest: tuple[Row, list[Row]] | None = None
        self._physics = _physics(case, grows=source is not None)
        self.strand = Strand(case, comm.rank, comm.size)
        self._columns = SliceRows(self.strand.model)
        self._moments = Moments(case, self.strand.model, output.path)
        self._index = self._gone = 0
        self._looks: dict[int, Look] = {}  # those of this rank at the current output time
        self._closed: dict[int, float] = {}
        self._left, self._before = (0.0, 0.0), math.nan
        # sizes of the files at the last output time
        self._sizes = self._restore() if goes_on else {}
        self._files: dict[str, GrowingTable] = {}
        on_root(comm, lambda: self._open(self._sizes))
        self._saved = self._begun = time.monotonic()
        self._done = 0.0  # s, summed over all slices

    def _open(self, sizes: dict[str, int]) -> None:
        own = self._columns.heading
        slices = [("slice", "-"), ("start", "s"), ("left", "s"), ("metallurgical_length", "m")]
        for name, heading in (
            (CASTER_NAME, HEADING),
            (STRAND_ROWS_NAME, self.heading),
            (SLICES_NAME, [*slices, *own]),
            *([(PYROMETERS_NAME, pyrometers.HEADING)] if self._asked.pyrometer else []),
        ):
            self._files[name] = GrowingTable(self._output / name, heading, sizes.get(name))
        self._sizes = {name: file.size for name, file in self._files.items()}

    @property
    def heading(self) -> list[tuple[str, str]]:
        """Name and unit of the columns of the strand at an output time."""
        return [("clock", "s"), ("slice", "-"), *self._columns.heading]

    def grow(self, case: Case) -> None:
        """Continue with a longer plant record that begins with the previous one."""
        self.strand.grow(case)
        assert case.caster is not None
        self._case, self._moments.asked = case, case.caster.moments

    def go(self, interrupt: Interrupt, progress: Progress | None) -> None:
        """Advance through all remaining output times, and save.

        Raises:
            RunFailure: A slice failed.
            Stopped: The run was stopped; everything is saved.
        """
        work = self.strand.work
        ages = self._comm.allreduce(sum(one.age for one in self.strand.inside))
        self._done = sum(work[: self._gone]) + ages
        if progress is not None:
            progress.start(sum(work), self._done)
        self.advance(interrupt, progress)
        self.save()

    def advance(self, interrupt: Interrupt, progress: Progress | None) -> None:
        """Advance through all remaining output times; see `go`."""
        try:
            while self._index < len(self.strand.instants):
                now = self.strand.instants[self._index]
                self._advance(now, interrupt, progress)
                self._look_at(now)
                self._index += 1
        except (Stopped, RunFailure):  # within a slice, between two of its steps
            self.save()
            raise

    def _advance(self, now: float, interrupt: Interrupt, progress: Progress | None) -> None:
        """Advance all slices to an output time; the ranks meet after each slice."""
        waiting = self.strand.waiting(now, self._looks)
        counts = self._comm.allgather((len(waiting), len(self.strand.inside)))
        for i in range(max(count for count, _ in counts)):
            report, ended = None, None
            try:
                if i < len(waiting):
                    report = self._take(waiting[i], now, interrupt)
                interrupt.check()
            except (Stopped, RunFailure) as error:
                ended = error
            due = time.monotonic() - self._saved >= self._every
            of_ranks = self._comm.allgather((report, ended, due))
            for report, _, _ in of_ranks:
                if report is not None:
                    self._report(*report, now, sum(inside for _, inside in counts), progress)
            for _, ended, _ in of_ranks:
                if ended is not None:
                    raise ended
            if of_ranks[0][-1]:  # the clock of rank 0 counts for all
                self.save()

    def _take(self, one: Slice, now: float, interrupt: Interrupt) -> tuple[int, float]:
        """Advance a slice to an output time; return its number, and the simulated time, s."""
        before = one.age
        self._looks[one.number] = self.strand.take(one, now, self._columns.row, interrupt)
        return one.number, one.age - before

    def _report(
        self, number: int, passed: float, now: float, inside: int, progress: Progress | None
    ) -> None:
        """Report that a slice has reached an output time; for the first also the time."""
        work = self.strand.work
        if not self._done and passed > 0.0:
            taken = time.monotonic() - self._begun
            left = taken / passed * sum(work) / min(self._comm.size, inside)
            log.logger.info(
                "%.0f s of a slice take %s; all take about %s", passed, clock(taken), clock(left)
            )
        self._done += passed
        if progress is not None:
            note = f"slice {number}, {inside} at once"
            progress.update(self._done, now, 0, passed, note)

    def _look_at(self, now: float) -> None:
        """Collect the state of the strand at an output time; release slices that left."""
        found = self._comm.gather(self._looks)
        before = self.strand.instants[self._index - 1] if self._index else -math.inf
        poured = self.strand.poured(now)
        self._moments.look(now, before, self.strand.inside, poured, self._comm)
        on_root(self._comm, lambda: self._write(now, _merged(found)))
        self._gone += self._comm.allreduce(sum(one.has_left for one in self._looks.values()))
        self._looks = {}
        self.strand.release(now)

    def _write(self, now: float, looks: dict[int, Look]) -> None:
        """Write the strand at an output time (rank 0); after a failure the previous one is kept."""
        strand, caster = self.strand, self._case.caster
        assert caster is not None
        ended = [one for one in looks.values() if one.has_left]
        inside = [one for one in looks.values() if not one.has_left]
        self._closed |= {one.number: one.closed for one in looks.values()}
        pool = pool_end(
            inside, self._closed, strand.cast, now, self._case.casting.length,
            has_head=caster.cast_from is not None,
        )  # fmt: skip
        lowest = inside[0].number if inside else max(self._closed, default=0) + 1
        self._closed = {n: age for n, age in self._closed.items() if n >= lowest - 1}
        left = heat_of(self._left, ended)
        removed, gained = heat_of(left, inside)
        self._files[SLICES_NAME].append(
            {
                "slice": one.number, "start": one.start, "left": one.start + one.lasts,
                **one.row, "metallurgical_length": one.solid,
            }
            for one in ended
        )  # fmt: skip
        rows: list[Row] = [{"clock": now, "slice": o.number, **o.row} for o in inside[::-1]]
        self._files[STRAND_ROWS_NAME].append(rows)
        apart = caster.every if self._index else math.nan
        plant = {name: float(caster.plant.table(name)(now)) for name in caster.plant.values}
        superheat = plant.get("superheat", strand.base.casting.poured_superheat)
        row: dict[str, float | str] = {
            "time": now, "speed": 60.0 * plant["speed"], "slices": len(inside),
            "superheat": math.nan if superheat is None else superheat,
            "metallurgical_length": pool,
            "cooling_power": 1e-3 * (removed - self._before) / apart,
            "energy_error": (removed + gained) / max(abs(removed), 1e-300),
            "event": events_between(caster.plant, now - (apart if self._index else math.inf), now),
        }  # fmt: skip
        self._files[CASTER_NAME].append([row])
        if self._asked.pyrometer:
            seen = pyrometers.rows(caster, list(looks.values()))
            self._files[PYROMETERS_NAME].append(seen)
        self.latest, self.is_saved = (row, rows), False
        self._left, self._before = left, removed
        self._sizes = {name: file.size for name, file in self._files.items()}

    def save(self) -> None:
        """Replace the checkpoint by the present state; resuming cuts off later rows."""
        slices: dict[int, tuple[dict[str, Any], dict[str, Array]]] = {}
        for one in self.strand.inside:
            if (state := one.state()) is not None:
                passed = [] if one.passing is None else one.passing.passed
                slices[one.number] = {**state[0], "passed": passed}, state[1]
        found, looks = self._comm.gather(slices), self._comm.gather(self._looks)
        on_root(self._comm, lambda: self._save(_merged(found), _merged(looks)))
        self._saved, self.is_saved = time.monotonic(), True

    def _save(
        self,
        slices: dict[int, tuple[dict[str, Any], dict[str, Array]]],
        looks: dict[int, Look],
    ) -> None:
        """Save a checkpoint and record how far the run has come (rank 0)."""
        for file in self._files.values():
            file.sync()
        meta = {
            "index": self._index, "gone": self._gone,
            "slices": {str(number): described for number, (described, _) in slices.items()},
            "looks": [asdict(one) for one in looks.values()],
            "closed": {str(number): age for number, age in self._closed.items()},
            "left": self._left, "before": self._before,
            "sizes": self._sizes,
        }  # fmt: skip
        arrays = {
            f"{number}/{name}": values
            for number, (_, own) in slices.items()
            for name, values in own.items()
        }
        if self._source is not None:
            meta["plant"] = [len(self._source), self._source.digest(len(self._source))]
        save_checkpoint(self._output / CHECKPOINT_NAME, meta, arrays, **self._physics)
        instants = self.strand.instants
        self._output.update(reached={"time": instants[max(self._index - 1, 0)]})

    def _restore(self) -> dict[str, int]:
        """Continue from the checkpoint, each rank with its slices; return file sizes then."""
        path, comm, strand = self._output / CHECKPOINT_NAME, self._comm, self.strand
        loaded = on_root(comm, lambda: load_checkpoint(path, **self._physics))
        meta, arrays = loaded if loaded is not None else ({}, {})
        meta = comm.bcast(meta)
        if "looks" not in meta:
            raise InputError(
                f"{path}: was written by an earlier castfem; start again (--overwrite)"
            )
        if self._source is not None:
            self._source.expect(*meta["plant"])
        self._index, self._gone = meta["index"], meta["gone"]
        self._closed = {int(number): age for number, age in meta["closed"].items()}
        self._left, self._before = tuple(meta["left"]), meta["before"]
        looks = [Look(**one) for one in meta["looks"]]
        self._looks = {one.number: one for one in looks if strand.holds(one.number)}
        strand.pass_by(self._gone)
        by_slice: dict[int, dict[str, Array]] = {}
        for name, values in arrays.items():
            number, _, own = name.partition("/")
            by_slice.setdefault(int(number), {})[own] = values
        parts = [
            {n: own for n, own in by_slice.items() if (n - 1) % comm.size == rank}
            for rank in range(comm.size)
        ]
        mine: dict[int, dict[str, Array]] = comm.scatter(parts)
        for own_number, kept in sorted(mine.items()):
            one = strand.enter(own_number)
            described = meta["slices"][str(own_number)]
            one.restore(described, kept)
            one.watch(self._asked.pyrometer, described["passed"])
        sizes: dict[str, int] = meta["sizes"]
        return sizes

    def close(self) -> None:
        """Close the files and free the PETSc objects."""
        for file in self._files.values():
            file.close()
        self.strand.destroy()


def _merged(parts: list[dict[int, T]] | None) -> dict[int, T]:
    """Merge what the ranks have sent, by number of the slice (rank 0; empty elsewhere)."""
    found = {number: one for part in parts or () for number, one in part.items()}
    return dict(sorted(found.items()))


def _physics(case: Case, grows: bool = False) -> dict[str, str]:
    """The case as stored in a checkpoint: that of a slice, and all slices."""
    written = case.document()
    if grows:  # the rows are compared separately
        names = {name for name in written["caster"]["plant"] if name != EVENT}
        written["caster"] |= {"plant": sorted(names), "end": None}
    for name in ("moments", "cut"):
        written["caster"].pop(name, None)
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
    """Run the caster of a case and write everything into `folder` (collective).

    Args:
        case: A case with a table [caster].
        folder: Output folder; see docs/caster.md.
        comm: Ranks that share the slices; None for all.
        resume: Continue from the checkpoint in `folder`, which any number of ranks may have
            written; start again if there is none.
        progress: Called on rank 0 when a slice has reached an output time.
        save_every: Wall-clock time between two checkpoints, s.
        source: File to which the plant record of the case, after its first row, is being added; the
            run follows it until it is stopped or the case ends; on one rank.

    Raises:
        InputError: The case, the folder or the checkpoint cannot be used.
        RunFailure: A slice failed; the last checkpoint is on disk.
    """
    from castfem.runs.caster.following import first_looked_at, follow

    comm, asked = MPI.COMM_WORLD if comm is None else comm, case
    if source is not None:
        case = first_looked_at(case, source, comm.size)
    line = comm.bcast(on_root(comm, lambda: demand(case, build_mesh(case).vertices, comm.size)))
    output = OutputFolder(folder)
    goes_on = begin_folder(case, output, comm, resume)
    together = Together(comm, (RunFailure, Stopped), lambda e: output.fail(reason_to_end(e)))
    with output, ExitStack() as closed, together:
        log.logger.info("%s", line)
        begun = time.monotonic()
        caster = CasterRun(case, output, comm, goes_on, save_every, source)
        closed.callback(caster.close)
        interrupt = Interrupt(MPI.COMM_SELF)
        with interrupt:
            if source is None:
                caster.go(interrupt, progress)
            else:
                follow(caster, asked, source, output, interrupt)
        watch = {"time loop": time.monotonic() - begun}
        memory = comm.allreduce(peak_memory())
        on_root(comm, lambda: output.finish(wall_time=watch, memory_mb=round(1e-6 * memory, 1)))
