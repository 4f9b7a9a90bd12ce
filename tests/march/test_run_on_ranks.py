"""A whole run with its mechanics gives the same history on one rank and on three."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import pytest

from castfem.output.history import read_history

WORDS = ["run", "billet125/idealised", "-q"]
for key in (
    "mechanics.law=norton_hoff_kozlowski", "coupling.interval=0.25 s", "casting.length=150 mm",
    "mesh.surface_size=2 mm", "mesh.corner_size=2 mm", "mesh.face_size=6 mm",
    "mesh.core_size=12 mm", "output.fields=[]", "output.figures=false",
):  # fmt: skip
    WORDS += ["--set", key]
# What is zero but for rounding, and rounds otherwise on other ranks.
LEFT_OVER = {"energy_error", "axial_force", "force_error"}


def history(folder: Path, ranks: int) -> pandas.DataFrame:
    """History of a run of its own, started as a user starts it."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith(("OMPI_COMM", "PMI", "PRTE_"))}
    clean |= {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
    command = ["mpirun", "--oversubscribe", "-n", str(ranks)] if ranks > 1 else []
    command += [sys.executable, "-m", "castfem.cli", *WORDS, "-o", str(folder)]
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=300, env=clean, check=False
    )
    assert done.returncode == 0, done.stderr
    return read_history(folder / "history.csv")


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="mpirun is not on the path")
def test_ranks_do_not_show(tmp_path: Path) -> None:
    from mpi4py import MPI

    if MPI.COMM_WORLD.size > 1:
        pytest.skip("starts ranks of its own")
    one = history(tmp_path / "1", 1)
    assert one["von_mises_max"].iloc[-1] > 1.0 and one["shell_corner"].iloc[-1] > 0.5
    three = history(tmp_path / "3", 3)
    assert list(three) == list(one) and len(three) == len(one)
    for name in set(one) - LEFT_OVER:
        ours, theirs = three[name].to_numpy(), one[name].to_numpy()
        size = np.nanmax(np.abs(theirs), initial=1e-300)
        assert np.nanmax(np.abs(ours - theirs), initial=0.0) <= 1e-8 * size, name
