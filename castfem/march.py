"""The march of the slice from the meniscus to the end of the followed length."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpi4py import MPI

import numpy as np
import numpy.typing as npt

from castfem import log, reductions
from castfem.coupling import Leg, StrandState, take_interval
from castfem.errors import RunFailure
from castfem.measure import Measure, Reading
from castfem.output.folder import OutputFolder
from castfem.output.summary import Quantity
from castfem.parallel import on_root
from castfem.recorder import Recorder
from castfem.report import quantities, summarise
from castfem.scene import Scene, build_scene
from castfem.stopwatch import peak_memory, profile_table
from castfem.timestep import same_instant

if TYPE_CHECKING:
    from castfem.case import Case
    from castfem.mechanics.archive import Archive
    from castfem.mechanics.state import MechanicalResult
    from castfem.output.summary import Summary
    from castfem.progress import Progress

Array = npt.NDArray[np.float64]

# Arrays of the thermal state that a checkpoint holds, by their name in it.
STATE = ("enthalpy", "rate")


@dataclass(slots=True)
class Counts:
    """What the march has done.

    Attributes:
        steps: Thermal steps. rejected: Tried and not kept. limited: Taken by backward Euler because
            the second-order scheme left the physical bounds.
        intervals: Of temperature and mechanics. cut_back: Tried and not kept.
        passes: Through intervals that were kept, repeated ones included. unsettled: Repeated as
            often as allowed, as short as sensible, and the gap still changed.
    """

    steps: int = 0
    rejected: int = 0
    limited: int = 0
    intervals: int = 0
    cut_back: int = 0
    passes: int = 0
    unsettled: int = 0

    @property
    def taken(self) -> int:
        """Commits so far: intervals, or thermal steps in a scene without mechanics."""
        return self.intervals or self.steps


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
        self.archive = make_archive(scene)
        thermal = scene.stepper.initial(scene.start_temperature)
        self.state: StrandState = (
            StrandState(thermal, None, np.zeros(0))
            if scene.coupler is None
            else scene.coupler.start(thermal)
        )
        self.counts = Counts()
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
        if self.counts.taken == 0:
            self._enter_zone()
            self._record(None, None)
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
                self.scene.steps.control.restart()
            self._zone = zone

    def advance(self) -> None:
        """Take one step, or with mechanics one interval: try, cut back if need be, commit.

        Raises:
            RunFailure: At the smallest step.
        """
        scene, counts, mechanical = self.scene, self.counts, None
        if scene.coupler is None:
            leg = scene.steps.one(self.state.thermal)
            state = replace(self.state, thermal=leg.state)
        else:
            taken, failed = take_interval(scene.coupler, self.state, scene.control)
            leg, mechanical, state = taken.leg, taken.mechanical, taken.state
            counts.intervals += 1
            counts.cut_back += failed
            counts.passes += taken.passes
            counts.unsettled += not taken.settled
        self.state = state
        counts.steps += leg.steps
        counts.rejected += leg.rejected
        counts.limited += leg.limited
        self._record(leg, mechanical)

    def _record(self, leg: Leg | None, mechanical: MechanicalResult | None) -> None:
        with self.scene.watch.section("results"):
            self.reading = self.measure.read(self.state, leg, mechanical)
            self._keep_snapshot(self.reading)
        if self.recorder is not None:
            with self.scene.watch.section("output"):
                self.recorder.step(self, self.reading)
        if self.progress is not None:
            reading = self.reading
            newton = reading.newton + (reading.mechanics.newton if reading.mechanics else 0)
            self.progress.update(reading.position, reading.time, newton, reading.step, self._note())

    def _keep_snapshot(self, reading: Reading) -> None:
        for position in self.scene.stations:
            if same_instant(reading.position, position, self.scene.case.casting.length):
                self.snapshots[position] = quantities(self, reading)

    def _note(self) -> str:
        return self.scene.zones.spans[max(self._zone, 0)].name

    def arrays(self) -> dict[str, Array | None]:
        """The arrays of the committed state, whole on rank 0 (collective)."""
        gather, state = self.scene.section.gather, self.state
        found = {name: gather(getattr(state.thermal, name)) for name in STATE}
        if self.archive is not None and state.mechanical is not None:
            found |= self.archive.arrays(state.mechanical)
            if self.scene.case.coupling.dissipation:
                found["heating"] = gather(state.heating)
            if self.scene.case.coupling.order == "mechanics_first":
                found["trend"] = gather(state.trend)
        return found

    def description(self) -> dict[str, Any]:
        """All of the committed state that is not an array; what a checkpoint holds beside them."""
        thermal, mechanical = self.state.thermal, self.state.mechanical
        found: dict[str, Any] = {
            "time": thermal.time,
            "removed": thermal.removed,
            "generated": thermal.generated,
            "counts": asdict(self.counts),
            "step": self.scene.control.step,
            "substep": self.scene.steps.control.step,
            "zone": self._zone,
            "measure": self.measure.memory(),
            "snapshots": [
                [position, {name: [q.value, q.unit, q.label] for name, q in found.items()}]
                for position, found in self.snapshots.items()
            ],
        }
        if self.archive is not None and mechanical is not None:
            found["mechanical"] = self.archive.description(mechanical)
        return found

    def restore(self, meta: dict[str, Any], arrays: dict[str, Array]) -> None:
        """Go on from a checkpoint: `description` and the arrays by node (on every rank)."""
        nodes = self.scene.section.node_of_owned
        enthalpy, rate = (np.asarray(arrays[name])[nodes] for name in STATE)
        thermal = self.scene.stepper.state_from(
            meta["time"], enthalpy, rate, meta["removed"], meta["generated"]
        )
        mechanical = None
        if self.archive is not None:
            mechanical = self.archive.state(meta["mechanical"], arrays)
        heating, trend = (
            np.asarray(arrays[name])[nodes] if name in arrays else np.zeros(0)
            for name in ("heating", "trend")
        )
        self.state = StrandState(thermal, mechanical, heating, trend)
        self.counts = Counts(**meta["counts"])
        self.scene.control.step = meta["step"]
        self.scene.steps.control.step = meta["substep"]
        self._zone = meta["zone"]
        if self._zone >= 0:
            self.scene.problem.set_cooling(self.scene.zones.cooling(self._zone))
        self.measure.recall(meta["measure"])
        self.snapshots = {
            position: {name: Quantity(*parts) for name, parts in found.items()}
            for position, found in meta["snapshots"]
        }
        self.reading = self.measure.read(self.state, None)


def make_archive(scene: Scene) -> Archive | None:
    """What takes the mechanical state apart for checkpoints; None in a scene without mechanics."""
    if scene.mechanics is None:
        return None
    from castfem.mechanics.archive import Archive

    return Archive(scene.mechanics.problem)


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
                "step": march.counts.steps,
            },
        }
        if status == "finished":
            output.finish(**facts)
        else:
            output.fail(reason, **facts)

    on_root(comm, write)
    return summary
