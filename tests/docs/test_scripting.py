"""The code of docs/scripting.md runs, block after block, on coarse cells and short strands."""

from __future__ import annotations

import re
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import matplotlib.pyplot as plt
import pytest

import castfem
from castfem.base.shown_quantity import Quantity
from castfem.model import Case
from castfem.studies.optimisation import Evaluation

pytestmark = pytest.mark.slow

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
SHORT = {"casting.length": "8 mm", "coupling.interval": "0.1 s"}
TUBE = {
    "casting.length": "60 mm",
    "mould.length": "60 mm",
    "mould.tube.cell_size": "40 mm",
    "mould.tube.cells_across": 1,
}
# Without the mechanics of "idealised", which the blocks that name it do not ask for.
QUICK: dict[str, tuple[str, dict[str, Any]]] = {
    "billet125/idealised": ("billet125/thermal", {"thermal.time.step": "1 s"}),
    "billet125/thermal": ("billet125/thermal", {"casting.length": "8 mm"}),
    "billet125/taper_1": ("billet125/taper_1", SHORT),
    "billet125/coupled": ("billet125/coupled", SHORT),
    "billet125/hot": ("billet125/hot", {**SHORT, **TUBE}),
    "billet125/optimum_single": ("billet125/optimum_single", SHORT),
}


class Jobs(ThreadPoolExecutor):
    """Stands for the executors of other packages."""

    def __init__(self, folder: str = "", max_workers: int = 1) -> None:
        super().__init__(max_workers)

    def update_parameters(self, **parameters: object) -> None: ...


EXECUTORS = {"SingleNodeExecutor": Jobs, "AutoExecutor": Jobs}


def known(changes: dict[str, str], fidelity: str) -> Evaluation:
    """Stands for the evaluator, which a block before has used, where an optimiser asks often."""
    taper = float(changes["mould.taper"].removesuffix(" %/m"))
    found = {"von_mises_max": 1e7 * (1.0 + taper**2), "heat_removed": 9.1e6 + 1e5 * (taper - 0.5)}
    return Evaluation({name: Quantity(value, "-", name) for name, value in found.items()})


def sparing(run: Any) -> Any:
    """Runs the idealised mould, whose history a search reads, and what is kept; knows the rest."""
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
    """Loads a case on coarse cells, and short."""

    def loaded(name: str) -> Case:
        other, changes = QUICK[name]
        return load(other).with_({**SIZES, **changes})

    return loaded


def test_the_blocks_run_one_after_another(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(castfem, "load", quick(castfem.load))
    for name in ("executorlib", "submitit"):  # which need not be installed
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
