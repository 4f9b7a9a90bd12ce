"""Whether a case may be run in a folder that holds a run already.

A new run into the folder of a run of the same physics replaces it, and a resumed run goes on with
it. A run of other physics is kept, unless the user says --overwrite. Which files are castfem's, and
that no others are touched, is the business of `castfem.output.folder`.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from castfem.case import AnyCase, read_case
from castfem.errors import InputError


def check(folder: Path, case: AnyCase, *, resume: bool, overwrite: bool) -> None:
    """Refuse a folder whose run is of other physics than the case.

    Raises:
        InputError: It is, or it cannot be told; or the folder is a file; or there is nothing to
            resume.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, a folder is needed; choose another with -o")
    file = folder / "case.toml"
    if not file.is_file():
        if resume:
            raise InputError(f"{folder}: holds no run to resume; run without --resume")
        return
    if overwrite:
        return
    mend = (
        "run without --resume into another folder (-o)"
        if resume
        else "choose another folder with -o, or --overwrite it"
    )
    former = read_case(file)
    if former.problems or former.case is None:
        raise InputError(f"{file}: is not a case of this version of castfem; {mend}")
    if former.case.physics_hash() != case.physics_hash():
        changes = list(differences(former.case.document(), case.document()))
        told = "; ".join(changes[:5]) or "the steel's file has changed"
        more = f"; and {len(changes) - 5} more" if len(changes) > 5 else ""
        raise InputError(f"{folder}: holds a run of another case ({told}{more}); {mend}")


def differences(there: Any, here: Any, key: str = "") -> Iterator[str]:
    """Yield the keys in which two documents of cases differ, those that are physics."""
    if key in ("title", "output", "reference", "casting.length"):
        return
    if isinstance(there, dict) and isinstance(here, dict):
        for name in there.keys() | here.keys():
            below = f"{key}.{name}" if key else name
            yield from differences(there.get(name), here.get(name), below)
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        for index, (one, other) in enumerate(zip(there, here, strict=True)):
            yield from differences(one, other, f"{key}.{index}")
    elif there != here:
        yield f"{key}: {_brief(there)} there, {_brief(here)} here"


def _brief(value: Any) -> str:
    if value is None:
        return "nothing"
    text = str(value)
    return text if len(text) <= 40 else text[:36] + " ..."
