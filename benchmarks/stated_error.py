"""Errors stated by `castfem error` compared with differences from much finer runs.

Writes tables of docs/accuracy.md. Finished runs in results/stated_error are not repeated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.report import PAGE, ROOT, Columns, Output, table
from castfem.model import Case, load_case
from castfem.post.compare.study_tables import main_names, quantity_of
from castfem.runs.output.summary_file import Summary
from castfem.runs.results.headline import plain_label
from castfem.studies.accuracy.ladder import Ladder, Level, levels, prepare
from castfem.studies.accuracy.sizes import AXES, axes_of, changes
from castfem.studies.accuracy.table import ErrorTable
from castfem.studies.sweep.work import Job, Outcome
from castfem.studies.sweep.workers import Workers

COARSE = ("mesh.surface_size=1.6 mm", "mesh.corner_size=1.6 mm", "mesh.face_size=12 mm",
          "mesh.core_size=16 mm", "coupling.interval=0.2 s")  # fmt: skip
"""Cells and windows twice as large as shipped, on which results are far from converged."""
FOLDER = ROOT / "results" / "stated_error"
FINER = 0.4  # factor on cells, steps and windows
QUIET = ("output.fields=[]", "output.figures=false")
DIGITS = {"degC": 0.1, "K": 0.1, "mm": 0.01}
"""Last digit printed, by unit; for other units the fourth significant digit."""
MOST = 10.0  # largest acceptable ratio of the stated error to the error found


@dataclass(frozen=True)
class Scene:
    """A case whose stated errors are tested."""

    path: Path  #: path of the case
    changes: tuple[str, ...] = ()  #: changed keys
    mould: str = ""  #: mould whose finer run `billet_error` has done; "" to do that run here


BLANK = ROOT / "benchmarks" / "beam_blank.toml"
BILLET, SLAB = ROOT / "cases" / "billet125", ROOT / "cases" / "slab1200"
SCENES: Mapping[str, Scene] = {
    "billet, thermal": Scene(BILLET / "thermal.toml"),
    "billet, +1 %/m": Scene(BILLET / "taper_1.toml", (), "taper_1"),
    "billet, 0 %/m": Scene(BILLET / "taper_0.toml", (), "taper_0"),
    "billet, +1 %/m, coarse": Scene(BILLET / "taper_1.toml", COARSE),
    "billet, 0 %/m, coarse": Scene(BILLET / "taper_0.toml", COARSE),
    "beam blank, coarse, to 40 mm": Scene(BLANK),
    "slab, thermal, coarse, to 4.2 m": Scene(
        SLAB / "thermal.toml",
        (
            "casting.length=4.2 m",
            "mesh.surface_size=4 mm",
            "mesh.corner_size=4 mm",
            "mesh.face_size=60 mm",
            "mesh.core_size=24 mm",
        ),
    ),
}
SHORT = Scene(
    BILLET / "thermal.toml",
    ("casting.length=40 mm", "mesh.surface_size=3 mm", "mesh.corner_size=3 mm",
     "mesh.face_size=15 mm", "mesh.core_size=20 mm"),
)  # fmt: skip
"""Case of `--quick`."""


def finer(case: Case) -> Level:
    """Return the run with all sizes much finer than on the ladder of a case."""
    small = dict.fromkeys(axes_of(case), FINER)
    return Level("finer", "finer", FINER, case.with_(changes(case, small)))


def measure(name: str, scene: Scene, folder: Path) -> list[dict[str, Any]]:
    """Do ladder and finer run of a scene; return a row for each headline number."""
    case = load_case(scene.path, (*scene.changes, *QUIET))
    rungs = levels(case)
    found = run_all(name, rungs if scene.mould else (*rungs, finer(case)), folder).table()
    truth = _from_billet_error(scene.mould) if scene.mould else _values(folder / "finer")
    names = [number for number in main_names(found.quantities) if number in truth]
    return [_row(name, found, truth, number) for number in names]


def run_all(name: str, rungs: Sequence[Level], folder: Path) -> Ladder:
    """Do the runs that have not finished in their folder; return the ladder."""
    ladder = prepare(rungs, folder)

    def noted(job: Job, outcome: Outcome) -> None:
        ladder.record.note(job, outcome)
        print(f"  {name}, {job.name}: {outcome.seconds:.1f} s {outcome.message}", flush=True)

    if ladder.jobs:
        with Workers(folder / "noise.log", processes=1) as workers:
            workers.run(ladder.jobs, ended=noted)
    return ladder


def _values(folder: Path) -> dict[str, float]:
    summary = Summary.load(folder)
    return {} if summary is None else {n: q.shown for n, q in summary.quantities.items()}


def _from_billet_error(mould: str) -> dict[str, float]:
    """Return the results of the finer run of `billet_error`: cells 0.35 mm, windows 0.05 s."""
    rows = Output(PAGE.parent).rows("billet_error")
    row = next(r for r in rows if (r["mould"], r["run"]) == (mould, "finer"))
    return {name: value for name, value in row.items() if isinstance(value, float)}


def _row(scene: str, found: ErrorTable, truth: Mapping[str, float], name: str) -> dict[str, Any]:
    """Return a number with its stated error and its error against the finer run."""
    entry = found.quantities[name]
    parts: dict[str, Any] = {}
    for axis in AXES:
        part = entry.parts.get(axis)
        parts |= {axis: part.error if part else None, f"{axis}_order": part.order if part else None}
    label = plain_label(quantity_of(entry))
    return {
        "scene": scene, "name": name, "what": label, "unit": entry.unit, "value": entry.value,
        "stated": entry.error(), "found": abs(truth[name] - entry.value), **parts,
    }  # fmt: skip


def main(output: Output, quick: bool) -> None:
    """Run every scene; write the results after each."""
    rows: list[dict[str, Any]] = []
    scenes = {"billet, short": SHORT} if quick else SCENES
    for name, scene in scenes.items():
        folder = (output.folder if quick else FOLDER.parent) / "stated_error" / _safe(name)
        rows += measure(name, scene, folder)
        output.csv("stated_error", rows)
    _count(output)
    show(output)


def _safe(name: str) -> str:
    return "".join(c if c.isalnum() else "_" for c in name).strip("_")


def show(output: Output) -> None:
    """Write how often the stated error holds by scene, and the numbers for which it does not."""
    head: Columns = {
        "case": "case", "numbers": "numbers", "within": "within what is stated",
        "large": "stated more than 10 times too large", "seen": "of these, in the digits printed",
        "ratio": ("stated over found, median", ".1f"),
    }  # fmt: skip
    output.table("stated error", output.rows("stated_error_cases"), head)
    wrong = [
        {"what": f"{r['scene']}: {r['what']} [{r['unit']}]",
         **{key: f"{r[key]:.4g}" for key in ("value", "stated", "found")}}
        for r in _compared_rows(output) if r["stated"] < r["found"]
    ]  # fmt: skip
    words = {"what": "number", "value": "castfem", "stated": "stated", "found": "found"}
    output.insert("stated error missed", table(wrong, words, {}))  # there may be none


def _compared_rows(output: Output) -> list[dict[str, Any]]:
    """Return the numbers with a stated error and an error found that are not zero."""
    return [r for r in output.rows("stated_error") if r["stated"] and r["found"]]


def _count(output: Output) -> None:
    """Write how often the stated error holds, for each case and for all together."""
    rows = _compared_rows(output)
    scenes = dict.fromkeys(r["scene"] for r in rows)
    lines = [_line(scene, [r for r in rows if r["scene"] == scene]) for scene in scenes]
    output.csv("stated_error_cases", [*lines, _line("together", rows)])


def _line(scene: str, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    ratios = [r["stated"] / r["found"] for r in rows]
    large = [r for r, ratio in zip(rows, ratios, strict=True) if ratio > MOST]
    return {
        "case": scene, "numbers": len(rows), "within": sum(x >= 1.0 for x in ratios),
        "large": len(large), "seen": sum(r["stated"] > _printed(r) for r in large),
        "ratio": median(ratios),
    }  # fmt: skip


def _printed(row: Mapping[str, Any]) -> float:
    """Return half of the last digit that `castfem show` prints of a number."""
    return 0.5 * DIGITS.get(row["unit"], 1e-3 * abs(row["value"]))
