"""Derivatives of solidification beside its closed forms: Neumann, and Weiner and Boley."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

from mpi4py import MPI

import numpy as np
import pytest
from scipy.integrate import quad
from sensitivity.test_mechanical_derivatives import Marks

import castfem
from castfem.model.build.simulation import build
from castfem.model.load import from_document
from castfem.physics.closed_forms import Neumann
from castfem.physics.closed_forms.half_space import ALPHA, YIELD, HalfSpace
from castfem.runs.loop import TimeLoop
from castfem.runs.results.run_state import RunState
from castfem.runs.results.sample import Sample
from castfem.studies.sensitivity.followed_run import follow

COARSE = {
    "casting.length": "83.3333333333 mm", "output.fields": [], "output.figures": False,
    "section.length": "20 mm", "mesh.core_size": "4 mm", "mesh.surface_depth": "11 mm",
    "thermal.time.step": "0.25 s", "coupling.interval": "0.25 s",
}  # fmt: skip
SLOPES = {"steel.thermal_expansion": ("alpha", ALPHA), "law.yield_stress": ("yield_stress", YIELD)}
BEGUN = 0.25  # of the time: from there on strains are compared; before, it is a cell or two


@dataclass(slots=True)
class StrainSlopes(Marks):
    """Notes the derivatives of the axial strain after each window."""

    noted: list[tuple[float, list[float]]] = field(default_factory=list)

    def step(self, run: RunState, sample: Sample) -> None:
        """Note the time, s, and the derivative by each parameter."""
        Marks.step(self, run, sample)
        assert self.derivatives.coupled is not None
        slopes = self.derivatives.coupled.mechanical.slopes
        if slopes[0]:
            self.noted.append(
                (run.state.time, [float(s["generalized_strains"][0]) for s in slopes])
            )


def moment(form: HalfSpace, time: float) -> float:
    """Moment of the stress about the surface, N m per m2 of its height."""
    size = 2.0 * np.sqrt(form.diffusivity * time)
    ends = (0.0, form.compressed, form.stretched, form.front)

    def integrand(zeta: float) -> float:
        return zeta * float(form.stress(np.array([size * zeta]), time)[0])

    parts = (quad(integrand, low, high)[0] for low, high in pairwise(ends))
    return float(size**2 * sum(parts))


def test_a_half_space_has_the_derivatives_of_weiner_and_boley() -> None:
    """Axial strain and moment of the stress by contraction and yield stress, at 5 s.

    Fifteen cells are frozen then, three of them elastic.  A depth of the closed form is that of a
    tread or riser on them: what is compared are sums over the shell, and the strain of a while.
    """
    document = castfem.load("verification/weiner_boley_coarse").with_(COARSE).document()
    del document["verification"]
    simulation = build(from_document(document), MPI.COMM_SELF)
    marks = StrainSlopes(follow(simulation, list(SLOPES)))
    loop = TimeLoop(simulation, marks)
    loop.run()
    assert marks.derivatives.coupled is not None and simulation.mechanics is not None
    slopes, points = (
        marks.derivatives.coupled.mechanical.slopes,
        simulation.mechanics.problem.points,
    )
    times, noted = np.array([t for t, _ in marks.noted]), np.array([s for _, s in marks.noted])
    end, later = times[-1], times > BEGUN * times[-1]
    # The strain of the closed form goes with log t: cell by cell it does so in steps.
    rates = np.polyfit(np.log(times[later]), noted[later], 1)[0]
    lever = points.deviator.volume * points.deviator.position[:, 0] / 0.5e-3
    for number, (name, (key, value)) in enumerate(SLOPES.items()):
        ends = [HalfSpace(**{key: value * share}) for share in (1.001, 0.999)]
        rate = 0.5 * (ends[0].rate - ends[1].rate) / 0.2
        assert rates[number] == pytest.approx(rate, rel=0.05), name
        if key == "yield_stress":
            exact = (moment(ends[0], end) - moment(ends[1], end)) / 0.2
            slope = points.recovered(slopes[number]["stress"])[:, 2]
            assert lever @ slope == pytest.approx(exact, rel=0.05)


MELT = {
    "output.fields": [], "output.figures": False, "mesh.surface_size": "1.2 mm",
    "mesh.core_size": "1.2 mm", "section.width": "1.2 mm", "thermal.time.step": "0.2 s",
}  # fmt: skip
# Conductivity, density, specific heat, latent heat, temperatures of surface, freezing and pouring.
NUMBERS = (33.0, 7500.0, 661.0, 272e3, 1273.15, 1767.55, 1823.15)


def test_a_melt_has_the_derivatives_of_neumann() -> None:
    """Heat by latent heat and conductivity, and so the front, which that heat has frozen.

    On the mesh the front stands at a vertex: its own derivative is 0 or without bounds, and none is
    told.  Heat of 21 s through cells of 1.2 mm, twelve of which freeze.
    """
    case = castfem.load("verification/neumann").with_(MELT)
    names = {"steel.latent_heat": (3, 1e3), "steel.conductivity": (0, 0.01 * NUMBERS[0])}
    found = castfem.sensitivities(case, list(names), "heat_removed")
    for name, (place, unit) in names.items():
        heats = []
        for sign in (1.0, -1.0):
            k, density, c, latent, surface, melting, poured = (
                value * (1.0 + 1e-4 * sign * (number == place))
                for number, value in enumerate(NUMBERS)
            )
            form = Neumann((k, c), (k, c), density, latent, surface, melting, poured)
            heats.append(2.0 * 21.0 * form.flux(21.0) * 1.2e-3)
        exact = unit * (heats[0] - heats[1]) / (2e-4 * NUMBERS[place])
        assert found.gradient["heat_removed"][name] == pytest.approx(exact, rel=1e-2), name
