"""A run with derivatives: restrictions, execution, results."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

from castfem.base import log
from castfem.base.atomic_files import plain, write_json
from castfem.base.errors import InputError
from castfem.fem.rank_zero import on_root
from castfem.model import Case
from castfem.model.build.simulation import Simulation, build
from castfem.runs.interrupt import Interrupt, Stopped
from castfem.runs.loop import TimeLoop
from castfem.runs.output.folder import DERIVATIVES_NAME
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.followed_run import CHECKPOINT_NAME, Derivatives, Recorder, follow
from castfem.studies.sensitivity.readings import Readings, asked_quantities
from castfem.studies.sensitivity.result import REFUSED, Sensitivity

if TYPE_CHECKING:
    from castfem.base.progress import Progress


def refuse(case: Case) -> None:
    """Refuse a case whose run has parts that are not differentiated."""
    problems = list(_refused_mechanics(case)) if case.mechanics is not None else []
    start = case.casting.start
    if start is not None and (start.at == "mould_exit" or start.meniscus is not None):
        problems.append(
            "casting.start: the way before the run begins is not differentiated; "
            "start at the meniscus"
        )
    if problems:
        raise InputError([f"{case.title}: {problem}" for problem in problems])


def _refused_mechanics(case: Case) -> Iterator[str]:
    """Yield parts of a case other than a slice strained in its mould."""
    mechanics, coupling = case.mechanics, case.coupling
    assert mechanics is not None
    refused = {
        "machine": (case.machine is not None, "bending, rolls and drives are not differentiated"),
        "mechanics.strain": (mechanics.strain == "large", 'take strain = "small"'),
        "mechanics.bulging": (mechanics.bulging is not None, "bulging is not differentiated"),
        "mechanics.until": (
            case.mechanics_end() is not None, "let the mechanics continue, or end the run there"
        ),
        "coupling.order": (coupling.order != "thermal_first", 'take order = "thermal_first"'),
        "coupling.mechanical_step": (
            coupling.mechanical_step is not None, "leave it out: one step per window"
        ),
    }  # fmt: skip
    found = [f"{key}: {why}" for key, (is_there, why) in refused.items() if is_there]
    yield from found
    if found:
        yield (
            "without [mechanics] the temperatures have their derivatives (as billet125/thermal); "
            "else compare runs (castfem sweep)"
        )


def sensitivity(
    case: Case,
    of: Sequence[str],
    to: Sequence[str],
    *,
    folder: Path | None = None,
    resume: bool = False,
    comm: MPI.Comm | None = None,
    progress: Progress | None = None,
) -> Sensitivity:
    """Run a case and differentiate its results at the end by some parameters (collective).

    Args:
        case: The case.
        of: Names of results, several separated by commas; empty for the default ones.
        to: Parameters, as for `castfem.studies.sensitivity.parameters.read_parameters`.
        folder: Folder for checkpoints and results; None writes nothing.
        resume: Continue from the checkpoint in `folder`.
        comm: Ranks of the run; None for all.
        progress: Called after each step, on rank 0.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    refuse(case)
    with ExitStack() as freed:
        simulation = build(case, comm)
        freed.callback(simulation.destroy)
        asked = asked_quantities(simulation, of)
        derivatives = follow(simulation, to)
        freed.callback(derivatives.destroy)
        path = folder / CHECKPOINT_NAME if folder is not None else None
        readings = Readings(simulation, derivatives, asked)
        recorder = Recorder(simulation, derivatives, readings, path)
        run = _to_the_end(simulation, recorder, resume, progress)
        result = result_of(run, derivatives, readings)
        if folder is not None:
            on_root(comm, lambda: result.write(folder))
        return result


def result_of(run: RunState, derivatives: Derivatives, readings: Readings) -> Sensitivity:
    """Return the results of a run in its present state, with derivatives (collective)."""
    assert run.sample is not None
    simulation, counts, coupled = run.simulation, run.counts, derivatives.coupled
    values, found = readings.read(run.sample)
    return Sensitivity(
        simulation.case.title, run.position, values,
        tuple(v.parameter for v in derivatives.variations), tuple(found), counts.steps,
        () if coupled is None else tuple(coupled.mechanical.kinks), coupled is not None,
        counts.windows, counts.cut_for_error,
    )  # fmt: skip


def _to_the_end(
    simulation: Simulation, recorder: Recorder, resume: bool, progress: Progress | None
) -> RunState:
    """Advance the slice to the end of the followed length."""
    interrupt = Interrupt(simulation.section.comm)
    loop = TimeLoop(simulation, recorder, progress, interrupt, recorder.unsampled)
    if resume:
        recorder.resume(loop.run_state)
    if progress is not None:
        progress.start(simulation.case.casting.length, loop.run_state.position)
    with interrupt:  # until everything is saved, since the same signal may come twice
        try:
            loop.run()
        except Stopped:
            recorder.save(loop.run_state)
            raise
    recorder.save(loop.run_state)
    return loop.run_state


class Carried:
    """Computes derivatives during a run (`castfem.runs.loop.Companion`).

    Raises:
        InputError: Case, results or parameters cannot be used; the simulation is unchanged.
    """

    def __init__(
        self, simulation: Simulation, of: Sequence[str], to: Sequence[str], path: Path
    ) -> None:
        refuse(simulation.case)
        asked = asked_quantities(simulation, of)
        self._path, self._derivatives = path, follow(simulation, to)
        self._readings = Readings(simulation, self._derivatives, asked, errors=False)
        self._recorder = Recorder(simulation, self._derivatives, self._readings, None)

    def step(self, run: RunState, sample: Sample) -> None:
        """Process a committed step (collective)."""
        self._recorder.step(run, sample)

    def finish(self, run: RunState) -> None:
        """Write the derivatives (collective).

        Raises:
            RunFailure: They cannot be written.
        """
        content = plain(result_of(run, self._derivatives, self._readings).to_json())
        comm = run.simulation.section.comm
        on_root(comm, lambda: write_json(self._path, content))

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self._derivatives.destroy()


def carrying(
    of: Sequence[str], to: Sequence[str], folder: Path
) -> Callable[[Simulation], Carried | None]:
    """Return a function that lets a run compute derivatives, if it can.

    If it cannot, its log says why, and so does the file of the derivatives.
    """
    path = folder / DERIVATIVES_NAME

    def begin(simulation: Simulation) -> Carried | None:
        try:
            return Carried(simulation, of, to, path)
        except InputError as error:
            problems = error.problems
        comm = simulation.section.comm
        if comm.rank == 0:
            log.logger.warning("the run has no derivatives: %s", "; ".join(problems))
        on_root(comm, lambda: write_json(path, {REFUSED: problems}))
        return None

    return begin
