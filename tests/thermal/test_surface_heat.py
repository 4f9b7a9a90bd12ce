"""Heat of a surface computed in one loop: the sum of all its laws."""

from __future__ import annotations

import numpy as np
import pytest

from castfem.base.tables import Constant, Table
from castfem.physics.thermal.boundary import Cooling, Patch
from castfem.physics.thermal.flux_laws import (
    Contact,
    Convection,
    PrescribedFlux,
    Radiation,
    SurfaceLaw,
)
from castfem.physics.thermal.spray_correlations import CORRELATIONS
from castfem.physics.thermal.spray_flux import (
    CoefficientTable,
    OfCorrelation,
    RollShare,
    Share,
    SprayWater,
)
from castfem.physics.thermal.surface_heat import SurfaceHeat
from castfem.physics.thermal.surface_loop import add_up

N = 9
KELVIN = np.array([-50.0, 300.0, 450.0, 500.0, 900.0, 1000.0, 1299.0, 1300.0, 1700.0])
FEW = CoefficientTable(
    (500.0, 900.0, 1300.0), (0.0, 5.0, 10.0), ((0, 900, 1500), (0, 400, 700), (0, 350, 650))
)
TWO = CoefficientTable((400.0, 1200.0), (0.0, 4.0), ((10.0, 500.0), (30.0, 900.0)))
WATER = np.linspace(0.0, 12.0, N)
RISING = Table("time", (0.0, 10.0), (0.2, 1.2))
EMISSIVITY = Table("temperature", (300.0, 1300.0), (0.6, 0.85))


def sprayed(*coefficients: object, flow: object = Constant(1.0)) -> SprayWater:
    rows = (Share(WATER * (i % 2 + 1), flow, 1.0, c) for i, c in enumerate(coefficients))  # type: ignore[arg-type]
    return SprayWater(tuple(rows), 298.0)


LAWS: dict[str, SurfaceLaw] = {
    "convection": Convection(800.0, 320.0),
    "over temperature": Convection(Table("temperature", (300.0, 1500.0), (900.0, 200.0)), 310.0),
    "radiation": Radiation(0.8, 330.0),
    "emissivity over temperature": Radiation(EMISSIVITY, 330.0, wall_emissivity=0.7),
    "across a gap": Radiation(EMISSIVITY, 400.0, 0.5, 1.5, 200.0, np.linspace(0.0, 1e-3, N)),
    "a wall that takes nothing": Radiation(0.8, 330.0, wall_emissivity=0.0),
    "one nozzle": sprayed(FEW),
    "the same nozzle twice": sprayed(FEW, FEW),
    "two nozzles": sprayed(FEW, TWO, FEW),
    "changing water": sprayed(FEW, TWO, flow=RISING),
    "of a formula": sprayed(OfCorrelation(CORRELATIONS["nozaki"], 298.0)),
    "roll": RollShare(0.3, 0.02, ((0.1, Radiation(EMISSIVITY, 330.0)), (0.05, sprayed(FEW, TWO)))),
    "roll beside changing water": RollShare(0.2, 0.01, ((0.1, sprayed(TWO, flow=RISING)),)),
    "flux": PrescribedFlux(lambda time: 1e5 * time),
    "contact": Contact(1500.0, 400.0, 0.1, np.linspace(0.0, 1e-3, N)),
}
PATCHES = (
    Patch(np.arange(3, 3 + N), np.linspace(0.01, 0.02, N)),
    Patch(np.arange(0, 2 * N, 2), np.linspace(0.03, 0.01, N)),
)
OWNED = np.resize(KELVIN, 2 * N + 2)


def one_by_one(cooling: Cooling, time: float) -> tuple[np.ndarray, np.ndarray]:
    heat, slope = np.zeros((2, len(OWNED)))
    for patch, law in cooling.laws:
        q, dq = law.flux(OWNED[patch.dofs], time)
        heat[patch.dofs] += patch.weights * q
        slope[patch.dofs] += patch.weights * dq
    return heat, slope


def compare(surface: SurfaceHeat, cooling: Cooling, time: float) -> None:
    expected, found = one_by_one(cooling, time), surface.at(OWNED, time)
    for reference, value in zip(expected, found, strict=True):
        assert value == pytest.approx(reference[surface.vertices], rel=1e-12, abs=1e-12)
        assert not np.delete(reference, surface.vertices).any()


@pytest.mark.parametrize("name", LAWS)
def test_each_law_is_the_sum_of_its_terms(name: str) -> None:
    cooling = Cooling([(PATCHES[0], LAWS[name])])
    surface = SurfaceHeat(cooling)
    for time in (2.0, 7.0, 7.0, 1.0):
        compare(surface, cooling, time)


def test_laws_add_up_and_can_be_replaced() -> None:
    laws = [(PATCHES[i % 2], law) for i, law in enumerate(LAWS.values())]
    cooling = Cooling(laws)
    surface = SurfaceHeat(cooling)
    compare(surface, cooling, 3.0)
    compare(surface, cooling, 8.0)
    cooling.laws = [(PATCHES[0], Convection(70.0, 350.0)), *laws[1:]]
    compare(surface, cooling, 8.0)


def test_nan_temperature_gives_nan_heat() -> None:
    cooling = Cooling([(PATCHES[0], sprayed(FEW)), (PATCHES[0], Convection(800.0, 320.0))])
    heat, _ = SurfaceHeat(cooling).at(np.full_like(OWNED, np.nan), 1.0)
    assert len(heat) == N
    assert np.isnan(heat).all()


def test_without_laws_there_is_no_heat() -> None:
    heat, slope = SurfaceHeat(Cooling([])).at(OWNED, 1.0)
    assert heat.shape == slope.shape == (0,)


def test_inconsistent_arrays_are_rejected() -> None:
    with pytest.raises(ValueError, match="belong together"):
        add_up(np.zeros(1, int), np.zeros((1, 2)), KELVIN, np.zeros((0, 2, N)), np.zeros(0))
