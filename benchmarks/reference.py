"""Converged values of the billet, with their uncertainty: what all errors are measured against.

At mid-face heat flows in one dimension for all of the 10 s (the corner is four diffusion lengths
away), so the values there come from a strip with cells down to 0.016 mm. Corner and heat come from
families of meshes, each extrapolated to size zero. Freezing makes single meshes scatter about the
second-order law (a front moves from vertex to vertex), so a law a + b s^2 is fitted to all meshes
of a family; the mean of the families counts. The uncertainty is the largest of: fit against
extrapolation of the two finest meshes, scatter about the fit, half the spread of the families,
half the correction for the time step. Triangles take no part in the temperature of a rounded
corner: where no vertex lies in the middle of the arc, it is that of a chord.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.billet import (
    INSTANTS,
    LATE,
    RADIUS,
    Result,
    Settings,
    refined,
    run,
    strip_case,
)
from benchmarks.report import Output
from castfem.base.types import Array

FILE = Path(__file__).parents[1] / "docs" / "data" / "billet_reference.json"
QUANTITIES = ("mid_face", "corner", "heat", "shell_mid_face", "shell_corner")
PARTS = ("values", "uncertainty")
UNITS = {
    "mid_face": "degC",
    "corner": "degC",
    "heat": "MJ/m",
    "shell_mid_face": "mm",
    "shell_corner": "mm",
}
WORDS = {
    "mid_face": "surface temperature, mid-face",
    "corner": "surface temperature, corner",
    "heat": "heat removed, whole section",
    "shell_mid_face": "shell, mid-face",
    "shell_corner": "shell, corner diagonal",
}
STEP = 0.05  # time step of the families, s; a correction is computed from `STEPS`
STEPS = (0.05, 0.025, 0.0125)
HALVINGS = (0.5**0.5) ** np.arange(4)  # factors on the sizes within a family


@dataclass(frozen=True, slots=True)
class Reference:
    """Converged values of one variant at `INSTANTS`, by quantity, and their uncertainty."""

    values: dict[str, Array]
    uncertainty: dict[str, Array]


@dataclass(frozen=True, slots=True)
class Family:
    """Meshes that differ by one factor on every size."""

    name: str  #: name in the table
    coarsest: Settings  #: settings of its coarsest mesh
    factors: Array  #: factors on the sizes
    serves: tuple[str, ...] = QUANTITIES  #: quantities it is used for

    def members(self) -> list[Settings]:
        """Return the settings of every mesh."""
        return [refined(self.coarsest, f) for f in self.factors]


def families(corner: str, factors: Array = HALVINGS) -> list[Family]:
    """Return the families of a variant."""
    quads = Settings(
        corner=corner,
        surface_size=0.25,
        corner_size=0.25,
        face_size=2.0,
        core_size=2.0,
        surface_depth=14.0,
        core_depth=40.0,
        step=STEP,
    )
    fewer = factors[: max(len(factors) - 1, 2)]
    if corner == "sharp":
        other = replace(quads, surface_depth=10.0, face_size=3.0, core_size=3.0, core_depth=60.0)
        return [
            Family("rectangles, fine to 14 mm", quads, factors),
            Family("rectangles, fine to 10 mm", refined(other, 0.85), factors),
        ]
    other = replace(quads, corner_size=0.125, surface_depth=6.0, core_depth=30.0)
    triangles = replace(quads, cell="triangle", face_size=None, surface_depth=9.0, core_size=2.5)
    chord = tuple(q for q in QUANTITIES if q != "corner")
    return [
        Family("quadrilaterals, fine to 14 mm", quads, factors),
        Family("quadrilaterals, finer corner", other, fewer),
        Family("Delaunay triangles", triangles, fewer, chord),
    ]


def fitted(sizes: Array, values: Array) -> tuple[Array, Array]:
    """Return the limit of values (m, n) for sizes (m,) by a + b s^2, and its uncertainty (n,)."""
    system = np.stack([np.ones_like(sizes), sizes**2], axis=1)
    weight = (sizes.min() / sizes)[:, None]  # finer meshes have more weight
    (limit, slope), *_ = np.linalg.lstsq(weight * system, weight * values, rcond=None)
    scatter = np.sqrt(np.mean((values - system @ np.stack([limit, slope])) ** 2, axis=0))
    (s1, s2), (v1, v2) = sizes[-2:], values[-2:]
    pair = v2 + (v2 - v1) * s2**2 / (s1**2 - s2**2)
    return limit, np.maximum(scatter, np.abs(limit - pair))


def histories(results: Iterable[Result], name: str) -> Array:
    """Return one quantity of several runs (m, n)."""
    return np.array([getattr(r, name) for r in results])


def converge(
    corner: str,
    factors: Array = HALVINGS,
    steps: tuple[float, ...] = STEPS,
    say: Callable[[str], None] = print,
) -> tuple[Reference, list[dict[str, Any]]]:
    """Compute the reference of a variant.

    Args:
        corner: "rounded" or "sharp".
        factors: Factors on the sizes of the families' coarsest meshes.
        steps: Time steps, s: that of the families, then finer ones for the correction.
        say: Called with a line for every run.

    Returns:
        The reference and a table of all runs.
    """
    rows: list[dict[str, Any]] = []

    def add_run(name: str, settings: Settings) -> Result:
        result = run(settings)
        rows.append(row(name, settings, result))
        say("  " + ", ".join(f"{k} {v}" for k, v in rows[-1].items()))
        return result

    limits: dict[str, list[tuple[Array, Array]]] = {q: [] for q in QUANTITIES}
    for family in families(corner, factors):
        members = [replace(m, step=steps[0]) for m in family.members()]
        results = [add_run(family.name, m) for m in members]
        sizes = np.array([m.surface_size for m in members])
        for q in family.serves:
            limits[q].append(fitted(sizes, histories(results, q)))
    coarsest = families(corner, factors)[0].coarsest
    by_step = [add_run("time step", replace(coarsest, step=step)) for step in steps]
    values, uncertainty = {}, {}
    for q, found in limits.items():
        ends, doubts = np.array([e for e, _ in found]), np.array([d for _, d in found])
        shift = getattr(by_step[-1], q) - getattr(by_step[0], q)
        values[q] = ends.mean(axis=0) + shift
        spread = 0.5 * (ends.max(axis=0) - ends.min(axis=0))
        uncertainty[q] = np.max([doubts.mean(axis=0), spread, 0.5 * np.abs(shift)], axis=0)
    return Reference(values, uncertainty), rows


def row(name: str, settings: Settings, result: Result) -> dict[str, Any]:
    """Return the row of a run in the reference file."""
    found: dict[str, Any] = {
        "family": name,
        "surface_size_mm": round(settings.surface_size, 5),
        "step_s": settings.step,
        "vertices": result.vertices,
    }
    return found | {f"{q}_{UNITS[q]}": round(float(getattr(result, q)[-1]), 6) for q in QUANTITIES}


def one_dimensional(
    cells: tuple[int, ...] = (500, 1000, 2000, 4000), step: float = 0.0125
) -> dict[str, tuple[Array, Array]]:
    """Return mid-face temperature (degC) and shell (mm) of a strip, each with its uncertainty."""
    length = 62.5
    sizes = length / np.array(cells, float)
    results = [run(Settings(step=step), case=strip_case(length, s, step)) for s in sizes]
    halved = run(Settings(step=2 * step), case=strip_case(length, sizes[0], 2 * step))
    found = {}
    for q in ("mid_face", "shell_mid_face"):
        limit, doubt = fitted(sizes, histories(results, q))
        found[q] = limit, doubt + np.abs(getattr(halved, q) - getattr(results[0], q))
    return found


def compute(say: Callable[[str], None] = print) -> dict[str, Reference]:
    """Compute and store the references of both variants."""
    strip = one_dimensional()
    stored: dict[str, Any] = {
        "what": "125 mm billet in the idealised mould (cases/billet125/thermal.toml), 0 to 10 s",
        "how": " ".join((__doc__ or "").split()),
        "made by": "python -m benchmarks reference",
        "instants_s": INSTANTS.tolist(),
        "units": UNITS,
    }
    found = {}
    for corner in RADIUS:
        say(f"reference, {corner} corner")
        plane, rows = converge(corner, say=say)
        check = float(np.abs(plane.values["mid_face"] - strip["mid_face"][0])[-1])
        say(f"  mid-face at exit: plane less strip {check:.2g} K")
        for q, (value, doubt) in strip.items():
            plane.values[q], plane.uncertainty[q] = value, doubt
        found[corner] = plane
        stored[corner] = {
            "values": {q: np.round(v, 7).tolist() for q, v in plane.values.items()},
            "uncertainty": {q: _upwards(u) for q, u in plane.uncertainty.items()},
            "mid_face_plane_less_strip_K": round(check, 6),
            "runs": rows,
        }
    FILE.parent.mkdir(parents=True, exist_ok=True)
    FILE.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
    return found


def _upwards(numbers: Array) -> list[float]:
    """Round to two significant digits, never below the number."""
    return [float(f"{1.05 * n:.1e}") for n in numbers]


def load() -> dict[str, Reference]:
    """Return the stored references by variant.

    Raises:
        FileNotFoundError: There are none; `python -m benchmarks reference` makes them.
    """
    stored = json.loads(FILE.read_text(encoding="utf-8"))
    if not np.allclose(stored["instants_s"], INSTANTS):
        raise ValueError(f"{FILE.name} has other instants: run `python -m benchmarks reference`")
    return {
        corner: Reference(
            *({q: np.array(v) for q, v in stored[corner][part].items()} for part in PARTS)
        )
        for corner in RADIUS
    }


def show(output: Output) -> None:
    """Write the values at the exit of the mould into the page."""
    rows = []
    for corner, reference in load().items():
        for q in QUANTITIES:
            rows.append(
                {
                    "corner": corner,
                    "what": WORDS[q],
                    "value": float(reference.values[q][-1]),
                    "exit": float(reference.uncertainty[q][-1]),
                    "late": float(reference.uncertainty[q][LATE].max()),
                    "unit": UNITS[q],
                }
            )
    head = {
        "corner": "corner", "what": "quantity", "value": ("at 10 s", ".8g"),
        "exit": ("uncertainty", ".1g"), "late": ("largest uncertainty, 5 s to 10 s", ".1g"),
        "unit": "unit",
    }  # fmt: skip
    output.table("reference", rows, head)


def main(output: Output) -> None:
    """Compute the references and write their table."""
    compute()
    show(output)
