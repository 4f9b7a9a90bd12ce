"""How much more two runs at once yield than one after the other: `castfem sweep -j 1` and `-j 2`.

    python -m benchmarks.throughput [CASE] [REPEATS]

Four runs of the case, each way as often as asked, in turns, so that a busy machine shows in both.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time

VALUES = "casting.superheat=20 K,25 K,30 K,35 K"


def seconds(name: str, jobs: int) -> float:
    """Wall time of the sweep from the command to its end, start-up and all."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "castfem.cli", "sweep", name, "--set", VALUES]
        begun = time.perf_counter()
        subprocess.run([*command, "-j", str(jobs), "-o", f"{folder}/out", "-q"], check=True)
        return time.perf_counter() - begun


def main(words: list[str]) -> None:
    """Measure and print a line each time; the best of each way makes the ratio."""
    name = words[0] if words else "billet125/idealised"
    repeats = int(words[1]) if len(words) > 1 else 3
    found: dict[int, list[float]] = {1: [], 2: []}
    seconds(name, 2)  # forms and meshes come from the cache from now on
    for _ in range(repeats):
        for jobs, times in found.items():
            load = os.getloadavg()[0]
            times.append(seconds(name, jobs))
            print(f"-j {jobs}: {times[-1]:.2f} s (load before it {load:.2f})", flush=True)
    one, two = (min(times) for times in found.values())
    print(f"throughput of two at once: {one / two:.2f} times that of one after the other")


if __name__ == "__main__":
    main(sys.argv[1:])
