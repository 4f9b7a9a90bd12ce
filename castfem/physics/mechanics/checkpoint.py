"""Converts the mechanical state to arrays that do not depend on the number of ranks, and back."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from dolfinx import fem

from castfem.base.types import Array
from castfem.fem import dof_values, reductions
from castfem.fem.section import Cellwise
from castfem.physics.mechanics.generalized_plane_strain import STRAIGHT, Bending
from castfem.physics.mechanics.problem import MechanicalProblem
from castfem.physics.mechanics.state import MechanicalState


class MechanicalCheckpoint:
    """Converts a `MechanicalState` for a checkpoint, and back.

    Values at points and at nodes of the displacement are stored cell by cell, so that each node is
    repeated in each of its cells; temperatures are stored by node of the section.

    Args:
        problem: Mechanical problem of the states (collective).
    """

    def __init__(self, problem: MechanicalProblem) -> None:
        self.problem = problem
        self._cellwise = Cellwise(problem.section)
        cells = len(self._cellwise.cells)
        self._nodes = np.asarray(problem.space.dofmap.list)[:cells]

    def arrays(self, state: MechanicalState) -> dict[str, Array | None]:
        """Arrays of `state`, complete on rank 0, None elsewhere (collective)."""
        deviator_points, cells = self.problem.points.deviator_points, len(self._cellwise.cells)
        rate = dof_values.with_ghosts(self.problem.space, state.rate)
        parts: dict[str, Array] = {
            "displacement": state.displacement.reshape(-1, 2)[self._nodes],
            "displacement_rate": rate.reshape(-1, 2)[self._nodes],
        }
        for name, values in (("stress", state.stress), ("internal", state.internal)):
            for rule, rows in (
                ("deviator", values[:deviator_points]),
                ("mean", values[deviator_points:]),
            ):
                shape = (cells, self._points_in_cell(rule), values.shape[1])
                parts[f"{name}_{rule}"] = rows.reshape(shape)
        if reductions.total(self.problem.section.comm, state.pressure.size) > 0:
            parts["pressure"] = state.pressure.reshape(cells, self._points_in_cell("mean"))
        found = {name: self._cellwise.gather(values) for name, values in parts.items()}
        found["mechanical_temperature"] = self.problem.section.gather(state.temperature)
        return found | self.problem.interactions.arrays(state.interactions)

    def _points_in_cell(self, rule: str) -> int:
        return len(getattr(self.problem.points, rule).points)

    @staticmethod
    def description(state: MechanicalState) -> dict[str, Any]:
        """Parts of `state` that are not arrays over the section."""
        bent = {} if state.bending == STRAIGHT else {"bending": _written(state.bending)}
        return bent | {
            "time": state.time,
            "modes": state.generalized_strains.tolist(),
            "scalars": state.scalars.tolist(),
            "scalar_rate": state.scalar_rate.tolist(),
            "unsteadiness": state.unsteadiness,
        }

    def state(self, description: dict[str, Any], arrays: dict[str, Array]) -> MechanicalState:
        """Restore the state from `description` and `arrays`, both on every rank."""
        cells = self._cellwise.cells
        displacement, rate = (
            self._by_node(arrays[name][cells]) for name in ("displacement", "displacement_rate")
        )
        nodes = self.problem.section.node_of_owned
        return MechanicalState(
            time=description["time"],
            displacement=displacement,
            generalized_strains=np.array(description["modes"], float),
            scalars=np.array(description["scalars"], float),
            rate=rate[: self.problem.owned],
            scalar_rate=np.array(description["scalar_rate"], float),
            unsteadiness=description["unsteadiness"],
            temperature=np.asarray(arrays["mechanical_temperature"])[nodes],
            stress=self._by_point("stress", arrays),
            internal=self._by_point("internal", arrays),
            pressure=arrays["pressure"][cells].ravel() if "pressure" in arrays else np.zeros(0),
            interactions=self.problem.interactions.restored(arrays),
            bending=_restored(description.get("bending", {})),
        )

    def _by_node(self, of_cells: Array) -> Array:
        """Values of this rank's nodes, including ghosts, from those of its cells' nodes."""
        field = fem.Function(self.problem.space)
        field.x.array.reshape(-1, 2)[self._nodes] = of_cells
        # Every node of this rank has a cell here; values of ghost cells come from their owners.
        field.x.scatter_forward()
        return np.array(field.x.array)

    def _by_point(self, name: str, arrays: dict[str, Array]) -> Array:
        cells = self._cellwise.cells
        rows = [arrays[f"{name}_{rule}"][cells] for rule in ("deviator", "mean")]
        # For a law without state variables there are no columns to derive -1 from.
        return np.concatenate([p.reshape(p.shape[0] * p.shape[1], p.shape[2]) for p in rows])


def _written(bending: Bending) -> dict[str, Any]:
    """The bending variables for a checkpoint."""
    found = asdict(bending)
    if bending.withdrawal is None:
        del found["withdrawal"]
    return found


def _restored(entries: dict[str, Any]) -> Bending:
    """Restore the bending from a checkpoint."""
    if "withdrawal" not in entries:
        return Bending(**entries)
    from castfem.physics.machine.extraction.effort import Withdrawal

    return Bending(**entries | {"withdrawal": Withdrawal.restored(entries["withdrawal"])})
