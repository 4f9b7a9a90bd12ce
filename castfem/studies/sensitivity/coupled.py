"""Derivatives of coupling windows, through all their iterations.

A window is iterated with changing gaps until it agrees with the resulting one; each iteration is a
step from the same committed state, and so is its derivative. The next gap is relaxed, and so is its
derivative, including that of the relaxation factor. The number of iterations is kept fixed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.coupling.relaxation import FACTORS, Relaxation
from castfem.physics.coupling.staggered import CouplingObserver, StaggeredCoupling, StrandState
from castfem.physics.mechanics.state import MechanicalState
from castfem.studies.sensitivity.mechanical import MechanicalDerivatives
from castfem.studies.sensitivity.result import Kink
from castfem.studies.sensitivity.shape_change import Feedback, ShapeChange
from castfem.studies.sensitivity.step_inputs import CARRIED, Slopes, with_numbers
from castfem.studies.sensitivity.thermal import ThermalDerivatives

if TYPE_CHECKING:
    from castfem.model.build.simulation import Simulation
    from castfem.runs.results.run_state import RunState


class CoupledDerivatives(CouplingObserver):
    """Derivatives of a strained slice, through its coupling windows."""

    def __init__(
        self, simulation: Simulation, thermal: ThermalDerivatives, mechanical: MechanicalDerivatives
    ) -> None:
        assert simulation.coupling is not None
        self._coupling: StaggeredCoupling = simulation.coupling
        self._thermal, self.mechanical = thermal, mechanical
        count, owned = len(thermal.variations), simulation.section.owned
        nothing: Array = np.zeros((count, owned))
        self._warming: list[Array] = []  # derivatives of the committed temperatures
        # Derivatives of the gap of the window, of the resulting mean gap, and of the gap at its
        # start.
        gap = self._coupling.gap
        gaps: Array = np.zeros((count, owned if gap is None else gap.count))
        self._gap = self._mean = self._begun = gaps
        self._ended: tuple[Sequence[Slopes], Array] = (), gaps
        # Derivatives of what a window passes to the next: heat of viscoplastic work (J/m3, empty if
        # it is left out), and filled volume relative to the undeformed one.
        self.warmed = self._warms = np.zeros((count, owned if self._coupling.dissipation else 0))
        self.filled = self._fills = nothing
        self._shape: ShapeChange | None = None
        if simulation.problem.shape is not None:
            self._shape = ShapeChange(simulation.problem, simulation.zones.surface, count)

    def destroy(self) -> None:
        """Free the PETSc objects."""
        if self._shape is not None:
            self._shape.destroy()

    def mark(self, state: StrandState) -> None:
        """Keep the derivatives of a committed state, from which a failed window starts again."""
        assert state.mechanical is not None
        self.mechanical.mark()
        self._warming = self._thermal.warming(state.thermal)
        self.warmed, self.filled = self._warms, self._fills
        self.mechanical.look(state.mechanical)

    def restore(self, slopes: list[Slopes], warmed: Array, filled: Array) -> None:
        """Continue from saved derivatives."""
        self.mechanical.slopes = slopes
        self.warmed = self._warms = warmed
        self.filled = self._fills = filled

    def begins(self, old: StrandState, end: float) -> None:
        """See `CouplingObserver`."""
        assert old.mechanical is not None
        self._old, self._duration = old, end - old.time
        self._relaxed: tuple[float, Array, Array] | None = None
        self._factor: Array = np.zeros(len(self._gap))
        if self._coupling.gap is not None:
            self._begun = self._gap = self._gaps_at_start(old.mechanical)

    def _gaps_at_start(self, state: MechanicalState) -> Array:
        """Derivatives of the gap of a committed state, at the end of the last window."""
        (slopes, gaps), marked = self._ended, self.mechanical.marked
        if slopes is marked:
            return gaps
        assert self._coupling.gap is not None
        if all(marked):
            return self.mechanical.gaps(self._coupling.gap, marked, state)
        # Nothing touches the strand at its start, but a wall may be at a distance.
        its = self.mechanical.committed(state)
        return self.mechanical.gaps_of_motion(self._coupling.gap, its, state)

    def shaped(self, state: MechanicalState) -> None:
        """See `CouplingObserver`."""
        if self._shape is None:
            return
        known = self.mechanical.committed(state)
        motions, strains = (
            np.array([slopes[name] for slopes in known])
            for name in ("displacement", "generalized_strains")
        )
        shape = self._coupling.thermal.stepper.problem.shape
        assert shape is not None
        solid = self._old.thermal.point.temperature < shape.solidus
        self._shape.follow(motions, strains, self.filled, solid)
        self._fills = self._shape.filled

    def expects(self, old: MechanicalState, ahead: MechanicalState) -> None:
        """See `CouplingObserver`."""
        assert self._coupling.gap is not None
        going_on = self.mechanical.going_on(old, ahead.time)
        ended = self.mechanical.gaps_of_motion(self._coupling.gap, going_on, ahead)
        self._gap = np.asarray(0.5 * (self._begun + ended))

    def iterates(self, gap: Array | None) -> None:
        """See `CouplingObserver`."""
        if self._coupling.gap is not None or self._coupling.dissipation or self._shape is not None:
            self._thermal.feedback = Feedback(self._duration, self.warmed, self._shape)
        if gap is not None:
            for variation, slope in zip(self._thermal.variations, self._gap, strict=True):
                by = variation.parameter.step * slope
                variation.above.simulation.zones.set_gap(gap + by)
                variation.below.simulation.zones.set_gap(gap - by)

    def iterated(self, old: StrandState, new: StrandState) -> None:
        """See `CouplingObserver`."""
        assert old.mechanical is not None and new.mechanical is not None
        after = self._thermal.warming(new.thermal)
        self.mechanical.step(old.mechanical, new.mechanical, self._warming, after)
        slopes, coupling = self.mechanical.slopes, self._coupling
        if coupling.gap is not None:
            ended = self.mechanical.gaps(coupling.gap, slopes, new.mechanical)
            self._mean = np.asarray(0.5 * (self._begun + ended))
            self._ended = slopes, ended
        if coupling.dissipation:
            points = coupling.mechanics.stepper.problem.points
            area = coupling.thermal.stepper.problem.area
            work = [points.to_vertices(its["dissipation"]) for its in slopes]
            self._warms = np.array([coupling.dissipation * one / area for one in work])

    def relaxed(self, relaxation: Relaxation) -> None:
        """See `CouplingObserver`: the derivatives of the gap are relaxed like the gap."""
        now, factor = relaxation.residual, relaxation.factor
        assert now is not None
        slopes = np.where(relaxation.reached, self._mean - self._gap, 0.0)
        if self._relaxed is not None:
            self._factor = self._of_factor(relaxation.weight, *self._relaxed, now, slopes)
        self._relaxed = factor, now, slopes
        moved = self._gap + np.outer(self._factor, now) + factor * slopes
        self._gap = np.where(relaxation.reached, moved, self._mean)

    def _of_factor(
        self, weight: Array, factor: float, before: Array, slopes_before: Array, now: Array,
        slopes: Array,
    ) -> Array:  # fmt: skip
        """Derivatives of the factor - factor before . change / change . change (parameters,)."""
        change, turned = now - before, slopes - slopes_before
        weighted = weight * change
        along, size, *rest = reductions.totals(
            self._coupling.mechanics.comm,
            [
                float(before @ weighted), float(change @ weighted), *(slopes_before @ weighted),
                *(turned @ (weight * before)), *(turned @ weighted),
            ],
        )  # fmt: skip
        if not size > 0.0 or not FACTORS[0] < -factor * along / size < FACTORS[1]:
            return np.zeros_like(self._factor) if size > 0.0 else self._factor
        one, other, third = np.array(rest).reshape(3, -1)
        of_share = (one + other) / size - 2.0 * along * third / size**2
        return np.asarray(-self._factor * along / size - factor * of_share)


_BESIDE = ("pressure", "mechanical_temperature")
"""Arrays of a state whose derivatives the next step does not need."""
_NUMBERS = ("generalized_strains", "scalars", "scalar_rate")
_OF_WINDOW = ("warmed", "filled")


class CoupledCheckpoint:
    """Converts the derivatives of a run with mechanics for a checkpoint, and back.

    The derivative of a state has the arrays of a state, and is converted in the same way.
    """

    def __init__(self, derivatives: CoupledDerivatives, run: RunState) -> None:
        assert run.mechanical_checkpoint is not None and run.state.mechanical is not None
        self._derivatives, self._checkpoint = derivatives, run.mechanical_checkpoint
        self._section, self._state = run.simulation.section, run.state.mechanical

    def arrays(self) -> dict[str, Array | None]:
        """Arrays for a checkpoint, complete on rank 0, None elsewhere (collective)."""
        found: dict[str, Array | None] = {}
        for number, slopes in enumerate(self._derivatives.mechanical.committed(self._state)):
            its = self._checkpoint.arrays(with_numbers(self._state, slopes))
            found |= {f"{n}_by_{number}": v for n, v in its.items() if n not in _BESIDE}
        for name in _OF_WINDOW:
            by_parameter = getattr(self._derivatives, name)
            if reductions.any_of(self._section.comm, by_parameter.shape[1] > 0):
                owned = {f"{name}_by_{i}": np.asarray(its) for i, its in enumerate(by_parameter)}
                found |= {key: self._section.gather(its) for key, its in owned.items()}
        return found

    def description(self) -> dict[str, Any]:
        """The parts that are not arrays over the section."""
        mechanical = self._derivatives.mechanical
        slopes = mechanical.committed(self._state)
        return {
            "slopes": [{n: s[n].tolist() for n in _NUMBERS} for s in slopes],
            "kinks": [asdict(kink) for kink in mechanical.kinks],
        }

    @staticmethod
    def is_whole(description: dict[str, Any]) -> bool:
        """Whether a checkpoint has everything a step needs; earlier ones lack the rates."""
        return all(name in numbers for numbers in description["slopes"] for name in _NUMBERS)

    def restore(self, description: dict[str, Any], by_node: dict[str, Array]) -> None:
        """Restore from `description` and, on every rank, `arrays` (collective)."""
        found: list[Slopes] = []
        for number, numbers in enumerate(description["slopes"]):
            ending = f"_by_{number}"
            mine = {n.removesuffix(ending): v for n, v in by_node.items() if n.endswith(ending)}
            mine |= {name: by_node[name] for name in _BESIDE if name in by_node}
            said = self._checkpoint.description(self._state)
            said |= {"modes": numbers["generalized_strains"]}
            said |= {name: numbers[name] for name in ("scalars", "scalar_rate")}
            its = self._checkpoint.state(said, mine)
            slopes = {name: getattr(its, name) for name in CARRIED}
            found.append(slopes | ({} if its.contact is None else its.contact.numbers()))
        nodes, count = self._section.node_of_owned, len(found)
        handed = [
            np.array([np.asarray(by_node[f"{n}_by_{i}"])[nodes] for i in range(count)])
            if f"{n}_by_0" in by_node
            else np.zeros((count, 0))
            for n in _OF_WINDOW
        ]
        self._derivatives.restore(found, *handed)

    def recall_kinks(self, description: dict[str, Any]) -> None:
        """Restore the recorded kinks, dropping any recorded since."""
        self._derivatives.mechanical.kinks[:] = [
            Kink(**{**kink, "place": tuple(kink["place"])}) for kink in description["kinks"]
        ]
