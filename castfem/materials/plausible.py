"""Numbers of a material that no metal has, and heat that stands in its file twice.

The ranges are wide: they find a wrong unit or a misread number, not a doubtful measurement.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from castfem.materials.enthalpy_table import EnthalpyTable
from castfem.materials.schema import KINDS, ExpansionEntry, MaterialFile, Problem
from castfem.materials.steel import Steel
from castfem.values.constants import ZERO_CELSIUS
from castfem.values.csv_files import read_csv
from castfem.values.tables import Constant, Table
from castfem.values.units import convert
from castfem.values.units import format as write

# Property -> least and largest value of metals that are cast, solid or liquid, SI. Where the kind
# of the property allows 0, that leaves something out of a case and is plausible.
PLAUSIBLE: Mapping[str, tuple[float, float]] = {
    "solidus": (373.15, 3300.0),
    "liquidus": (373.15, 3300.0),
    "latent_heat": (1e4, 2e6),
    "density": (1e3, 25e3),
    "specific_heat": (80.0, 1e4),  # outside of the freezing range; Curie points have some 5000
    "conductivity": (1.0, 5e3),
    "emissivity": (0.01, 1.0),
    "thermal_expansion": (1e-6, 1e-4),
    "youngs_modulus": (1e5, 6e11),
}
# Of a differential coefficient: a transformation within a kelvin changes lengths by 0.5 %.
LARGEST_DIFFERENTIAL = 1e-2  # 1/K
TWICE = 0.2  # of the latent heat: so much more in the specific heat is no rounding
SMOOTH = 1.3  # the specific heats of solid and liquid differ by less
MARGIN = 50.0  # K beyond solidus and liquidus: a peak may be wider than they say


def implausible(steel: Steel, given: MaterialFile) -> Iterator[Problem]:
    """Yield what is wrong with a steel whose file is sound in form.

    Args:
        steel: The steel.
        given: What it was made of.
    """
    for key in PLAUSIBLE:
        if (entry := given.entry(key)) is not None and entry.formula is None:
            yield from _out_of_range(steel, given, key)
    yield from _slope_out_of_range(steel)
    yield from _counted_twice(steel)


def _out_of_range(steel: Steel, given: MaterialFile, key: str) -> Iterator[Problem]:
    """Yield the first value of a property that is beyond its range."""
    entry = given.entry(key)
    assert entry is not None
    least, most = PLAUSIBLE[key]
    if isinstance(entry, ExpansionEntry) and entry.coefficient == "differential":
        least, most = -LARGEST_DIFFERENTIAL, LARGEST_DIFFERENTIAL
    for number, (at, value) in enumerate(_values(steel, key)):
        freezing = at is not None and _is_near(steel, at) and key == "specific_heat"
        if value == 0.0 or least <= value <= (np.inf if freezing else most):
            continue
        where = "" if at is None else f"row {number + 1}, {at - ZERO_CELSIUS:g} degC: "
        if at is not None and entry.file is not None:
            row = read_csv(Path(entry.file)).rows[number]
            where = f"'{entry.file}' line {row.line}, {at - ZERO_CELSIUS:g} degC: "
        yield Problem((key,), f"{where}{_beyond(key, value, least, most)}")
        return


def _values(steel: Steel, key: str) -> list[tuple[float | None, float]]:
    """The numbers of a property with their temperatures in K; of a constant without."""
    if key in ("solidus", "liquidus", "latent_heat"):
        return [(None, float(getattr(steel, key)))]
    law = steel.properties.get(key)
    if key == "thermal_expansion":
        law = getattr(steel.expansion, "coefficient", None)
        law = Constant(law) if isinstance(law, float) else law
    if isinstance(law, Constant):
        return [(None, law.value)]
    return list(zip(law.arguments, law.values, strict=True)) if isinstance(law, Table) else []


def _beyond(key: str, value: float, least: float, most: float) -> str:
    """Say that a value is beyond its range."""
    kind = KINDS[key]
    unit = kind.shown or kind.unit
    low, high = (f"{convert(x, kind.unit, unit):.6g}" for x in (least, most))
    ends = f"{low} to {high}{'' if unit == '1' else f' {unit}'}"
    shown = f"{value:g}" if kind.unit == "1" else write(value, kind.unit, unit)
    return f"({shown}) is beyond what metals have, {ends}; are number and unit right?"


def _is_near(steel: Steel, temperature: float) -> bool:
    """Whether steel freezes at a temperature, or nearly."""
    return steel.solidus - MARGIN <= temperature <= steel.liquidus + MARGIN


def _slope_out_of_range(steel: Steel) -> Iterator[Problem]:
    """Yield the first piece of a table of enthalpies with a heat capacity beyond the range."""
    law = steel.properties.get("enthalpy")
    if not isinstance(law, EnthalpyTable):
        return
    least, most = PLAUSIBLE["specific_heat"]
    rows = law.table.arguments
    for number, slope in enumerate(map(float, law.slopes), start=1):
        freezing = _is_near(steel, rows[number - 1]) or _is_near(steel, rows[number])
        freezing |= rows[number - 1] < steel.solidus < rows[number]
        if not least <= slope <= (np.inf if freezing else most):
            yield Problem(
                ("enthalpy",),
                f"row {number + 1}, {rows[number] - ZERO_CELSIUS:g} degC: the specific heat from "
                f"row {number} to it {_beyond('specific_heat', slope, least, most)}",
            )
            return


def _counted_twice(steel: Steel) -> Iterator[Problem]:
    """Yield the heat of freezing where both the specific heat and the latent heat have it."""
    law = steel.properties["specific_heat"]
    if not isinstance(law, Table) or not steel.latent_heat or steel.has("enthalpy"):
        return
    low, high = steel.solidus - MARGIN, steel.liquidus + MARGIN
    inside = [t for t in law.arguments if low < t < high]
    t = np.concatenate([np.linspace(a, b, 33) for a, b in itertools.pairwise([low, *inside, high])])
    values = law(t)
    usual = SMOOTH * min(values[0], values[-1])
    more = np.maximum(values - usual, 0.0)
    held = float(np.trapezoid(more, t))
    if held <= TWICE * steel.latent_heat:
        return
    where = t[more > 0.0] - ZERO_CELSIUS
    yield Problem(
        ("specific_heat",),
        f"holds heat of freezing, {held / 1e3:.3g} kJ/kg from {where[0]:.4g} to {where[-1]:.4g} "
        f"degC, and latent_heat ({steel.latent_heat / 1e3:.4g} kJ/kg) would add it once more; set "
        'latent_heat = "0 kJ/kg", or take the peak out of the table',
    )
