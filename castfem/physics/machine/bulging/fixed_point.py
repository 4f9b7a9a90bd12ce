"""Anderson's acceleration of a fixed-point iteration x <- g(x)."""

from __future__ import annotations

import numpy as np

from castfem.base.types import Array

DEPTH = 5  # iterations that are remembered
WORSE = 2.0  # growth of what is missing, at which all that is remembered is dropped
RANK = 1e-6  # of the largest singular value: differences that are as good as dependent


class Anderson:
    """Remembers the last iterations and proposes the next x."""

    def __init__(self) -> None:
        self._x: list[Array] = []
        self._rest: list[Array] = []

    def next(self, x: Array, image: Array) -> Array:
        """Return the next x, from x (n,) and its image g(x) (n,)."""
        rest = image - x
        if self._rest and np.linalg.norm(rest) > WORSE * np.linalg.norm(self._rest[-1]):
            self._x, self._rest = [], []
        self._x = [*self._x[-DEPTH:], x]
        self._rest = [*self._rest[-DEPTH:], rest]
        if len(self._x) == 1:
            return image
        moves = np.diff(np.array(self._x), axis=0).T
        changes = np.diff(np.array(self._rest), axis=0).T
        share = np.linalg.lstsq(changes, self._rest[-1], rcond=RANK)[0]
        return np.asarray(image - (moves + changes) @ share)
