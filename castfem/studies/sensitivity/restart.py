"""Derivatives of a strained slice as a checkpoint holds them, and back.

The derivative of a state has the arrays of a state: it is taken apart as one is.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np

from castfem.base.types import Array
from castfem.fem import reductions
from castfem.physics.mechanics.checkpoint import MechanicalCheckpoint
from castfem.physics.mechanics.state import MechanicalState
from castfem.runs.results.run_state import RunState
from castfem.studies.sensitivity.coupled import FollowedCoupling
from castfem.studies.sensitivity.mechanical import MechanicalDerivatives
from castfem.studies.sensitivity.moved_state import CARRIED, Slopes, none_of, with_numbers
from castfem.studies.sensitivity.result import Kink

_BESIDE = ("pressure", "mechanical_temperature")
"""Arrays of a state whose derivatives the next step does not ask for."""
_NUMBERS = ("generalized_strains", "scalars", "scalar_rate")
_OF_WINDOW = ("warmed", "filled")


class CoupledCheckpoint:
    """Takes the derivatives of a run with mechanics apart, and puts them together again.

    Args:
        coupling: Carries what a window hands to the next.
        mechanical: Derivatives of the slice.
        run: Whose states these are; it is not written to.
    """

    def __init__(
        self, coupling: FollowedCoupling, mechanical: MechanicalDerivatives, run: RunState
    ) -> None:
        assert run.mechanical_checkpoint is not None
        self._coupling, self._mechanical = coupling, mechanical
        self._checkpoint: MechanicalCheckpoint = run.mechanical_checkpoint
        self._section = run.simulation.section

    def arrays(self, state: MechanicalState) -> dict[str, Array | None]:
        """The arrays, whole on rank 0, None elsewhere (collective)."""
        found: dict[str, Array | None] = {}
        for number, slopes in enumerate(self._slopes(state)):
            its = self._checkpoint.arrays(with_numbers(state, slopes))
            found |= {f"{n}_by_{number}": v for n, v in its.items() if n not in _BESIDE}
        for name, by_parameter in zip(_OF_WINDOW, self._coupling.handed_on(), strict=True):
            if reductions.any_of(self._section.comm, by_parameter.shape[1] > 0):
                owned = {f"{name}_by_{i}": np.asarray(its) for i, its in enumerate(by_parameter)}
                found |= {key: self._section.gather(its) for key, its in owned.items()}
        return found

    def _slopes(self, state: MechanicalState) -> list[Slopes]:
        """Those of the committed state."""
        return [slopes or none_of(state) for slopes in self._mechanical.marked]

    def description(self, state: MechanicalState) -> dict[str, Any]:
        """What of them is no array over the section."""
        return {
            "slopes": [{n: s[n].tolist() for n in _NUMBERS} for s in self._slopes(state)],
            "kinks": [asdict(kink) for kink in self._mechanical.kinks.found],
        }

    @staticmethod
    def is_whole(description: dict[str, Any]) -> bool:
        """Whether all that a step begins with is in a checkpoint; earlier ones lack the rates."""
        return all(name in numbers for numbers in description["slopes"] for name in _NUMBERS)

    def restore(
        self, description: dict[str, Any], by_node: dict[str, Array], state: MechanicalState
    ) -> None:
        """Go on from derivatives that have been saved (collective).

        Args:
            description: As `description` gave it.
            by_node: As `arrays` gave them, on every rank.
            state: That they belong to, restored.
        """
        found: list[Slopes] = []
        for number, numbers in enumerate(description["slopes"]):
            ending = f"_by_{number}"
            mine = {n.removesuffix(ending): v for n, v in by_node.items() if n.endswith(ending)}
            mine |= {name: by_node[name] for name in _BESIDE if name in by_node}
            said = self._checkpoint.description(state)
            said |= {"modes": numbers["generalized_strains"]}
            said |= {name: numbers[name] for name in ("scalars", "scalar_rate")}
            its = self._checkpoint.state(said, mine)
            slopes = {name: getattr(its, name) for name in CARRIED}
            found.append(slopes | ({} if its.contact is None else its.contact.numbers()))
        self._mechanical.slopes = found
        nodes, count = self._section.node_of_owned, len(found)
        handed = [
            np.array([np.asarray(by_node[f"{n}_by_{i}"])[nodes] for i in range(count)])
            if f"{n}_by_0" in by_node
            else np.zeros((count, 0))
            for n in _OF_WINDOW
        ]
        self._coupling.take_up(*handed)

    def recall_kinks(self, description: dict[str, Any]) -> None:
        """Take up what had been noted, and nothing that was noted since."""
        self._mechanical.kinks.found[:] = [
            Kink(**{**kink, "place": tuple(kink["place"])}) for kink in description["kinks"]
        ]
