"""Results of a run with [verification]: its errors against the closed form."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from castfem.base.result_registry import quantity
from castfem.base.types import Array

if TYPE_CHECKING:
    from castfem.physics.closed_forms import ClosedForm
    from castfem.runs.results.sample import Sample


def _exact(sample: Sample) -> ClosedForm:
    exact = sample.simulation.exact
    assert exact is not None, "of a quantity that needs a closed form"
    return exact


def _temperature_off(sample: Sample) -> tuple[Array, Array]:
    """Error of the temperature at this rank's frozen vertices, and their areas."""
    exact, section, time = _exact(sample), sample.simulation.section, sample.time
    depth = section.vertex_space.tabulate_dof_coordinates()[: section.owned, 0]
    ours = sample.state.thermal.point.temperature[: section.owned]
    inside = depth <= exact.depth(time)
    area = sample.simulation.problem.area[: section.owned]
    return (ours - exact.temperature(depth, time))[inside], area[inside]


quantity(
    "error_temperature", "mK", "temperature off the closed form, rms of what has frozen",
    column=False, needs=("closed_form",),
    says="Root mean square error of the temperature over the frozen part, against the closed form.",
)(
    lambda sample: _rms(sample, *_temperature_off(sample)) if sample.time > 0.0 else None
)  # fmt: skip


@quantity(
    "error_temperature_max", "mK", "temperature off the closed form, worst vertex of that",
    column=False, needs=("closed_form",),
)  # fmt: skip
def error_temperature_max(sample: Sample) -> float | None:
    """Largest error of the temperature at a frozen vertex."""
    if not sample.time > 0.0:
        return None
    from castfem.fem import reductions

    largest = np.abs(_temperature_off(sample)[0]).max(initial=0.0)
    return float(reductions.largest(sample.simulation.section.comm, np.array([largest])))


@quantity(
    "error_stress", "percent", "axial stress off the closed form, rms of the shell", column=False,
    place=lambda sample: f"of {1e-6 * _exact(sample).unit_stress:g} MPa",
    needs=("mechanics", "closed_form"),
)  # fmt: skip
def error_stress(sample: Sample) -> float | None:
    """Root mean square error of the axial stress over the shell."""
    exact, strained, time = _exact(sample), sample.simulation.strained, sample.time
    if exact.stress is None or exact.shell is None or strained is None or not time > 0.0:
        return None
    assert sample.state.mechanical is not None
    points = strained.points
    depth = points.deviator.position[:, 0]
    inside = depth < exact.shell(time)
    stress = points.recovered(sample.state.mechanical.stress)[:, 2][inside]
    off = (stress - exact.stress(depth[inside], time)) / exact.unit_stress
    return _rms(sample, off, points.deviator.volume[inside])


def _rms(sample: Sample, off: npt.NDArray[Any], weight: npt.NDArray[Any]) -> float:
    """Weighted root mean square over the ranks; NaN without values."""
    from castfem.fem import reductions

    sums = np.array([weight @ off**2, weight.sum()])
    squares, whole = reductions.totals(sample.simulation.section.comm, sums)
    return float(np.sqrt(squares / whole)) if whole > 0.0 else float("nan")
