"""The plates and springs of the thesis (VI.2.2.2), with an error of its formula (318).

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import Elasticity, ThermoElastic, load_elasticity, load_law
from castfem.physics.machine.bulging import (
    Bulge,
    CreepingStrip,
    ElasticStrip,
    Rolls,
    Shell,
    Span,
    ThesisPlate,
    over_rolls,
    stiffness,
)
from castfem.physics.machine.bulging.plate import clamped_deflection

pytestmark = pytest.mark.slow


P, LENGTH, WIDTH = 0.2e6, 0.25, 1.2
BENDING = 10e9 * 0.03**3 / 12.0 / (1.0 - 0.3**2)
SHELL = Shell(0.03, lambda depth: 1400.0)
SPAN = Span(LENGTH, P, 0.02)
ELASTIC = Elasticity.constant(10e9, 0.3)


def cosine(position: npt.ArrayLike, length: float) -> Array:
    return np.asarray(1.0 - np.cos(2.0 * np.pi * np.asarray(position, float) / length))


def free_deflection(pressure: npt.ArrayLike, across: npt.ArrayLike) -> Array:
    """Return the deflection w1 (307) of a plate supported only along its narrow faces, m."""
    amplitude = np.asarray(pressure) * WIDTH**4 / (np.pi**4 * 12.0 * BENDING)
    return np.asarray(1.5 * amplitude * cosine(across, WIDTH))


def carried_share(along: npt.ArrayLike) -> Array:
    """Return the share q/p (315) of the pressure carried by the slice; springs carry the rest."""
    ratio = (WIDTH / LENGTH) ** 2
    return np.asarray(cosine(along, LENGTH) / (1.5 * (ratio**2 + 2.0 / 3.0 * ratio + 1.0)))


def spring_stiffness(along: npt.ArrayLike, across: npt.ArrayLike) -> Array:
    """Return the spring stiffness k of corrected (318), with which a slice bulges as w2, Pa/m."""
    share = carried_share(along)
    with np.errstate(divide="ignore"):
        return (1.0 / share - 1.0) / free_deflection(1.0, across)


def test_bulges_have_the_values_of_the_thesis() -> None:
    """(309) gives about 40 and 0.1 mm."""
    free = float(free_deflection(P, 0.5 * WIDTH))
    clamped = float(clamped_deflection(P, BENDING, LENGTH, WIDTH, 0.5 * LENGTH, 0.5 * WIDTH))
    assert 1e3 * free == pytest.approx(43.0, abs=0.05)
    assert 1e3 * clamped == pytest.approx(0.105, abs=5e-4)
    exact = ElasticStrip(ELASTIC).bulge(SPAN, SHELL).largest
    assert clamped / exact == pytest.approx(1.275, abs=1e-3)


def test_slice_on_springs_bulges_as_the_plate() -> None:
    """(313), (316), (317): slice under q and springs under f = p - q have equal displacements."""
    along = np.linspace(0.01, 0.24, 24)[:, None]
    across = np.linspace(0.05, 1.15, 23)[None, :]
    share = carried_share(along)
    expected = clamped_deflection(P, BENDING, LENGTH, WIDTH, along, across)
    assert free_deflection(P * share, across) == pytest.approx(expected, rel=1e-12)
    force = spring_stiffness(along, across) * expected
    assert force == pytest.approx(np.broadcast_to(P * (1.0 - share), force.shape), rel=1e-9)
    # The springs carry all but a quarter of a percent.
    assert 0.0023 < float(carried_share(0.5 * LENGTH)) < 0.0025
    assert np.isinf(spring_stiffness(0.0, 0.5 * WIDTH))


def test_last_line_of_318_lacks_a_factor() -> None:
    """As printed it differs from the first line: the factor 1.5 of (315) is missing in p/q."""
    bracket = (WIDTH / LENGTH) ** 4 + 2.0 / 3.0 * (WIDTH / LENGTH) ** 2 + 1.0
    cosine = 1.0 - np.cos(2.0 * np.pi * 0.3)
    per_pressure = free_deflection(1.0, 0.5 * WIDTH)
    printed = (bracket / cosine - 1.0) / per_pressure
    right = spring_stiffness(0.3 * LENGTH, 0.5 * WIDTH)
    assert right / printed == pytest.approx(1.5, rel=2e-3)


def test_plate_has_the_closed_form_at_mid_width() -> None:
    plate = ThesisPlate(ELASTIC, WIDTH).bulge(SPAN, SHELL)
    z = np.linspace(0.0, LENGTH, 51)
    expected = clamped_deflection(P, BENDING, LENGTH, WIDTH, z, 0.5 * WIDTH)
    assert plate.at(z) == pytest.approx(expected, abs=1e-5 * plate.largest)
    assert plate.mean == pytest.approx(0.5 * plate.largest, rel=1e-6)
    assert plate.roll_force == pytest.approx(P * LENGTH)


def test_plate_is_scaled_to_a_reference_bulge() -> None:
    """As in VI.2.2.3 of the thesis."""
    plain = ThesisPlate(ELASTIC, WIDTH).bulge(SPAN, SHELL)
    scaled = ThesisPlate(ELASTIC, WIDTH, largest=1.3e-3).bulge(SPAN, SHELL)
    assert scaled.largest == pytest.approx(1.3e-3, rel=1e-12)
    assert scaled.at(0.1) / plain.at(0.1) == pytest.approx(1.3e-3 / plain.largest, rel=1e-12)
    assert scaled.moment == pytest.approx(plain.moment)


def test_bulge_of_none_is_zero() -> None:
    none = Bulge.none(SPAN, SHELL)
    assert none.largest == none.mean == 0.0
    assert not none.at([0.1, 0.2]).any() and not none.strain(0.0).any()
    assert none.roll_force == pytest.approx(50e3)


def test_strain_is_curvature_times_distance() -> None:
    """In the middle of a pitch the surface is stretched and the front compressed."""
    bulge = ElasticStrip(ELASTIC).bulge(SPAN, SHELL)
    middle = len(bulge.z) // 2
    swing = (bulge.curvature[middle] - bulge.curvature[0]) * 0.015
    assert swing > 0.0
    assert bulge.strain(0.0)[middle] == pytest.approx(swing, rel=1e-9)
    assert bulge.strain(bulge.thickness)[middle] == pytest.approx(-swing, rel=1e-9)


# The strip with shear deformation: a Timoshenko beam, closed forms and a continuum.


DATA = Path(__file__).parents[2] / "docs" / "data" / "moving_strip.csv"
STEEL = load_elasticity()
EVEN = Shell(0.06, lambda depth: 1273.15)
LONG_SPAN = Span(0.25, 0.3e6, 0.02)


def uneven(thickness: float, surface: float) -> Shell:
    """Return a shell with a surface temperature in degC and 1490 degC at the front."""
    front, outside = 1763.15, surface + 273.15
    return Shell(thickness, lambda depth: outside + (front - outside) * depth / thickness)


def test_uniform_shell_has_shear_factor_of_five_sixths() -> None:
    shear = STEEL.moduli(np.array([1273.15]))[0][0]
    found = stiffness(STEEL, EVEN.points()).shear
    assert found == pytest.approx(1.2 / (shear * EVEN.thickness), rel=2e-5)


def test_shear_compliance_is_the_energy_of_the_shear_flow() -> None:
    """The reference sums over 4000 layers the shear flow of the stress by a unit moment."""
    shell = uneven(0.085, 940.0)
    edges = np.linspace(0.0, shell.thickness, 4001)
    depth, dn = 0.5 * (edges[1:] + edges[:-1]), edges[1]
    shear, bulk, young = STEEL.moduli(np.asarray(shell.temperature(depth)))
    poisson = (3.0 * bulk - 2.0 * shear) / (6.0 * bulk + 2.0 * shear)
    plane, arm = young / (1.0 - poisson**2), 0.5 * shell.thickness - depth
    sums = [[float((plane * f * g).sum() * dn) for g in (poisson, 1.0, arm)] for f in (1.0, arm)]
    free = [float((plane * g).sum() * dn) for g in (np.ones_like(arm), poisson, poisson * arm)]
    across, axial, bent = np.linalg.solve([free, *sums], [0.0, 0.0, 1.0])
    stress = plane * (axial + bent * arm + poisson * across)
    flow = np.cumsum(stress) * dn
    assert abs(flow[-1]) < 1e-6 * np.abs(flow).max()
    found = stiffness(STEEL, shell.points(96))
    assert found.bending == pytest.approx(1.0 / bent, rel=1e-3)
    assert found.shear == pytest.approx(float((flow**2 / shear).sum() * dn), rel=1e-3)


@pytest.mark.parametrize("shell", [EVEN, uneven(0.03, 1000.0)], ids=["even", "uneven"])
def test_between_equal_rolls_shear_adds_a_parabola(shell: Shell) -> None:
    p, length, stiff = LONG_SPAN.pressure, LONG_SPAN.length, stiffness(STEEL, shell.points())
    z = length * np.linspace(0.0, 1.0, 33)
    inside = z * (length - z)
    exact = p * inside**2 / (24.0 * stiff.bending) + 0.5 * p * stiff.shear * inside
    elastic = ElasticStrip(STEEL, shear=True).bulge(LONG_SPAN, shell)
    creeping = CreepingStrip(ThermoElastic(STEEL), shear=True).bulge(LONG_SPAN, shell)
    stiffer = CreepingStrip(ThermoElastic(STEEL)).bulge(LONG_SPAN, shell)
    assert exact.max() > 1.15 * stiffer.largest
    for found in (elastic, creeping):
        assert found.at(z) == pytest.approx(exact, abs=1.2e-3 * exact.max())
    assert creeping.moment == pytest.approx(stiffer.moment, rel=1e-12)


def three_moments(pitches: np.ndarray, p: float, bending: float, shear: float) -> np.ndarray:
    """Return the moments over the rolls of an elastic Timoshenko beam with clamped ends.

    The rotation of the section is continuous over a roll, the slope is not: the rotations at the
    ends of a span are those of bending, less the rotation of its chord by shear.
    """
    count = len(pitches) + 1
    matrix, right = np.eye(count), np.full(count, -p * pitches[0] ** 2 / 12.0)
    for i in range(1, count - 1):
        before, after = pitches[i - 1], pitches[i]
        tilt = 6.0 * bending * shear
        matrix[i, i - 1] = before - tilt / before
        matrix[i, i] = 2.0 * (before + after) + tilt / before + tilt / after
        matrix[i, i + 1] = after - tilt / after
        right[i] = -0.25 * p * (before**3 + after**3)
    return np.asarray(np.linalg.solve(matrix, right))


def test_strip_at_lost_roll_has_moments_of_timoshenko_beam() -> None:
    """The shell is so thick for its pitch that shear changes the moments."""
    p, stiff = LONG_SPAN.pressure, stiffness(STEEL, EVEN.points())
    pitches = np.array([0.25] * 4 + [0.5] + [0.25] * 4)
    places = tuple(float(one) for one in np.concatenate([[0.0], np.cumsum(pitches)]))
    rolls = Rolls(places, (0.0,) * len(places), p, 0.02)
    found = over_rolls(CreepingStrip(ThermoElastic(STEEL), shear=True), rolls, EVEN)
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
def test_strip_with_shear_is_close_to_a_continuum(
    what: str, pitch: int, off: float, without: float
) -> None:
    """The continuum is plane and creeps under moving rolls: docs/data/moving_strip.csv."""
    with DATA.open(newline="", encoding="utf-8") as file:
        row = next(
            r for r in csv.DictReader(file) if r["what"] == what and int(r["pitch"]) == pitch
        )
    shell = uneven(1e-3 * float(row["shell"]), float(row["surface"]))
    law: Any = ThermoElastic(STEEL)
    if what == "austenite":
        law = load_law("kozlowski_zhu_signed", STEEL, carbon=0.1, delta_share=np.zeros_like)
    span = Span(1e-3 * pitch, 1e6 * float(row["pressure"]), 0.02)
    bulges = [CreepingStrip(law, shear=shear).bulge(span, shell) for shear in (True, False)]
    limit = float(row["limit"])
    errors = [abs(1e3 * one.largest / limit - 1.0) for one in bulges]
    assert errors[0] < off and errors[1] > without
