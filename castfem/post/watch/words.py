"""What is said of runs at work: a line each, and the results that are shown."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

from castfem.base.progress import clock
from castfem.base.shown_units import label_shown, plain_unit, scale_of
from castfem.post.report.show import how_it_ended
from castfem.post.watch.many import WAITING, Overview
from castfem.post.watch.run_status import FAILED, KILLED, RUNNING, Look
from castfem.runs.output.folder import LOG_NAME
from castfem.runs.results.numbers import cells

COLUMNS = {
    "shell_mid_face": "shell",
    "gap_max": "gap",
    "surface_temperature_mid_face": "surface",
    "von_mises_max": "stress",
}
"""What stands of a run in one line, and how it is called there."""
_STOPPED = {
    KILLED: "killed, or ended without a word",
    "interrupted": "interrupted",
    WAITING: "waiting",
}
_NAMED = 5  # runs, of those that are alike
_STARTS = ("shell_", "surface_temperature_", "gap_", "von_mises_max")
_NARROW, _WIDE = "_narrow_face", "_mid_face"  # ends of names


def results(look: Look) -> Iterator[tuple[str, str, str]]:
    """Label, value and unit of shell, surface, gap and largest stress.

    The narrow face is left out where it is as the mid-face.
    """
    found = look.quantities
    for start in _STARTS:
        for name, quantity in found.items():
            if not name.startswith(start):
                continue
            twin = found.get(name.replace(_NARROW, _WIDE))
            if name.endswith(_NARROW) and twin and cells(name, twin) == cells(name, quantity):
                continue
            yield (label_shown(quantity.label), *cells(name, quantity))


def brief(look: Look) -> dict[str, str]:
    """Shell, gap, surface and stress of a run as one line has them, those that it has."""
    return {
        word: " ".join(cells(name, look.quantities[name]))
        for name, word in COLUMNS.items()
        if name in look.quantities
    }


def where(look: Look) -> str:
    """How far the run has come."""
    if math.isnan(look.position):
        return "no step has been taken yet"
    scale = scale_of("m", "position")
    digits = ".3f" if scale.unit == "m" else ".5g"
    here = f"{scale(look.position):{digits}}"
    if math.isnan(look.length):
        return f"{here} {plain_unit(scale.unit)}"
    return f"{here} of {scale(look.length):{digits}} {plain_unit(scale.unit)}"


def percent(look: Look) -> str:
    """The share of its way in percent; empty where it is not known."""
    return "" if math.isnan(look.share) else f"{100.0 * look.share:.0f} %"


def left(look: Look) -> str:
    """The time left, as 0:07; empty where it is not known."""
    return "" if math.isnan(look.left) else clock(look.left)


def line(name: str, look: Look) -> str:
    """A run in one line."""
    parts = [f"{name}:", look.state if look.state != RUNNING else "", percent(look), where(look)]
    parts += [f"{word} {text}" for word, text in brief(look).items()]
    parts += [f"left {left(look)}"] if left(look) else []
    return "  ".join(part for part in parts if part)


def unfinished(found: Overview) -> Iterator[str]:
    """What is to be said of the runs of a sweep that have not ended well, a line each."""
    for state, why in _STOPPED.items():
        names = [row.name for row in found.rows if row.look.state == state]
        if names:
            listed = ", ".join(names[:_NAMED]) + (", ..." if len(names) > _NAMED else "")
            yield f"{len(names)} {why}: {listed}"
    if not found.complete:
        yield (
            f"no run has been at work for {clock(found.idle)}: the sweep was stopped, or the rest "
            "waits for its turn; the command of the sweep goes on with it (--resume: from the "
            "checkpoints), castfem watch --wait waits until it does"
        )
    for row in found.rows:
        if row.look.state == FAILED:
            yield f"{row.name}: failed: {row.look.record.reason}"


def ending(folder: Path, look: Look) -> str:
    """How a run has ended, why, and what can be done; one line."""
    told = how_it_ended(look.record)
    if look.state == KILLED:
        return f"{told}; castfem run --resume {folder} goes on from its last checkpoint"
    if look.state == "interrupted":
        return f"{told}; castfem run --resume {folder} goes on"
    if look.state == "failed":
        return f"{told}; what happened: {folder / LOG_NAME}"
    return f"{told}; its results: castfem show {folder}"
