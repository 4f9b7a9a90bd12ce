"""A pair lost in the bender: what the strip leaves out, the growth of its shell and the width.

A clamped plate of finite width creeps under an even pressure, stationary, by Norton's power of the
von Mises stress, its in-plane strains small: the minimum of the power, by polynomials (Ritz), over
that of a strip.  Beside it the creeping strip over a lost pair as it is in the bender, with the
shell that enters the long pitch, with that half-way, and with the pressure that a plate feels as a
strip does.  Writes two tables of docs/slab_limits.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial import Polynomial
from numpy.polynomial.legendre import leggauss

from benchmarks.lost_roll import COUNT, steel
from benchmarks.report import Output, table
from castfem.base.types import Array
from castfem.physics.constitutive.base import Law
from castfem.physics.machine.bulging import CreepingStrip, Shell, Span
from castfem.physics.machine.bulging.uneven import UnevenRolls

POWERS = (1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 5.5, 6.0)  # each begins at the one before
TOLD = (1.0, 3.0, 5.0, 6.0)
WIDTHS = (1.2, 2.4, 4.8)  # over the pitch; 1200 mm and a pitch of 500
EDGES = {True: "clamped", False: "simply supported"}
TERMS, POINTS = (8, 9), 60
LOAD = 0.7 * 16.0  # of unit pitch and moment: what a strip bears as it yields is 16
ITERATIONS, ENDED = 200, 1e-12
LEAST = 1e-8  # of the squared curvature: rigid steel has a tangent, too
MISES = np.array([[4.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 4.0]]) / 3.0  # kxx, kyy, kxy

# The shell below #11 of the slab; between #11 and #13 if #12 is lost.
SHELL, SURFACE, FRONT = 0.034, 1308.15, 1763.15  # m, K
PITCH, PRESSURE, SPEED, ENTERED = 0.257, 0.22e6, 0.02, 160.0  # m, Pa, m/s, s since the meniscus


@dataclass(frozen=True)
class Shapes:
    """Even polynomials over a length that end at 0, clamped or not.

    Attributes:
        weights: Of Gauss' points, m. value, slope, bend: There (terms, points). middle: (terms,).
    """

    weights: Array
    value: Array
    slope: Array
    bend: Array
    middle: Array

    @classmethod
    def over(cls, length: float, terms: int, clamped: bool) -> Shapes:
        """Over a length, m; of unit mean bend, none in that of another."""
        half = 0.5 * length
        x, weights = leggauss(POINTS)
        edge = Polynomial([1.0, 0.0, -1.0]) ** (2 if clamped else 1)
        given = [edge * Polynomial([*[0.0] * 2 * i, 1.0]) for i in range(terms)]
        value, slope, bend = (np.array([p.deriv(k)(x) for p in given]) / half**k for k in range(3))
        new = np.linalg.inv(np.linalg.cholesky((bend * weights) @ bend.T))
        middle = np.array([p(0.0) for p in given])
        return cls(half * weights, new @ value, new @ slope, new @ bend, new @ middle)


@dataclass(frozen=True)
class Plate:
    """A plate of unit pitch; of no width it is a strip.

    Attributes:
        curvatures: Of each shape at each point, (3, shapes, points).
        deflections: (shapes, points). weights: Of the points. middle: Deflections there.
    """

    curvatures: Array
    deflections: Array
    weights: Array
    middle: Array

    @classmethod
    def of(cls, width: float | None, clamped: bool = True) -> Plate:
        """Between two rolls that clamp it, its edges clamped or supported."""
        along = Shapes.over(1.0, TERMS[0], clamped=True)
        if width is None:
            none = np.zeros_like(along.bend)
            bends = np.stack([along.bend, none, none])
            return cls(bends, along.value, along.weights, along.middle)
        across = Shapes.over(width, TERMS[1], clamped)

        def both(one: Array, other: Array) -> Array:
            product = np.einsum("ip,jq->ijpq", one, other)
            return product.reshape(len(one) * len(other), -1)

        return cls(
            np.stack([both(along.bend, across.value), both(along.value, across.bend),
                      both(along.slope, across.slope)]),
            both(along.value, across.value),
            np.outer(along.weights, across.weights).ravel(),
            np.outer(along.middle, across.middle).ravel(),
        )  # fmt: skip

    def rises(self, load: float = LOAD) -> dict[float, float]:
        """Rate of its middle for each power, by an even pressure."""
        shapes, found = np.full(len(self.middle), 1e-3), {}
        for power in POWERS:
            shapes = self._least(power, load, shapes)
            found[power] = float(self.middle @ shapes)
        return found

    def _least(self, power: float, load: float, shapes: Array) -> Array:
        """Newton's method to the minimum of the power of creep less that of the pressure."""
        q = 1.0 + 1.0 / power

        def functional(given: Array) -> float:
            bent = np.tensordot(self.curvatures, given, axes=([1], [0]))
            square = np.einsum("ap,ab,bp->p", bent, MISES, bent) + LEAST
            done = load * float(self.weights @ (given @ self.deflections))
            return float(self.weights @ square ** (0.5 * q)) / q - done

        for _ in range(ITERATIONS):
            bent = np.tensordot(self.curvatures, shapes, axes=([1], [0]))
            turned = MISES @ bent
            square = (bent * turned).sum(0) + LEAST
            stiff = self.weights * square ** (0.5 * q - 1.0)
            softer = self.weights * (q - 2.0) * square ** (0.5 * q - 2.0)
            slope = np.einsum("acp,ap->c", self.curvatures, stiff * turned)
            slope -= load * self.deflections @ self.weights
            along = np.einsum("ap,acp->cp", turned, self.curvatures)
            matrix = np.einsum(
                "acp,ab,bdp,p->cd", self.curvatures, MISES, self.curvatures, stiff, optimize=True
            )
            step = -np.linalg.solve(matrix + (along * softer) @ along.T, slope)
            before, share = functional(shapes), 1.0
            while functional(shapes + share * step) > before + 1e-4 * share * slope @ step:
                share *= 0.5
                if share < ENDED:
                    break
            shapes = shapes + share * step
            if abs(slope @ step) < ENDED * abs(before):
                break
        return shapes


def felt(ratio: float, power: float) -> float:
    """Share of the pressure under which a strip creeps as far as the plate."""
    return float(ratio ** (1.0 / power))


def lost(law: Law, thickness: float, pressure: float) -> float:
    """Largest bulge of a strip over rolls of which one is lost, m."""
    shell = Shell(thickness, lambda depth: SURFACE + (FRONT - SURFACE) / thickness * depth)
    places = PITCH * np.delete(np.arange(12), 6)
    rolls = UnevenRolls(
        CreepingStrip(law), places, np.zeros(len(places)), (5,), (PITCH, PITCH), COUNT
    )
    return rolls.bulge(5, Span(2 * PITCH, pressure, SPEED), shell, 1.0).bulge.largest


def main(output: Output, quick: bool) -> None:
    """Plates over strips, then the strip of the bender by what it is given."""
    strip, rows = Plate.of(None).rises(), []
    for width in WIDTHS[1:2] if quick else WIDTHS:
        for clamped, edges in EDGES.items():
            found = Plate.of(width, clamped).rises()
            ratios = {f"n{power:g}": found[power] / strip[power] for power in TOLD}
            rows.append({"width": width, "edges": edges, **ratios})
    output.csv("creeping_plate", rows)
    narrow = {row["edges"]: row for row in rows if row["width"] == WIDTHS[1]}
    share = felt(narrow["clamped"]["n5"], 5.0)
    grown = SHELL * float(np.sqrt(1.0 + PITCH / SPEED / ENTERED))
    law = steel()
    told: list[dict[str, Any]] = [
        {"what": what, "shell": 1e3 * shell, "pressure": 1e-3 * pressure,
         "bulge": 1e3 * lost(law, shell, pressure)}
        for what, shell, pressure in (
            ("as it enters the long pitch", SHELL, PRESSURE),
            ("half-way", grown, PRESSURE),
            ("as it enters, 1200 mm wide", SHELL, share * PRESSURE),
            ("half-way, 1200 mm wide", grown, share * PRESSURE),
        )
    ]  # fmt: skip
    output.csv("lost_bender", told)
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    head = {"width": "width over pitch", "edges": "narrow edges"}
    head |= {f"n{power:g}": f"n = {power:g}" for power in TOLD}
    forms = {name: ".2f" for name in head if name.startswith("n")}
    if rows := output.rows("creeping_plate"):
        output.insert("creeping plate", table(rows, head, forms))
    head = {"what": "shell", "shell": "mm", "pressure": "pressure, kPa", "bulge": "bulge, mm"}
    if rows := output.rows("lost_bender"):
        forms = {"shell": ".1f", "pressure": ".0f", "bulge": ".1f"}
        output.insert("lost bender", table(rows, head, forms))
