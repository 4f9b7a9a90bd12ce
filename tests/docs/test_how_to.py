"""Examples of the how-tos and "Getting started" are run: files written, commands executed.

By default on coarse cells and short strands (`QUICK`); output is then compared only if a page needs
no such change. `MANUAL=as_written` runs everything unchanged and compares all output.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import pytest
from PIL import Image

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.cli import execute
from castfem.model import Case, load_case
from castfem.model.shipped_cases import find
from castfem.studies.optimisation import Evaluation

pytestmark = pytest.mark.slow


DOCS = Path(__file__).parents[2] / "docs"
PAGES = [
    "getting_started.md",
    "my_steel.md",
    *sorted(f"how_to/{p.name}" for p in DOCS.glob("how_to/*.md")),
]
BLOCK = re.compile(r"((?:^(?!```)[^\n]+\n)*)\n```(\w*)\n(.*?)^```$", re.M | re.S)
AS_WRITTEN = os.environ.get("MANUAL") == "as_written"
# By page and a word of the command: keys that make its runs short. Their output is not compared.
COARSE = {
    "mesh.surface_size": "4 mm",
    "mesh.surface_depth": "8 mm",
    "mesh.face_size": "10 mm",
    "mesh.core_size": "12 mm",
    "thermal.time.adaptive.tolerance": "50 K",
    "thermal.time.adaptive.largest": "10 s",
    "output.every": "1 h",
}
SHORT = {"casting.length": "24 mm", "output.every": "1 h"}
COUPLED = SHORT | {
    "mesh.surface_size": "4 mm",
    "mesh.corner_size": "4 mm",
    "mesh.face_size": "12 mm",
    "mesh.core_size": "15 mm",
    "coupling.interval": "0.2 s",
}
QUICK = {
    ("getting_started.md", "billet125/taper_1"): SHORT,
    ("how_to/asymmetric_cooling.md", "run"): COARSE,
    ("how_to/calibrate.md", "calibrate"): COARSE,
    ("how_to/cluster.md", "sweep"): COARSE | SHORT,
    ("how_to/locked_roll.md", "run"): SHORT | {"casting.start.at": "meniscus"},
    ("how_to/my_billet.md", "run"): COARSE | {"casting.length": "5 m"},
    ("how_to/report.md", "run"): COARSE | {"casting.length": "1 m"},
    ("how_to/slab.md", "run"): {
        "mesh.face_size": "100 mm",
        "mesh.surface_size": "10 mm",
        "thermal.time.adaptive.tolerance": "20 K",
    },
    ("how_to/spray_water.md", "sweep"): COARSE,
    ("how_to/taper.md", "sweep"): COUPLED,
    **{("my_steel.md", word): COUPLED for word in ("run", "sweep", "sensitivity")},
}
# Differences of runs, which change a little with versions of the libraries.
ROUGHLY = ("how_to/error.md",)
# Commands for the machine: an existing environment, a missing batch system.
NOT_HERE = ("make env", "export PATH=$PWD/.castfem/bin:$PATH")
# The case to which a piece of a case file belongs.
PIECES = {"how_to/locked_roll.md": "slab1200/reference"}


def blocks(page: str) -> Iterator[tuple[str, str, str]]:
    """Yield kind, file name, if any, and text of each block of a page."""
    for before, kind, text in BLOCK.findall((DOCS / page).read_text(encoding="utf-8")):
        named = re.findall(r"`(\w+\.(?:toml|csv))`", before if kind in ("toml", "text") else "")
        yield kind, named[-1] if named else "", text


def commands(text: str) -> Iterator[list[str]]:
    """Yield the words of each command; for a submitted script those of its sweep."""
    before: list[str] = []
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words == ["sbatch", "job.sh"]:
            assert before[-2:] == ["--slurm", "job.sh"]
            words = before[:-2]
        if words and line not in NOT_HERE:
            yield words
        before = words


def shortened(page: str, words: list[str]) -> tuple[list[str], bool]:
    """Return a command with short values of keys if it runs a case, and whether they change."""
    if not AS_WRITTEN and words[1] == "compare":
        return [*words, "--no-figures"], False
    if AS_WRITTEN or words[1] not in ("run", "sweep", "error", "calibrate", "sensitivity"):
        return words, False
    changes = {k: v for (where, word), keys in QUICK.items() if where == page and word in words
               for k, v in keys.items()}  # fmt: skip
    kept, rest = [], iter(words)
    for word in rest:
        pair = next(rest) if word == "--set" else ""
        if pair.split("=")[0] not in changes:
            kept += [word, pair] if pair else [word]
    every = {"output.figures": "false", **changes}
    more = [x for key, value in every.items() for x in ("--set", f"{key}={value}")]
    return [*kept, *more], bool(changes)


def inline(value: object) -> str:
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key} = {inline(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(inline, value)) + "]"
    return json.dumps(value)


def added(piece: dict[str, object], above: str = "") -> Iterator[str]:
    """Yield assignments for --set that put a piece of a case file into a case."""
    for key, value in piece.items():
        if isinstance(value, dict):
            yield from added(value, f"{above}{key}.")
        else:
            yield f"{above}{key}={inline(value)}"


def same(said: str, printed: str) -> bool:
    """Return whether two rows of a table of errors agree to a tenth of their stated error.

    Values far below it, a part of the error or an order of convergence, are only rounding: other
    libraries and processors have other digits.
    """
    ours, theirs = (re.split(" {2,}", row.strip()) for row in (said, printed))
    if len(ours) != len(theirs) or len(ours) < 4 or ours[::3][:2] != theirs[::3][:2]:
        return False
    numbers = [(float(one.split()[0]), float(other.split()[0]))
               for one, other in zip(ours, theirs, strict=True)
               if one[0].isdigit() and other[0].isdigit()]  # fmt: skip
    return all(abs(one - other) <= 0.1 * float(theirs[2]) for one, other in numbers)


def test_rows_of_errors_that_are_roughly_the_same() -> None:
    row = "shell, corner  15.05  0.28  mm  0.28 (1.4)  8e-05"
    assert same(row, "shell, corner   15.05  0.27  mm  0.27   2.1e-04 (1.4) ")
    others = [row.replace(*pair) for pair in (("15.05", "15.08"), ("0.28", "0.34"), ("mm", "m"))]
    for other in (*others, row.replace("corner", "face"), "shell, corner  15.05"):
        assert not same(row, other), other


def test_every_how_to_is_a_page() -> None:
    assert len(PAGES) == 14
    assert {page for page, _ in QUICK} <= set(PAGES)


@pytest.mark.usefixtures("runs_here")
@pytest.mark.parametrize("page", PAGES)
def test_examples_of_a_page_work(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Commands succeed, files are valid, and the lines of an output are printed."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")
    for name in ("OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID"):
        monkeypatch.delenv(name, raising=False)
    for kind, name, text in blocks("how_to/my_billet.md"):
        if kind == "toml":
            Path(name).write_text(text, encoding="utf-8")
    printed, status, other, code = "", 0, False, dict[str, object]()
    for kind, name, text in blocks(page):
        if kind in ("toml", "text") and name:
            Path(name).write_text(text, encoding="utf-8")
        elif kind == "toml":
            load_case(find(PIECES[page]), list(added(tomllib.loads(text))))
        elif kind == "sh":
            printed = ""
            for words in commands(text):
                assert words[0] == "castfem", words
                words, changed = shortened(page, words)
                other = other or changed
                status = execute(words[1:])
                result = capsys.readouterr()
                printed += result.out + result.err
                assert status == 0 or words[1] == "check", result.err
        elif kind == "python":
            exec(compile(text, page, "exec"), code)
        elif kind == "":
            assert (status == 1) == text.startswith("castfem:")
            if not other:
                found = {" ".join(line.split()) for line in printed.splitlines()}
                missing = [x for x in text.splitlines() if " ".join(x.split()) not in found]
                rows = printed.splitlines() if page in ROUGHLY else []
                missing = [x for x in missing if not any(same(x, row) for row in rows)]
                assert not missing, printed
            status = 0
        else:
            assert kind == "{toctree}", kind
    assert status == 0


def test_each_picture_belongs_to_its_present_page(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is made from the same files and commands by `docs/how_to_pictures.py PAGE`."""
    monkeypatch.syspath_prepend(DOCS)
    pictures = import_module("how_to_pictures")
    stale = []
    for page in pictures.PICTURES:
        target = pictures.picture(page)
        text = (DOCS / "how_to" / f"{page}.md").read_text(encoding="utf-8")
        assert f"](../figures/{target.name})" in text, page
        with Image.open(target) as made:
            assert made.width == pictures.WIDTH
            stale += [page] if made.info["made from"] != pictures.fingerprint(page) else []
    assert not stale, f"python docs/how_to_pictures.py {' '.join(stale)}"
    assert len({pictures.fingerprint(page) for page in pictures.PICTURES}) == 11


# The code of docs/scripting.md runs, block by block, on coarse cells and short strands.


PAGE = Path(__file__).parents[2] / "docs" / "scripting.md"
CODE = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
SIZES = {
    "mesh.surface_size": "4 mm",
    "mesh.corner_size": "4 mm",
    "mesh.surface_depth": "0 mm",
    "mesh.face_size": "12 mm",
    "mesh.core_size": "15 mm",
    "output.figures": False,
}
SHORT_CASE = {"casting.length": "8 mm", "coupling.interval": "0.1 s"}
TUBE = {
    "casting.length": "60 mm",
    "mould.length": "60 mm",
    "mould.tube.cell_size": "40 mm",
    "mould.tube.cells_across": 1,
}
# Without the mechanics of "idealised", which the blocks with it do not need.
QUICK_CASE: dict[str, tuple[str, dict[str, Any]]] = {
    "billet125/idealised": ("billet125/thermal", {"thermal.time.step": "1 s"}),
    "billet125/thermal": ("billet125/thermal", {"casting.length": "8 mm"}),
    "billet125/taper_1": ("billet125/taper_1", SHORT_CASE),
    "billet125/coupled": ("billet125/coupled", SHORT_CASE),
    "billet125/hot": ("billet125/hot", {**SHORT_CASE, **TUBE}),
    "billet125/optimum_single": ("billet125/optimum_single", SHORT_CASE),
}


class Jobs(ThreadPoolExecutor):
    """Replaces the executors of other packages."""

    def __init__(self, folder: str = "", max_workers: int = 1) -> None:
        super().__init__(max_workers)

    def update_parameters(self, **parameters: object) -> None: ...


EXECUTORS = {"SingleNodeExecutor": Jobs, "AutoExecutor": Jobs}


def known(changes: dict[str, str], fidelity: str) -> Evaluation:
    """Replace the evaluator of an earlier block where an optimiser makes many calls."""
    taper = float(changes["mould.taper"].removesuffix(" %/m"))
    found = {"von_mises_max": 1e7 * (1.0 + taper**2), "heat_removed": 9.1e6 + 1e5 * (taper - 0.5)}
    return Evaluation({name: Quantity(value, "-", name) for name, value in found.items()})


def sparing(run: Any) -> Any:
    """Run the idealised mould, whose history a search reads, and kept runs; know the others."""
    ideal: list[float] = []

    def sometimes(case: Case, *folder: str) -> castfem.Result | dict[str, float]:
        if case.mould is not None and not folder:
            (segment,) = case.mould.taper.face.segments
            stress = 1e7 * (1.0 + 1e4 * segment.top**2)
            return {"von_mises_max": stress, "heat_removed": ideal[-1] * (0.985 + segment.top)}
        found = run(case, *folder)
        ideal.append(found.quantities["heat_removed"])
        return found

    return sometimes


def quick(load: Any) -> Any:
    """Load a case on coarse cells, and short."""

    def loaded(name: str) -> Case:
        other, changes = QUICK_CASE[name]
        return load(other).with_({**SIZES, **changes})

    return loaded


def test_blocks_run_one_after_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(castfem, "load", quick(castfem.load))
    for name in ("executorlib", "submitit"):  # may not be installed
        monkeypatch.setitem(sys.modules, name, SimpleNamespace(**EXECUTORS))
    castfem.run(castfem.load("billet125/taper_1"), "results/billet125/taper_1")
    run, names = castfem.run, dict[str, Any](__name__="page")
    for number, code in enumerate(CODE, start=1):
        monkeypatch.setattr(castfem, "run", sparing(run) if "study.tell(" in code else run)
        if "minimize(" in code:
            names["evaluate"] = known
        text = code.replace('at="300 mm"', 'at="8 mm"')
        exec(compile(text, f"docs/scripting.md, block {number}", "exec"), names)
        plt.close("all")
    # 99 % of the heat at 0.5 %/m, and more stress beyond.
    assert names["best"].values[0].value == pytest.approx(0.5, abs=0.01)
