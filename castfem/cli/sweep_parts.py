"""A sweep in parts, for processes that know nothing of each other, and a script for SLURM."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from castfem.base.atomic_files import write_text
from castfem.base.errors import InputError

MOST = 20  # parts, where the user has not said how many
Row = TypeVar("Row")


@dataclass(frozen=True, slots=True)
class Share:
    """Every n-th row, from the i-th on: rows beside each other often cost alike."""

    number: int  #: which share, from 1 on
    count: int  #: number of shares

    @classmethod
    def read(cls, text: str) -> Share:
        """Read `3/20`."""
        number, _, count = text.partition("/")
        try:
            share = cls(int(number), int(count))
        except ValueError:
            raise InputError(f"--part {text}: write it as 3/20, the third of 20 parts") from None
        if not 1 <= share.number <= share.count:
            raise InputError(f"--part {text}: the parts are 1/{share.count} to {count}/{count}")
        return share

    def of(self, rows: Sequence[Row]) -> Sequence[Row]:
        """Return the rows of this share; none where there are more shares than rows."""
        return rows[self.number - 1 :: self.count]


def write_script(
    path: Path, words: Sequence[str], folder: Path, rows: int, parts: int | None, ranks: int
) -> int:
    """Write an array script: a task a part, and behind it the command that makes the table.

    Args:
        path: The script.
        words: The command line of the sweep, without --part and what goes with it.
        folder: Of the sweep.
        rows: Number of its runs.
        parts: Number of tasks; None for one a run, but not more than 20.
        ranks: Of each run.

    Returns:
        The number of parts.
    """
    if path.exists():
        raise InputError(f"{path}: exists already; choose another name for the script")
    parts = min(rows, MOST) if parts is None else parts
    command = " ".join(["castfem", "sweep", *map(shlex.quote, words)])
    launch = f"mpirun -n {ranks} " if ranks > 1 else ""  # srun may know nothing of this MPI
    each = f" --ranks {ranks}" if ranks > 1 else " -j 1"
    lines = [
        "#!/bin/bash",
        f"# {rows} runs in {parts} tasks of one array. Set what your cluster asks for, then, from",
        "# the folder in which castfem wrote this:",
        f"#   sbatch {shlex.quote(str(path))}",
        "# A task that was killed goes on when it is submitted again. When all have ended:",
        f"#   {command} --collect",
        "#SBATCH --job-name=castfem",
        f"#SBATCH --array=1-{parts}",
        f"#SBATCH --ntasks={ranks}",
        "#SBATCH --cpus-per-task=1",
        "#SBATCH --mem-per-cpu=2G",
        "#SBATCH --time=04:00:00",
        f"#SBATCH --output={shlex.quote(str(folder / 'slurm-%a.log'))}",
        "#SBATCH --requeue",
        "set -eu",
        "export OMP_NUM_THREADS=1",
        f'{launch}{command} --part "$SLURM_ARRAY_TASK_ID/{parts}" --resume --quiet{each}',
        "",
    ]
    write_text(path, "\n".join(lines), durable=False)
    return parts
