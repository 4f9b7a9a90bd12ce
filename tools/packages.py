"""Which package of castfem imports which: their order, read off the imports, and its picture.

    .castfem/bin/python tools/packages.py      draw docs/figures/packages.png anew

`tests/test_layers.py` holds the imports against `ORDER`; docs/architecture.md explains it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
# A package imports only what stands before it, also where only its types need it.
ORDER = {
    "base": "units, tables, files, log, errors",
    "meshes": "sections as plain arrays (gmsh)",
    "forms": "weak forms in UFL",
    "fem": "DOLFINx and PETSc, any physics",
    "physics.materials": "steels",
    "physics.constitutive": "laws at a material point",
    "physics.machine": "rolls, line, drives, bulging",
    "physics.mould": "the wall, the hot copper tube",
    "physics.thermal": "heat balance, surface laws",
    "physics.contact": "wall contact, friction, rolls",
    "physics.mechanics": "equilibrium of the slice",
    "physics.coupling": "temperature and mechanics in turn",
    "physics.closed_forms": "closed forms",
    "model": "case files, checked",
    "model.build": "from a case to what computes it",
    "runs.output": "the files of a run",
    "runs.tensile": "tensile tests of a law",
    "runs.results": "what is read off the slice",
    "runs": "from the meniscus to the end",
    "runs.caster": "many slices of one strand",
    "studies.identification": "laws fitted to tensile tests",
    "studies.mould_fit": "strand and mould fitted to each other",
    "studies.sensitivity": "derivatives of a run",
    "studies.sweep": "many runs",
    "studies.accuracy": "the error of each number",
    "studies.optimisation": "which values are best",
    "studies.calibration": "keys fitted to measurements",
    "post.plots": "figures of a run",
    "post.report": "words on a run",
    "post.compare": "runs side by side",
    "post.html": "runs as one HTML page",
    "post.watch": "runs at work",
    "api": "Python interface",
    "several_runs": "Python interface to several runs",
    "cli": "commands",
}


def package_of(module: str) -> str:
    """Return the longest name in `ORDER` that a module below castfem begins with, or its first."""
    parts = module.split(".")
    names = [".".join(parts[:n]) for n in range(len(parts), 0, -1)]
    return next((name for name in names if name in ORDER), parts[0])


def files() -> Iterator[tuple[str, Path]]:
    """Yield the package of each file, and the file."""
    for folder in ("castfem", "forms", "meshes"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            inside = path.relative_to(ROOT / folder).with_suffix("").parts
            unit = package_of(".".join(inside)) if folder == "castfem" else folder
            if unit not in ("__init__", "__main__"):
                yield unit, path


def named(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and dotted name of all that a file imports of castfem, types included."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from ((node.lineno, name) for name in names if name.startswith("castfem."))


def imported(path: Path) -> Iterator[tuple[int, str]]:
    """Yield line and package of all that a file imports of castfem, types included."""
    for line, name in named(path):
        yield line, package_of(name.partition(".")[2])


def arrows() -> list[tuple[str, str]]:
    """Each package with each that it imports."""
    found = {(unit, name) for unit, path in files() for _, name in imported(path)}
    return sorted((unit, name) for unit, name in found if name in ORDER and name != unit)


def written(pairs: list[tuple[str, str]]) -> str:
    """The arrows as the picture carries them within, so that a test sees whether it is stale."""
    return " ".join(f"{unit}>{needed}" for unit, needed in pairs)


def draw(target: Path) -> None:
    """Draw the table of imports: a row for each package, a column for each that it imports."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    there = {unit for unit, _ in files()}
    names = [name for name in ORDER if name in there]
    place = {name: i for i, name in enumerate(names)}
    table = [[0.0] * len(names) for _ in names]
    for unit, needed in arrows():
        table[place[unit]][place[needed]] = 0.6
    for i in range(len(names)):
        table[i][i] = 0.25
    figure = Figure(figsize=(9.0, 7.4))
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    axes.pcolormesh(table, cmap="Blues", vmin=0.0, vmax=1.0, edgecolors="0.92", linewidth=0.5)
    axes.invert_yaxis()
    middle = [i + 0.5 for i in range(len(names))]
    axes.set_xticks(middle, names, rotation=90)
    axes.set_yticks(middle, [f"{ORDER[name]}   {name}" for name in names])
    axes.xaxis.tick_top()
    axes.tick_params(length=0, labelsize=8)
    axes.set_aspect("equal")
    axes.set_title("The package on the left imports the package above", fontsize=9)
    for side in axes.spines.values():
        side.set_visible(False)
    told = {"Software": None, "Description": written(arrows())}
    figure.savefig(target, dpi=100, bbox_inches="tight", metadata=told)


if __name__ == "__main__":
    draw(ROOT / "docs" / "figures" / "packages.png")
