"""Whether a case may be run in a folder that holds a run already.

A new run into the folder of a run of the same physics replaces it, and a resumed run goes on with
it. A run of other physics is kept, unless the user says --overwrite. Which files are castfem's, and
that no others are touched, is the business of `castfem.output.folder`.
"""

from __future__ import annotations

from pathlib import Path

from castfem.case import AnyCase, read_case
from castfem.errors import InputError
from castfem.wording import differences

_NOT_PHYSICS = ("title", "output", "reference", "casting.length")


def check(folder: Path, case: AnyCase, *, resume: bool, overwrite: bool) -> None:
    """Refuse a folder whose run is of other physics than the case.

    Raises:
        InputError: It is, or it cannot be told; or the folder is a file.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, a folder is needed; choose another with -o")
    file = folder / "case.toml"
    if overwrite or not file.is_file():
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
        told = differences(former.case.document(), case.document(), _NOT_PHYSICS)
        told = told or "the steel's file has changed"
        raise InputError(f"{folder}: holds a run of another case ({told}); {mend}")
