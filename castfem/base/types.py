"""Types of arrays and literals that several tables share."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]

MushyZone = Literal["skeleton", "geometric", "linear", "none"]
"""Models of the mushy zone, see `castfem.physics.constitutive.elasticity.Solidity`."""
