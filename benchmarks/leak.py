"""Whether many runs in one process leave memory, communicators or open files behind.

    python -m benchmarks.leak [CASE] [RUNS] [KEY=VALUE ...]

prints the state after each fifth run and, at the end, the growth per run after ten of them.
"""

from __future__ import annotations

import gc
import sys
import time

from mpi4py import MPI

import psutil

import castfem

WARM_UP = 10
QUICK = {
    "casting.length": "60 mm",
    "mesh.surface_size": "2 mm",
    "mesh.corner_size": "2 mm",
    "mesh.face_size": "8 mm",
    "mesh.core_size": "12 mm",
}


def state() -> tuple[float, int, int]:
    """Resident memory [MB], handle of a new communicator (with Open MPI their number), files."""
    gc.collect()
    process = psutil.Process()
    own = MPI.COMM_WORLD.Dup()
    handle = own.py2f()
    own.Free()
    return process.memory_info().rss / 1e6, handle, process.num_fds()


def measure(name: str, runs: int, changes: dict[str, str]) -> list[tuple[float, int, int]]:
    """Run a case again and again; the state after each run."""
    case = castfem.load(name).with_(changes)
    found = []
    print(f"{'run':>4} {'seconds':>8} {'MB':>8} {'communicators':>14} {'files':>6}")
    for number in range(1, runs + 1):
        begun = time.perf_counter()
        with castfem.run(case) as result:
            result.history  # noqa: B018  read as a script would
            if len(result.times):
                result.fields()
        del result
        found.append(state())
        if number == 1 or number % 5 == 0:
            memory, handle, files = found[-1]
            took = time.perf_counter() - begun
            print(f"{number:>4} {took:>8.2f} {memory:>8.2f} {handle:>14} {files:>6}", flush=True)
    return found


def main(words: list[str]) -> None:
    """Measure and print the growth per run."""
    plain = [word for word in words if "=" not in word]
    given = dict(word.split("=", 1) for word in words if "=" in word)
    name = plain[0] if plain else "billet125/idealised"
    found = measure(name, int(plain[1]) if len(plain) > 1 else 40, given or QUICK)
    count = len(found) - WARM_UP
    if count < 1:
        return
    first, last = found[WARM_UP - 1], found[-1]
    memory, communicators, files = ((b - a) / count for a, b in zip(first, last, strict=True))
    print(
        f"growth a run after {WARM_UP}: {1e3 * memory:.1f} kB, "
        f"{communicators:g} communicators, {files:g} files"
    )


if __name__ == "__main__":
    main(sys.argv[1:])
