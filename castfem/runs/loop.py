"""The time loop from the meniscus to the end of the followed length, and the run around it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from mpi4py import MPI

from castfem.base import log
from castfem.base.constants import EXACT, same_instant, same_or_before
from castfem.base.errors import CastfemError, RunFailure
from castfem.base.process import one_at_a_time, reason_of
from castfem.base.shown_quantity import Quantity
from castfem.base.shown_units import below_meniscus
from castfem.base.stopwatch import peak_memory, profile_table
from castfem.fem import reductions
from castfem.fem.rank_zero import Together, on_root
from castfem.model.build.simulation import Simulation, build
from castfem.model.checks.mould_fit import wider
from castfem.model.load import portable
from castfem.physics.coupling.staggered import CouplingWindow
from castfem.physics.coupling.subcycling import SubSteps
from castfem.physics.coupling.windows import take_window
from castfem.runs import restart
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.output.folder import PROPERTIES_NAME, OutputFolder
from castfem.runs.recorder import Recorder
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.runs.results.summary import quantities, run_warnings, summarise

if TYPE_CHECKING:
    from castfem.base.progress import Progress
    from castfem.model import Case
    from castfem.physics.mechanics.state import MechanicalResult
    from castfem.runs.output.summary_file import Summary

Named = dict[str, Quantity]


class StepRecord(Protocol):
    """Processes the committed steps."""

    def step(self, run: RunState, sample: Sample) -> None:
        """Process one committed step (collective)."""


class Companion(StepRecord, Protocol):
    """Computes something else during a run, such as its derivatives."""

    def finish(self, run: RunState) -> None:
        """Write its results before the run is recorded as finished (collective)."""

    def destroy(self) -> None:
        """Free the PETSc objects."""


class _Both:
    """Passes each committed step to two records, one after the other."""

    def __init__(self, first: StepRecord, second: StepRecord) -> None:
        self._each = first, second

    def step(self, run: RunState, sample: Sample) -> None:
        """Process one committed step (collective)."""
        for one in self._each:
            one.step(run, sample)


class TimeLoop:
    """Advances a simulation from the meniscus to the end of the followed length.

    Args:
        simulation: The simulation to run.
        recorder: Writes the committed steps; None for a run in memory.
        progress: Called after each step; None for none.
        interrupt: Checked before each step.
        unsampled: Processes a committed step without sampling its results, and returns whether it
            did; None to sample each step.

    Attributes:
        run_state: State of the run.
    """

    def __init__(
        self,
        simulation: Simulation,
        recorder: StepRecord | None = None,
        progress: Progress | None = None,
        interrupt: Interrupt | None = None,
        unsampled: Callable[[RunState], bool] | None = None,
    ) -> None:
        self.simulation, self.recorder, self.progress = simulation, recorder, progress
        self.interrupt, self._unsampled = interrupt, unsampled
        self.run_state = RunState.at_start(simulation)
        self._released = False

    def run(self, until: float = math.inf) -> Sample:
        """Advance to the end of the followed length, or to a time before, s, where a step ends.

        Raises:
            RunFailure: A step cannot be saved; the committed state is unchanged.
        """
        run, control = self.run_state, self.simulation.control
        if run.sample is None:
            self._enter_zone()
            self._record(None, None)
        while run.state.time < min(control.end, until - EXACT * control.end):
            if self.interrupt is not None:
                self.interrupt.check()
            self._enter_zone()
            self.advance()
        assert run.sample is not None
        return run.sample

    def _enter_zone(self) -> None:
        """Change the cooling if the slice has entered the next zone."""
        run, simulation = self.run_state, self.simulation
        zone = simulation.zones.index(run.state.time)
        if zone != run.zone:
            simulation.problem.set_cooling(simulation.zones.cooling(zone))
            thermal = replace(run.state.thermal, cooling_changed=True)
            run.state = replace(run.state, thermal=thermal)
            run.zone = zone

    def advance(self) -> None:
        """Take one step, or with mechanics one coupling window; shorten it if needed; commit it.

        Raises:
            RunFailure: A step of the smallest size failed.
        """
        run, before = self.run_state, self._iterations()
        counts = run.counts
        try:
            found, failed = self._attempt()
        except RunFailure as error:
            raise RunFailure(f"{self._whereabouts()}: {error}{self._open_mould()}") from None
        after = self._iterations()
        counts.newton += after[0] - before[0]
        counts.newton_mechanics += after[1] - before[1]
        if isinstance(found, CouplingWindow):
            substeps, result, run.state = found.substeps, found.mechanical, found.state
            counts.windows += 1
            counts.cut_back += failed
            counts.cut_for_error += found.cut_for_error
            counts.coupling_iterations += found.iterations
            counts.gap_not_converged += not found.gap_converged
        else:
            substeps, result = found, None
            run.state = replace(run.state, thermal=substeps.state, step=substeps.length)
            counts.alone += 1
        counts.steps += substeps.steps
        counts.rejected += substeps.rejected
        counts.limited += substeps.limited
        self._record(substeps, result)

    def _attempt(self) -> tuple[SubSteps | CouplingWindow, int]:
        """Return an accepted thermal step or coupling window, and the number rejected."""
        simulation, state = self.simulation, self.run_state.state
        if simulation.coupling is None or self._released:
            return simulation.steps.one(state.thermal, state.step), 0
        if same_or_before(simulation.mechanics_end, state.time):
            found = simulation.steps.one(simulation.coupling.release(state), state.step)
            self._released = True
            return found, 0
        return take_window(simulation.coupling, state, simulation.control)

    def _iterations(self) -> tuple[int, int]:
        """Newton iterations of this process, thermal and mechanical."""
        mechanics = self.simulation.mechanics
        return self.simulation.problem.iterations, mechanics.problem.iterations if mechanics else 0

    def _open_mould(self) -> str:
        """Return where liquid has lost the wall, which no step, however short, can solve."""
        case = self.simulation.case
        if case.mechanics is None or case.mould is None:
            return ""
        return next((f"; mould.{key}: {what}" for key, what in wider(case, case.mould)), "")

    def _whereabouts(self) -> str:
        run = self.run_state
        return f"{below_meniscus(run.position)} ({run.state.time:.4g} s)"

    def _record(self, substeps: SubSteps | None, mechanical: MechanicalResult | None) -> None:
        run = self.run_state
        if self._unsampled is not None and self._unsampled(run):
            self._tell(substeps, mechanical)
            return
        with self.simulation.watch.section("results"):
            sample = run.take_sample(substeps, mechanical)
            self._keep_snapshot(sample)
        if self.recorder is not None:
            with self.simulation.watch.section("output"):
                self.recorder.step(run, sample)
        run.remember()
        self._tell(substeps, mechanical)

    def _tell(self, substeps: SubSteps | None, mechanical: MechanicalResult | None) -> None:
        """Log a committed step."""
        run = self.run_state
        if self.progress is not None:
            newton = sum(step.newton for step in (substeps, mechanical) if step is not None)
            length = 0.0 if substeps is None else substeps.step
            note = self.simulation.zones.name(run.zone)
            self.progress.update(run.position, run.state.time, newton, length, note)

    def _keep_snapshot(self, sample: Sample) -> None:
        case, machine = self.simulation.case, self.simulation.machine
        # The end included: a run that continues from there has its number at a station.
        for position in {r.at for r in case.reference if r.at is not None}:
            # A stopped strand passes a position more than once: the first time counts.
            if same_instant(sample.time, machine.time_at(position), self.simulation.control.end):
                self.run_state.snapshots[position] = quantities(sample)


def begin_folder(case: Case, output: OutputFolder, comm: MPI.Comm, resume: bool) -> bool:
    """Begin the folder of a run and its log (collective).

    Returns:
        Whether there is a checkpoint to continue from.

    Raises:
        InputError: The folder cannot be used.
    """

    def begin() -> bool:
        text, files = portable(case, PROPERTIES_NAME)
        goes_on = output.begin(text, files=files, ranks=comm.size, resume=resume)
        log.to_file(output / "run.log", append=goes_on)
        if resume and not goes_on:
            log.logger.warning(
                "%s: no checkpoint to continue from; the run starts again", output.path
            )
        return goes_on

    return bool(comm.bcast(on_root(comm, begin)))


@one_at_a_time()
def run(
    case: Case,
    folder: Path | str,
    *,
    comm: MPI.Comm | None = None,
    resume: bool = False,
    profile: bool = False,
    progress: Progress | None = None,
    beside: Callable[[Simulation], Companion | None] | None = None,
) -> Summary:
    """Run `case` and write everything into `folder` (collective).

    Args:
        case: The case.
        folder: Output folder; see docs/output.md.
        comm: Communicator; None for all ranks.
        resume: Continue from the checkpoint in `folder`; start from the beginning if there is none.
        profile: Log where the time was spent.
        progress: Called after each step, on rank 0.
        beside: Makes a companion of the built run, such as one for its derivatives; not for a
            resumed run.

    Returns:
        The summary, on every rank.

    Raises:
        InputError: The case, the folder or the checkpoint cannot be used.
        RunFailure: The run failed; the last good state is on disk. This also holds for any other
            error of a run on one rank. An error on one of several ranks ends all: it is reported on
            stderr, and the last checkpoint is on disk.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    output = OutputFolder(folder)
    resume = begin_folder(case, output, comm, resume)
    # In reverse order: failing ranks meet before shared objects are freed.
    together = Together(
        comm, (RunFailure, Stopped), lambda error: output.fail(reason_to_end(error))
    )
    with output, ExitStack() as freed, together:
        simulation = build(case, comm)
        freed.callback(simulation.destroy)
        _tell_of_idle_ranks(simulation)
        companion = None if beside is None or resume else beside(simulation)
        if companion is not None:
            freed.callback(companion.destroy)
        recorder = Recorder(simulation, output, resume)
        freed.callback(recorder.close)
        return _run(simulation, output, recorder, companion, together, profile, progress)


def _tell_of_idle_ranks(simulation: Simulation) -> None:
    """Warn that fewer than 1000 vertices per rank take longer than on one rank (collective)."""
    comm = simulation.section.comm
    each = reductions.total(comm, simulation.section.owned) / comm.size
    if comm.size > 1 and each < 1000 and comm.rank == 0:
        log.logger.info(
            "%.0f vertices on each of %d ranks: this is slower than one rank, because they "
            "wait for each other (docs/benchmarks.md); castfem sweep makes several runs at once",
            each, comm.size,
        )  # fmt: skip


def _run(
    simulation: Simulation,
    output: OutputFolder,
    recorder: Recorder,
    companion: Companion | None,
    together: Together,
    profile: bool,
    progress: Progress | None,
) -> Summary:
    """Run a built simulation whose files are open."""
    comm, watch = simulation.section.comm, simulation.watch
    interrupt = Interrupt(comm)
    records = recorder if companion is None else _Both(recorder, companion)
    loop = TimeLoop(simulation, records, progress, interrupt)
    run_state = loop.run_state
    recorder.begin_maps(run_state)
    recorder.begin_followed(run_state)
    if recorder.checkpoint is not None:
        restart.restore(run_state, *recorder.checkpoint)
    if progress is not None:
        progress.start(simulation.case.casting.length, run_state.position)
    with interrupt:  # until everything is saved, since the same signal may come twice
        try:
            with watch.section("time loop"):
                loop.run()
            if companion is not None:
                companion.finish(run_state)
        except BaseException as error:
            # Saving needs all ranks. They raise failures and stops together; after any other error
            # they may be at different places, so that the last checkpoint must do.
            if together.meet(error):
                _leave(run_state, recorder, output, error)
            raise
    recorder.close()
    if simulation.case.output.steps_to_checkpoint:
        recorder.save(run_state)
    if profile and comm.rank == 0:
        log.logger.info("%s", profile_table(watch))
    summary = _finish(run_state, output, "finished")
    if comm.rank == 0:
        for line in summary.warnings:
            log.logger.warning("%s", line)
    return summary


def _leave(run: RunState, recorder: Recorder, output: OutputFolder, error: BaseException) -> None:
    """Save the last good state after `error`, which must not be hidden here (collective)."""
    try:
        if run.fall_back():
            recorder.save(run)
        stopped = isinstance(error, KeyboardInterrupt)
        _finish(run, output, "interrupted" if stopped else "failed", reason_to_end(error))
    except Exception as other:
        if str(other) != str(error):  # such as a full disk, which ends the run and is reported then
            log.logger.warning("the state could not be saved: %s", other)


def reason_to_end(error: BaseException) -> str:
    """Reason why a run ended, as one line for run.json."""
    if isinstance(error, CastfemError):
        return str(error)
    if isinstance(error, KeyboardInterrupt):
        return reason_of(error)
    return f"unexpected {type(error).__name__}: {error}"


def _finish(run: RunState, output: OutputFolder, status: str, reason: str = "") -> Summary:
    """Write summary and run record; the summary is the same on every rank."""
    comm = run.simulation.section.comm
    summary = summarise(run, status)
    if status == "finished":
        found = run_warnings(summary, run.simulation.case, run.sampler.warmed)
        summary = replace(summary, warnings=tuple(found))
    memory = reductions.total(comm, peak_memory())

    def write() -> None:
        output.write_summary(summary)
        facts = {
            "wall_time": dict(run.simulation.watch.seconds),
            "compiled_forms": tuple(run.simulation.section.compiled),
            "memory_mb": round(memory / 1e6, 1),
            "reached": run.reached,
        }
        if status == "finished":
            output.finish(**facts)
        elif status == "interrupted":
            output.interrupt(reason, **facts)
        else:
            output.fail(reason, **facts)

    on_root(comm, write)
    return summary
