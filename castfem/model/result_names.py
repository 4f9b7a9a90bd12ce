"""What [[reference]] may compare with: names of the results of a run, and what they measure.

The results are computed far above the case (`castfem.runs.results`), which must not be imported to
read one; tests hold this list against runs.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from castfem.base import units

PROBES = ("mid_face", "narrow_face", "corner", "diagonal", "tip", "fillet")
"""Probes of all shapes; in a half or whole section there are more, their images."""
AT_PROBES = {
    "shell": "mm",
    "liquidus_depth": "mm",
    "surface_temperature": "degC",
    "heat_flux": "kW/m^2",
    "von_mises": "MPa",
    "displacement": "mm",
    "size": "mm",
    "gap": "mm",
    "axial_stress": "MPa",
}
"""Results at a probe, whose name stands behind (shell_mid_face), and a unit of each."""
WHOLE = {
    "solidus": "degC",
    "liquidus": "degC",
    "position": "m",
    "time": "s",
    "heat_removed": "MJ/m",
    "cooling_power": "kW",
    "heat_removed_slice": "kJ",
    "temperature_max": "degC",
    "von_mises_max": "MPa",
    "way_von_mises_max": "MPa",
    "von_mises_smooth": "MPa",
    "way_von_mises_smooth": "MPa",
    "axial_strain": "1",
    **dict.fromkeys(("tilt_x", "tilt_y"), "1/m"),
    "colder_than_data": "percent",
    "hotter_than_data": "percent",
    "faster_than_data": "percent",
    **{f"slice_thickness_{place}": "1" for place in ("intrados", "centre", "extrados")},
    "curvature": "1/m",
    "neutral_axis": "mm",
    "bending_moment": "kN m",
    "bending_work": "kJ/m",
    **dict.fromkeys(("way_I2_max", "way_I2_mechanical_max", "way_I2_pitch_max"), "1/s"),
    **{
        f"{phase}_{index}_max": "MPa" if index == "I1" else "1/s"
        for phase in ("bending", "straightening")
        for index in ("I1", "I2", "I2_mechanical", "I2_pitch")
    },
    "way_I1_max": "MPa",
    "way_band_time_max": "s",
    "way_brittle_strain_max": "percent",
    "critical_share": "percent",
    "centre_solid_fraction": "1",
    **dict.fromkeys([f"pool_end_fs{percent}" for percent in (10, 30, 70, 100)], "m"),
    "soft_reduction_length": "m",
    "soft_reduction": "mm",
    "gap_max": "mm",
    "mean_contact_pressure_max": "MPa",
    "contact_pressure_max": "MPa",
    "contact_share": "percent",
    "contact_sticking": "percent",
    "mould_friction": "kN/m",
    "mould_pull": "kN",
    "penetration": "um",
    "mould_heat_removed": "MJ/m",
    "mould_gap_max": "mm",
    "mould_contact_least": "percent",
    "mould_mean_pressure_max": "MPa",
    "mould_pressure_max": "MPa",
    "mould_penetration_max": "um",
    "negative_strip_time": "s",
    "oscillation_pitch": "mm",
    "liquid_end": "m",
    "metallurgical_length": "m",
    "mould_mean_flux": "kW/m^2",
    "error_temperature": "mK",
    "error_temperature_max": "mK",
    "error_stress": "percent",
}
"""Results of the whole slice, and a unit of each."""

COLUMNS = {
    "step": "s",
    "solidus_cell": "mm",
    "temperature_core": "degC",
    "temperature_min": "degC",
    "axial_force": "kN",
    "friction_force": "kN/m",
    "friction_pull": "kN",
    "contact_pressure": "MPa",
    "roll_resistance": "kN",
    "drive_force": "kN",
    "effort": "kN",
    "bulge_intrados": "mm",
    "bulge_extrados": "mm",
    "bulge_pitch": "mm",
    "bulge_error": "um",
    "roll_force": "kN/m",
    "I1_max": "MPa",
    **dict.fromkeys(("I2_max", "I2_mechanical_max", "I2_pitch_max"), "1/s"),
    "band_time_max": "s",
}
"""Columns of history.csv that are no results, with a unit of each; at probes without their names.

Plain numbers and percentages, which have no other unit, are left out."""


SMOOTH = {
    "von_mises_smooth": "von_mises_max",
    "way_von_mises_smooth": "way_von_mises_max",
}
"""Smooth twins of maxima, which are computed where they are asked for, and what they are of."""


def unit_of(name: str) -> str | None:
    """Return a unit that measures a result, "1" for a plain number; None if there is none."""
    if name in WHOLE:
        return WHOLE[name]
    at_fraction = re.match(r"fs[1-9]\d?_", name)
    known = AT_PROBES if at_fraction is None else {at_fraction[0][:-1]: "mm"}
    for result, unit in known.items():
        probe = name.removeprefix(f"{result}_")
        if probe != name and any(f"{probe}_".startswith(f"{one}_") for one in PROBES):
            return unit
    return None


def all_names() -> Iterator[str]:
    """Yield the names, those of probes without the images of symmetry."""
    yield from WHOLE
    yield from (f"{result}_{probe}" for result in AT_PROBES for probe in PROBES)


def fault(name: str, value: str) -> tuple[str, str] | None:
    """Return the key of a reference that is wrong and why; None if it can be compared.

    Args:
        name: Of the result.
        value: What it is expected to be, with its unit.
    """
    unit = unit_of(name)
    if unit is None:
        return "quantity", f'("{name}") is no result of a run{units.nearest(name, all_names())}'
    measured = "1" if unit == "1" else units.parse_any(f"1 {unit}")[1]
    if units.parse_any(value)[1] == measured:
        return None
    wanted = "a plain number" if unit == "1" else f'a unit such as "{unit}"'
    return "value", f'("{value}") does not measure {name}; it has {wanted}'
