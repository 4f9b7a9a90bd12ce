"""Derivatives of the strained slice, compared with differences of runs and in linear cases."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from mpi4py import MPI

import numpy as np
import pytest

import castfem
from castfem.base.errors import InputError
from castfem.model import Case
from castfem.model.build import mechanics as making
from castfem.model.build import simulation as building
from castfem.model.build.law import build_law
from castfem.model.build.simulation import Simulation, build, case_steel
from castfem.model.load import from_document
from castfem.physics.coupling.staggered import StrandState
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.followed_run import Derivatives, follow
from castfem.studies.sensitivity.mechanical import MechanicalDerivatives
from castfem.studies.sensitivity.parameters import Parameter, read_parameters
from castfem.studies.sensitivity.step_inputs import CARRIED

FREE = {
    "casting.length": "2.5 mm", "output.fields": [], "output.figures": False,
    "mechanics.tolerance": 1e-12,
}  # fmt: skip
LAWS: dict[str, dict[str, Any]] = {
    "plastic": {},
    "viscoplastic": {
        "law": "norton_hoff_kozlowski", "elasticity": "elastic_steel", "ferrostatic": "full",
    },
    "signed": {
        "law": "norton_hoff_kozlowski_signed", "elasticity": "elastic_steel", "ferrostatic": "full",
    },
    "blended": {
        "law": str(Path(__file__).with_name("blended_steel.toml")), "elasticity": "elastic_steel",
        "ferrostatic": "full",
    },
}  # fmt: skip
CREEPS = str(Path(__file__).with_name("creeping_steel.toml"))
LAWS["creeping"] = {"law": CREEPS, "elasticity": "elastic_steel", "ferrostatic": "full"}
CARBON = {
    "steel": {"name": "plain_carbon", "composition": {"C": 0.15}},
    "casting": {"speed": "1 m/min", "length": "10 mm", "superheat": "5 K"},
}  # fmt: skip
"""A steel that is delta ferrite as it freezes, and becomes austenite during the run."""


@cache
def strip(law: str = "plastic") -> Case:
    """Return the half-space of Weiner and Boley, three windows of it, with another law."""
    document = castfem.load("verification/weiner_boley_coarse").with_(FREE).document()
    del document["verification"]
    document["mechanics"] |= LAWS[law]
    if law == "blended":
        document |= CARBON
    return from_document(document)


@dataclass(slots=True)
class Marks:
    derivatives: Derivatives

    def step(self, run: RunState, sample: Sample) -> None:
        self.derivatives.mark(run.state)


def ended(simulation: Simulation, recorder: Marks | None = None) -> StrandState:
    """Return the state at the end of a run whose temperatures are solved to rounding."""
    simulation.problem.tolerance = 1e-12
    loop = TimeLoop(simulation, recorder)
    loop.run()
    return loop.run_state.state


def followed(case: Case, *names: str) -> tuple[StrandState, MechanicalDerivatives]:
    """Return the end of a run with its derivatives."""
    simulation = build(case, MPI.COMM_SELF)
    derivatives = follow(simulation, names)
    state = ended(simulation, Marks(derivatives))
    return state, derivatives.coupled.mechanical


def moved(case: Case, parameter: Parameter, by: float) -> StrandState:
    """Return the end of a separate run with a parameter moved, in its unit."""
    value = parameter.value + by
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(building, "case_steel", lambda c: parameter.steel_at(case_steel(c), value))
        patch.setattr(making, "build_law", lambda t, s: parameter.law_at(build_law(t, s), value))
        simulation = build(parameter.case_at(case, value), MPI.COMM_SELF)
    return ended(simulation)


PARAMETERS = {
    "plastic": ("steel.thermal_expansion", "law.yield_stress"),
    "viscoplastic": ("steel.conductivity",),
    "signed": ("law.strength",),
    "blended": ("casting.superheat",),
    "creeping": ("law.rate", "law.exponent"),
}


@pytest.mark.parametrize("law", PARAMETERS)
def test_slice_has_the_differences_of_runs(law: str) -> None:
    """Stress, memory, displacement and planes; by law, contraction, heat and pressure."""
    case, names = strip(law), PARAMETERS[law]
    share = 1e-4 if law == "creeping" else 1e-5  # a weak effect of its rate: more rounding
    _, found = followed(case, *names)
    parameters = read_parameters(case, case_steel(case), names)
    for parameter, slopes in zip(parameters, found.slopes, strict=True):
        by = share * (10.0 if parameter.unit == "degC" else abs(parameter.value))
        above, below = (moved(case, parameter, sign * by).mechanical for sign in (1.0, -1.0))
        assert above is not None and below is not None
        for name in CARRIED:
            known = (getattr(above, name) - getattr(below, name)) / (2.0 * by)
            size = np.abs(slopes[name]).max()
            assert np.abs(known - slopes[name]).max() < 2e-6 * size, (parameter.name, name)


def test_results_of_the_slice() -> None:
    """The contraction strains the slice and does not change the heat."""
    found = castfem.sensitivities(
        strip(), "steel.thermal_expansion", "axial_strain,von_mises_max,heat_removed"
    ).gradient
    assert found["heat_removed"]["steel.thermal_expansion"] == 0.0
    _, slopes = followed(strip(), "steel.thermal_expansion")
    strain = slopes.slopes[0]["generalized_strains"][0]
    assert found["axial_strain"]["steel.thermal_expansion"] == pytest.approx(strain, rel=1e-6)


def test_number_of_the_law_has_its_name_in_inputs() -> None:
    case = strip()
    names = "law.yield_stress", "mechanics.law.yield_stress"
    short, long = (castfem.sensitivities(case, name, "axial_strain").gradient for name in names)
    assert short["axial_strain"][names[0]] == long["axial_strain"][names[1]] != 0.0
    with pytest.raises(InputError, match=r"law weiner_boley has yield_stress; did you mean yield"):
        castfem.sensitivities(case, "mechanics.law.yield_stres")


def test_unsupported_derivatives_are_refused_by_name() -> None:
    taper = "billet125/taper_1"
    large = castfem.load(taper).with_({"mechanics.strain": "large"})
    zhu = castfem.load(taper).with_({"mechanics.law": "kozlowski_zhu"})
    for case, name, message in (
        ("slab1200/bending", "casting.speed", "machine: bending, rolls and drives are not"),
        (large, "mould.taper", 'mechanics.strain: take strain = "small"'),
        (strip(), "law.yield_stres", "law weiner_boley has yield_stress; did you mean yield"),
        (zhu, "law.strength", "law kozlowski_zhu has no number that is given over t"),
        (taper, "mould.length", r"--to mould.length: .*with 599.9\d+ mm it is invalid: compare"),
        (taper, "mould.tapper", r"no number there; did you mean mould.taper\?"),
        ("billet125/thermal", "law.yield_stress", r"the case has no \[mechanics\]"),
    ):
        with pytest.raises(InputError, match=message):
            castfem.sensitivities(case, name)
    with pytest.raises(InputError, match=r"corner; did you mean von_mises_max"):
        castfem.sensitivities(taper, "mould.taper", "von_mises_mx")
