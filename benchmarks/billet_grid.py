"""Corner of ordinary billets in their moulds: carbon, size, heat law and taper varied together.

Writes tables of docs/coupling.md: how far the default is from `--accuracy coarse` and from sizes
half as large, how often the error of `castfem error` covers the second difference, and whether a
run fails that succeeds on finer cells. Finished runs in results/billet_grid are not repeated.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.report import ROOT, Output, table
from benchmarks.stated_error import run_all
from castfem.model import Case, load_case
from castfem.runs.output.summary_file import Summary
from castfem.studies.accuracy.ladder import BASE, Level, levels, quiet
from castfem.studies.accuracy.sizes import AXES, MESH, changes, factors_of

PATH = ROOT / "cases" / "billet180" / "peritectic.toml"
FOLDER = ROOT / "results" / "billet_grid"
CARBONS = ("0.05", "0.10", "0.12", "0.17", "0.25", "0.42", "0.80")
SPEEDS = {"100": "3 m/min", "130": "2.4 m/min", "180": "1.6 m/min", "240": "1.1 m/min"}
"""Casting speed by size of the billet, mm."""
LAWS = {"flux": 'flux="savage_pritchard"', "coefficient": 'coefficient="1100 W/(m^2 K)"'}
TAPERS = ("0.4", "0.8", "1.2", "1.6", "2.0")
LENGTH, MOULD = "120 mm", "500 mm"
COARSE, DEFAULT, FINE = "coarse", "default", "fine"
STATED = "error"
"""Levels of the rows: three runs, and the stated errors of the default run."""
HALF = dict.fromkeys(AXES, 0.5)
"""Cells, steps and windows of the fine run divided by those of the default."""
RESULTS = {
    "shell_corner": ("shell, corner [mm]", ".2f"),
    "surface_temperature_corner": ("surface, corner [K]", ".0f"),
    "gap_corner": ("gap, corner [mm]", ".3f"),
    "von_mises_max": ("peak stress [MPa]", ".2f"),
    "shell_mid_face": ("shell, mid-face [mm]", ".2f"),
}
"""Heading of each result, and format of its differences."""
CORNER = tuple(RESULTS)[:4]


@dataclass(frozen=True, slots=True)
class Billet:
    """A billet of the grid: carbon in wt%, size in mm, key of `LAWS`, taper in %/m."""

    carbon: str
    size: str
    law: str
    taper: str

    def keys(self) -> tuple[str, ...]:
        """Return the assignments that change `billet180/peritectic` to this billet."""
        law = f'{{law="contact", {LAWS[self.law]}, wall="160 degC"'
        law += ', gap_conductivity="0.15 W/(m K)"}'
        return (
            f"steel.composition.C={self.carbon}",
            f"section.width={self.size} mm",
            f"section.height={self.size} mm",
            f"casting.speed={SPEEDS[self.size]}",
            f"casting.length={LENGTH}",
            f"cooling.mould.to={MOULD}",
            f"mould.length={MOULD}",
            f"cooling.mould.surface=[{law}]",
            f"mould.taper={self.taper} %/m",
            "output.figures=false",
        )


def grid() -> Iterator[Billet]:
    """Yield each carbon with two sizes; laws and tapers alternate."""
    for number, carbon in enumerate(CARBONS):
        for place, size in [*enumerate(SPEEDS)][number % 2 :: 2]:
            law = [*LAWS][(number + place // 2) % len(LAWS)]
            taper = TAPERS[(2 * number + place) % len(TAPERS)]
            yield Billet(carbon, size, law, taper)


def beside(case: Case, level: str) -> Level:
    """Return the run of a case with the cells, steps and windows of a level."""
    factors = HALF if level == FINE else factors_of(level)
    return Level(level, level, factors[MESH], case.with_(changes(case, factors) | quiet(case)))


def measure(billet: Billet, folder: Path) -> list[dict[str, Any]]:
    """Run a billet at each level and on the ladder of `castfem error`.

    Returns:
        Rows of the results at the end or the failure by level, and of their errors.
    """
    case = load_case(PATH, billet.keys())
    ladder = run_all(folder.name, [*levels(case), beside(case, COARSE), beside(case, FINE)], folder)
    rows = []
    for level, name in ((COARSE, COARSE), (DEFAULT, BASE), (FINE, FINE)):
        failure = ladder.record.entries[name].message.partition(";")[0]
        summary = None if failure else Summary.load(folder / name)
        values = {n: "" if summary is None else summary.quantities[n].shown for n in RESULTS}
        rows.append({**asdict(billet), "level": level, **values, "failure": failure})
    if rows[1]["failure"]:
        return rows
    numbers = ladder.table().quantities
    # A result that is equal in all runs (no shell) has no error.
    stated = {name: numbers[name].error() if name in numbers else 0.0 for name in RESULTS}
    return [*rows, {**asdict(billet), "level": STATED, **stated, "failure": ""}]


def main(output: Output, quick: bool) -> None:
    """Run all billets; write the results after each."""
    rows: list[dict[str, Any]] = []
    for billet in [*grid()][: 1 if quick else None]:
        folder = (output.folder if quick else FOLDER) / f"C{billet.carbon}_{billet.size}"
        rows += measure(billet, folder)
        output.csv("billet_grid", rows)
    show(output)


def errors(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return each result of a billet with its error and its differences from other levels."""
    billets: dict[str, dict[str, Mapping[str, Any]]] = {}
    for row in rows:
        if not row["failure"]:
            name = f"{row['carbon']} % C, {row['size']} mm"
            billets.setdefault(name, {})[row["level"]] = row
    found = []
    for billet, runs in billets.items():
        for name in RESULTS if {DEFAULT, STATED} <= runs.keys() else ():
            at = {level: float(run[name]) for level, run in runs.items()}
            default, stated = at[DEFAULT], at.pop(STATED)
            off = {level: abs(value - default) for level, value in at.items()}
            found.append(
                {"billet": billet, "result": name, "value": default, "stated": stated, **off}
            )
    return found


def within(row: Mapping[str, Any]) -> bool:
    """Whether the stated error of a result covers its difference from the finer run."""
    return bool(row["stated"] >= row[FINE])


def held(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return how many of the results with a finer run are within their stated error."""
    compared = [row for row in rows if FINE in row]
    return f"{sum(map(within, compared))} of {len(compared)}"


def show(output: Output) -> None:
    """Write the tables from the data."""
    rows = errors(output.rows("billet_grid"))
    lines = []
    for name, (heading, form) in RESULTS.items():
        some = [row for row in rows if row["result"] == name]
        line: dict[str, Any] = {"result": heading}
        for level in (COARSE, FINE):
            off = sorted(row[level] for row in some if level in row)
            chosen = (median(off), off[int(0.9 * (len(off) - 1))], off[-1])
            line[level] = " / ".join(format(number, form) for number in chosen)
        lines.append(line | {"within": held(some)})
    corner = held([row for row in rows if row["result"] in CORNER])
    lines.append({"result": "all of the corner", "within": corner})
    head = {
        "result": "result", COARSE: "coarse off default", FINE: "twice as fine off default",
        "within": "within the error",
    }  # fmt: skip
    output.insert("billet grid", table(lines, head, {}))
    missed = [
        {"what": f"{row['billet']}: {RESULTS[row['result']][0]}",
         **{key: format(row[key], ".3g") for key in ("value", "stated", FINE)}}
        for row in rows if FINE in row and not within(row)
    ]  # fmt: skip
    head = {"what": "result", "value": "default", "stated": "error", FINE: "twice as fine, off by"}
    output.insert("billet grid missed", table(missed, head, {}))
