"""Where a run stands: what goes round between time loop, recorder, checkpoint and summary."""

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
    from castfem.runs.results.quality import QualityState


STORED = {
    "windows": "intervals", "coupling_iterations": "passes", "gap_not_converged": "unsettled",
}  # fmt: skip
"""Counts that a checkpoint holds under other names, which it has had from the beginning."""


@dataclass(slots=True)
class Counts:
    """Counts of a run, those before it was resumed included."""

    steps: int = 0  #: thermal steps
    rejected: int = 0  #: tried and not kept
    #: taken by backward Euler because the second-order scheme left the physical bounds, or would
    #: have come back
    limited: int = 0
    windows: int = 0  #: of the coupling
    cut_back: int = 0  #: that failed
    cut_for_error: int = 0  #: whose error was too large
    coupling_iterations: int = 0  #: in windows that were kept
    #: windows repeated as often as allowed, as short as sensible, whose gap still changed
    gap_not_converged: int = 0
    alone: int = 0  #: commits of the temperature alone
    newton: int = 0  #: Newton iterations of the temperature, those of what was not kept included
    newton_mechanics: int = 0  #: likewise of the mechanics

    @property
    def taken(self) -> int:
        """Commits so far: coupling windows, and thermal steps without mechanics."""
        return self.windows + self.alone if self.windows else self.steps

    def stored(self) -> dict[str, int]:
        """The counts by their names in a checkpoint."""
        return {STORED.get(name, name): count for name, count in asdict(self).items()}

    @classmethod
    def restored(cls, counts: Mapping[str, int]) -> Counts:
        """The inverse of `stored`."""
        names = {key: name for name, key in STORED.items()}
        return cls(**{names.get(key, key): count for key, count in counts.items()})


@dataclass(frozen=True, slots=True)
class Recorded:
    """All that a run goes on from, as it stood when its files were written last."""

    state: StrandState  #: the committed state
    sample: Sample  #: taken of it
    counts: Counts  #: so far
    zone: int  #: index of the cooling
    memory: dict[str, float | None]  #: of the sampler
    snapshots: dict[float, dict[str, Quantity]]  #: results at the references' positions
    quality: QualityState | None  #: crack indexes; None in a case without [quality]


@dataclass(slots=True)
class RunState:
    """A run between two steps. It holds nothing that is not committed."""

    simulation: Simulation  #: the objects of the run
    state: StrandState  #: the committed state
    sampler: Sampler  #: takes samples of the state, and knows the extremes of the whole run
    #: takes the mechanical state apart; None without mechanics
    mechanical_checkpoint: MechanicalCheckpoint | None = None
    counts: Counts = field(default_factory=Counts)  #: of steps and iterations
    sample: Sample | None = None  #: the last one; None before the first
    zone: int = -1  #: index of the cooling; -1 before the first
    #: results at the positions (m) for which the case has references
    snapshots: dict[float, dict[str, Quantity]] = field(default_factory=dict)
    #: results and balances of forces as a checkpoint has them, until the next step: what a step
    #: finds out, and the heat flux through its gap, are no part of the state
    restored: tuple[dict[str, Quantity], dict[str, dict[str, Quantity]]] | None = None
    _recorded: Recorded | None = None

    @classmethod
    def at_start(cls, simulation: Simulation) -> RunState:
        """A run that has not begun."""
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
        """Of the slice below the meniscus, m."""
        return self.simulation.machine.position(self.state.time)

    @property
    def reached(self) -> dict[str, float]:
        """How far the run has come, for run.json: time in s, position in m, thermal steps."""
        return {"time": self.state.time, "position": self.position, "step": self.counts.steps}

    def take_sample(self, substeps: SubSteps | None, mechanical: MechanicalResult | None) -> Sample:
        """Take a sample of the committed state, and of the step that led to it (collective)."""
        self.restored = None
        self.sample = self.sampler.read(self.state, substeps, mechanical)
        return self.sample

    def remember(self) -> None:
        """Keep what has been recorded: states are never written into, the rest is copied."""
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
        """Take back what is not recorded, after an error at whatever place; False if nothing is."""
        good = self._recorded
        if good is None:
            return False
        self.state, self.sample, self.counts = good.state, good.sample, good.counts
        self.zone, self.snapshots = good.zone, good.snapshots
        self.sampler.recall(good.memory)
        if self.sampler.quality is not None and good.quality is not None:
            self.sampler.quality.state = good.quality
        return True
