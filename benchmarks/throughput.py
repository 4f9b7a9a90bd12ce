"""How much more two runs at once yield than one after the other.

    python -m benchmarks.throughput [CASE] [REPEATS]

Each way in turns, as often as asked, so that a busy machine shows in both; the best of each makes
the ratio:

* `castfem run` of two tapers, one after the other and both at once;
* `castfem sweep` of eight tapers, `-j 1` and `-j 2`, from the command to its end, start-up and all.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable

TAPERS = ("0.8", "0.85", "0.9", "0.95", "1", "1.05", "1.1", "1.15")
Way = Callable[[str, str, bool], None]


def two_runs(name: str, folder: str, together: bool) -> None:
    """Run two tapers in processes of their own."""
    running = []
    for taper in TAPERS[-2:]:
        words = [name, "--set", f"mould.taper={taper} %/m", "-o", f"{folder}/{taper}", "-q"]
        running.append(subprocess.Popen([sys.executable, "-m", "castfem.cli", "run", *words]))
        if not together:
            running[-1].wait()
    if any(process.wait() for process in running):
        raise RuntimeError("a run has failed")


def sweep(name: str, folder: str, together: bool) -> None:
    """Sweep the tapers."""
    values = "mould.taper=" + ",".join(f"{taper} %/m" for taper in TAPERS)
    words = ["sweep", name, "--set", values, "-j", "2" if together else "1"]
    command = [sys.executable, "-m", "castfem.cli", *words, "-o", f"{folder}/sweep", "-q"]
    subprocess.run(command, check=True)


def seconds(way: Way, name: str, together: bool) -> float:
    """Wall time of one way, into a folder that goes afterwards."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        way(name, folder, together)
        return time.perf_counter() - begun


def parse(words: list[str]) -> argparse.Namespace:
    """The command line."""
    about, _, ways = (__doc__ or "").partition("\n\n")
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.throughput",
        description=about,
        epilog=ways.partition("\n\n")[2],
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("name", nargs="?", default="billet125/taper_1", metavar="CASE")
    parser.add_argument("repeats", nargs="?", type=int, default=3, metavar="REPEATS")
    return parser.parse_args(words)


def main(words: list[str]) -> None:
    """Measure and print a line each time."""
    given = parse(words)
    name, repeats = given.name, given.repeats
    ways: dict[str, Way] = {"two runs": two_runs, "a sweep of eight": sweep}
    seconds(two_runs, name, together=True)  # forms and meshes come from the cache from now on
    for title, way in ways.items():
        found: dict[bool, list[float]] = {False: [], True: []}
        for _ in range(repeats):
            for together, times in found.items():
                load = os.getloadavg()[0]
                times.append(seconds(way, name, together))
                how = "two at once" if together else "one by one "
                print(f"{title}, {how}: {times[-1]:.2f} s (load before it {load:.2f})", flush=True)
        ratio = min(found[False]) / min(found[True])
        print(f"{title}: two at once yield {ratio:.2f} times as much as one by one", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
