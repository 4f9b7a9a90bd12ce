"""Label and unit of each result, by its name in the summary and in the history."""

from __future__ import annotations

from collections.abc import Mapping

from castfem.output.summary import Quantity, to_si

# Of the whole slice.
_WHOLE = {
    "position": ("position", "m"),
    "time": ("time", "s"),
    "heat_removed": ("heat removed per m", "MJ/m"),
    "cooling_power": ("cooling power to here", "kW"),
    "temperature_max": ("highest temperature", "degC"),
    "von_mises_max": ("largest von Mises stress", "MPa"),
    "way_von_mises_max": ("largest von Mises stress on the way", "MPa"),
    "axial_strain": ("axial strain", "-"),
    "gap_max": ("largest gap", "mm"),
    "mean_contact_pressure_max": ("largest contact pressure, mean over 5 mm", "MPa"),
    "contact_pressure_max": ("largest contact pressure, at a point", "MPa"),
    "contact_share": ("share of the surface in contact", "percent"),
    "contact_sticking": ("share of the surface that sticks to the mould", "percent"),
    "mould_friction": ("friction of the mould, whole strand, per m", "kN/m"),
    "mould_pull": ("pull of the mould's friction, whole strand", "kN"),
    "penetration": ("penetration of the mould here, at most", "um"),
    "size_corner": ("diagonal", "mm"),
}
# At a probe, whose name stands behind: `shell_mid_face`.
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


def probe_label(probe: str) -> str:
    """Return what a probe is called."""
    return probe.replace("mid_face", "mid-face").replace("_", " ")


def result(name: str, value: float, place: str = "") -> Quantity:
    """Return a result, in SI, with its label and the unit in which it is shown.

    Args:
        name: Of the result.
        value: In SI.
        place: Where it was found, behind the label.

    Raises:
        KeyError: There is no such result.
    """
    known = _known(name)
    if known is None:
        raise KeyError(name)
    label, unit = known
    return Quantity(value, unit, f"{label}, {place}" if place else label)


def last_quantities(row: Mapping[str, float], units: Mapping[str, str]) -> dict[str, Quantity]:
    """Return the quantities of a row by name, in the order of its columns; position and time first.

    Args:
        row: Column to value; what is no result is left out.
        units: Of the values.
    """
    found = {}
    for name in sorted(row, key=lambda column: column not in ("position", "time")):
        if _known(name) is not None:
            found[name] = result(name, to_si(row[name], units[name]))
    return found


def _known(name: str) -> tuple[str, str] | None:
    """Label and unit of a result; None if there is none of that name."""
    if name in _WHOLE:
        return _WHOLE[name]
    for prefix, (label, unit) in _AT_PROBES.items():
        if name.startswith(f"{prefix}_"):
            return label.format(probe_label(name.removeprefix(f"{prefix}_"))), unit
    return None
