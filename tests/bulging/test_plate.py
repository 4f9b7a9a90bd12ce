"""The thesis' plates and springs (VI.2.2.2), with the numbers it gives and those it has wrong.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from castfem.base.types import Array
from castfem.physics.constitutive import Elasticity
from castfem.physics.machine.bulging import Bulge, ElasticStrip, Shell, Span, ThesisPlate
from castfem.physics.machine.bulging.plate import (
    borne_share,
    clamped_deflection,
    free_deflection,
)

P, LENGTH, WIDTH = 0.2e6, 0.25, 1.2
BENDING = 10e9 * 0.03**3 / 12.0 / (1.0 - 0.3**2)
SHELL = Shell(0.03, lambda depth: 1400.0)
SPAN = Span(LENGTH, P, 0.02)
ELASTIC = Elasticity.constant(10e9, 0.3)


def spring_stiffness(along: npt.ArrayLike, across: npt.ArrayLike) -> Array:
    """Stiffness k of the springs that make a slice bulge as w2 (318) as corrected, Pa/m."""
    share = borne_share(LENGTH, WIDTH, along)
    with np.errstate(divide="ignore"):
        return (1.0 / share - 1.0) / free_deflection(1.0, BENDING, WIDTH, across)


def test_numbers_of_the_thesis() -> None:
    """(309): about 40 and 0.1 mm."""
    free = float(free_deflection(P, BENDING, WIDTH, 0.5 * WIDTH))
    clamped = float(clamped_deflection(P, BENDING, LENGTH, WIDTH, 0.5 * LENGTH, 0.5 * WIDTH))
    assert 1e3 * free == pytest.approx(43.0, abs=0.05)
    assert 1e3 * clamped == pytest.approx(0.105, abs=5e-4)
    exact = ElasticStrip(ELASTIC).bulge(SPAN, SHELL).largest
    assert clamped / exact == pytest.approx(1.275, abs=1e-3)


def test_springs_make_the_slice_bulge_as_the_plate() -> None:
    """(313), (316), (317): the slice under q and the springs under f = p - q move alike."""
    along = np.linspace(0.01, 0.24, 24)[:, None]
    across = np.linspace(0.05, 1.15, 23)[None, :]
    share = borne_share(LENGTH, WIDTH, along)
    wanted = clamped_deflection(P, BENDING, LENGTH, WIDTH, along, across)
    assert free_deflection(P * share, BENDING, WIDTH, across) == pytest.approx(wanted, rel=1e-12)
    force = spring_stiffness(along, across) * wanted
    assert force == pytest.approx(np.broadcast_to(P * (1.0 - share), force.shape), rel=1e-9)
    # The springs bear all but a quarter of a percent.
    assert 0.0023 < float(borne_share(LENGTH, WIDTH, 0.5 * LENGTH)) < 0.0025
    assert np.isinf(spring_stiffness(0.0, 0.5 * WIDTH))


def test_last_line_of_318_lacks_a_factor() -> None:
    """As printed it is not the first line: 1.5 of (315) is missing in p/q."""
    bracket = (WIDTH / LENGTH) ** 4 + 2.0 / 3.0 * (WIDTH / LENGTH) ** 2 + 1.0
    cosine = 1.0 - np.cos(2.0 * np.pi * 0.3)
    per_pressure = free_deflection(1.0, BENDING, WIDTH, 0.5 * WIDTH)
    printed = (bracket / cosine - 1.0) / per_pressure
    right = spring_stiffness(0.3 * LENGTH, 0.5 * WIDTH)
    assert right / printed == pytest.approx(1.5, rel=2e-3)


def test_plate_at_mid_width() -> None:
    plate = ThesisPlate(ELASTIC, WIDTH).bulge(SPAN, SHELL)
    z = np.linspace(0.0, LENGTH, 51)
    expected = clamped_deflection(P, BENDING, LENGTH, WIDTH, z, 0.5 * WIDTH)
    assert plate.at(z) == pytest.approx(expected, abs=1e-5 * plate.largest)
    assert plate.mean == pytest.approx(0.5 * plate.largest, rel=1e-6)
    assert plate.roll_force == pytest.approx(P * LENGTH)


def test_plate_is_amplified_to_a_reference() -> None:
    """VI.2.2.3."""
    plain = ThesisPlate(ELASTIC, WIDTH).bulge(SPAN, SHELL)
    given = ThesisPlate(ELASTIC, WIDTH, largest=1.3e-3).bulge(SPAN, SHELL)
    assert given.largest == pytest.approx(1.3e-3, rel=1e-12)
    assert given.at(0.1) / plain.at(0.1) == pytest.approx(1.3e-3 / plain.largest, rel=1e-12)
    assert given.moment == pytest.approx(plain.moment)


def test_no_bulge() -> None:
    none = Bulge.none(SPAN, SHELL)
    assert none.largest == none.mean == 0.0
    assert not none.at([0.1, 0.2]).any() and not none.strain(0.0).any()
    assert none.roll_force == pytest.approx(50e3)


def test_strain_of_a_bulge() -> None:
    """Surface and front of an elastic strip: stretched and pressed in the middle of a pitch."""
    bulge = ElasticStrip(ELASTIC).bulge(SPAN, SHELL)
    middle = len(bulge.z) // 2
    swing = (bulge.curvature[middle] - bulge.curvature[0]) * 0.015
    assert swing > 0.0
    assert bulge.strain(0.0)[middle] == pytest.approx(swing, rel=1e-9)
    assert bulge.strain(bulge.thickness)[middle] == pytest.approx(-swing, rel=1e-9)
