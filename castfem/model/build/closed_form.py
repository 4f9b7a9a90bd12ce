"""How far a run is from the closed form that its case names."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from castfem.fem import reductions
from castfem.runs.output.summary import Quantity, Reference
from castfem.base.types import Array

if TYPE_CHECKING:
    from mpi4py import MPI

    from castfem.model import Case
    from castfem.physics.coupling.staggered import StrandState
    from castfem.physics.materials import Steel
    from castfem.model.build.simulation import Simulation
    from castfem.physics.closed_forms import ClosedForm


def of_case(case: Case, steel: Steel, start: float) -> ClosedForm | None:
    """The closed form of a case; None if it names none.

    Raises:
        InputError: Steel or temperatures are none for which it holds.
    """
    if case.verification is None:
        return None
    from castfem.model.cooling import PrescribedTemperature
    from castfem.physics.closed_forms import closed_form

    (law,) = case.cooling[0].surface
    assert isinstance(law, PrescribedTemperature), "the case has been checked"
    return closed_form(case.verification.closed_form, steel, law.value, start)


def references(exact: ClosedForm, time: float) -> list[Reference]:
    """What it has for the results of the summary at a time, s."""
    return [
        Reference(name, e.value, e.unit, exact.source, note=e.note)
        for name, e in exact.results(time).items()
    ]


def errors(exact: ClosedForm, simulation: Simulation, state: StrandState) -> dict[str, Quantity]:
    """Rms errors of the committed `state` over what has frozen (collective)."""
    section, time = simulation.section, state.thermal.time
    if time <= 0.0:
        return {}
    comm = section.comm
    depth = section.vertex_space.tabulate_dof_coordinates()[: section.owned, 0]
    ours = state.thermal.point.temperature[: section.owned]
    inside = depth <= exact.depth(time)
    gap = (ours - exact.temperature(depth, time))[inside]
    area = simulation.problem.area[: section.owned][inside]
    largest = reductions.largest(comm, np.array([np.abs(gap).max(initial=0.0)]))
    found = {
        "error_temperature": Quantity(
            _rms(comm, gap, area), "mK", "temperature off the closed form, rms of what has frozen"
        ),
        "error_temperature_max": Quantity(
            float(largest), "mK", "temperature off the closed form, worst vertex of that"
        ),
    }
    if exact.stress is None or exact.shell is None or state.mechanical is None:
        return found
    assert simulation.mechanics is not None
    points = simulation.mechanics.problem.points
    depth = points.deviator.position[:, 0]
    inside = depth < exact.shell(time)
    stress = points.recovered(state.mechanical.stress)[:, 2][inside]
    off = (stress - exact.stress(depth[inside], time)) / exact.unit_stress
    unit = f"{1e-6 * exact.unit_stress:g} MPa"
    found["error_stress"] = Quantity(
        _rms(comm, off, points.deviator.volume[inside]),
        "percent",
        f"axial stress off the closed form, rms of the shell, of {unit}",
    )
    return found


def _rms(comm: MPI.Comm, gap: npt.NDArray[Any], weight: Array) -> float:
    """Weighted root mean square over the ranks; NaN where there is nothing."""
    squares, whole = reductions.totals(comm, np.array([weight @ gap**2, weight.sum()]))
    return float(np.sqrt(squares / whole)) if whole > 0.0 else float("nan")
