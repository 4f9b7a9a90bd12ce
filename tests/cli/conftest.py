"""A case file, and an engine that records its calls."""

from __future__ import annotations

import sys
import types
from pathlib import Path

import pytest
from small_case import write_small

SOUND = (Path(__file__).parents[2] / "cases" / "billet125" / "base.toml").read_text()


@pytest.fixture
def case_file(tmp_path):
    path = tmp_path / "mine" / "billet.toml"
    path.parent.mkdir()
    path.write_text(SOUND)
    return path


@pytest.fixture
def refused(castfem, tmp_path):
    """Return a function that checks a refused command, and returns its message."""

    def _refused(*words) -> str:
        write_small(tmp_path)
        (tmp_path / "lone").mkdir()
        (tmp_path / "lone" / "run.json").write_text("{}")
        before = sorted(tmp_path.rglob("*"))
        outcome = castfem(*words)
        assert outcome.status == 1
        assert sorted(tmp_path.rglob("*")) == before
        return outcome.err

    return _refused


@pytest.fixture
def engine(monkeypatch):
    """Replace run and show; `engine.calls` has the calls, `engine.raises` an error to raise."""
    stand_in = types.SimpleNamespace(calls=[], raises=None)

    def run(case, folder, *, comm=None, resume=False, profile=False, progress=None):
        stand_in.calls.append(
            types.SimpleNamespace(
                case=case,
                folder=folder,
                comm=comm,
                resume=resume,
                profile=profile,
                progress=progress,
            )
        )
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "case.toml").write_text(case.resolved_toml())
        if stand_in.raises is not None:
            raise stand_in.raises

    def show(folder, console, *, figures=True):
        console.print(f"table of {folder}, figures {figures}")

    def draw(folder):
        assert folder.is_dir()

    for name, functions in (("runs.loop", (run,)), ("post.report.show", (show, draw))):
        module = types.ModuleType(f"castfem.{name}")
        for function in functions:
            setattr(module, function.__name__, function)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return stand_in
