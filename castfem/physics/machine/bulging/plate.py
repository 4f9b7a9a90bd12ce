"""The elastic strip, and the elastic plate with a cosine deflection of the thesis.

The strip is clamped at both rolls, with the moduli at the shell's own temperatures. The thesis'
plates (VI.2.2.2) are clamped at each roll and each narrow face; L1 is the pitch, L2 the width. A
single cosine overestimates the deflection of the exact strip, by 27 % in the example of (309).
(308) lacks the bracket around the sum in its denominator that (314) has.

Equation numbers are those of [Pascon2003] (docs/references.md).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.machine.bulging.result import Bulge, Span, evenly
from castfem.physics.machine.bulging.shell import Shell, stiffness

NODES = 41


@dataclass(frozen=True, slots=True)
class ElasticStrip:
    """w = p z^2 (L - z)^2 / 24 D, at most p L^4 / 384 D, without memory or speed.

    Shear adds S p z (L - z) / 2, with compliance S: as all pitches are equal, the moment is
    unchanged.
    """

    elasticity: Elasticity  #: elasticity of the steel
    shear: bool = False  #: whether the strip has shear deformation

    def bulge(self, span: Span, shell: Shell) -> Bulge:
        """See `BulgingModel`."""
        length, p, stiff = span.length, span.pressure, stiffness(self.elasticity, shell.points())
        z = evenly(length, NODES)
        load = p / stiff.bending
        inside: Array = np.asarray(z * (length - z))
        yields = p * stiff.shear if self.shear else 0.0
        moment: Array = np.asarray(0.5 * p * inside - p * length**2 / 12.0)
        return Bulge(
            z=z,
            deflection=np.asarray(load * inside**2 / 24.0 + 0.5 * yields * inside),
            slope=np.asarray((load * inside / 12.0 + 0.5 * yields) * (length - 2.0 * z)),
            moment=moment,
            curvature=np.asarray(moment / stiff.bending),
            axial_strain=np.zeros(NODES),
            neutral=stiff.neutral,
            thickness=shell.thickness,
            roll_force=np.array([p * length]),
        )


_PI4 = np.pi**4


def _sum(length: float, width: float) -> float:
    """The bracket of (308), (314): 1 plus powers of L2/L1."""
    ratio = (width / length) ** 2
    return ratio**2 + 2.0 / 3.0 * ratio + 1.0


def _cosine(position: npt.ArrayLike, length: float) -> Array:
    return np.asarray(1.0 - np.cos(2.0 * np.pi * np.asarray(position, float) / length))


def clamped_deflection(
    pressure: float, bending: float, length: float, width: float,
    along: npt.ArrayLike, across: npt.ArrayLike,
) -> Array:  # fmt: skip
    """Deflection w2 of a plate clamped along its four edges (308) as corrected, m.

    Args:
        pressure: Pressure p, Pa.
        bending: Bending stiffness D, N m.
        length: Pitch L1, m.
        width: Width L2, m.
        along: Positions from the roll, m.
        across: Positions from one narrow face, m; to be broadcast with `along`.
    """
    amplitude = pressure * width**4 / (_PI4 * 12.0 * bending * _sum(length, width))
    return np.asarray(amplitude * _cosine(along, length) * _cosine(across, width))


@dataclass(frozen=True, slots=True)
class ThesisPlate:
    """The thesis' plate at mid-width, w2(z, L2/2), with the shell's own stiffness."""

    elasticity: Elasticity  #: elasticity of the steel
    width: float  #: width of the slab, m
    #: reference for the largest deflection in the pitch, m, to which the deflection is scaled
    #: (VI.2.2.3); None for that of the plate itself
    largest: float | None = None

    def bulge(self, span: Span, shell: Shell) -> Bulge:
        """See `BulgingModel`."""
        stiff, wave = stiffness(self.elasticity, shell.points()), 2.0 * np.pi / span.length
        z = evenly(span.length, NODES)
        top = float(
            clamped_deflection(
                span.pressure, stiff.bending, span.length, self.width,
                0.5 * span.length, 0.5 * self.width,
            )
        )  # fmt: skip
        factor = 1.0 if self.largest is None else self.largest / top
        half = 0.5 * top * factor
        curvature = -half * wave**2 * np.cos(wave * z)
        return Bulge(
            z=z,
            deflection=half * (1.0 - np.cos(wave * z)),
            slope=half * wave * np.sin(wave * z),
            moment=stiff.bending / factor * curvature,
            curvature=curvature,
            axial_strain=np.zeros(NODES),
            neutral=stiff.neutral,
            thickness=shell.thickness,
            roll_force=np.array([span.pressure * span.length]),
        )
