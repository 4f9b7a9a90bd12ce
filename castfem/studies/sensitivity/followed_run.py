"""A run with derivatives: their computation, recording and checkpoint."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.atomic_files import saving
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.fem.rank_zero import on_root
from castfem.model.build.simulation import Simulation
from castfem.physics.coupling.staggered import StrandState
from castfem.runs import restart
from castfem.runs.output.checkpoint import load_checkpoint, save_checkpoint
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.parameters import read_parameters
from castfem.studies.sensitivity.perturbed_simulation import Variation, vary
from castfem.studies.sensitivity.thermal import ThermalDerivatives

if TYPE_CHECKING:
    from castfem.studies.sensitivity.coupled import CoupledCheckpoint, CoupledDerivatives
    from castfem.studies.sensitivity.readings import Readings

CHECKPOINT_NAME = "sensitivity.checkpoint.h5"
_SAVED = ("enthalpy", "rate")


class Derivatives:
    """All derivatives computed along with a run.

    Args:
        simulation: The run, whose steps and windows are differentiated from now on.
        variations: Its parameters.

    Attributes:
        thermal: Derivatives of the temperatures.
        coupled: Derivatives of the slice and its windows; None without mechanics.
    """

    def __init__(self, simulation: Simulation, variations: Sequence[Variation]) -> None:
        self.variations = tuple(variations)
        self.thermal = ThermalDerivatives(simulation, variations)
        self.coupled: CoupledDerivatives | None = None
        simulation.steps.on_kept = self.thermal.step
        if simulation.coupling is not None:
            from castfem.studies.sensitivity.coupled import CoupledDerivatives
            from castfem.studies.sensitivity.mechanical import MechanicalDerivatives

            mechanical = MechanicalDerivatives(simulation, variations)
            self.coupled = CoupledDerivatives(simulation, self.thermal, mechanical)
            simulation.coupling.observer = self.coupled

    def mark(self, state: StrandState) -> None:
        """Keep the derivatives of a committed state, to restart failed steps (collective)."""
        self.thermal.mark(state.thermal)
        if self.coupled is not None:
            self.coupled.mark(state)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        self.thermal.destroy()
        if self.coupled is not None:
            self.coupled.destroy()


def follow(simulation: Simulation, to: Sequence[str]) -> Derivatives:
    """Differentiate the steps of a simulation with respect to some parameters (collective).

    Raises:
        InputError: Some parameters cannot be used; all of them, one line each.
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
    return Derivatives(simulation, variations)


class Recorder:
    """Processes committed steps, for results that depend on the history, and checkpoints."""

    def __init__(
        self,
        simulation: Simulation,
        derivatives: Derivatives,
        readings: Readings,
        path: Path | None,
    ) -> None:
        self.simulation, self.derivatives, self.readings = simulation, derivatives, readings
        self.path, self._every = path, simulation.case.output.steps_to_checkpoint

    @cached_property
    def _physics(self) -> dict[str, str]:
        """The constant part of this run's checkpoints: its case (rank 0)."""
        return self.simulation.case.physics_record()

    def unsampled(self, run: RunState) -> bool:
        """Process a committed step if its results are not needed; return if so (collective)."""
        last = run.state.time >= self.simulation.control.end
        if self.path is not None or self.readings.reads_all or last:
            return False
        self.derivatives.mark(run.state)
        return True

    def step(self, run: RunState, sample: Sample) -> None:
        """Process a committed step, and save a checkpoint when due (collective)."""
        self.derivatives.mark(run.state)
        self.readings.follow(sample)
        if self.path is not None and self._every and run.counts.taken % self._every == 0:
            self.save(run)

    def _parameters(self) -> list[list[Any]]:
        found = [v.parameter for v in self.derivatives.variations]
        return [[p.name, p.value, p.unit, p.step] for p in found]

    def save(self, run: RunState) -> None:
        """Save state and derivatives, if there is a checkpoint (collective)."""
        path = self.path
        if path is None:
            return
        gather, slopes = self.simulation.section.gather, self.derivatives.thermal
        meta = restart.description(run) | {
            "parameters": self._parameters(),
            "removed_by": list(slopes.removed),
            "readings": self.readings.memory(),
        }
        arrays: dict[str, Array | None] = dict(restart.arrays(run))
        if (coupled := self._coupled(run)) is not None:
            meta["coupled"] = coupled.description()
            arrays |= coupled.arrays()
        for name in _SAVED:
            for number, owned in enumerate(getattr(slopes, name)):
                arrays[f"{name}_by_{number}"] = gather(owned)
        kept = {name: values for name, values in arrays.items() if values is not None}

        def write() -> None:
            with saving(path):
                path.parent.mkdir(parents=True, exist_ok=True)
            save_checkpoint(path, meta, kept, **self._physics)

        on_root(self.simulation.section.comm, write)

    def resume(self, run: RunState) -> None:
        """Continue from the checkpoint (collective).

        Raises:
            InputError: There is none, it belongs to another case or other parameters, or an earlier
                castfem wrote it with fewer derivatives.
        """
        comm, path = self.simulation.section.comm, self.path
        assert path is not None
        if lost := self.readings.of_tearing():
            raise InputError(
                f"{path}: holds no derivatives of {lost[0]}, which depends on the whole section in "
                "all steps; run without --resume"
            )
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
        self.derivatives.thermal.restore(slopes[0], slopes[1], np.array(meta["removed_by"]))
        self.readings.recall(meta["readings"])
        if (coupled := self._coupled(run)) is not None:
            if not coupled.is_whole(meta["coupled"]):
                raise InputError(
                    f"{path}: written by an earlier castfem, without the derivatives of the rates; "
                    "run without --resume"
                )
            coupled.restore(meta["coupled"], by_node)
            self.derivatives.mark(run.state)
            coupled.recall_kinks(meta["coupled"])

    def _coupled(self, run: RunState) -> CoupledCheckpoint | None:
        """Checkpoint converter for the derivatives of the slice; None without mechanics."""
        if self.derivatives.coupled is None:
            return None
        from castfem.studies.sensitivity.coupled import CoupledCheckpoint

        return CoupledCheckpoint(self.derivatives.coupled, run)
