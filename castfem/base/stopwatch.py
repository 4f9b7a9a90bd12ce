"""Wall-clock time of named sections, each without the time of inner sections."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from time import perf_counter

LIBRARIES = ("petsc", "assembly")
TIME_LOOP = (*LIBRARIES, "law", "python", "time loop", "results")


class _Section(AbstractContextManager[None]):
    """A timed block; a generator would take three times as long."""

    __slots__ = ("_name", "_watch")

    def __init__(self, watch: Stopwatch, name: str) -> None:
        self._watch, self._name = watch, name

    def __enter__(self) -> None:
        self._watch.start(self._name)

    def __exit__(self, *raised: object) -> None:
        self._watch.stop()


class Stopwatch:
    """Exclusive wall time of nested sections.

    A section entered inside another stops the clock of the outer one, so that the times of all
    sections add up to the total.

    Args:
        clock: Returns the time, s; `time.process_time` if other work shares the machine.
    """

    def __init__(self, clock: Callable[[], float] = perf_counter) -> None:
        self._clock = clock
        self.seconds: dict[str, float] = {}
        self.calls: dict[str, int] = {}
        self._stack: list[str] = []
        self._since = clock()

    def _charge(self) -> None:
        now = self._clock()
        if self._stack:
            name = self._stack[-1]
            self.seconds[name] = self.seconds.get(name, 0.0) + now - self._since
        self._since = now

    def start(self, name: str) -> None:
        """Enter section `name`."""
        self._charge()
        self._stack.append(name)
        self.calls[name] = self.calls.get(name, 0) + 1

    def stop(self) -> None:
        """Leave the section entered last."""
        self._charge()
        self._stack.pop()

    def section(self, name: str) -> AbstractContextManager[None]:
        """Time the block as section `name`."""
        return _Section(self, name)

    def share(self, names: tuple[str, ...], of: tuple[str, ...] | None = None) -> float:
        """Time of the sections `names` over that of `of` (all if None)."""
        whole = sum(t for n, t in self.seconds.items() if of is None or n in of)
        return sum(self.seconds.get(n, 0.0) for n in names) / whole if whole else 0.0


def profile_table(watch: Stopwatch) -> str:
    """Table of the sections, longest first, with their share of the total."""
    whole = sum(watch.seconds.values())
    lines = [f"{'section':<24}{'seconds':>10}{'share':>8}{'calls':>9}"]
    for name, seconds in sorted(watch.seconds.items(), key=lambda item: -item[1]):
        share = seconds / whole if whole else 0.0
        lines.append(f"{name:<24}{seconds:>10.3f}{share:>8.1%}{watch.calls.get(name, 0):>9}")
    inside = watch.share(LIBRARIES, of=TIME_LOOP)
    lines.append(f"of the time loop {inside:.0%} is spent inside PETSc and DOLFINx")
    return "\n".join(lines)


def peak_memory() -> float:
    """Largest resident memory of this process so far, bytes."""
    import resource
    import sys

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak if sys.platform == "darwin" else 1024 * peak)
