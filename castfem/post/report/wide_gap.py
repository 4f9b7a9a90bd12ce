"""Whether a gap was so wide that radiation, which a case leaves out, would cross it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.base.shown_units import said
from castfem.physics.thermal.flux_laws import Radiation
from castfem.runs.output.summary import Summary
from castfem.runs.results.run_case import case_with

SURFACE, WALL = 1200.0 + ZERO_CELSIUS, 150.0 + ZERO_CELSIUS  # K
EMISSIVITY = 0.8


def radiated() -> float:
    """What radiates across a gap from a surface of 1200 degC to a mould, W/(m2 K)."""
    flux = Radiation(EMISSIVITY, ambient=WALL).flux(np.array([SURFACE]), 0.0)[0]
    return float(flux[0]) / (SURFACE - WALL)


def wide_gap(folder: Path, summary: Summary) -> str:
    """What to say of a run whose largest gap conducts less than would radiate; "" of any other.

    Args:
        folder: Of the run, with its case.
        summary: Has the largest gap.
    """
    widest = summary.quantities.get("mould_gap_max")
    if widest is None or not widest.value > 0.0:
        return ""
    case = case_with(folder, "contact")
    if case is None:
        return ""
    from castfem.model import cooling

    for zone in case.cooling:
        contacts = [one for one in zone.surface if isinstance(one, cooling.Contact)]
        if not contacts or any(isinstance(one, cooling.Radiation) for one in zone.surface):
            continue
        best = max(one.gap_conductivity or 0.0 for one in contacts)
        conducted = best / widest.value
        if 0.0 < conducted < radiated():
            gap = said(1e3 * widest.value, "mm", ".3g", "mould_gap_max")
            return (
                f"the largest gap, {gap}, conducts {conducted:.0f} W/(m^2 K); radiation, which "
                f'zone "{zone.name}" leaves out, would carry some {radiated():.0f}: lay law = '
                '"radiation" beside contact'
            )
    return ""
