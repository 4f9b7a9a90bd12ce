"""h5py and MPI are loaded before DOLFINx, whatever comes first; without it, how to get it."""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LATER = ("dolfinx", "petsc4py")
# A new process for each, forked from one that has loaded what is without effect on the order.
FORKED = """
import json, os, sys
import castfem, castfem.model, numba, scipy.optimize, scipy.sparse.linalg, ufl
from importlib import import_module
assert not {"h5py", "mpi4py", "dolfinx", "petsc4py"} & sys.modules.keys()
for name in sys.argv[1:]:
    if os.fork() == 0:
        import_module(name)
        print(json.dumps([name, list(sys.modules)]), flush=True)
        os._exit(0)
    os.wait()
"""


def first_modules() -> list[str]:
    """Of each package that loads DOLFINx or petsc4py at once, a module that does so itself."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / "castfem").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in LATER:
                module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
                found.setdefault(path.parent.name, module)
    return list(found.values())


def test_each_package_may_be_the_first() -> None:
    modules = ["castfem.fem.snes", *first_modules()]
    done = subprocess.run(
        [sys.executable, "-c", FORKED, *modules], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    loaded = dict(json.loads(line) for line in done.stdout.splitlines())
    assert set(loaded) == set(modules), done.stderr
    seen = 0
    for name, order in loaded.items():
        late = [order.index(one) for one in LATER if one in order]
        seen += bool(late)
        for earlier in ("h5py", "mpi4py.MPI") if late else ():
            assert order.index(earlier) < min(late), name
    assert seen > 5


def test_a_script_may_load_dolfinx_itself(tmp_path: Path) -> None:
    """Where its HDF5 then stands in the way of h5py, one line says what to do."""
    (tmp_path / "dolfinx.py").touch()
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}

    def said(h5py: str, script: str) -> str:
        (tmp_path / "h5py.py").write_text(h5py, encoding="utf-8")
        done = subprocess.run(
            [sys.executable, "-c", script], env=environment, capture_output=True, text=True
        )
        return done.stdout + done.stderr

    behind = said("raise ValueError('Not a datatype')", "import dolfinx, castfem")
    assert behind.splitlines()[-1].endswith("has loaded: import castfem before dolfinx")
    assert said("print('h5py')", "import dolfinx; print('dolfinx'); import castfem") == (
        "dolfinx\nh5py\n"
    )
    assert said("print('h5py')", "import castfem, dolfinx; print('dolfinx')") == "h5py\ndolfinx\n"


PIPE = """
import os
from petsc4py import PETSc
r, w = os.pipe()
os.close(r)
try:
    os.write(w, b"x")
except BrokenPipeError:
    print("raised", flush=True)
PETSc.Sys.getVersion()
"""


# That of PyPI finds its MPI through mpi4py alone.
@pytest.mark.parametrize("order", ["castfem, dolfinx", "mpi4py.MPI, dolfinx, castfem"])
def test_a_closed_pipe_raises_also_after_petsc_was_loaded(order: str) -> None:
    """PETSc's own handler of signals would abort the script instead."""
    done = subprocess.run(
        [sys.executable, "-c", f"import {order}{PIPE}"], capture_output=True, text=True
    )
    assert (done.stdout, done.returncode) == ("raised\n", 0), done.stderr


HIDDEN = """
import sys
import castfem

class Without:
    def __init__(self, finder):
        self.finder = finder

    def find_spec(self, name, *rest):
        hidden = ("dolfinx", "mpi4py", "petsc4py", "ufl", "basix")
        return None if name in hidden else self.finder.find_spec(name, *rest)

sys.meta_path[1:] = [Without(finder) for finder in sys.meta_path[1:]]
"""


@pytest.mark.parametrize(
    "use",
    [
        "castfem.run('billet125/thermal')",
        "from castfem.cli import main; main(['mould', 'billet125/hot', '--hot'])",
    ],
)
def test_without_dolfinx_one_line_says_how_to_get_it(use: str, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", HIDDEN + use], cwd=tmp_path, capture_output=True, text=True
    )
    last = done.stderr.splitlines()[-1]
    for way in ('pip install "castfem[solver]"', "apt install", "conda install"):
        assert way in last
    if "cli" in use:
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
