"""What start-up, memory and files of single commands cost beside an earlier version.

Both versions do each command by turns, in one go, on one machine; time is that of the processor,
which other programs leave alone, and the least of the turns counts. Forms and meshes come from the
cache: a first turn fills it. Files are those of the run's folder, hidden ones too.

    git worktree add ../before fd4462d; make -C ../before env
    CASTFEM_BEFORE=../before python -m benchmarks plain_run
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from benchmarks.report import ROOT, Output, table

BEFORE = "CASTFEM_BEFORE"
_TINY = ("casting.length=12 mm", "mesh.surface_size=2 mm", "mesh.core_size=12 mm")
_RUN = tuple(word for one in _TINY for word in ("--set", one))
COMMANDS: dict[str, tuple[str, ...]] = {
    "`castfem --help`": ("--help",),
    "`castfem check billet125/thermal`": ("check", "billet125/thermal"),
    "`castfem check billet125/taper_1`": ("check", "billet125/taper_1"),
    "run, temperature": ("run", "billet125/thermal", "-q", *_RUN, "--set", "output.figures=false"),
    "run, temperature, figures": ("run", "billet125/thermal", "-q", *_RUN),
    "run, coupled, figures": (
        *("run", "billet125/taper_1", "-q", *_RUN),
        *("--set", "mesh.corner_size=3 mm", "--set", "mesh.face_size=12 mm"),
    ),
}


def measure(checkout: Path, words: tuple[str, ...]) -> dict[str, float]:
    """One command in a process of its own: processor time, peak of memory, files and bytes."""
    python = str(checkout / ".castfem" / "venv" / "bin" / "python")
    if checkout == ROOT:
        python = sys.executable
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home, "run")
        more = ("-o", str(folder)) if words[0] in ("run", "sensitivity") else ()
        running = subprocess.Popen(
            [python, "-m", "castfem.cli", *words, *more], cwd=checkout, stdout=subprocess.DEVNULL
        )
        _, status, used = os.wait4(running.pid, 0)
        running.returncode = os.waitstatus_to_exitcode(status)
        if running.returncode:
            raise RuntimeError(f"{checkout}: castfem {' '.join(words)} has failed")
        files = [path for path in folder.rglob("*") if path.is_file()]
        size = sum(path.stat().st_size for path in files)
    return {
        "processor [s]": used.ru_utime + used.ru_stime, "memory [MB]": used.ru_maxrss * 1.024e-3,
        "files": len(files), "size [kB]": 1e-3 * size,
    }  # fmt: skip


def measured(before: Path, turns: int) -> list[dict[str, Any]]:
    """A row a command, a turn and a version; the first turn, which fills the caches, is left."""
    rows = []
    for name, words in COMMANDS.items():
        for turn in range(turns + 1):
            for version, checkout in (("before", before), ("now", ROOT)):
                found = measure(checkout, words)
                if turn:
                    rows.append({"command": name, "version": version, "turn": turn, **found})
    return rows


def show(output: Output) -> None:
    """Make the table anew."""
    rows = output.rows("plain_run")
    if not rows:
        return
    lines = []
    for name in dict.fromkeys(row["command"] for row in rows):
        line: dict[str, Any] = {"command": name}
        for version in ("before", "now"):
            mine = [r for r in rows if r["command"] == name and r["version"] == version]
            for what in ("processor [s]", "memory [MB]", "files", "size [kB]"):
                least = min(row[what] for row in mine)
                line[f"{what} {version}"] = least if least or what[0] in "pm" else None
        lines.append(line)
    headings = {"command": "command"}
    formats = {}
    for what, digits in {
        "processor [s]": ".2f", "memory [MB]": ".0f", "files": ".0f", "size [kB]": ".0f"
    }.items():  # fmt: skip
        for version in ("before", "now"):
            headings[f"{what} {version}"] = f"{what}, {version}"
            formats[f"{what} {version}"] = digits
    output.insert("plain_run", table(lines, headings, formats))


def main(output: Output, quick: bool) -> None:
    """Measure, if there is an earlier version; write data and table."""
    given = os.environ.get(BEFORE)
    if given:
        output.csv("plain_run", measured(Path(given).resolve(), 1 if quick else 4))
    show(output)
