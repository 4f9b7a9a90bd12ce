"""The elastic strip: clamped at both rolls, with the moduli at the shell's own temperatures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.types import Array
from castfem.physics.constitutive.elasticity import Elasticity
from castfem.physics.machine.bulging.result import Bulge, Span, evenly
from castfem.physics.machine.bulging.shell import Shell, stiffness

NODES = 41


@dataclass(frozen=True, slots=True)
class ElasticStrip:
    """w = p z^2 (L - z)^2 / 24 D, at most p L^4 / 384 D, without memory or speed.

    Shear adds S p z (L - z) / 2, S its compliance: all pitches being alike, no moment changes.

    Attributes:
        elasticity: Of the steel.
        shear: Whether the strip yields to shear.
    """

    elasticity: Elasticity
    shear: bool = False

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
