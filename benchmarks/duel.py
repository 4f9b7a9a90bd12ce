"""castfem against the plain scikit-fem script: error against run time, both in one run.

Both get the same lengths for their meshes, the same steps, and the best of their options: the
script's form, cells, scheme and linear solver are all varied.  Of every combination the shortest of
several runs counts; the two take turns, so that a busy machine meets both.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from benchmarks.accuracy import GRADED, LEVELS, cheapest, errors, front, row_of, worst
from benchmarks.billet import RADIUS, Settings, billet_case, run
from benchmarks.reference import Reference, load
from benchmarks.report import Output, table
from castfem.model.build.simulation import build_mesh

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from skfem import MeshQuad, MeshTri

    from benchmarks.opponent import Run

SIZES = (0.8, 0.6, 0.4, 0.3, 0.2)  # mm
STEPS = (0.5, 0.25, 0.1)  # s
EULER = (0.1, 0.05, 0.02)


@dataclass(frozen=True, slots=True)
class Way:
    """One way to run the script."""

    cell: str
    form: str
    linear: str
    scheme: str
    step: float


def ways(corner: str) -> Iterator[Way]:
    """All ways the script is run, on every mesh."""
    kinds = [("quadrilateral", "lumped", "splu"), ("quadrilateral", "lumped", "cg")]
    if corner == "sharp":
        kinds.append(("triangle", "lumped", "cg"))
    for kind in kinds:
        for scheme in ("bdf2", "sdirk2"):
            for step in STEPS:
                yield Way(*kind, scheme, step)
    for step in EULER:
        yield Way("quadrilateral", "lumped", "cg", "backward_euler", step)
    for step in STEPS[:2]:
        yield Way("quadrilateral", "consistent", "splu", "bdf2", step)


def grid(corner: str, size: float) -> Settings:
    """Mesh of castfem for a size; the script's has the same lengths."""
    depth = 5.0 if corner == "rounded" else 10.0
    return replace(GRADED, corner=corner, surface_size=size, corner_size=size, surface_depth=depth)


def script_mesh(settings: Settings, cell: str) -> MeshQuad | MeshTri:
    """The script's mesh: its own for the sharp corner; the rounded one it is given by castfem."""
    from benchmarks import opponent, plain_heat

    if settings.corner == "sharp":
        depth = settings.surface_depth or 0.0
        mesh = opponent.tensor_mesh(
            1e-3 * settings.surface_size, 1e-3 * depth, 1e-3 * settings.core_size
        )
        return mesh.to_meshtri() if cell == "triangle" else mesh
    made = build_mesh(billet_case(replace(settings, step=0.1)))
    return plain_heat.mesh_from(made.points, made.cells[:, [0, 1, 3, 2]])


def script_runs(
    settings: Settings, reference: Reference, repeats: int, quick: bool
) -> Iterator[dict[str, Any]]:
    """All runs of the script on one mesh, as rows."""
    from benchmarks import opponent

    chosen = list(ways(settings.corner))[:: 6 if quick else 1]
    problems: dict[tuple[str, str, str], opponent.Billet] = {}
    for way in chosen:
        key = way.cell, way.form, way.linear
        if key not in problems:
            mesh = script_mesh(settings, way.cell)
            surface = _outer(settings.corner)
            problems[key] = opponent.Billet(mesh, way.form, way.linear, surface)
        spent, best = 0.0, None
        for _ in range(repeats):
            found = opponent.advance(problems[key], way.scheme, way.step)
            best = found if best is None or found.wall < best.wall else best
            spent += found.wall
            if spent > 1.0:
                break
        assert best is not None
        yield _row(settings, way, best, reference)


def _outer(corner: str) -> Callable[[Any], Any] | None:
    """The cooled facets of the boundary by their midpoints: all but those on lines of symmetry."""
    return None if corner == "sharp" else lambda x: (x[0] > 1e-9) & (x[1] > 1e-9)


def _row(settings: Settings, way: Way, found: Run, reference: Reference) -> dict[str, Any]:
    return {
        "code": "scikit-fem",
        "variant": settings.corner,
        "how": f"{way.cell}s, {way.form}, {way.linear}",
        "scheme": way.scheme,
        "surface_size_mm": settings.surface_size,
        "stepping": f"{way.step:g} s",
        "vertices": found.vertices,
        "newton": found.newton,
        "seconds": found.wall,
        **errors(found, reference),
    }


def castfem_runs(
    settings: Settings, reference: Reference, repeats: int, quick: bool
) -> Iterator[dict[str, Any]]:
    """All runs of castfem on one mesh, as rows."""
    for step in STEPS[: 1 if quick else None]:
        result = run(replace(settings, step=step), repeats=repeats)
        found = row_of(result, reference)
        keys = ("scheme", "surface_size_mm", "stepping", "vertices", "newton", "seconds")
        yield {
            "code": "castfem",
            "variant": settings.corner,
            "how": "quadrilaterals",
            **{k: found[k] for k in keys},
            **errors(result, reference),
        }


def verdict(rows: list[dict[str, Any]], corner: str) -> list[dict[str, Any]]:
    """The cheapest run of each code for each level, and how many times castfem is faster."""
    lines = []
    for level in LEVELS:
        best = {
            code: cheapest(rows, level, code=code, variant=corner)
            for code in ("castfem", "scikit-fem")
        }
        ours, theirs = best["castfem"], best["scikit-fem"]
        for code, found in best.items():
            line: dict[str, Any] = {"level": f"{level[0]:g} K, {level[1]:g} %", "code": code}
            line |= found or {"how": "not reached"}
            if code == "scikit-fem" and ours and theirs:
                line["ratio"] = theirs["seconds"] / ours["seconds"]
            lines.append(line)
    return lines


def draw(rows: list[dict[str, Any]]) -> Figure:
    """Error against time of every run, and the front of each code, for both corners."""
    from castfem.post.plots.style import look, new_figure

    colours = {"castfem": "#0072b2", "scikit-fem": "#d55e00"}
    rows = [r | {"worst_K": worst(r)} for r in rows]
    with look():
        figure = new_figure(9.0, 3.9)
        axes = figure.subplots(1, 2, sharey=True)
        for axis, corner in zip(axes, RADIUS, strict=True):
            for code, colour in colours.items():
                own = [r for r in rows if r["code"] == code and r["variant"] == corner]
                x, y = ([r[k] for r in own] for k in ("seconds", "worst_K"))
                axis.plot(x, y, ".", color=colour, alpha=0.35, markersize=5)
                axis.step(*front(own, "worst_K"), where="post", color=colour, label=code)
            for level, _ in LEVELS:
                axis.axhline(level, color="#555555", linewidth=0.8, linestyle=":")
            axis.set(xscale="log", yscale="log", xlabel="run time [s]")
            axis.set_title(f"{corner} corner")
        axes[0].set_ylabel("temperature error, 5 s to 10 s [K]")
        axes[0].legend()
    return figure


def main(output: Output, quick: bool = False) -> None:
    """Run both codes on both corners."""
    try:
        from benchmarks import opponent  # noqa: F401
    except ModuleNotFoundError as error:
        print(f"opponent: {error.name} is missing; pip install 'castfem[benchmark]'")
        return
    rows: list[dict[str, Any]] = []
    repeats = 1 if quick else 3
    for corner, reference in load().items():
        for size in SIZES[: 2 if quick else None]:
            settings = grid(corner, size)
            rows += castfem_runs(settings, reference, repeats, quick)
            rows += script_runs(settings, reference, repeats, quick)
            rows += castfem_runs(settings, reference, repeats, quick)
        print(f"opponent, {corner}: {sum(r['variant'] == corner for r in rows)} runs")
    output.csv("opponent", rows)
    output.figure("opponent", draw(rows))
    show(output)


def show(output: Output) -> None:
    """The tables, from the data."""
    rows = output.rows("opponent")
    headings = {
        "level": "asked for", "code": "code", "how": "how", "scheme": "scheme",
        "surface_size_mm": "surface size [mm]", "stepping": "step", "vertices": "vertices",
        "newton": "Newton iterations", "mid_face_late_K": "mid-face [K]",
        "corner_late_K": "corner [K]", "heat_late_percent": "heat [%]", "seconds": "time loop [s]",
        "ratio": "times castfem's",
    }  # fmt: skip
    formats = {
        "mid_face_late_K": ".3f", "corner_late_K": ".3f", "heat_late_percent": ".4f",
        "seconds": ".3f", "ratio": ".1f",
    }  # fmt: skip
    for corner in RADIUS:
        output.insert(f"opponent {corner}", table(verdict(rows, corner), headings, formats))
