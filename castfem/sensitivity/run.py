"""A run that carries derivatives along: what it refuses, its steps, its checkpoint."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np

from castfem.case import Case
from castfem.coupling.step_control import StepControl
from castfem.coupling.subcycling import MechanicalSteps, Moment, ThermalSteps
from castfem.errors import InputError
from castfem.fem.root import on_root
from castfem.output.checkpoint import load_checkpoint, save_checkpoint
from castfem.results.run_state import RunState
from castfem.results.sample import Sample
from castfem.sensitivity.parameters import read_parameters
from castfem.sensitivity.readings import Readings, asked_quantities
from castfem.sensitivity.result import Kink, Sensitivity
from castfem.sensitivity.thermal import ThermalDerivatives
from castfem.sensitivity.varied import Variation, vary
from castfem.simulation.simulation import Simulation, build
from castfem.support.atomic_files import saving
from castfem.thermal.stepper import StepResult, ThermalState, ThermalStepper
from castfem.time_loop import restart
from castfem.time_loop.interrupt import Interrupt, Stopped
from castfem.time_loop.loop import TimeLoop
from castfem.values.types import Array

if TYPE_CHECKING:
    from castfem.coupling.staggered import StaggeredCoupling, StrandState
    from castfem.mechanics.state import MechanicalResult, MechanicalState
    from castfem.sensitivity.coupled import FollowedCoupling
    from castfem.sensitivity.mechanical import MechanicalDerivatives
    from castfem.sensitivity.restart import CoupledCheckpoint
    from castfem.support.progress import Progress

CHECKPOINT_NAME = "sensitivity.checkpoint.h5"
_SAVED = ("enthalpy", "rate")


class FollowedSteps(ThermalSteps):
    """Thermal steps, each followed by the derivatives.

    Args:
        stepper: Takes one step. control: Chooses its length and learns.
        derivatives: Carried through each step that is kept.
    """

    def __init__(
        self, stepper: ThermalStepper, control: StepControl, derivatives: ThermalDerivatives
    ) -> None:
        super().__init__(stepper, control)
        self._derivatives = derivatives

    def kept(self, old: ThermalState, result: StepResult) -> None:
        """Carry the derivatives through a step."""
        self._derivatives.step(old, result)


class FollowedMechanics(MechanicalSteps):
    """Mechanical steps, each followed by the derivatives.

    Args:
        steps: That are followed.
        thermal: Derivatives of the temperatures. mechanical: Of the slice.
    """

    def __init__(
        self, steps: MechanicalSteps, thermal: ThermalDerivatives, mechanical: MechanicalDerivatives
    ) -> None:
        super().__init__(steps.stepper, steps.longest)
        self._thermal, self.mechanical = thermal, mechanical
        self._before: list[Array] = []

    def mark(self, state: ThermalState) -> None:
        """Keep the derivatives of a committed state."""
        self.mechanical.mark()
        self._before = self._warming(state)

    def _warming(self, state: ThermalState) -> list[Array]:
        return [self._thermal.warming(i, state) for i in range(len(self._thermal.variations))]

    def through(self, old: MechanicalState, moments: Sequence[Moment]) -> MechanicalResult:
        """Carry the derivatives through the step of a window."""
        result = super().through(old, moments)
        if result.converged:
            assert self._thermal.reached is not None, "temperatures go first"
            after = self._warming(self._thermal.reached)
            self.mechanical.step(old, result.state, self._before, after)
        return result


def followed(coupling: StaggeredCoupling) -> FollowedCoupling:
    """The coupling as `follow` has made it."""
    from castfem.sensitivity.coupled import FollowedCoupling

    assert isinstance(coupling, FollowedCoupling)
    return coupling


def mark_coupled(coupling: FollowedCoupling, state: StrandState) -> None:
    """Keep the derivatives of a committed state, after those of its temperatures (collective)."""
    assert isinstance(coupling.mechanics, FollowedMechanics)
    coupling.mechanics.mark(state.thermal)
    coupling.mark(state)


def refuse(case: Case) -> None:
    """Refuse a case whose run has parts that are not differentiated.

    Raises:
        InputError: Naming each, and what to do instead.
    """
    problems = list(_refused_mechanics(case)) if case.mechanics is not None else []
    start = case.casting.start
    if start is not None and (start.at == "mould_exit" or start.meniscus is not None):
        problems.append(
            "casting.start: what the slice passes before the run begins is not differentiated; "
            "let it begin at the meniscus"
        )
    if problems:
        raise InputError([f"{case.title}: {problem}" for problem in problems])


def _refused_mechanics(case: Case) -> Iterator[str]:
    """Yield what a case has beside a slice that is strained in its mould."""
    mechanics, coupling = case.mechanics, case.coupling
    assert mechanics is not None
    refused = {
        "machine": (case.machine is not None, "bending, rolls and drives are not differentiated"),
        "mechanics.strain": (mechanics.strain == "large", 'take strain = "small"'),
        "mechanics.bulging": (mechanics.bulging is not None, "bulging is not differentiated"),
        "coupling.order": (coupling.order != "thermal_first", 'take order = "thermal_first"'),
        "coupling.mechanical_step": (
            coupling.mechanical_step is not None, "leave it out: one step a window"
        ),
    }  # fmt: skip
    found = [f"{key}: {why}" for key, (is_there, why) in refused.items() if is_there]
    yield from found
    if found:
        yield (
            "without [mechanics] the temperatures have their derivatives (as billet125/thermal); "
            "else compare runs (castfem sweep)"
        )


class Recorder:
    """Follows the committed steps: for results that hang on the way, and for checkpoints.

    Args:
        simulation: The run.
        derivatives: Its derivatives.
        readings: Reads results.
        path: Of the checkpoint; None for a run in memory.
    """

    def __init__(
        self,
        simulation: Simulation,
        derivatives: ThermalDerivatives,
        readings: Readings,
        path: Path | None,
    ) -> None:
        self.simulation, self.derivatives, self.readings = simulation, derivatives, readings
        self.path, self._every = path, simulation.case.output.checkpoint_every

    def step(self, run: RunState, sample: Sample) -> None:
        """Take in one committed step, and save a checkpoint in turn (collective)."""
        thermal, coupling = run.state.thermal, self.simulation.coupling
        self.derivatives.mark(thermal)
        if coupling is not None:
            mark_coupled(followed(coupling), run.state)
        self.readings.follow(sample)
        if self.path is not None and self._every and run.counts.taken % self._every == 0:
            self.save(run)

    def _parameters(self) -> list[list[Any]]:
        found = [v.parameter for v in self.derivatives.variations]
        return [[p.name, p.value, p.unit, p.step] for p in found]

    def save(self, run: RunState) -> None:
        """Save state and derivatives (collective)."""
        gather, slopes = self.simulation.section.gather, self.derivatives
        meta = restart.description(run) | {
            "parameters": self._parameters(),
            "removed_by": list(slopes.removed),
            "readings": self.readings.memory(),
        }
        arrays: dict[str, Array | None] = dict(restart.arrays(run))
        if (coupled := self._coupled(run)) is not None:
            assert run.state.mechanical is not None
            meta["coupled"] = coupled.description(run.state.mechanical)
            arrays |= coupled.arrays(run.state.mechanical)
        for name in _SAVED:
            for number, owned in enumerate(getattr(slopes, name)):
                arrays[f"{name}_by_{number}"] = gather(owned)
        kept = {name: values for name, values in arrays.items() if values is not None}
        case, path = self.simulation.case, self.path

        def write() -> None:
            assert path is not None
            with saving(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            save_checkpoint(path, meta, kept, physics=case.physics_hash(), case=case.physics())

        on_root(self.simulation.section.comm, write)

    def resume(self, run: RunState) -> None:
        """Go on from the checkpoint (collective).

        Raises:
            InputError: There is none, or it is of another case or of other parameters, or an
                earlier castfem wrote it with fewer derivatives.
        """
        case, comm, path = self.simulation.case, self.simulation.section.comm, self.path
        assert path is not None
        read = on_root(
            comm, lambda: load_checkpoint(path, physics=case.physics_hash(), case=case.physics())
        )
        meta, by_node = comm.bcast(read)
        if meta["parameters"] != self._parameters():
            names = ", ".join(name for name, *_ in meta["parameters"])
            raise InputError(
                f"{path}: carries derivatives by {names}; ask for these, or run without --resume"
            )
        if meta["readings"]["results"] != list(self.readings.asked):
            names = ",".join(meta["readings"]["results"])
            raise InputError(f"{path}: follows {names}; ask for these, or run without --resume")
        restart.restore(run, meta, by_node)
        nodes = self.simulation.section.node_of_owned
        count = len(self.derivatives.variations)
        slopes = [
            np.array([np.asarray(by_node[f"{name}_by_{i}"])[nodes] for i in range(count)])
            for name in _SAVED
        ]
        self.derivatives.restore(slopes[0], slopes[1], np.array(meta["removed_by"]))
        self.readings.recall(meta["readings"])
        coupling, coupled = self.simulation.coupling, self._coupled(run)
        if coupling is not None and coupled is not None:
            assert run.state.mechanical is not None
            if not coupled.is_whole(meta["coupled"]):
                raise InputError(
                    f"{path}: an earlier castfem wrote it, without the derivatives of the rates; "
                    "run without --resume"
                )
            coupled.restore(meta["coupled"], by_node, run.state.mechanical)
            self.derivatives.mark(run.state.thermal)
            mark_coupled(followed(coupling), run.state)
            coupled.recall_kinks(meta["coupled"])

    def _coupled(self, run: RunState) -> CoupledCheckpoint | None:
        """For the derivatives of the slice; None of a run without."""
        if self.simulation.coupling is None:
            return None
        from castfem.sensitivity.restart import CoupledCheckpoint

        coupling = followed(self.simulation.coupling)
        assert isinstance(coupling.mechanics, FollowedMechanics)
        return CoupledCheckpoint(coupling, coupling.mechanics.mechanical, run)


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
        case: What to run.
        of: Names of results, several with commas between them; empty for the usual ones.
        to: Parameters, `castfem.sensitivity.parameters.read_parameters`.
        folder: For checkpoints and results; None writes nothing.
        resume: Go on from the checkpoint in `folder`.
        comm: Ranks of the run; all when None.
        progress: Told after each step; on rank 0.

    Raises:
        InputError: Case, results or parameters cannot be used.
        RunFailure: The run cannot go on.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    refuse(case)
    with ExitStack() as freed:
        simulation = build(case, comm)
        freed.callback(simulation.destroy)
        asked = asked_quantities(simulation, of)
        derivatives = follow(simulation, to)
        freed.callback(derivatives.destroy)
        if simulation.coupling is not None:
            freed.callback(followed(simulation.coupling).destroy)
        path = folder / CHECKPOINT_NAME if folder is not None else None
        readings = Readings(simulation, derivatives, asked)
        recorder = Recorder(simulation, derivatives, readings, path)
        run = _to_the_end(simulation, recorder, resume, progress)
        assert run.sample is not None
        values, found = readings.read(run.sample)
        kept = tuple(v.parameter for v in derivatives.variations)
        result = Sensitivity(
            case.title, run.position, values, kept, tuple(found), run.counts.steps,
            _kinks(simulation), simulation.coupling is not None, run.counts.windows,
            run.counts.cut_for_error,
        )  # fmt: skip
        if folder is not None:
            on_root(comm, lambda: result.write(folder))
        return result


def _kinks(simulation: Simulation) -> tuple[Kink, ...]:
    """Where contact was about to change in a run."""
    if simulation.coupling is None:
        return ()
    steps = simulation.coupling.mechanics
    assert isinstance(steps, FollowedMechanics)
    return tuple(steps.mechanical.kinks.found)


def follow(simulation: Simulation, to: Sequence[str]) -> ThermalDerivatives:
    """Let the steps of a simulation carry derivatives by some parameters (collective).

    Raises:
        InputError: With all parameters that cannot be used, a line each.
    """
    variations: list[Variation] = []
    problems: list[str] = []
    for parameter in read_parameters(simulation.case, simulation.steel, to):
        try:
            variations.append(vary(simulation, parameter))
        except InputError as error:
            problems += error.problems
    if problems:
        raise InputError(problems)
    derivatives = ThermalDerivatives(simulation, variations)
    simulation.steps = FollowedSteps(simulation.stepper, simulation.steps.control, derivatives)
    if simulation.coupling is not None:
        from castfem.sensitivity.coupled import FollowedCoupling
        from castfem.sensitivity.mechanical import MechanicalDerivatives

        mechanical = MechanicalDerivatives(simulation, variations)
        coupling = FollowedCoupling(simulation, derivatives, mechanical)
        coupling.thermal = simulation.steps
        coupling.mechanics = FollowedMechanics(coupling.mechanics, derivatives, mechanical)
        simulation.coupling = coupling
    return derivatives


def _to_the_end(
    simulation: Simulation, recorder: Recorder, resume: bool, progress: Progress | None
) -> RunState:
    """Take the slice to the end of the followed length."""
    interrupt = Interrupt(simulation.section.comm)
    loop = TimeLoop(simulation, recorder, progress, interrupt)
    if resume:
        recorder.resume(loop.run_state)
    if progress is not None:
        progress.start(simulation.case.casting.length, loop.run_state.position)
    try:
        with interrupt:
            loop.run()
    except Stopped:
        if recorder.path is not None:
            recorder.save(loop.run_state)
        raise
    if recorder.path is not None:
        recorder.save(loop.run_state)
    return loop.run_state
