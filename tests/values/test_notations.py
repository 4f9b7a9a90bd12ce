"""How values are written in files: the annotations of fields."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Annotated, Optional, get_args, get_origin

import castfem.base
import castfem.model
from castfem.base.quantities import Notation


def annotations() -> dict[str, object]:
    """Each annotated type that a module of case files names, by module and name."""
    found = {}
    for package in (castfem.model, castfem.base):
        for module in pkgutil.iter_modules(package.__path__, f"{package.__name__}."):
            for name, value in vars(importlib.import_module(module.name)).items():
                if get_origin(value) is Annotated:
                    found[f"{module.name}.{name}"] = value
    return found


def test_any_python_can_join_it_with_none() -> None:
    """Early releases of Python 3.11 and 3.12 put the members of a union in a set."""
    assert annotations()
    for name, annotation in annotations().items():
        marks = [mark for mark in get_args(annotation)[1:] if isinstance(mark, Notation)]
        assert len({*marks, *marks}) == len(marks), name
        assert type(None) in get_args(Optional[annotation]), name  # noqa: UP045
