"""What a march has come to: its counts, and all that it goes on from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from castfem.coupling.staggered import StrandState
    from castfem.output.summary import Quantity
    from castfem.results.thermal import Sample


@dataclass(slots=True)
class Counts:
    """Counts of a march, those before it was resumed included.

    Attributes:
        steps: Thermal steps. rejected: Tried and not kept. limited: Taken by backward Euler because
            the second-order scheme left the physical bounds, or would have come back.
        intervals: Of temperature and mechanics. cut_back: Tried and not kept.
        passes: Through intervals that were kept, repeated ones included. unsettled: Repeated as
            often as allowed, as short as sensible, and the gap still changed.
        newton: Newton iterations of the temperature, those of what was not kept included.
        newton_mechanics: Likewise of the mechanics.
    """

    steps: int = 0
    rejected: int = 0
    limited: int = 0
    intervals: int = 0
    cut_back: int = 0
    passes: int = 0
    unsettled: int = 0
    newton: int = 0
    newton_mechanics: int = 0

    @property
    def taken(self) -> int:
        """Commits so far: intervals, or thermal steps in a simulation without mechanics."""
        return self.intervals or self.steps


@dataclass(frozen=True, slots=True)
class Recorded:
    """All that a march goes on from, as it stood when its files were written last.

    Attributes:
        state: The committed state. sample: What was read off it. counts: So far.
        step: Of `Simulation.control`, s. substep: Of the thermal steps, s.
        zone: Index of the cooling.
        memory: Of the sampler. snapshots: Results at the references' positions.
    """

    state: StrandState
    sample: Sample
    counts: Counts
    step: float
    substep: float
    zone: int
    memory: dict[str, float | None]
    snapshots: dict[float, dict[str, Quantity]]
