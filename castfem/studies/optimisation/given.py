"""What scripts hand in: looked at where it comes in, and answered in their words if it is wrong."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from castfem.base import units
from castfem.base.errors import InputError
from castfem.base.result_registry import unit_of
from castfem.base.shown_quantity import Quantity
from castfem.model.key_names import full_key
from castfem.model.shipped_cases import load
from castfem.runs.output.run_record import RUN_NAME
from castfem.studies.optimisation.fidelity import WORDS
from castfem.studies.optimisation.question import Axis, Question, Wanted

if TYPE_CHECKING:
    from castfem.model import Case


def case_of(given: Case | str | Path, asked: str) -> Case:
    """Return a case, or the one that `castfem.load` takes.

    Args:
        given: What is to be one.
        asked: By whom, for the message.

    Raises:
        InputError: It is none, or there is no such case.
    """
    from castfem.model import Case

    found = load(given) if isinstance(given, str | Path) else given
    if not isinstance(found, Case):
        raise InputError(
            f"{asked}: case: a case is needed, its path or the name of a shipped one, not {found!r}"
        )
    return found


def origin_of(given: Case | str | Path) -> str:
    """What messages call a case: its path or name as it was given; "" of a case."""
    return str(given) if isinstance(given, str | Path) else ""


def folder_of(given: Path | str, asked: str) -> Path:
    """Return a path for many runs.

    Raises:
        InputError: It is no path, a file, or the folder of a single run.
    """
    if not isinstance(given, str | Path):
        raise InputError(f"{asked}: folder: the path of a folder is needed, not {given!r}")
    folder = Path(given)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{asked}: folder: {folder} is a file; choose another")
    if (folder / RUN_NAME).is_file():
        raise InputError(f"{asked}: folder: {folder} holds a single run; choose another")
    return folder


def whole(given: int, least: int, asked: str) -> int:
    """Return a whole number that is not too small.

    Raises:
        InputError: It is none.
    """
    if isinstance(given, bool) or not isinstance(given, int) or given < least:
        raise InputError(f"{asked}: a whole number from {least} on is needed, not {given!r}")
    return given


def changes_of(given: Mapping[str, Any] | None, asked: str) -> Mapping[str, Any]:
    """Return changes of a case.

    Raises:
        InputError: They are none.
    """
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(
            f"{asked}: changes: keys with their new values are needed, "
            f'{{"casting.speed": "3 m/min"}}, not {given!r}'
        )
    return given


def fidelity_of(given: str, asked: str) -> str:
    """Return a word of `castfem.studies.optimisation.fidelity`.

    Raises:
        InputError: It is none.
    """
    if isinstance(given, str) and given in WORDS:
        return given
    near = units.nearest(given, WORDS) if isinstance(given, str) else ""
    raise InputError(f"{asked}: fidelity: one of {', '.join(WORDS)} is needed, not {given!r}{near}")


def wanted_of(question: Question, given: Wanted | Mapping[str, Any], asked: str) -> Wanted:
    """Return a run of a question, as it is or by the values of its variables.

    Args:
        question: What is asked for.
        given: One that a study has asked for, or key to value of all variables, with units or in
            those of their ranges; then with the fidelity of the search.
        asked: By whom, for the message.

    Raises:
        InputError: It is none, or lies outside of the ranges.
    """
    if isinstance(given, Mapping):
        given = Wanted(_values(question, given, asked), question.table.fidelity)
    if not isinstance(given, Wanted):
        keys = ", ".join(f'"{axis.key}": {axis.low:g}' for axis in question.axes)
        raise InputError(
            f"{asked}: a run is needed, one of those that ask() returns or values by key, "
            f"{{{keys}}}, not {given!r}"
        )
    if not isinstance(given.values, Sequence) or isinstance(given.values, str):
        raise InputError(f"{asked}: values: numbers are needed, not {given.values!r}")
    for axis, value in zip(question.axes, given.values, strict=False):
        if isinstance(value, str):
            raise InputError(f"{asked}: {axis.key}: a number is needed, not {value!r}")
        _number(axis, value, asked)
    given = replace(given, values=tuple(given.values), inputs=tuple(given.inputs))
    question.check_place(given)
    fidelity_of(given.fidelity, asked)
    if given.inputs and len(given.inputs) != len(question.inputs):
        raise InputError(
            f"{asked}: a run has {len(given.inputs)} inputs where {len(question.inputs)} are "
            "needed; leave them out for those of the case"
        )
    return given


def _values(question: Question, given: Mapping[str, Any], asked: str) -> tuple[float, ...]:
    """Values of the variables in the units of their ranges, each to the digits of its own."""
    keys = [axis.key for axis in question.axes]
    found: dict[str, float] = {}
    for key, value in given.items():
        try:
            full = full_key(type(question.case), question.case.document(), str(key))
        except ValueError:
            full = str(key)
        if full not in keys:
            near = units.nearest(full, keys)
            raise InputError(
                f"{asked}: {key} is no variable of [optimise]; there are {', '.join(keys)}{near}"
            )
        axis = question.axes[keys.index(full)]
        found[full] = round(_number(axis, value, asked), axis.decimals)
    missing = [key for key in keys if key not in found]
    if missing:
        raise InputError(f"{asked}: {', '.join(missing)} is missing; give all variables a value")
    return tuple(found[key] for key in keys)


def _number(axis: Axis, given: object, asked: str) -> float:
    """A value of a variable as a number in its unit."""
    if isinstance(given, str):
        found = units.number_in(given, axis.unit)
        if found is not None:
            return found
    elif not isinstance(given, bool):
        try:
            return float(given)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            pass
    unit = f" in {axis.unit}" if axis.unit else ""
    raise InputError(f"{asked}: {axis.key}: a number{unit} is needed, not {given!r}")


def quantities_of(
    question: Question, wanted: Wanted, given: Mapping[str, Any]
) -> dict[str, Quantity]:
    """Return results that were told by name, in SI, in the units in which castfem shows them.

    Raises:
        InputError: One is no number, or one that the question needs is missing.
    """
    found = {str(name): _quantity(str(name), value) for name, value in given.items()}
    missing = [] if wanted.ideal else [n for n in results_of(question) if n not in found]
    if missing:
        near = difflib.get_close_matches(missing[0], found, n=1, cutoff=0.5)
        other = f'; write it so, not "{near[0]}"' if near else ""
        raise InputError(f"tell: {', '.join(missing)} is missing, which [optimise] needs{other}")
    return found


def results_of(question: Question) -> Iterable[str]:
    """The results that a question needs of each run."""
    names = [name for name, _ in question.table.objectives]
    names += [bound.quantity for bound in question.bounds]
    if question.table.front is not None:
        names.append(question.table.front.objective[0])
    return dict.fromkeys(names)


def _quantity(name: str, value: object) -> Quantity:
    if isinstance(value, Quantity):
        return value
    unit = unit_of(name) or "1"
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise InputError(f"tell: {name}: a number in SI is needed, not {value!r}") from None
    if not math.isfinite(number):
        raise InputError(
            f"tell: {name}: a finite number is needed, not {number:g}; of a run that has failed "
            'hand in Evaluation(share=0.3, message="why"), or its Result'
        )
    return Quantity(number, "-" if unit == "1" else unit, name.replace("_", " "))
