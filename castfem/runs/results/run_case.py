"""The case in the folder of a run, where something of it is to be told."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from castfem.base.errors import CastfemError
from castfem.runs.output.folder import CASE_NAME

if TYPE_CHECKING:
    from castfem.model import Case


def case_with(folder: Path, *words: str) -> Case | None:
    """Return the case of a run that has one of some words; None without, or if it is damaged.

    Args:
        folder: Of the run.
        words: Keys; cases without any of them are not read further.
    """
    path = folder / CASE_NAME
    try:
        text = path.read_text(encoding="utf-8")
        if not any(word in text for word in words):
            return None
        from castfem.model import load_case

        return load_case(path)
    except (OSError, CastfemError):
        return None
