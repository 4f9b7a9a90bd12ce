"""What keeps the committed steps of a run that carries derivatives along, and its checkpoint."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import saving
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.root import on_root
from castfem.model.build.simulation import Simulation
from castfem.runs import restart
from castfem.runs.interrupt import Interrupt
from castfem.runs.loop import TimeLoop
from castfem.runs.output.checkpoint import load_checkpoint, save_checkpoint
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.differentiated_steps import (
    FollowedMechanics,
    followed,
    mark_coupled,
)
from castfem.studies.sensitivity.readings import Readings
from castfem.studies.sensitivity.thermal import ThermalDerivatives

if TYPE_CHECKING:
    from castfem.base.progress import Progress
    from castfem.physics.coupling.subcycling import SubSteps
    from castfem.physics.mechanics.state import MechanicalResult
    from castfem.studies.sensitivity.restart import CoupledCheckpoint

CHECKPOINT_NAME = "sensitivity.checkpoint.h5"
_SAVED = ("enthalpy", "rate")


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

    @cached_property
    def _physics(self) -> dict[str, Any]:
        """What the checkpoints of this run hold of its case; it does not change (rank 0)."""
        return self.simulation.case.physics_record()

    @property
    def reads_all(self) -> bool:
        """Whether each step must be sampled, not the last alone."""
        return self.path is not None or self.readings.reads_all

    def mark(self, run: RunState) -> None:
        """Keep the derivatives of a committed step: one that fails begins there (collective)."""
        self.derivatives.mark(run.state.thermal)
        if self.simulation.coupling is not None:
            mark_coupled(followed(self.simulation.coupling), run.state)

    def step(self, run: RunState, sample: Sample) -> None:
        """Take in one committed step, and save a checkpoint in turn (collective)."""
        self.mark(run)
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
        path = self.path

        def write() -> None:
            assert path is not None
            with saving(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            save_checkpoint(path, meta, kept, **self._physics)

        on_root(self.simulation.section.comm, write)

    def resume(self, run: RunState) -> None:
        """Go on from the checkpoint (collective).

        Raises:
            InputError: There is none, or it is of another case or of other parameters, or an
                earlier castfem wrote it with fewer derivatives.
        """
        comm, path = self.simulation.section.comm, self.path
        assert path is not None
        read = on_root(comm, lambda: load_checkpoint(path, **self._physics))
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
        from castfem.studies.sensitivity.restart import CoupledCheckpoint

        coupling = followed(self.simulation.coupling)
        assert isinstance(coupling.mechanics, FollowedMechanics)
        return CoupledCheckpoint(coupling, coupling.mechanics.mechanical, run)


class FollowedLoop(TimeLoop):
    """The time loop of a run with derivatives: what nobody asks for on the way is not sampled.

    Args:
        simulation: What to run, followed.
        recorder: Keeps its steps.
        progress: What is told after each step; None for silence.
        interrupt: Asked after each step whether to stop there.
    """

    def __init__(
        self,
        simulation: Simulation,
        recorder: Recorder,
        progress: Progress | None = None,
        interrupt: Interrupt | None = None,
    ) -> None:
        super().__init__(simulation, recorder, progress, interrupt)
        self._keeps = recorder

    def _record(self, substeps: SubSteps | None, mechanical: MechanicalResult | None) -> None:
        """See `TimeLoop`."""
        run = self.run_state
        if self._keeps.reads_all or run.state.time >= self.simulation.control.end:
            super()._record(substeps, mechanical)
            return
        self._keeps.mark(run)
        self._tell(substeps, mechanical)
