"""The last row of a history in the words and units of the table of a finished run."""

from __future__ import annotations

from collections.abc import Mapping

from castfem.output.style import probe_label
from castfem.output.summary import Quantity, to_si

# Column to label and unit; columns of a finished run's table alone, not those of its march.
_WHOLE = {
    "position": ("position", "m"),
    "time": ("time", "s"),
    "heat_removed": ("heat removed per m", "MJ/m"),
    "cooling_power": ("cooling power to here", "kW"),
    "temperature_max": ("highest temperature", "degC"),
    "von_mises_max": ("largest von Mises stress", "MPa"),
    "axial_strain": ("axial strain", "-"),
    "gap_max": ("largest gap", "mm"),
    "contact_pressure_max": ("largest contact pressure", "MPa"),
    "contact_share": ("share of the surface in contact", "percent"),
    "contact_sticking": ("share of the surface that sticks to the mould", "percent"),
    "penetration": ("penetration of the mould here, at most", "um"),
    "size_corner": ("diagonal", "mm"),
}
# The same for columns of a probe, which stands behind them: `shell_mid_face`.
_AT_PROBES = {
    "shell": ("shell, {}", "mm"),
    "liquidus_depth": ("liquidus, {}", "mm"),
    "surface_temperature": ("surface, {}", "degC"),
    "heat_flux": ("heat flux, {}", "kW/m^2"),
    "von_mises": ("von Mises stress, {}", "MPa"),
    "displacement": ("outward displacement, {}", "mm"),
    "size": ("size at {}", "mm"),
    "gap": ("gap to the mould, {}", "mm"),
}


def last_quantities(row: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Quantity]:
    """Return the quantities of a row by name, in the order of its columns; position and time first.

    Args:
        row: Column to value; those that are in no table of a finished run are left out.
        units: Of the values.
    """
    found = {}
    for name in sorted(row, key=lambda column: column not in ("position", "time")):
        known = _WHOLE.get(name) or _at_probe(name)
        if known is not None:
            label, unit = known
            found[name] = Quantity(to_si(row[name], units[name]), unit, label)
    return found


def _at_probe(column: str) -> tuple[str, str] | None:
    """Label and unit of a column of a probe; None if it is none, or in no table."""
    for prefix, (label, unit) in _AT_PROBES.items():
        if column.startswith(f"{prefix}_"):
            return label.format(probe_label(column.removeprefix(f"{prefix}_"))), unit
    return None
