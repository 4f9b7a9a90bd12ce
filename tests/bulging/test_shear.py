"""The strip that yields to shear: a Timoshenko beam, against closed forms and a continuum."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from castfem.physics.constitutive import ThermoElastic, load_elasticity, load_law
from castfem.physics.machine.bulging import (
    CreepingStrip,
    ElasticStrip,
    Rolls,
    Shell,
    Span,
    over_rolls,
    stiffness,
)

DATA = Path(__file__).parents[2] / "docs" / "data" / "moving_strip.csv"
ELASTIC = load_elasticity()
EVEN = Shell(0.06, lambda depth: 1273.15)
SPAN = Span(0.25, 0.3e6, 0.02)


def uneven(thickness: float, surface: float) -> Shell:
    """A shell whose front has 1490 degC, its surface so many degC."""
    front, outside = 1763.15, surface + 273.15
    return Shell(thickness, lambda depth: outside + (front - outside) * depth / thickness)


def test_a_shell_of_one_temperature_has_five_sixths_of_its_section() -> None:
    shear = ELASTIC.moduli(np.array([1273.15]))[0][0]
    found = stiffness(ELASTIC, EVEN.points()).shear
    assert found == pytest.approx(1.2 / (shear * EVEN.thickness), rel=2e-5)


def test_its_compliance_is_the_energy_of_its_shear_flow() -> None:
    """By a plain sum over 4000 strips, the shear flow from what each takes of a unit moment."""
    shell = uneven(0.085, 940.0)
    edges = np.linspace(0.0, shell.thickness, 4001)
    depth, dn = 0.5 * (edges[1:] + edges[:-1]), edges[1]
    shear, bulk, young = ELASTIC.moduli(np.asarray(shell.temperature(depth)))
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    plane, arm = young / (1.0 - poisson**2), 0.5 * shell.thickness - depth
    sums = [[float((plane * f * g).sum() * dn) for g in (poisson, 1.0, arm)] for f in (1.0, arm)]
    free = [float((plane * g).sum() * dn) for g in (np.ones_like(arm), poisson, poisson * arm)]
    across, axial, bent = np.linalg.solve([free, *sums], [0.0, 0.0, 1.0])
    stress = plane * (axial + bent * arm + poisson * across)
    flow = np.cumsum(stress) * dn
    assert abs(flow[-1]) < 1e-6 * np.abs(flow).max()
    found = stiffness(ELASTIC, shell.points(96))
    assert found.bending == pytest.approx(1.0 / bent, rel=1e-3)
    assert found.shear == pytest.approx(float((flow**2 / shear).sum() * dn), rel=1e-3)


@pytest.mark.parametrize("shell", [EVEN, uneven(0.03, 1000.0)], ids=["even", "uneven"])
def test_between_rolls_that_are_alike_shear_adds_a_parabola(shell: Shell) -> None:
    p, length, stiff = SPAN.pressure, SPAN.length, stiffness(ELASTIC, shell.points())
    z = length * np.linspace(0.0, 1.0, 33)
    inside = z * (length - z)
    exact = p * inside**2 / (24.0 * stiff.bending) + 0.5 * p * stiff.shear * inside
    elastic = ElasticStrip(ELASTIC, shear=True).bulge(SPAN, shell)
    creeping = CreepingStrip(ThermoElastic(ELASTIC), shear=True).bulge(SPAN, shell)
    stiffer = CreepingStrip(ThermoElastic(ELASTIC)).bulge(SPAN, shell)
    assert exact.max() > 1.15 * stiffer.largest
    for found in (elastic, creeping):
        assert found.at(z) == pytest.approx(exact, abs=1.2e-3 * exact.max())
    assert creeping.moment == pytest.approx(stiffer.moment, rel=1e-12)


def three_moments(pitches: np.ndarray, p: float, bending: float, shear: float) -> np.ndarray:
    """Moments over the rolls of an elastic beam that yields to shear, the outer two clamped.

    The rotation of the section is continuous over a roll, the slope is not: each span's end
    rotations are those of bending, tilted by what shear takes off its chord.
    """
    count = len(pitches) + 1
    matrix, right = np.eye(count), np.full(count, -p * pitches[0] ** 2 / 12.0)
    for i in range(1, count - 1):
        one, other = pitches[i - 1], pitches[i]
        tilt = 6.0 * bending * shear
        matrix[i, i - 1] = one - tilt / one
        matrix[i, i] = 2.0 * (one + other) + tilt / one + tilt / other
        matrix[i, i + 1] = other - tilt / other
        right[i] = -0.25 * p * (one**3 + other**3)
    return np.asarray(np.linalg.solve(matrix, right))


def test_over_a_lost_roll_the_moments_are_those_of_a_timoshenko_beam() -> None:
    """Thick for its pitch, so that shear moves the moments, too."""
    p, stiff = SPAN.pressure, stiffness(ELASTIC, EVEN.points())
    pitches = np.array([0.25] * 4 + [0.5] + [0.25] * 4)
    places = tuple(float(one) for one in np.concatenate([[0.0], np.cumsum(pitches)]))
    rolls = Rolls(places, (0.0,) * len(places), p, 0.02)
    found = over_rolls(CreepingStrip(ThermoElastic(ELASTIC), shear=True), rolls, EVEN)
    exact = three_moments(pitches, p, stiff.bending, stiff.shear)
    stiffer = three_moments(pitches, p, stiff.bending, 0.0)
    assert np.abs(exact - stiffer).max() > 0.02 * np.abs(exact).max()
    steps = len(found.z) // len(pitches)
    assert found.moment[::steps] == pytest.approx(exact, abs=2e-3 * np.abs(exact).max())
    middle = (
        5.0 * p * 0.5**4 / (384.0 * stiff.bending)
        + (exact[4] + exact[5]) * 0.5**2 / (16.0 * stiff.bending)
        + stiff.shear * p * 0.5**2 / 8.0
    )
    assert found.at([1.25])[0] == pytest.approx(middle, rel=2e-3)
    assert found.at(places) == pytest.approx(np.zeros(len(places)), abs=2e-4 * middle)


@pytest.mark.parametrize(
    ("what", "pitch", "off", "without"),
    [
        ("elastic", 250, 0.03, 0.13),
        ("elastic", 320, 0.13, 0.40),
        ("austenite", 310, 0.03, 0.11),
        ("austenite", 500, 0.06, 0.07),
    ],
)
def test_it_comes_near_a_continuum(what: str, pitch: int, off: float, without: float) -> None:
    """Plane, creeping, its rolls moving along it: docs/data/moving_strip.csv."""
    with DATA.open(newline="", encoding="utf-8") as file:
        row = next(
            r for r in csv.DictReader(file) if r["what"] == what and int(r["pitch"]) == pitch
        )
    shell = uneven(1e-3 * float(row["shell"]), float(row["surface"]))
    law: Any = ThermoElastic(ELASTIC)
    if what == "austenite":
        law = load_law("kozlowski_zhu_signed", ELASTIC, carbon=0.1, delta_share=np.zeros_like)
    span = Span(1e-3 * pitch, 1e6 * float(row["pressure"]), 0.02)
    bulges = [CreepingStrip(law, shear=shear).bulge(span, shell) for shear in (True, False)]
    limit = float(row["limit"])
    missed = [abs(1e3 * one.largest / limit - 1.0) for one in bulges]
    assert missed[0] < off and missed[1] > without
