"""A new surface law and a new spray correlation need only the definitions in this file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pytest
from pydantic import Field
from small_case import write_small

import castfem
from castfem.base.errors import InputError
from castfem.base.quantities import Kind, Temperature
from castfem.base.types import Array
from castfem.model.cooling import GivenFlux
from castfem.model.heat_law import HeatLaw, Surroundings
from castfem.model.schema import case_schema, markdown_page
from castfem.physics.machine import Machine
from castfem.physics.machine.travel import Steady
from castfem.physics.materials import load_steel
from castfem.physics.thermal import spray_correlations
from castfem.physics.thermal.flux_laws import SurfaceLaw

HEAT = "cooling.mould.surface"
RATED = {"law": "rated", "flux": "4 MW/m^2", "at": "1200 degC", "ambient": "25 degC"}


@dataclass(frozen=True)
class RatedFlux(SurfaceLaw):
    """A flux proportional to the excess over the ambient temperature, W/m2."""

    per_kelvin: float
    ambient: float

    def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
        return self.per_kelvin * (temperature - self.ambient), np.full_like(
            temperature, self.per_kelvin
        )

    def least_rise(self, temperatures: Array, time: float) -> float:
        return self.per_kelvin

    def ambient_range(self, time: float) -> tuple[float, float]:
        return self.ambient, self.ambient


@pytest.fixture
def rated(monkeypatch: pytest.MonkeyPatch) -> type[HeatLaw]:
    """Register a law for the test that uses this fixture."""
    monkeypatch.setattr(HeatLaw, "kinds", dict(HeatLaw.kinds))

    class Rated(HeatLaw):
        """A flux that is known at one surface temperature."""

        law: Literal["rated"]
        flux: Annotated[float, Kind("W/m^2", "MW/m^2")] = Field(description="heat flux there")
        at: Temperature = Field(description="surface temperature it is known at")
        ambient: Temperature = Field(description="temperature of the surroundings")
        until: GivenFlux | None = Field(None, description="nothing; a table for its milestones")

        def build(self, around: Surroundings) -> RatedFlux:
            return RatedFlux(self.flux / (self.at - self.ambient), self.ambient)

    return Rated


@pytest.fixture
def case(tmp_path: Path) -> castfem.Case:
    return castfem.load(write_small(tmp_path))


def final(case: castfem.Case) -> float:
    return float(castfem.run(case).history["surface_temperature_mid_face"].iloc[-1])


def test_new_law_runs(case: castfem.Case, rated: type[HeatLaw]) -> None:
    """It gives the temperature of convection with the same coefficient."""
    convection = {
        "law": "convection",
        "coefficient": f"{4e6 / (1200 - 25)!r} W/(m^2 K)",
        "ambient": "25 degC",
    }
    new, expected = (final(case.with_({HEAT: [law]})) for law in (RATED, convection))
    assert new == pytest.approx(expected, abs=1e-6)
    assert new < final(case) - 20.0


def test_new_law_is_checked_written_and_documented(
    case: castfem.Case, rated: type[HeatLaw], tmp_path: Path
) -> None:
    table = {"time": [0, 0.4, 0.7], "time_unit": "s", "value": [1, 2, 3], "unit": "MW/m^2"}
    changed = case.with_({HEAT: [{**RATED, "until": table}]})
    (law,) = changed.cooling[0].surface
    assert isinstance(law, rated)
    around = Surroundings(load_steel("carbon_042"), Machine(Steady(0.06)))
    assert law.milestones(around) == (0.0, 0.4, 0.7)
    path = tmp_path / "again.toml"
    path.write_text(changed.resolved_toml())
    assert castfem.load(path).cooling == changed.cooling
    with pytest.raises(InputError, match=r"flux .*is missing; heat flux there, such as"):
        case.with_({HEAT: [{"law": "rated", "at": "1200 degC", "ambient": "25 degC"}]})
    with pytest.raises(InputError, match=r'"raded" is not known.*did you mean "?rated'):
        case.with_({HEAT: [{**RATED, "law": "raded"}]})
    with pytest.raises(InputError, match=r'at .*temperature.*"1200 mm"'):
        case.with_({HEAT: [{**RATED, "at": "1200 mm"}]})
    page = markdown_page()
    assert '### `[[cooling.surface]], law = "rated"`' in page
    assert '| `ambient` | temperature: `"160 degC"` | required | temperature of the surr' in page
    assert "Rated" in case_schema()["$defs"]


def test_law_without_build_is_rejected_in_its_definition() -> None:
    with pytest.raises(TypeError, match=r'Unbuilt \(law = "unbuilt"\) does not define build'):

        class Unbuilt(HeatLaw):
            law: Literal["unbuilt"]

    assert "unbuilt" not in HeatLaw.kinds


def test_law_without_a_bound_of_its_slope_is_rejected(
    case: castfem.Case, rated: type[HeatLaw], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also if it is not derived from SurfaceLaw."""

    class Falling(SurfaceLaw):
        def flux(self, temperature: Array, time: float) -> tuple[Array, Array]:
            return temperature, temperature

        def ambient_range(self, time: float) -> tuple[float, float]:
            return 0.0, 0.0

    with pytest.raises(TypeError, match=r"Falling .*least_rise"):
        Falling()
    monkeypatch.setattr(rated, "build", lambda *_: object())
    with pytest.raises(TypeError, match="object is not a flux law; derive it from SurfaceLaw"):
        castfem.run(case.with_({HEAT: [RATED]}))


def test_new_spray_correlation_runs(case: castfem.Case) -> None:
    """It is registered by its name, and its measured range is checked."""

    def linear(water: float, water_temperature: float, surface: Array) -> Array:
        """Return twice the coefficient of Mizikar."""
        return np.full_like(surface, 155.2 * water)

    spray = {"law": "spray", "water": "5 L/(m^2 s)", "water_temperature": "25 degC"}
    with pytest.raises(InputError, match=r"correlation .*: not possible .*wendelstorf"):
        case.with_({HEAT: [{**spray, "correlation": "linear"}]})
    try:
        spray_correlations.correlation((1.0, 4.0))(linear)
        new = case.with_({HEAT: [{**spray, "correlation": "linear"}]})
        twice = {**spray, "correlation": "mizikar", "machine_factor": 0.5}
        assert final(new) == pytest.approx(final(case.with_({HEAT: [twice]})), abs=1e-9)
        assert "outside of what linear was measured for, 1 to 4" in " ".join(
            str(warning) for warning in castfem.model.checks.unusual.warnings(new)
        )
        assert '`"linear"`' in markdown_page()
    finally:
        del spray_correlations.CORRELATIONS["linear"]
