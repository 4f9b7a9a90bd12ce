"""The wall of a run's mould, as figures of the section draw it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from castfem.base.tolerances import ROUNDING
from castfem.base.types import Array
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import CASE_NAME

_FINE = 33  # points of a segment; odd: one lies in the middle of a face, on the plane of symmetry
_MODELLED = {"quarter": (0, 1), "half": (0,)}  # axes along which the modelled part is above 0


@dataclass(frozen=True, slots=True)
class WallLine:
    """The wall round the modelled part of a section; NaN parts its pieces.

    Attributes:
        start: (n, 2) at the meniscus [m].
        moved: (n, 2) how far the same points have moved since [m]: the taper.
    """

    start: Array
    moved: Array

    @classmethod
    def of(cls, fields: Fields, index: int) -> WallLine | None:
        """From the case of the run; None without a mould at that time, or without a sound case."""
        from castfem.model import Case, read_case
        from castfem.model.build_mould import build_mould

        file, position = fields.folder / CASE_NAME, float(fields.positions[index])
        case = read_case(file).case if file.is_file() else None
        if not isinstance(case, Case) or case.mould is None:
            return None
        mould = build_mould(case.mould, case.section)
        if position > mould.length * (1.0 + ROUNDING):
            return None
        start, now = (
            np.concatenate([s.points(_FINE) for s in mould.contour(place).segments])
            for place in (0.0, position)
        )
        near = ROUNDING * float(np.abs(start).max())
        for axis in _MODELLED.get(str(fields.attributes.get("symmetry")), ()):
            start[start[:, axis] < -near] = np.nan
        return cls(start, now - start)

    def drawn(self, factor: float) -> Array:
        """The wall (n, 2) [m], the taper magnified by a factor."""
        return self.start + factor * self.moved
