"""Checks of material data: values that no metal has, and heat counted twice.

The ranges are wide: they detect wrong units and misread numbers, not doubtful measurements.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from castfem.base import ranges
from castfem.base.constants import ZERO_CELSIUS
from castfem.base.csv_files import read_csv
from castfem.base.tables import Constant, Table
from castfem.physics.materials.enthalpy_table import EnthalpyTable
from castfem.physics.materials.expansion import DifferentialExpansion
from castfem.physics.materials.properties import ByFormula
from castfem.physics.materials.schema import KINDS, ExpansionEntry, MaterialFile, Problem
from castfem.physics.materials.steel import Steel

COLDEST, HOTTEST = 293.15, 1973.15  # K: range in which formulas must give plausible values
MARGIN = 50.0  # K beyond solidus and liquidus, since a peak may be wider


def implausible(steel: Steel, given: MaterialFile) -> Iterator[Problem]:
    """Yield the errors of a steel whose file is valid in form.

    Args:
        steel: The steel.
        given: Its material file.
    """
    for key in KINDS:
        if given.entry(key) is not None and ranges.of(f"steel.{key}") is not None:
            yield from _out_of_range(steel, given, key)
    yield from _slope_out_of_range(steel)
    yield from _counted_twice(steel)


def _out_of_range(steel: Steel, given: MaterialFile, key: str) -> Iterator[Problem]:
    """Yield the first value of a property outside its range."""
    entry = given.entry(key)
    assert entry is not None
    differential = isinstance(entry, ExpansionEntry) and entry.coefficient == "differential"
    bounds = ranges.RANGES[f"steel.{key}.differential" if differential else f"steel.{key}"]
    for number, (at, value) in enumerate(_values(steel, key)):
        text = bounds.impossible(value, KINDS[key])
        if not text or (_freezes(steel, key, at) and value > bounds.possible[1]):
            continue
        where = "" if at is None else f"row {number + 1}, {at - ZERO_CELSIUS:g} degC: "
        if at is not None and entry.formula is not None:
            where = f"formula {entry.formula} at {at - ZERO_CELSIUS:.0f} degC: "
        if at is not None and entry.file is not None:
            row = read_csv(Path(entry.file)).rows[number]
            where = f"'{entry.file}' line {row.line}, {at - ZERO_CELSIUS:g} degC: "
        yield Problem((key,), f"{where}{text}")
        return


def unusual(steel: Steel) -> Iterator[Problem]:
    """Yield warnings about a steel, one per property."""
    for key in KINDS:
        differential = isinstance(steel.expansion, DifferentialExpansion)
        bounds = ranges.of(f"steel.{key}")
        if bounds is None or (key == "thermal_expansion" and differential):
            continue
        for at, value in _values(steel, key):
            text = bounds.unusual(value, KINDS[key])
            if text and not (_freezes(steel, key, at) and value > bounds.usual[1]):
                where = "" if at is None else f"at {at - ZERO_CELSIUS:.4g} degC: "
                yield Problem((key,), where + text)
                break


def _freezes(steel: Steel, key: str, at: float | None) -> bool:
    """Whether a property at a temperature may include heat of freezing."""
    return key == "specific_heat" and at is not None and _is_near(steel, at)


def _values(steel: Steel, key: str) -> list[tuple[float | None, float]]:
    """The numbers of a property with their temperatures in K; None for a constant.

    For a formula they are evaluated over the temperatures of castings.
    """
    if key in ("solidus", "liquidus", "latent_heat"):
        return [(None, float(getattr(steel, key)))]
    law = steel.properties.get(key)
    if key == "thermal_expansion":
        law = getattr(steel.expansion, "coefficient", None)
        law = Constant(law) if isinstance(law, float) else law
    if isinstance(law, Constant):
        return [(None, law.value)]
    if isinstance(law, ByFormula):
        t = np.union1d(np.linspace(COLDEST, HOTTEST, 169), law.kinks)
        t = t[(t >= COLDEST) & (t <= HOTTEST)]
        return list(zip(map(float, t), map(float, law(t)), strict=True))
    return list(zip(law.arguments, law.values, strict=True)) if isinstance(law, Table) else []


def _is_near(steel: Steel, temperature: float) -> bool:
    """Whether a temperature is in or near the freezing range."""
    return steel.solidus - MARGIN <= temperature <= steel.liquidus + MARGIN


def _slope_out_of_range(steel: Steel) -> Iterator[Problem]:
    """Yield the first piece of a table of enthalpies with a heat capacity outside the range."""
    law = steel.properties.get("enthalpy")
    if not isinstance(law, EnthalpyTable):
        return
    bounds = ranges.RANGES["steel.specific_heat"]
    least, most = bounds.possible
    rows = law.table.arguments
    for number, slope in enumerate(map(float, law.slopes), start=1):
        freezing = _is_near(steel, rows[number - 1]) or _is_near(steel, rows[number])
        freezing |= rows[number - 1] < steel.solidus < rows[number]
        if not least <= slope <= (np.inf if freezing else most):
            yield Problem(
                ("enthalpy",),
                f"row {number + 1}, {rows[number] - ZERO_CELSIUS:g} degC: the specific heat from "
                f"row {number} to it {bounds.impossible(slope, KINDS['specific_heat'])}",
            )
            return


def _counted_twice(steel: Steel) -> Iterator[Problem]:
    """Yield an error if both the specific heat and the latent heat contain the heat of freezing."""
    law = steel.properties["specific_heat"]
    if not isinstance(law, Table) or not steel.latent_heat or steel.has("enthalpy"):
        return
    low, high = steel.solidus - MARGIN, steel.liquidus + MARGIN
    inside = [t for t in law.arguments if low < t < high]
    t = np.concatenate([np.linspace(a, b, 33) for a, b in itertools.pairwise([low, *inside, high])])
    values = law(t)
    usual = 1.3 * min(values[0], values[-1])  # solid and liquid differ by less
    more = np.maximum(values - usual, 0.0)
    held = float(np.trapezoid(more, t))
    if held <= 0.2 * steel.latent_heat:  # more than rounding
        return
    where = t[more > 0.0] - ZERO_CELSIUS
    yield Problem(
        ("specific_heat",),
        f"holds heat of freezing, {held / 1e3:.3g} kJ/kg from {where[0]:.4g} to {where[-1]:.4g} "
        f"degC, and latent_heat ({steel.latent_heat / 1e3:.4g} kJ/kg) would add it once more; set "
        'latent_heat = "0 kJ/kg", or take the peak out of the table',
    )
