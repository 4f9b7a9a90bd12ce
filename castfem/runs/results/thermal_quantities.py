"""Results of the thermal problem: position and steps, temperature, shell, heat."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from castfem.base.result_registry import AT_FRACTION, QuantityDefinition, quantity, quantity_family

if TYPE_CHECKING:
    from castfem.physics.materials import Steel
    from castfem.runs.results.sample import Sample


quantity(
    "solidus", "degC", "solidus", column=False,
    says="Solidus of the steel.",
)(lambda sample: sample.simulation.steel.solidus)  # fmt: skip
quantity(
    "liquidus", "degC", "liquidus", column=False,
    says="Liquidus of the steel.",
)(lambda sample: sample.simulation.steel.liquidus)  # fmt: skip
quantity(
    "time", "s", "time", after="position",
    says="Time since the meniscus.",
)(lambda sample: sample.time)  # fmt: skip
quantity(
    "position", "m", "position",
    says="Position of the slice below the meniscus.",
)(lambda sample: sample.position)  # fmt: skip
quantity(
    "step", "s", "time step", row=False,
    says="Time step of the thermal problem.",
)(lambda sample: sample.step)  # fmt: skip
quantity(
    "newton", "-", "Newton iterations of the temperature", row=False,
    says="Newton iterations of the thermal step.",
)(lambda sample: float(sample.newton))  # fmt: skip
quantity(
    "surface_temperature", "degC", "surface, {}", each="probe", axis="temperature",
    after="liquidus_depth",
    says="Temperature of the surface.",
)(lambda sample, probe: float(sample.profiles[probe].temperature[0]))  # fmt: skip
quantity(
    "shell", "mm", "shell, {}", each="probe", axis="depth below the surface",
    says="Depth of the solidus below the surface, along the line of the probe.",
)(lambda sample, probe: sample.shell[probe])  # fmt: skip
quantity(
    "solidus_cell", "mm", "cell of the solidus, {}", each="probe", row=False,
    says="Size of the cell that contains the solidus, along the line; empty without one. The "
    "curve of the shell has steps of the cell size, since a vertex cools fast once all its "
    "neighbours are solid. Its error is within a sixth of the cell (cells of 4 mm against 0.8 mm "
    "in `billet125/thermal` down to 13 m: -0.63 to +0.50 mm, 0.03 mm in the mean).",
)(lambda sample, probe: sample.cell[probe])  # fmt: skip
quantity(
    "liquidus_depth", "mm", "depth of the liquidus, {}", each="probe",
    axis="depth below the surface",
    says="Depth of the liquidus below the surface, along the line of the probe.",
)(lambda sample, probe: sample.liquidus[probe])  # fmt: skip
quantity(
    "heat_flux", "kW/m^2", "heat flux, {}", each="probe",
    says="Heat flux out of the surface.",
)(lambda sample, probe: sample.flux[probe])  # fmt: skip
quantity(
    "heat_removed", unit="J/m", shown="MJ/m", label="heat removed per m", axis="heat removed",
    says="Heat removed since the meniscus, per metre of the whole strand.",
)(lambda sample: sample.removed)  # fmt: skip
quantity(
    "cooling_power", "kW", "cooling power to here",
    says="Heat removed at the casting speed: the power of the cooling down to the slice. With a "
    "changing speed the mean speed so far is used.",
)(lambda sample: sample.removed * sample.simulation.machine.mean_speed(sample.time))  # fmt: skip


@quantity("heat_removed_slice", "kJ", "heat removed in 1 s of casting, modelled part", column=False)
def heat_removed_slice(sample: Sample) -> float:
    """Heat removed from the modelled part of the length that is cast in 1 s."""
    simulation = sample.simulation
    speed = simulation.machine.mean_speed(sample.time)
    return sample.removed / simulation.section.multiplicity * speed


quantity(
    "temperature_core", "degC", "core", row=False,
    says="Temperature at the inner end of the line of the first probe.",
)(
    lambda sample: next((float(p.temperature[-1]) for p in sample.profiles.values()), np.nan)
)  # fmt: skip
quantity(
    "temperature_min", "degC", "lowest temperature", row=False,
    says="Lowest temperature of the section.",
)(lambda sample: sample.temperature_range[0])  # fmt: skip
quantity(
    "temperature_max", "degC", "highest temperature",
    says="Highest temperature of the section.",
)(lambda sample: sample.temperature_range[1])  # fmt: skip
quantity(
    "energy_error", "-", "relative error of the energy", row=False,
    axis="relative error of\nthe energy",
    says="Heat in minus heat out minus change of enthalpy in the step, relative.",
)(lambda sample: sample.balance)  # fmt: skip
quantity(
    "metallurgical_length", "m", "metallurgical length", column=False,
    after="mould_penetration_max", of_way=True,
    says="Position at which the last point of the section passed the solidus; empty while liquid "
    "is left.",
)(lambda sample: sample.metallurgical_length)  # fmt: skip
quantity(
    "liquid_end", "m", "end of the liquid core, fs = 0", column=False,
    after="mould_penetration_max", of_way=True,
    says="Position at which the last point of the section passed the liquidus; empty until then.",
)(lambda sample: sample.liquid_end)  # fmt: skip
quantity(
    "mould_mean_flux", "kW/m^2", "mean heat flux in the mould", column=False, after="cooling_power",
    of_way=True,
    says='Heat removed in the mould so far, per surface of the strand and time. The end of the '
    'mould is `mould.length`, or that of the zones whose names contain "mould".',
)(lambda sample: sample.mould_flux)  # fmt: skip


@lru_cache(maxsize=128)
def depth_of(percent: int) -> QuantityDefinition:
    """Return the depth of a solid fraction at each probe as a quantity."""
    levels: dict[int, tuple[Steel, float]] = {}  # those of the last steel

    def depth(sample: Sample, probe: str) -> float:
        """Depth below the surface, along the probe's line, with at least this solid fraction."""
        steel = sample.simulation.steel
        if id(steel) not in levels:
            levels.clear()
            levels[id(steel)] = steel, temperature_at(steel, percent / 100)
        return sample.profiles[probe].isotherm_depth(levels[id(steel)][1])

    return QuantityDefinition(
        f"fs{percent}", unit="mm", label=f"shell to fs = {percent / 100:g}, {{}}", each="probe",
        axis="depth below the surface", compute=depth,
    )  # fmt: skip


quantity_family(AT_FRACTION, depth_of)


def temperature_at(steel: Steel, fraction: float) -> float:
    """Highest temperature with this solid fraction, K; at 1 the solidus."""
    if fraction >= 1.0:
        return steel.solidus
    low, high = steel.solidus, steel.liquidus
    for _ in range(60):  # bisections of the mushy zone
        middle = 0.5 * (low + high)
        if float(steel.solid_fraction(middle)) >= fraction:
            low = middle
        else:
            high = middle
    return low
