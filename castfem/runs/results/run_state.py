"""State of a run, shared by time loop, recorder, checkpoint and summary."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from castfem.model.build.start import starting_state
from castfem.physics.coupling.staggered import StrandState
from castfem.runs.results.sample import Sample
from castfem.runs.results.thermal import Sampler

if TYPE_CHECKING:
    from castfem.base.shown_quantity import Quantity
    from castfem.model.build.simulation import Simulation
    from castfem.physics.coupling.subcycling import SubSteps
    from castfem.physics.mechanics.checkpoint import MechanicalCheckpoint
    from castfem.physics.mechanics.state import MechanicalResult
    from castfem.runs.results.crack_state import QualityState


STORED = {
    "windows": "intervals", "coupling_iterations": "passes", "gap_not_converged": "unsettled",
}  # fmt: skip
"""Counts whose names in a checkpoint differ, for compatibility."""


@dataclass(slots=True)
class Counts:
    """Counts of a run, including those before a resume."""

    steps: int = 0  #: thermal steps
    rejected: int = 0  #: rejected thermal steps
    #: steps by backward Euler, where the second-order scheme left the physical bounds, or would
    #: again
    limited: int = 0
    windows: int = 0  #: coupling windows
    cut_back: int = 0  #: windows shortened after a failure
    cut_for_error: int = 0  #: windows shortened for their error
    coupling_iterations: int = 0  #: coupling iterations in accepted windows
    #: windows whose gap had not converged after the largest number of iterations, at the shortest
    #: length
    gap_not_converged: int = 0
    alone: int = 0  #: commits of the temperature only
    newton: int = 0  #: thermal Newton iterations, including those of rejected steps
    newton_mechanics: int = 0  #: mechanical Newton iterations, including those of rejected steps

    @property
    def taken(self) -> int:
        """Number of commits: coupling windows, and thermal steps without mechanics."""
        return self.windows + self.alone if self.windows else self.steps

    def stored(self) -> dict[str, int]:
        """The counts by their names in a checkpoint."""
        return {STORED.get(name, name): count for name, count in asdict(self).items()}

    @classmethod
    def restored(cls, counts: Mapping[str, int]) -> Counts:
        """Inverse of `stored`."""
        names = {key: name for name, key in STORED.items()}
        return cls(**{names.get(key, key): count for key, count in counts.items()})


@dataclass(frozen=True, slots=True)
class Recorded:
    """Everything from which a run continues, at the time its files were last written."""

    state: StrandState  #: the committed state
    sample: Sample  #: sample of that state
    counts: Counts  #: so far
    zone: int  #: index of the cooling zone
    memory: dict[str, float | None]  #: numbers kept by the sampler
    snapshots: dict[float, dict[str, Quantity]]  #: results at the positions of references
    quality: QualityState | None  #: crack indexes; None in a case without [quality]


@dataclass(slots=True)
class RunState:
    """A run between two steps; everything in it is committed."""

    simulation: Simulation  #: the simulation
    state: StrandState  #: the committed state
    sampler: Sampler  #: samples the state, and keeps the extremes of the whole run
    #: converts the mechanical state for a checkpoint; None without mechanics
    mechanical_checkpoint: MechanicalCheckpoint | None = None
    counts: Counts = field(default_factory=Counts)  #: numbers of steps and iterations
    sample: Sample | None = None  #: last sample; None before the first
    zone: int = -1  #: index of the cooling zone; -1 before the first
    #: results at the positions (m) of references
    snapshots: dict[float, dict[str, Quantity]] = field(default_factory=dict)
    #: results and force balances from a checkpoint, until the next step: results of a step, and the
    #: heat flux through its gap, are not part of the state
    restored: tuple[dict[str, Quantity], dict[str, dict[str, Quantity]]] | None = None
    _recorded: Recorded | None = None

    @classmethod
    def at_start(cls, simulation: Simulation) -> RunState:
        """A run before its first step."""
        thermal = starting_state(simulation)
        state = (
            StrandState(thermal, None, np.zeros(0), step=simulation.control.first)
            if simulation.coupling is None
            else simulation.coupling.start(thermal, simulation.control.first)
        )
        mechanical_checkpoint = None
        if simulation.mechanics is not None:
            from castfem.physics.mechanics.checkpoint import MechanicalCheckpoint

            mechanical_checkpoint = MechanicalCheckpoint(simulation.mechanics.problem)
        return cls(simulation, state, Sampler(simulation), mechanical_checkpoint)

    @property
    def position(self) -> float:
        """Position of the slice below the meniscus, m."""
        return self.simulation.machine.position(self.state.time)

    @property
    def reached(self) -> dict[str, float]:
        """Progress of the run for run.json: time in s, position in m, number of thermal steps."""
        return {"time": self.state.time, "position": self.position, "step": self.counts.steps}

    def take_sample(self, substeps: SubSteps | None, mechanical: MechanicalResult | None) -> Sample:
        """Sample the committed state and the step that led to it (collective)."""
        self.restored = None
        self.sample = self.sampler.read(self.state, substeps, mechanical)
        return self.sample

    def remember(self) -> None:
        """Remember the recorded state: states are never modified, the rest is copied."""
        sample = self.sample
        assert sample is not None, "a sample has been taken"
        self._recorded = Recorded(
            self.state,
            sample,
            replace(self.counts),
            self.zone,
            self.sampler.memory(),
            dict(self.snapshots),
            None if self.sampler.quality is None else self.sampler.quality.state,
        )

    def fall_back(self) -> bool:
        """Return to the recorded state after an error; False if nothing has been recorded."""
        good = self._recorded
        if good is None:
            return False
        self.state, self.sample, self.counts = good.state, good.sample, good.counts
        self.zone, self.snapshots = good.zone, good.snapshots
        self.sampler.recall(good.memory)
        if self.sampler.quality is not None and good.quality is not None:
            self.sampler.quality.state = good.quality
        return True
