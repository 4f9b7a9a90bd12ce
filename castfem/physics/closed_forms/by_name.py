"""Closed forms that a case may name, built from its steel and temperatures."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.errors import InputError
from castfem.base.types import Array
from castfem.physics.closed_forms import half_space
from castfem.physics.closed_forms.half_space import HalfSpace
from castfem.physics.closed_forms.solidification import Neumann, ThreeZones

if TYPE_CHECKING:
    from castfem.physics.materials import Steel

Profile = Callable[[Array, float], Array]

SHARP = 0.2  # K: a narrower freezing range counts as one temperature
_PROPERTIES = ("density", "specific_heat", "conductivity")
_WITHIN = "freezing at one temperature moves the front from vertex to vertex: within one cell"


@dataclass(frozen=True, slots=True)
class Expected:
    """A result at the mid-face according to the closed form."""

    value: float  #: in SI
    unit: str  #: unit in which it is shown
    note: str = ""  #: remark for the reader


@dataclass(frozen=True, slots=True)
class ClosedForm:
    """A half-space x > 0 chilled at x = 0."""

    source: str  #: reference
    temperature: Profile  #: K at depths (n,), m, and a time, s
    #: depth of the liquidus (the end of the mushy zone) at a time, m; errors are evaluated down to
    #: there
    depth: Callable[[float], float]
    #: results at a time, by name in the summary
    results: Callable[[float], Mapping[str, Expected]]
    #: sigma_yy = sigma_zz as a function like the temperature, Pa; None without mechanics
    stress: Profile | None = None
    #: depth of the solid at a time, m; errors of the stress are evaluated down to there
    shell: Callable[[float], float] | None = None
    unit_stress: float = field(default=1.0)  #: unit stress for relative errors, Pa


def closed_form(name: str, steel: Steel, surface: float, start: float) -> ClosedForm:
    """Return the closed form of a case.

    Args:
        name: One of `NAMES`.
        steel: Steel with constant properties.
        surface: Temperature of the surface, K.
        start: Initial temperature of the melt, K.

    Raises:
        InputError: The closed form does not hold for the steel or a temperature.
    """
    if not surface < steel.solidus < start:
        raise InputError(
            f'verification.closed_form: "{name}" is for a melt whose surface is chilled below the '
            "solidus; mend cooling.0.surface.0.value or casting.temperature"
        )
    return _MAKERS[name](steel, surface, start)


def _constants(name: str, steel: Steel, surface: float, start: float) -> tuple[float, ...]:
    """Density, specific heat and conductivity."""
    temperatures = np.linspace(surface, start, 101)
    found = []
    for key in _PROPERTIES:
        values = getattr(steel, key)(temperatures)
        if np.ptp(values) > 1e-12 * np.abs(values).max():
            raise InputError(
                f'verification.closed_form: "{name}" is for constant properties; {key} of '
                f"{steel.name} changes with temperature"
            )
        found.append(float(values[0]))
    return tuple(found)


def _alloy(steel: Steel, surface: float, start: float) -> ClosedForm:
    density, heat, conductivity = _constants("alloy_similarity", steel, surface, start)
    if steel.liquidus - steel.solidus < SHARP:
        raise InputError(
            'verification.closed_form: "alloy_similarity" needs a freezing range; at one '
            'temperature it is "neumann"'
        )
    middle = steel.solid_fraction(0.5 * (steel.solidus + steel.liquidus))
    quarter = steel.solid_fraction(0.75 * steel.solidus + 0.25 * steel.liquidus)
    if not (np.isclose(middle, 0.5) and np.isclose(quarter, 0.75)):
        raise InputError(
            'verification.closed_form: "alloy_similarity" is for a solid fraction linear in '
            f"temperature; that of {steel.name} is not"
        )
    exact = ThreeZones(
        conductivity, density, heat, steel.latent_heat,
        surface, steel.solidus, steel.liquidus, start,
    )  # fmt: skip

    def results(time: float) -> dict[str, Expected]:
        solidus, liquidus = exact.depths(time)
        return {
            "shell_mid_face": Expected(solidus, "mm"),
            "liquidus_depth_mid_face": Expected(liquidus, "mm"),
            "heat_flux_mid_face": Expected(exact.flux(time), "kW/m^2"),
        }

    return ClosedForm(
        "similarity solution of three zones",
        exact.temperature,
        lambda time: exact.depths(time)[1],
        results,
    )


def _neumann(steel: Steel, surface: float, start: float) -> ClosedForm:
    density, heat, conductivity = _constants("neumann", steel, surface, start)
    if steel.liquidus - steel.solidus > SHARP:
        raise InputError(
            'verification.closed_form: "neumann" is for a steel that freezes at one temperature; '
            'with a freezing range it is "alloy_similarity"'
        )
    phase, melting = (conductivity, heat), 0.5 * (steel.solidus + steel.liquidus)
    exact = Neumann(phase, phase, density, steel.latent_heat, surface, melting, start)

    def results(time: float) -> dict[str, Expected]:
        return {
            "shell_mid_face": Expected(exact.front(time), "mm", _WITHIN),
            "heat_flux_mid_face": Expected(exact.flux(time), "kW/m^2"),
        }

    return ClosedForm("Neumann's solution", exact.temperature, exact.front, results)


def _half_space(steel: Steel, surface: float, start: float) -> ClosedForm:
    """Weiner and Boley's problem; a steel with other constants is refused."""
    found = (
        *_constants("weiner_boley", steel, surface, start),
        steel.latent_heat,
        surface - ZERO_CELSIUS,
        float(steel.thermal_expansion(surface)) if steel.has("thermal_expansion") else 0.0,
    )
    wanted = (
        half_space.DENSITY, half_space.HEAT, half_space.CONDUCTIVITY, half_space.LATENT,
        half_space.SURFACE, half_space.ALPHA,
    )  # fmt: skip
    melting = half_space.MELTING + ZERO_CELSIUS
    if (
        not np.allclose(found, wanted, rtol=1e-9)
        or steel.liquidus - steel.solidus > SHARP
        or max(abs(steel.liquidus - melting), start - melting) > 1.0  # K
    ):
        raise InputError(
            'verification.closed_form: "weiner_boley" has its own constants; it needs '
            f'steel.name = "weiner_boley", a surface of {half_space.SURFACE:g} degC, and a melt at '
            f"{half_space.MELTING:g} degC"
        )
    exact = HalfSpace()

    def temperature(depth: Array, time: float) -> Array:
        zeta = depth / (2.0 * np.sqrt(half_space.DIFFUSIVITY * time))
        return np.where(zeta < exact.front, exact.temperature(zeta) + ZERO_CELSIUS, start)

    def results(time: float) -> dict[str, Expected]:
        return {
            "shell_mid_face": Expected(exact.shell(time), "mm", _WITHIN),
            "heat_flux_mid_face": Expected(exact.flux(time), "kW/m^2"),
        }

    return ClosedForm(
        "Weiner and Boley (1963)",
        temperature,
        exact.shell,
        results,
        exact.stress,
        exact.shell,
        half_space.YIELD,
    )


_MAKERS: Mapping[str, Callable[[Steel, float, float], ClosedForm]] = {
    "alloy_similarity": _alloy,
    "neumann": _neumann,
    "weiner_boley": _half_space,
}
NAMES = tuple(_MAKERS)
"""Names of the closed forms."""
