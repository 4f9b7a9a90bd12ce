"""Mesh, step and coupling window of a case: its sizes, each with its own scale factor.

The depths of the mesh's grading are kept, so that all cells are scaled equally. With mechanics no
thermal step is longer than a coupling window: the shorter one counts.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from castfem.base.errors import InputError, choices
from castfem.base.units import nearest
from castfem.model import Case
from castfem.model.mechanics import Way
from castfem.model.section import meshing
from castfem.physics.coupling.step_control import LIMITS

DEFAULT = "default"


@dataclass(frozen=True, slots=True)
class Level:
    """A level of accuracy."""

    cells: float  #: size of the cells relative to that of the case
    window: float  #: length of the coupling windows relative to that of the case


LEVELS: Mapping[str, Level] = {
    "coarse": Level(1.5, 2.0),
    DEFAULT: Level(1.0, 1.0),
    "fine": Level(0.625, 0.5),
}
"""Levels of accuracy, the cheapest first."""
MESH, STEP, COUPLING = "mesh", "step", "coupling"
AXES = (MESH, STEP, COUPLING)
CELLS = ("surface_size", "corner_size", "face_size", "core_size")
_LOCAL = {"sdirk2": 3, "backward_euler": 2}  # order of the local error of a step
_SIZES = {
    "mesh": CELLS,
    "coupling": (
        "interval",
        "mechanical_step",
        "settled",
        "window_error",
        "growth",
        "strain_error",
    ),
}


def factors_of(word: str) -> dict[str, float]:
    """Return the scale factors of an accuracy level.

    They are those of `LEVELS`; the step is scaled like the coupling window.
    """
    level = LEVELS.get(word)
    if level is None:
        near = nearest(word, LEVELS)
        raise InputError(f"--accuracy {word}: unknown; use one of {choices(LEVELS)}{near}")
    return {MESH: level.cells, STEP: level.window, COUPLING: level.window}


def at_accuracy(case: Case, word: str) -> Case:
    """Return a case at an accuracy level, with a title that says so."""
    return case.with_(changes(case, factors_of(word)) | {"title": titled(case, word)})


def titled(case: Case, word: str) -> str:
    """Return the title of a case at an accuracy level."""
    return f"{case.title}; {word} accuracy"


def assignments(case: Case, word: str) -> list[str]:
    """Return the changes of a case for an accuracy level: KEY=VALUE, as for --set."""
    return [f"{key}={value}" for key, value in changes(case, factors_of(word)).items()]


def axes_of(case: Case) -> tuple[str, ...]:
    """Return the sizes that can be scaled: without mechanics there is no coupling."""
    return AXES if case.mechanics is not None else (MESH, STEP)


def cell_count(case: Case) -> int:
    """Return the number of cells of a case's mesh, which is built once for this."""
    return _cells(json.dumps(case.mesh_parameters(), sort_keys=True))


@lru_cache(maxsize=32)
def _cells(parameters: str) -> int:
    from castfem.meshes.build import build

    with meshing():
        return len(build(**json.loads(parameters)).cells)


def window(case: Case) -> float:
    """Return the coupling window of a case with mechanics, s; for a length at the mean speed."""
    given = case.coupling.interval
    if isinstance(given, Way):
        return given.length * case.casting.duration / case.casting.length
    return given


def steps_fill_windows(case: Case) -> bool:
    """Return whether the coupling windows limit the fixed thermal steps of a case."""
    step = case.thermal.time.step
    return case.mechanics is not None and step is not None and step >= window(case)


def changes(case: Case, factors: Mapping[str, float]) -> dict[str, Any]:
    """Return the keys of a case with scaled sizes, with their new values.

    Args:
        case: The case.
        factors: For mesh, step and coupling; below 1 is finer. Others are unchanged.
    """
    found: dict[str, Any] = {}
    if (factor := factors.get(MESH, 1.0)) != 1.0:
        for name in CELLS:
            size = getattr(case.mesh, name)
            if size is not None:
                found[f"mesh.{name}"] = _text(1e3 * factor * size, "mm")
    if (factor := factors.get(COUPLING, 1.0)) != 1.0 and case.mechanics is not None:
        found |= _coupling(case, factor)
    if (factor := factors.get(STEP, 1.0)) != 1.0:
        found |= _step(case, factor)
    elif factors.get(COUPLING, 1.0) > 1.0 and steps_fill_windows(case):
        # Longer windows must not lengthen the thermal steps.
        found["thermal.time.step"] = _text(window(case), "s")
    return found


def _coupling(case: Case, factor: float) -> dict[str, Any]:
    """The coupling windows and their tolerances."""
    given = case.coupling
    scaled = (
        _text(1e3 * factor * given.interval.length, "mm")
        if isinstance(given.interval, Way)
        else _text(factor * given.interval, "s")
    )
    found: dict[str, Any] = {"coupling.interval": scaled}
    if case.mould is not None:  # without a mould no window is iterated
        found["coupling.settled"] = _text(factor * given.settled, "K")
    if given.mechanical_step is not None:
        found["coupling.mechanical_step"] = _text(factor * given.mechanical_step, "s")
    if given.window_error is not None:
        found["coupling.window_error"] = _text(factor * given.window_error, "K")
    if (given.growth or 1.0) > 1.0:  # the error of a window is of second order in its length
        allowed = given.strain_error or LIMITS.strain
        found["coupling.strain_error"] = factor**2 * allowed
    return found


def _step(case: Case, factor: float) -> dict[str, Any]:
    """The fixed step, or the parameters of the adaptive one."""
    time = case.thermal.time
    if time.step is not None:
        counts = min(time.step, window(case)) if case.mechanics is not None else time.step
        return {"thermal.time.step": _text(factor * counts, "s")}
    assert time.adaptive is not None
    given = time.adaptive
    tolerance = factor ** _LOCAL[time.scheme] * given.tolerance
    return {
        "thermal.time.adaptive.tolerance": _text(tolerance, "K"),
        "thermal.time.adaptive.first": _text(factor * given.first, "s"),
        "thermal.time.adaptive.smallest": _text(min(factor, 1.0) * given.smallest, "s"),
        "thermal.time.adaptive.largest": _text(factor * given.largest, "s"),
    }  # fmt: skip


def _text(value: float, unit: str) -> str:
    return f"{value:.6g} {unit}"


def key(case: Case) -> str:
    """Return a hash of all input that the numbers of a case depend on, except its sizes."""
    physics = case.physics()
    for table, names in _SIZES.items():
        for name in names:
            physics.get(table, {}).pop(name, None)
    for name in ("step", "adaptive"):
        physics["thermal"]["time"].pop(name, None)
    text = json.dumps([physics, f"{case.casting.length:.9g}"], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def described(case: Case) -> dict[str, float]:
    """Return the sizes of a case by their keys, m, s and K, for `factors_between`."""
    found = {f"mesh.{name}": getattr(case.mesh, name) for name in CELLS}
    time = case.thermal.time
    if time.step is not None:
        found["step"] = time.step
        if case.mechanics is not None:
            found["step"] = min(time.step, window(case))
    else:
        assert time.adaptive is not None
        found["tolerance"] = time.adaptive.tolerance ** (1.0 / _LOCAL[time.scheme])
        found["largest step"] = time.adaptive.largest
    if case.mechanics is not None:
        found["window"] = window(case)
    return {name: float(value) for name, value in found.items() if value is not None}


def factors_between(
    base: Mapping[str, float], other: Mapping[str, float]
) -> dict[str, float] | None:
    """Return the factors between the sizes of two cases, by axis.

    Returns:
        Factors; None if the sizes do not differ by common factors, so no error can be estimated.
    """
    if base.keys() != other.keys():
        return None
    groups: dict[str, list[float]] = {}
    for name, size in base.items():
        axis = MESH if name.startswith("mesh.") else COUPLING if name == "window" else STEP
        groups.setdefault(axis, []).append(other[name] / size)
    if any(not _nearly_equal(ratios) for ratios in groups.values()):
        return None
    return {axis: math.prod(r) ** (1.0 / len(r)) for axis, r in groups.items()}


def _nearly_equal(ratios: Iterable[float]) -> bool:
    every = list(ratios)
    return max(every) <= 1.02 * min(every)
