"""How much a shell bulges where a roll is lost, by what is assumed of it.

A shell of 40 mm, 1000 degC at its surface, under 0.25 MPa, pitches of 250 mm, 1.2 m/min: from the
elastic strip to one lost roll between sound ones.  Two of the rows are computed once more by an
ODE solver (`benchmarks.ode_strip`).  Writes a table of docs/slab_bulging.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.ode_strip import OdeStrip
from benchmarks.report import Output, table
from castfem.base.types import Array
from castfem.physics.constitutive import ThermoElastic, load_elasticity, load_law
from castfem.physics.constitutive.base import Law
from castfem.physics.machine.bulging import (
    Bulge,
    CreepingStrip,
    ElasticStrip,
    Rolls,
    Shell,
    Span,
    over_rolls,
)
from castfem.physics.machine.bulging.creep import nodes
from castfem.physics.machine.bulging.layers import Layers
from castfem.physics.machine.bulging.result import deflected
from castfem.physics.machine.bulging.uneven import UnevenRolls

THICKNESS, SURFACE, FRONT = 0.04, 1273.15, 1763.15
PITCH, PRESSURE, SPEEDS = 0.25, 0.25e6, (0.02, 0.01)
CLAMPED = -PRESSURE * (2 * PITCH) ** 2 / 12.0  # moment of the elastic strip, N
PLACES = PITCH * np.delete(np.arange(10), 4)  # one lost
SHELL = Shell(THICKNESS, lambda depth: SURFACE + (FRONT - SURFACE) / THICKNESS * depth)
ELASTIC = load_elasticity()
COUNT = 33
Found = tuple[float, float, float]


def austenite(name: str = "kozlowski_zhu_signed") -> Law:
    """The law of a shell without delta ferrite."""
    return load_law(name, ELASTIC, carbon=0.1, delta_share=np.zeros_like)


def steel() -> Law:
    """The law of a shell whose front is delta ferrite."""
    return load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1)


def alternate(law: Law, speed: float) -> Found:
    """Every second roll lost: a single pitch that repeats itself."""
    return _extremes(CreepingStrip(law).bulge(Span(2 * PITCH, PRESSURE, speed), SHELL))


def single(law: Law, speed: float) -> Found:
    """One roll lost, those that would have to pull hold nevertheless."""
    rolls = Rolls(tuple(PLACES), (0.0,) * len(PLACES), PRESSURE, speed)
    return _extremes(over_rolls(CreepingStrip(law), rolls, SHELL), PLACES[3])


def leaving(law: Law, speed: float) -> Found:
    """One roll lost, and the shell leaves rolls that would have to pull: as in a case."""
    places = PITCH * np.delete(np.arange(12), 6)
    rolls = UnevenRolls(
        CreepingStrip(law), places, np.zeros(len(places)), (5,), (PITCH, PITCH), COUNT
    )
    spans = {k: Span(float(places[k + 1] - places[k]), PRESSURE, speed) for k in (5, 6, 7)}
    found = {k: rolls.bulge(k, span, SHELL, 1.0).bulge for k, span in spans.items()}
    top, at, _ = found[5].extremes()
    return top, at / (2 * PITCH), min(one.extremes()[2] for one in found.values())


def kept_at(law: Law, moment: float, pitches: int, speed: float) -> Found:
    """Virgin steel led through some pitches with one and the same moment over each roll, N."""
    bent, z = kept_curvature(law, moment, pitches, speed), nodes(2 * PITCH, 256)
    w = deflected(z, bent - np.trapezoid(bent, z) / z[-1])[0]
    return float(w.max()), float(z[w.argmax()] / z[-1]), float(w.min())


def kept_curvature(
    law: Law, moment: float, pitches: int, speed: float, steps: int = 256, layers: int = 48
) -> Array:
    """Curvature along the last of these pitches, since the steel was virgin, 1/m."""
    shell, z = Layers(law, SHELL.points(layers, SHELL.breaks(law))), nodes(2 * PITCH, steps)
    along = moment + 0.5 * PRESSURE * z * (2 * PITCH - z)
    first = shell.advance(shell.virgin(), along[:1], np.array([1e-6]))
    state, bent = first.end, first.curvature[-1]
    for _ in range(pitches):
        history = shell.advance(state, along[1:], np.diff(z) / speed)
        state, found = history.end, bent + history.curvature
        bent = found[-1]
    return found


def by_ode(rolls: Array | None, speed: float) -> Found:
    """By `benchmarks.ode_strip`: over rolls, or with every second one lost."""
    strip = OdeStrip(ELASTIC, THICKNESS, SURFACE, FRONT)
    start = 0.0
    if rolls is None:
        one = strip.periodic(PRESSURE, 2 * PITCH, speed)
        z, w = one.z, one.w
    else:
        (z, w, _), start = strip.over(rolls, PRESSURE, speed), float(rolls[3])
    return float(w.max()), float((z[w.argmax()] - start) / (2 * PITCH)), float(w.min())


def _extremes(bulge: Bulge, start: float = 0.0) -> Found:
    top, at, low = bulge.extremes()
    return top, (at - start) / (2 * PITCH), low


def main(output: Output, quick: bool) -> None:
    """One row for each assumption."""
    gamma, delta, elastic = austenite(), steel(), ThermoElastic(ELASTIC)

    def clamped(speed: float) -> Found:
        return _extremes(ElasticStrip(ELASTIC).bulge(Span(2 * PITCH, PRESSURE, speed), SHELL))

    rows: list[dict[str, Any]] = []
    for lost, what, computed, again in (
        ("every second", "elastic", clamped, False),
        ("every second", "austenite, moment of the elastic strip, first pitch",
         lambda speed: kept_at(gamma, CLAMPED, 1, speed), False),
        ("every second", "the same, twelfth pitch",
         lambda speed: kept_at(gamma, CLAMPED, 12, speed), False),
        ("every second", "0.8 of that moment, twelfth pitch",
         lambda speed: kept_at(gamma, 0.8 * CLAMPED, 12, speed), False),
        ("every second", "austenite, accumulated hardening, four pitches",
         lambda speed: alternate(austenite("kozlowski_zhu"), speed), False),
        ("every second", "austenite", lambda speed: alternate(gamma, speed), True),
        ("every second", "delta ferrite at the front", lambda speed: alternate(delta, speed),
         False),
        ("one", "elastic", lambda speed: single(elastic, speed), False),
        ("one", "austenite", lambda speed: single(gamma, speed), True),
        ("one", "delta ferrite at the front", lambda speed: single(delta, speed), False),
        ("one", "the same, which leaves rolls that would pull",
         lambda speed: leaving(delta, speed), False),
    ):  # fmt: skip
        top, at, low = computed(SPEEDS[0])
        row: dict[str, Any] = {"lost": lost, "what": what, "largest": 1e3 * top, "at": at}
        row |= {"least": 1e3 * low, "slow": 1e3 * computed(SPEEDS[1])[0], "ode": None}
        if again and not (quick and lost == "one"):
            row["ode"] = 1e3 * by_ode(PLACES if lost == "one" else None, SPEEDS[0])[0]
        rows.append(row)
    output.csv("lost_roll", rows)
    show(output)


def show(output: Output) -> None:
    """The table, from the data."""
    head = {
        "lost": "rolls lost", "what": "strip", "largest": "bulge, mm", "at": "at z/L",
        "least": "least, mm", "ode": "by an ODE solver, mm", "slow": "at half the speed, mm",
    }  # fmt: skip
    forms = dict.fromkeys(("largest", "least", "ode", "slow"), ".2f") | {"at": ".2f"}
    output.insert("lost roll", table(output.rows("lost_roll"), head, forms))
