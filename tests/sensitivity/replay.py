"""Runs on fixed steps, to compare derivatives with differences of runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest
from small_case import small

from castfem.base.types import Array
from castfem.model import Case
from castfem.model.build.simulation import Simulation, build
from castfem.model.build.start import starting_state
from castfem.physics.thermal.stepper import StepResult, ThermalState
from castfem.runs.loop import TimeLoop
from castfem.studies.sensitivity import perturbed_simulation as varied
from castfem.studies.sensitivity.followed_run import Derivatives
from castfem.studies.sensitivity.parameters import Parameter, read_parameters
from castfem.studies.sensitivity.perturbed_simulation import Varied, vary

EXACT = 1e-12  # K, tolerance of stages in compared runs
QUIET: Mapping[str, Any] = {"output.fields": [], "output.every": "100 s", "reference": []}


def bare(changes: Mapping[str, Any] | None = None) -> Case:
    """Return the small billet without output, changed."""
    return small({**QUIET, **(changes or {})})


def built(case: Case, comm: MPI.Comm = MPI.COMM_SELF) -> Simulation:
    """Return a simulation whose stages are solved to rounding."""
    simulation = build(case, comm)
    simulation.problem.tolerance = EXACT
    return simulation


@dataclass(slots=True)
class Followed:
    """A run with its derivatives."""

    simulation: Simulation  #: the run
    state: ThermalState  #: at its end
    derivatives: Derivatives  #: likewise
    loop: TimeLoop  #: that has run
    ends: list[tuple[float, int]]  #: time and number of stages of each step


def followed(case: Case, *names: str, comm: MPI.Comm = MPI.COMM_SELF) -> Followed:
    """Run a case with the derivatives of its temperatures."""
    simulation = built(case, comm)
    parameters = read_parameters(case, simulation.steel, names)
    slopes = Derivatives(simulation, [vary(simulation, p) for p in parameters])
    ends: list[tuple[float, int]] = []

    def noted(old: ThermalState, result: StepResult) -> None:
        ends.append((result.state.time, len(result.stages)))
        slopes.thermal.step(old, result)

    simulation.steps.on_kept = noted
    loop = TimeLoop(simulation)
    loop.run()
    return Followed(simulation, loop.run_state.state.thermal, slopes, loop, ends)


def replayed(run: Followed, number: int, by: float) -> tuple[ThermalState, Varied]:
    """Repeat the steps with a parameter moved `by`, in its unit, with the laws of its own case."""
    parameter: Parameter = run.derivatives.variations[number].parameter
    end = varied._varied(run.simulation, parameter, by)
    state, zone, before = starting_state(end.simulation), -1, 0.0
    problem, stepper = run.simulation.problem, run.simulation.stepper
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(problem, "curve", end.simulation.problem.curve)
        for time, stages in run.ends:
            found = run.simulation.zones.index(before)
            if found != zone:
                zone = found
                problem.set_cooling(end.simulation.zones.cooling(zone))
            result = stepper.step(state, end.time(time))
            assert result.converged, result.reason
            assert len(result.stages) == stages, "the scheme of a step has changed"
            state, before = result.state, time
    return state, end


def differences(
    run: Followed, number: int, by: float, read: Callable[[ThermalState, Varied], Array]
) -> Array:
    """Return the central difference of a reading of two runs, per unit of the parameter."""
    above, below = (read(*replayed(run, number, sign * by)) for sign in (1.0, -1.0))
    return np.asarray((above - below) / (2.0 * by))


def enthalpy(state: ThermalState, end: Varied) -> Array:
    """Return the enthalpy of the vertices."""
    return state.enthalpy
