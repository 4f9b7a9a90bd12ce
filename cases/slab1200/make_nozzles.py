"""Makes spray.csv, spray_mist.csv and run_off.csv: `.castfem/bin/python make_nozzles.py`.

The thesis measured coefficients of four models of nozzle at six temperatures and four flows
(VI.2.1); they are confidential. These are made from published correlations instead, each within the
range that it was measured for. Sources: docs/references.md.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from castfem.base.constants import ZERO_CELSIUS
from castfem.physics.thermal.spray_correlations import CORRELATIONS
from castfem.physics.thermal.spray_flux import OfCorrelation

HERE = Path(__file__).parent
WATER = 25.0  # degC
FLOWS = (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 25.0, 30.0)  # L/(m2 s)
# Of what, for which temperatures, degC, and for which flows at most.
NOZZLES = {
    "spray.csv": ("wendelstorf", (210, 300, 350, 400, 450, 500, 600, *range(700, 1101, 100)), 30.0),
    "spray_mist.csv": ("sasaki", tuple(range(700, 1201, 100)), 30.0),
}
SURFACES = tuple(range(600, 1201, 100))  # degC, of the film of steam
# Steam at 1 atm: K, kg/m3, J/(kg K), Pa s, W/(m K) (tables of Incropera and DeWitt).
STEAM = np.array(
    [
        [400.0, 0.5542, 2014.0, 134.4e-7, 26.1e-3],
        [500.0, 0.4405, 1985.0, 170.4e-7, 33.9e-3],
        [600.0, 0.3652, 2026.0, 206.7e-7, 42.2e-3],
        [700.0, 0.3140, 2085.0, 242.6e-7, 50.5e-3],
        [800.0, 0.2739, 2152.0, 278.6e-7, 59.2e-3],
        [850.0, 0.2579, 2186.0, 296.9e-7, 63.7e-3],
    ]
)
LATENT, BOILING, LIQUID, GRAVITY = 2.257e6, 100.0, 958.0, 9.81  # J/kg, degC, kg/m3, m/s2
RUN_OFF = 0.1  # m along the strand from a spray to the next roll
STAGNANT, FLOWING = 0.667, 0.943  # of Bromley's formula: liquid that stands, or goes with the film


def steam(kelvin: float) -> list[float]:
    """Density, specific heat, viscosity and conductivity of steam, the last row drawn on."""
    rows = STEAM if kelvin <= STEAM[-1, 0] else STEAM[-2:]
    low = min(max(int(np.searchsorted(rows[:, 0], kelvin)) - 1, 0), len(rows) - 2)
    share = (kelvin - rows[low, 0]) / (rows[low + 1, 0] - rows[low, 0])
    return [float(v) for v in rows[low, 1:] + share * (rows[low + 1, 1:] - rows[low, 1:])]


def film_boiling(surface: float, factor: float = FLOWING) -> float:
    """Bromley (1950): h of water that boils on a film of steam, without radiation, W/(m2 K).

    h = C [k^3 rho_v (rho_l - rho_v) g (L + 0.8 cp dT) / (mu l dT)]^(1/4), dT over boiling; told
    here over the temperature of the water.

    Args:
        surface: degC.
        factor: C.
    """
    density, heat, viscosity, conductivity = steam(0.5 * (surface + BOILING) + ZERO_CELSIUS)
    excess = surface - BOILING
    latent = LATENT + 0.8 * heat * excess
    driving = conductivity**3 * density * (LIQUID - density) * GRAVITY * latent
    h = factor * math.pow(driving / (viscosity * RUN_OFF * excess), 0.25)
    return h * excess / (surface - WATER)


def write(name: str, header: str, rows: Iterable[str]) -> None:
    """Write a table beside this file."""
    told = "# Made by make_nozzles.py from published correlations (docs/machine.md)."
    (HERE / name).write_text("\n".join([told, header, *rows]) + "\n", encoding="utf-8")


def main() -> None:
    """Make the tables."""
    for name, (correlation, surfaces, most) in NOZZLES.items():
        law = OfCorrelation(CORRELATIONS[correlation], WATER + ZERO_CELSIUS)
        flows = np.array([flow for flow in FLOWS if flow <= most])
        rows = []
        for surface in surfaces:
            h = law(flows, np.full_like(flows, surface + ZERO_CELSIUS))
            rows += [f"{surface:g}, {w:g}, {v:.1f}" for w, v in zip(flows, h, strict=True)]
        write(name, "temperature [degC], water [L/(m^2 s)], value [W/(m^2 K)]", rows)
    rows = [f"{surface:g}, {film_boiling(surface):.1f}" for surface in SURFACES]
    write("run_off.csv", "temperature [degC], value [W/(m^2 K)]", rows)


if __name__ == "__main__":
    main()
