"""The march of the slice from the meniscus to the end of the followed length."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from castfem import log, reductions
from castfem.errors import RunFailure
from castfem.measure import Measure, Reading
from castfem.output.folder import OutputFolder
from castfem.output.summary import Quantity
from castfem.parallel import on_root
from castfem.recorder import STATE, Recorder
from castfem.report import quantities, summarise
from castfem.scene import Scene, build_scene
from castfem.stopwatch import peak_memory, profile_table
from castfem.thermal.stepper import StepResult, ThermalState
from castfem.timestep import same_instant

if TYPE_CHECKING:
    from castfem.case import Case
    from castfem.output.summary import Summary
    from castfem.progress import Progress

Array = npt.NDArray[np.float64]


class March:
    """Steps a scene through time; holds the committed state and nothing that is not committed.

    Args:
        scene: What to march.
        recorder: Where committed steps are written; None for a march in memory.
        progress: What is told after each step; None for silence.
    """

    def __init__(
        self, scene: Scene, recorder: Recorder | None = None, progress: Progress | None = None
    ) -> None:
        self.scene, self.recorder, self.progress = scene, recorder, progress
        self.measure = Measure(scene)
        self.state: ThermalState = scene.stepper.initial(scene.start_temperature)
        self.steps = self.rejected = self.limited = 0
        self.reading: Reading | None = None
        # Results at the positions the case has references for, short of the end.
        self.snapshots: dict[float, dict[str, Quantity]] = {}
        self._zone = -1

    def run(self) -> Reading:
        """March to the end of the scene.

        Raises:
            RunFailure: If a step cannot be saved; the committed state stays as it was.
        """
        control = self.scene.control
        if self.steps == 0:
            self._enter_zone()
            self._record(None, 0.0)
        while self.state.time < control.end:
            self._enter_zone()
            self.advance()
        assert self.reading is not None
        return self.reading

    def _enter_zone(self) -> None:
        """Change the cooling if the slice has come to the next zone."""
        zone = self.scene.zones.index(self.state.time)
        if zone != self._zone:
            self.scene.problem.set_cooling(self.scene.zones.cooling(zone))
            if self._zone >= 0:
                self.scene.control.restart()
            self._zone = zone

    def advance(self) -> None:
        """Take one step: try, cut back if need be, commit.

        Raises:
            RunFailure: At the smallest step.
        """
        control, stepper = self.scene.control, self.scene.stepper
        while True:
            end = control.propose(self.state.time)
            dt = end - self.state.time
            result = stepper.step(self.state, end)
            if not result.converged:
                log.logger.debug(
                    "t = %.6g s: step %.3g s fails: %s", self.state.time, dt, result.reason
                )
                control.failed(dt, result.reason)
            elif not control.accepts(result.error):
                control.learn(dt, result.error)
            else:
                break
            self.rejected += 1
        self.state = result.state
        control.learn(dt, result.error)
        self.steps += 1
        self.limited += result.limited
        self._record(result, dt)

    def _record(self, result: StepResult | None, dt: float) -> None:
        with self.scene.watch.section("results"):
            self.reading = self.measure.read(self.state, result, dt)
            self._keep_snapshot(self.reading)
        if self.recorder is not None:
            with self.scene.watch.section("output"):
                self.recorder.step(self, self.reading)
        if self.progress is not None:
            self.progress.update(
                self.reading.position, self.reading.time, self.reading.newton, dt, self._note()
            )

    def _keep_snapshot(self, reading: Reading) -> None:
        for position in self.scene.stations:
            if same_instant(reading.position, position, self.scene.case.casting.length):
                self.snapshots[position] = quantities(self, reading)

    def _note(self) -> str:
        return self.scene.zones.spans[max(self._zone, 0)].name

    def description(self) -> dict[str, Any]:
        """All of the committed state that is not an array; what a checkpoint holds beside them."""
        return {
            "time": self.state.time,
            "removed": self.state.removed,
            "steps": self.steps,
            "rejected": self.rejected,
            "limited": self.limited,
            "step": self.scene.control.step,
            "zone": self._zone,
            "measure": self.measure.memory(),
            "snapshots": [
                [position, {name: [q.value, q.unit, q.label] for name, q in found.items()}]
                for position, found in self.snapshots.items()
            ],
        }

    def restore(self, meta: dict[str, Any], arrays: dict[str, Array]) -> None:
        """Go on from a checkpoint: `description` and the arrays by node (on every rank)."""
        nodes = self.scene.section.node_of_owned
        enthalpy, rate = (np.asarray(arrays[name])[nodes] for name in STATE)
        self.state = self.scene.stepper.state_from(meta["time"], enthalpy, rate, meta["removed"])
        self.steps, self.rejected, self.limited = meta["steps"], meta["rejected"], meta["limited"]
        self.scene.control.step = meta["step"]
        self._zone = meta["zone"]
        if self._zone >= 0:
            self.scene.problem.set_cooling(self.scene.zones.cooling(self._zone))
        self.measure.recall(meta["measure"])
        self.snapshots = {
            position: {name: Quantity(*parts) for name, parts in found.items()}
            for position, found in meta["snapshots"]
        }
        self.reading = self.measure.read(self.state, None, 0.0)


def run(
    case: Case,
    folder: Path | str,
    *,
    comm: MPI.Comm | None = None,
    resume: bool = False,
    profile: bool = False,
    progress: Progress | None = None,
) -> Summary:
    """Run `case` and write everything into `folder` (collective).

    Args:
        case: What to run.
        folder: Where the results go; see docs/output.md.
        comm: Communicator; all ranks when None.
        resume: Go on from the checkpoint in `folder`.
        profile: Log where the time went.
        progress: Told after each step; on rank 0.

    Returns:
        The summary, on every rank.

    Raises:
        InputError: The case, the folder or the checkpoint cannot be used.
        RunFailure: The run cannot go on; the last good state is on disk.
    """
    comm = MPI.COMM_WORLD if comm is None else comm
    output = OutputFolder(folder)

    def begin() -> None:
        output.begin(case.resolved_toml(), ranks=comm.size, resume=resume)
        log.to_file(output / "run.log", append=resume)

    on_root(comm, begin)
    with output:
        scene = build_scene(case, comm)
        try:
            return _march(scene, output, resume, profile, progress)
        finally:
            scene.destroy()


def _march(
    scene: Scene, output: OutputFolder, resume: bool, profile: bool, progress: Progress | None
) -> Summary:
    """March a built scene with its files open."""
    comm, watch = scene.section.comm, scene.watch
    recorder = Recorder(scene, output, resume)
    march = March(scene, recorder, progress)
    if recorder.checkpoint is not None:
        march.restore(*recorder.checkpoint)
    if progress is not None:
        progress.start(scene.case.casting.length, march.state.time * scene.case.casting.speed)
    try:
        with watch.section("march"):
            march.run()
    except RunFailure as error:
        recorder.save(march)
        _finish(march, output, "failed", str(error))
        raise
    finally:
        recorder.close()
    if scene.case.output.checkpoint_every:
        recorder.save(march)
    if profile and comm.rank == 0:
        log.logger.info("%s", profile_table(watch))
    return _finish(march, output, "finished")


def _finish(march: March, output: OutputFolder, status: str, reason: str = "") -> Summary:
    """Write summary and run record; the summary is the same on every rank."""
    comm = march.scene.section.comm
    summary = summarise(march, status)
    memory = reductions.total(comm, peak_memory())

    def write() -> None:
        output.write_summary(summary)
        facts = {
            "wall_time": dict(march.scene.watch.seconds),
            "compiled_forms": tuple(march.scene.section.compiled),
            "memory_mb": round(memory / 1e6, 1),
            "reached": {
                "time": march.state.time,
                "position": march.state.time * march.scene.case.casting.speed,
                "step": march.steps,
            },
        }
        if status == "finished":
            output.finish(**facts)
        else:
            output.fail(reason, **facts)

    on_root(comm, write)
    return summary
