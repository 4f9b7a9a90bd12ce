"""How the creeping strip comes to its closed forms, by steps and by layers.

A step is a cell of the pitch too, since z = v t.  Norton creep of a shell that is elastically rigid
has closed forms, the elastic strip p L^4/384 D; a lost roll is compared with more steps.  Writes
two tables of docs/slab_bulging.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import cumulative_simpson, quad
from scipy.optimize import brentq

from benchmarks.report import Output, table
from castfem.physics.constitutive import (
    Elasticity,
    NortonCreep,
    ThermoElastic,
    load_elasticity,
    load_law,
)
from castfem.physics.machine.bulging import (
    CreepingStrip,
    ElasticStrip,
    Rolls,
    Shell,
    Span,
    creep,
    over_rolls,
)

SPAN, THICKNESS = Span(0.25, 0.2e6, 0.02), 0.03
SHELL = Shell(THICKNESS, lambda depth: 1400.0)
HOT = Shell(0.04, lambda depth: 1273.15 + 490.0 * depth / 0.04)  # with a lost roll
PRESSURE, PITCH = 0.25e6, 0.25
PLACES = PITCH * np.array([0.0, 1.0, 2.0, 4.0, 5.0, 6.0])
LOAD = SPAN.pressure * SPAN.length**2
STEPS, LAYERS = (16, 32, 64, 160), (6, 12, 24, 48)
FINE_STEPS, FINE_LAYERS = 320, 192
POWERS = (1, 3, 5, 6)


def clamped(n: float) -> float:
    """M of M0 = -p L^2/m, from which creep leaves the slope at the rolls as it is."""

    def creep(m: float) -> float:
        zero = 0.5 - np.sqrt(0.25 - 2.0 / m)  # of the moment

        def power(x: float) -> float:
            return float(abs(0.5 * m * x * (1.0 - x) - 1.0) ** n)

        return float(quad(power, zero, 0.5)[0] - quad(power, 0.0, zero)[0])

    return float(brentq(creep, 10.0, 20.0, xtol=1e-12))


def norton(n: float) -> tuple[NortonCreep, float]:
    """A law, and the largest bulge that its closed form has, m."""
    m = clamped(n)
    stress = LOAD / m / (0.25 * THICKNESS**2)
    law = NortonCreep.constant(Elasticity.constant(1e13, 0.3), 0.1, stress, n)
    # kappa' = B |M|^n in plane strain, with no stress through the thickness.
    axial = (np.sqrt(0.75)) ** (n + 1.0) * 0.1 / stress**n
    power = 2.0 + 1.0 / n
    rate = axial * (0.5 * power / (0.5 * THICKNESS) ** power) ** n
    x = np.linspace(0.0, 1.0, 40001)
    moment = LOAD * (0.5 * x * (1.0 - x) - 1.0 / m)
    bent = cumulative_simpson(np.abs(moment) ** n * np.sign(moment), x=x, initial=0.0)
    turned = cumulative_simpson(bent - np.trapezoid(bent, x), x=x, initial=0.0)
    sunk = cumulative_simpson(turned, x=x, initial=0.0)
    return law, float((sunk[-1] * x - sunk).max() * rate * SPAN.length**3 / SPAN.speed)


def _lost(steps: int, layers: int = 24) -> tuple[float, float]:
    """Largest bulge over a lost roll of austenite, and the force on the roll above it."""
    law = load_law("kozlowski_zhu_signed", load_elasticity(), carbon=0.1, delta_share=np.zeros_like)
    rolls = Rolls(tuple(PLACES), (0.0,) * len(PLACES), PRESSURE, SPAN.speed)
    found = over_rolls(CreepingStrip(law, steps=steps, layers=layers), rolls, HOT)
    return found.largest, float(found.roll_force[1])


def main(output: Output, quick: bool) -> None:
    """Errors in per cent, by steps and by layers."""
    elastic = Elasticity.constant(10e9, 0.3)
    exact = ElasticStrip(elastic).bulge(SPAN, SHELL).largest
    laws = {n: norton(float(n)) for n in POWERS}
    finest = None if quick else _lost(FINE_STEPS)
    rows: list[dict[str, Any]] = []
    for steps in STEPS:
        found = CreepingStrip(ThermoElastic(elastic), steps=steps).bulge(SPAN, SHELL).largest
        row: dict[str, Any] = {"steps": steps, "elastic": 100.0 * (found / exact - 1.0)}
        for n, (law, closed) in laws.items():
            bulge = CreepingStrip(law, steps=steps, layers=96).bulge(SPAN, SHELL)
            row[f"norton{n}"] = 100.0 * (bulge.largest / closed - 1.0)
            if n == max(POWERS):
                row["moment"] = 100.0 * (-bulge.moment[0] / LOAD * clamped(n) - 1.0)
        if finest is not None:
            largest, force = _lost(steps)
            row["lost"] = 100.0 * (largest / finest[0] - 1.0)
            row["force"] = 100.0 * (force / finest[1] - 1.0)
        rows.append(row)
    output.csv("strip_steps", rows)
    rows = []
    fine = {n: _by_layers(law, FINE_LAYERS) for n, (law, _) in laws.items()}
    sure = None if quick else _lost(creep.STEPS, FINE_LAYERS)
    for layers in LAYERS:
        row = {"layers": layers}
        for n, (law, _) in laws.items():
            row[f"norton{n}"] = 100.0 * (_by_layers(law, layers) / fine[n] - 1.0)
        if sure is not None:
            row["lost"] = 100.0 * (_lost(creep.STEPS, layers)[0] / sure[0] - 1.0)
        rows.append(row)
    output.csv("strip_layers", rows)
    show(output)


def _by_layers(law: NortonCreep, layers: int) -> float:
    return CreepingStrip(law, layers=layers).bulge(SPAN, SHELL).largest


def show(output: Output) -> None:
    """The tables, from the data."""
    first, *others = POWERS
    named = {f"norton{first}": f"Norton, n = {first}"}
    named |= {f"norton{n}": f"n = {n}" for n in others}
    head = {
        "steps": "steps a pitch", "elastic": "elastic", **named, "moment": "moment, n = 6",
        "lost": "one lost roll", "force": "force on the roll above it",
    }  # fmt: skip
    forms = dict.fromkeys(head, "+.3f") | {"steps": "d", "layers": "d"}
    output.insert("strip steps", table(output.rows("strip_steps"), head, forms))
    head = {"layers": "layers", **named, "lost": "one lost roll"}
    output.insert("strip layers", table(output.rows("strip_layers"), head, forms))
