"""Kinds of arrays, and words that several tables share, for annotations."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]
Indices = npt.NDArray[np.int64]

MushyZone = Literal["skeleton", "geometric", "linear", "none"]
"""What the mushy zone bears, see `castfem.physics.constitutive.elasticity.Solidity`."""
