"""A law's machine code is loaded without numba, renewed with its sources, and checked."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from ctypes import c_double, c_int64, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from castfem import cli
from castfem.base import libraries, shared_code
from castfem.physics.constitutive import kernel
from castfem.physics.constitutive.kernel.calling import SOURCES, integrate_points
from castfem.physics.machine.bulging import layer_steps
from castfem.physics.machine.bulging.layers import _OWN_SOURCE

ARGUMENTS = c_int64, c_double, c_void_p
TEXT = """
from numba import carray, cfunc, types

@cfunc(types.void(types.int64, types.float64, types.CPointer(types.float64)))
def scale(n, factor, values):
    values = carray(values, (n,))
    for i in range(n):
        values[i] *= FACTOR * factor
"""


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Return the factors of the compiled functions; sources and cache are separate."""
    (tmp_path / "sources").mkdir()
    monkeypatch.setattr(shared_code, "cache_folder", lambda: tmp_path / "cache")
    return []


def answer(tmp_path: Path, made: list[float], factor: float = 2.0) -> list[float]:
    """Return 10 times the function of 1 and 3 that is compiled from a file with a factor."""
    (tmp_path / "sources" / "scale.py").write_text(f"FACTOR = {factor}\n{TEXT}")

    def make() -> Any:
        made.append(factor)
        names: dict[str, Any] = {}
        exec((tmp_path / "sources" / "scale.py").read_text(), names)
        return names["scale"]

    values = np.array([1.0, 3.0])
    sources = [tmp_path / "sources" / "scale.py"]
    function = shared_code.loaded("scaled", sources, make, ARGUMENTS)
    function(2, 10.0, *shared_code.addresses(values))
    return list(values)


def library(tmp_path: Path) -> Path:
    (path,) = tmp_path.rglob("*.so")
    return path


def test_code_is_compiled_once_and_after_a_change(tmp_path: Path, made: list[float]) -> None:
    for _ in range(2):
        assert answer(tmp_path, made) == [20.0, 60.0]
    assert made == [2.0]
    for _ in range(2):
        assert answer(tmp_path, made, 5.0) == [50.0, 150.0]
    assert made == [2.0, 5.0]
    assert [path.suffix for path in tmp_path.rglob("cache/**/*.*")] == [".so"] * 2


def test_code_is_compiled_again_for_another_processor(
    tmp_path: Path, made: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    for processor in ("one", "other", "one"):
        monkeypatch.setattr(shared_code, "_processor", lambda processor=processor: processor)
        assert answer(tmp_path, made) == [20.0, 60.0]
    assert len(made) == 2


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.99])
def test_truncated_library_is_not_loaded(tmp_path: Path, made: list[float], kept: float) -> None:
    """The system would kill a process that calls code beyond the end of the file."""
    answer(tmp_path, made)
    content = library(tmp_path).read_bytes()
    library(tmp_path).unlink()  # in use
    path = tmp_path / "cut"
    path.write_bytes(content[: int(kept * len(content))])
    (name,) = (tmp_path / "cache" / "kernels").iterdir()
    path.rename(name / "scaled.so")
    assert answer(tmp_path, made) == [20.0, 60.0]
    assert answer(tmp_path, made) == [20.0, 60.0]
    assert len(made) == 2


def test_each_process_compiles_without_folder_or_compiler(
    tmp_path: Path, made: list[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cache").write_text("no folder")
    for _ in range(2):
        assert answer(tmp_path, made) == [20.0, 60.0]
    monkeypatch.setenv("CC", str(tmp_path / "no-compiler"))
    (tmp_path / "cache").unlink()
    assert answer(tmp_path, made) == [20.0, 60.0]
    monkeypatch.setenv("CC", "false")
    assert answer(tmp_path, made) == [20.0, 60.0]
    assert len(made) == 4
    assert not list(tmp_path.rglob("*.so"))


def test_unusable_folder_is_left_unchanged(tmp_path: Path, made: list[float]) -> None:
    """A folder is in place of the library; temporary files are removed again."""
    answer(tmp_path, made)
    path = library(tmp_path)
    path.unlink()
    path.mkdir()
    for _ in range(2):
        assert answer(tmp_path, made) == [20.0, 60.0]
    assert len(made) == 3
    assert list(path.parent.iterdir()) == [path]


def test_missing_numba_is_reported_with_the_fix(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    hook = libraries._Watch()
    assert hook.find_spec("numba") is None  # others find it
    monkeypatch.setattr(sys, "meta_path", [hook])
    with pytest.raises(ModuleNotFoundError, match="no numba: `pip install numba`") as found:
        hook.find_spec("numba")
    assert cli.report(found.value) == 2
    assert capsys.readouterr().err == f"castfem: {found.value}\n"


def test_compiled_code_depends_only_on_its_sources() -> None:
    """Changes of other modules would not be noticed."""
    known = {f"castfem.base.{one}" for one in ("compiled", "shared_code", "types")}
    known |= {kernel.__name__, *(f"{kernel.__name__}.{path.stem}" for path in SOURCES)}
    steps = Path(str(layer_steps.__file__))
    assert steps == _OWN_SOURCE
    for path in (*SOURCES, steps):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("castfem"):
                assert node.module in known, path.name


ALONE = """
import sys
import numpy as np
from castfem.physics.constitutive.kernel.calling import integrate_points
n = np.ones
out = n((2, 4)), n((2, 4, 4)), n((2, 0)), n(2), n(2, bool)
integrate_points(0, False, n((2, 8)), n((2, 4)), 0.0 * n(2), n((2, 4)), n((2, 0)), 1.0, *out)
assert out[0][0, 0] != 1.0
print({"numba", "llvmlite"} & sys.modules.keys())
"""


def test_process_with_compiled_code_needs_no_numba() -> None:
    for _ in range(2):  # the first may compile
        done = subprocess.run(
            [sys.executable, "-c", ALONE], capture_output=True, text=True, env=os.environ
        )
    assert (done.stdout, done.stderr) == ("set()\n", "")


def test_inconsistent_arrays_are_refused() -> None:
    """Compiled code would read and write beyond their ends."""

    def out(points: int) -> list[Any]:
        shapes = (points, 4), (points, 4, 4), (points, 1), (points,)
        return [*map(np.zeros, shapes), np.zeros(points, dtype=bool)]

    z = np.zeros
    given = z((3, 9)), z((3, 4)), z(3), z((3, 4)), z((3, 1)), 1.0
    integrate_points(0, False, *given, *out(3))
    with pytest.raises(ValueError, match="belong together"):
        integrate_points(0, False, *given, *out(2))
    turned = out(3)
    turned[0] = np.zeros((4, 3)).T
    with pytest.raises(ValueError, match="in one piece"):
        integrate_points(0, False, *given, *turned)
    for i, kind in ((0, np.float32), (1, ">f8"), (3, complex), (4, float)):
        other = out(3)
        other[i] = other[i].astype(kind)
        with pytest.raises(ValueError, match=f"is of {np.dtype(kind)}, not (float|bool)"):
            integrate_points(0, False, *given, *other)
    with pytest.raises(ValueError, match="needs 8 coefficients a point, not 7"):
        integrate_points(0, False, z((3, 7)), *given[1:], *out(3))
    closed = out(3)
    closed[3].flags.writeable = False
    with pytest.raises(ValueError, match="closed"):
        integrate_points(0, False, *given, *closed)
