"""`castfem identify`: parameters of the modified Norton-Hoff law from tensile curves."""

from __future__ import annotations

from pathlib import Path
from typing import Literal, cast, get_args

from castfem.base.errors import InputError, RunFailure

Softening = Literal["positive", "free", "none"]


def identify_law(
    data: Path, output: Path | None, degree: int | None, softening: str, overwrite: bool = False
) -> None:
    """Fit the law to the curves in `data`; write NAME.toml and NAME.png and print the report.

    Args:
        data: CSV with the columns temperature, strain rate, strain, stress and their units.
        output: The material file; by default the data's name with .toml.
        degree: Of the polynomials over temperature; None fits each temperature by itself.
        softening: Bounds of p1, see `castfem.studies.identification.fit.IdentifyOptions`.
        overwrite: Replace a material file and a picture that are there.

    Raises:
        InputError: The data cannot be used, a file is there already, or cannot be written.
    """
    if softening not in get_args(Softening):
        raise InputError(f"--softening '{softening}': one of {', '.join(get_args(Softening))}")
    if degree is not None and degree < 0:
        raise InputError(f"--degree {degree}: a number from 0 on, or leave it out")
    target = output or Path(data.name).with_suffix(".toml")
    there = [p for p in (target, target.with_suffix(".png")) if p.exists() and not overwrite]
    if there:
        raise InputError(
            f"{there[0]}: is there already; choose another file with -o, or give --overwrite"
        )
    from castfem.base.atomic_files import write_text
    from castfem.studies.identification.fit import IdentifyOptions, identify

    options = IdentifyOptions(degree=degree, softening=cast(Softening, softening))
    found = identify(data, options)
    try:
        write_text(target, found.to_toml())
    except RunFailure as error:
        raise InputError(str(error).partition(";")[0]) from None
    try:
        picture = found.plot(target.with_suffix(".png"))
    except OSError as error:
        raise InputError(f"{target}: cannot be drawn ({error.strerror})") from None
    print(found.report())
    print(f"law in {target}, drawn in {picture}")
