"""Bulging of the wide face between two pairs of rolls: plain numbers in, plain arrays out.

A strip of unit width at mid-face, as thick as the solid shell, moves from roll to roll under the
pressure of the liquid. Positions z are lengths from the upstream roll, w points outwards, n is the
depth from the surface; the curvature is kappa = -w'', the moment M = int sigma_zz (n_n - n) dn has
M'' = -p, and the axial strain is e + kappa (n_n - n), with n_n the depth of the neutral axis. The
strip is not bent across its width, and free to stretch.
"""

from __future__ import annotations

from castfem.physics.machine.bulging.creep import CreepingStrip
from castfem.physics.machine.bulging.plate import ElasticStrip, ThesisPlate
from castfem.physics.machine.bulging.result import Bulge, BulgingModel, Span
from castfem.physics.machine.bulging.shell import Shell, stiffness
from castfem.physics.machine.bulging.spans import Rolls, over_rolls

__all__ = [
    "Bulge",
    "BulgingModel",
    "CreepingStrip",
    "ElasticStrip",
    "Rolls",
    "Shell",
    "Span",
    "ThesisPlate",
    "over_rolls",
    "stiffness",
]
