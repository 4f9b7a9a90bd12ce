"""Describes a steel in text: characteristic values with units and sources."""

from __future__ import annotations

from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.materials.phase_table import PhaseTable
from castfem.physics.materials.steel import Steel

CONTRACTED = (
    1200.0 + ZERO_CELSIUS
)  # K: lower end of the description, the surface of a shell in its mould

_LABELS = (
    ("density", "density", "{:.0f}", 1.0, " kg/m³"),
    ("specific_heat", "specific heat", "{:.0f}", 1.0, " J/(kg K)"),
    ("conductivity", "conductivity", "{:.1f}", 1.0, " W/(m K)"),
    ("emissivity", "emissivity", "{:.2f}", 1.0, ""),
    ("youngs_modulus", "Young's modulus", "{:.3g}", 1e-9, " GPa"),
    ("poisson_ratio", "Poisson's ratio", "{:.3g}", 1.0, ""),
)
_STATUS = {
    "F": "read in the source",
    "M": "not yet checked against it",
    "C": "computed",
    "U": "the user's own",
}


def property_label(key: str) -> str:
    """Return the name of a property of a set, as text shows it."""
    return next((label for name, label, *_ in _LABELS if name == key), key.replace("_", " "))


def describe_steel(steel: Steel) -> list[tuple[str, str]]:
    """Return labels and values that describe a steel, with units.

    Variable properties are given at 1000 degC, the solidus and the liquidus; each is followed by
    its status and source.
    """
    rows = [("steel", steel.name), ("description", steel.description)]
    if steel.composition:
        rows.append(("composition", ", ".join(f"{w:g} %{e}" for e, w in steel.composition.items())))
    if isinstance(steel.diagram, PhaseTable) and (outside := steel.diagram.header.get("outside")):
        rows.append(("extrapolated", f"beyond what the database is stated to cover: {outside} wt%"))
    for label, value in (("solidus", steel.solidus), ("liquidus", steel.liquidus)):
        note = _origin_note(steel, label, "solid_fraction")
        rows.append((label, f"{celsius(value)} °C{note}"))
    diagram = steel.diagram
    if diagram is not None and diagram.gamma_start is not None and diagram.gamma_end is not None:
        span = celsius(diagram.gamma_start), celsius(diagram.gamma_end)
        text = f"{span[0]} to {span[1]} °C" if span[0] != span[1] else f"at {span[0]} °C"
        by = "database" if isinstance(diagram, PhaseTable) else "Fe-C diagram"
        rows.append(("δ to γ", f"{text}  [{by}]"))
    latent = f"{steel.latent_heat / 1e3:.4g} kJ/kg"
    rows.append(("latent heat", f"{latent}{_origin_note(steel, 'latent_heat', 'enthalpy')}"))
    rows.append(("solid fraction", _origin_note(steel, "solid_fraction").strip()))
    for key, label, form, factor, unit in _LABELS:
        if steel.has(key):
            at = (1273.15, steel.solidus, steel.liquidus)
            shown = [form.format(factor * float(getattr(steel, key)(t))) for t in at]
            text = f"{shown[0]}{unit}"
            if len(set(shown)) > 1:
                text = f"{' / '.join(shown)}{unit} at 1000 °C / solidus / liquidus"
            rows.append((label, f"{text}{_origin_note(steel, key)}"))
    if steel.has("thermal_expansion"):
        mean = 1e6 * float(steel.thermal_expansion(1273.15))
        note = _origin_note(steel, "thermal_expansion")
        rows.append(("thermal expansion", f"{mean:.1f}e-6 1/K from solidus to 1000 °C{note}"))
        share = 100.0 * float(steel.transformation_strain(CONTRACTED))
        if share < -5e-4:
            total = 100.0 * float(steel.thermal_strain(CONTRACTED))
            text = f"{-total:.3f} % from solidus to {celsius(CONTRACTED)} °C, {-share:.3f} % of it"
            rows.append(("contraction", f"{text} by δ to γ"))
    if steel.origins:
        rows.append(("sources", ", ".join(f"{code}: {text}" for code, text in _STATUS.items())))
    return rows


def celsius(temperature: float) -> str:
    """Return a temperature in K as degC, rounded to 0.01 without trailing zeros."""
    return f"{round(temperature - ZERO_CELSIUS, 2):g}"


def _origin_note(steel: Steel, *keys: str) -> str:
    """Return "  [status: law; source]" for the first of the properties in the set."""
    for key in keys:
        origin = steel.origins.get(key)
        if origin is not None:
            law = origin.law if origin.law.startswith(("formula", "table")) else ""
            note = "; ".join(text for text in (law, origin.source) if text)
            return f"  [{origin.status}: {note or 'no source given'}]"
    return ""
