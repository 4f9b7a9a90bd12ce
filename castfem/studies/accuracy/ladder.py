"""Which runs tell the error of a case: one of its sizes scaled at a time, the cheap ones first."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from castfem.base.errors import InputError
from castfem.model import Case
from castfem.studies.accuracy import sizes
from castfem.studies.accuracy.sizes import COUPLING, MESH, STEP

BASE = "base"
FACTORS: Mapping[str, tuple[float, ...]] = {
    MESH: (2.0, 2.0**0.5, 2.0**-0.5),
    STEP: (2.0, 0.5),
    COUPLING: (2.0, 0.5),
}
"""Of the runs beside that of the case itself."""
_DEARER = {MESH: 2.0, STEP: 0.5, COUPLING: 1.0}  # time goes with this power of 1 / factor


@dataclass(frozen=True, slots=True)
class Level:
    """A run of the ladder."""

    name: str  #: of its folder
    axis: str  #: which of the sizes is scaled; "" for the case itself
    factor: float  #: by how much
    case: Case  #: the case with these sizes
    problem: str = ""  #: why it cannot be run, empty if it can

    @property
    def text(self) -> str:
        """What tables call it: "mesh x 1.41"."""
        return f"{self.axis} x {self.factor:.3g}" if self.axis else "as it is"


def levels(case: Case) -> tuple[Level, ...]:
    """Return the runs of a case, the cheapest first.

    Runs beside that of the case itself write one field, if that writes any. Sizes that a check of
    the case refuses (cells larger than a face) make a level with a problem.
    """
    found = [Level(BASE, "", 1.0, case)]
    for axis in sizes.axes_of(case):
        factors = FACTORS[axis]
        if axis == STEP and sizes.steps_fill_windows(case):
            factors = (0.5, 0.25)  # the windows limit the step: no longer one
        found += [_level(case, axis, factor) for factor in factors]
    return tuple(sorted(found, key=_cost))


def _level(case: Case, axis: str, factor: float) -> Level:
    name = f"{axis}_x{factor:.3g}"
    try:
        scaled = case.with_(sizes.changes(case, {axis: factor}) | quiet(case))
    except InputError as error:
        return Level(name, axis, factor, case, "; ".join(error.problems))
    return Level(name, axis, factor, scaled)


def quiet(case: Case) -> dict[str, Any]:
    """Return the keys with which a case writes little, and takes the same steps.

    Steps and windows end where fields are written: one of them is kept if there are any.
    """
    return {"output.fields": list(case.output_fields[:1]), "output.figures": False}


def _cost(level: Level) -> float:
    return 1.0 if not level.axis else level.factor ** -_DEARER[level.axis]
