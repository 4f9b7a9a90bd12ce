"""Build a section from the name of its shape and its parameters, as a case file gives them."""

from __future__ import annotations

import dataclasses
import difflib
import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from castfem.meshes.section_mesh import SectionMesh
from castfem.meshes.sizes import check_sizes

BUILDERS: dict[str, str] = {
    "rectangle": "castfem.meshes.rectangle:rectangle",
    "round": "castfem.meshes.disc:disc",
    "beam_blank": "castfem.meshes.beam_blank:beam_blank",
    "strip": "castfem.meshes.rectangle:strip",
}
"""Module and function that mesh a shape, by its name."""


def builder_of(shape: str) -> Callable[..., SectionMesh]:
    """The function that meshes a shape.

    Raises:
        ValueError: The shape is unknown; the message lists the known ones.
    """
    if shape not in BUILDERS:
        raise ValueError(f"shape = {shape!r} is unknown: choose one of {', '.join(BUILDERS)}")
    # Imported when a mesh is built, not when one is read from the cache.
    module, function = BUILDERS[shape].split(":")
    builder: Callable[..., SectionMesh] = getattr(importlib.import_module(module), function)
    return builder


def parameters_of(shape: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Names of the parameters a shape needs, and of those it takes besides.

    Raises:
        ValueError: The shape is unknown.
    """
    known = list(inspect.signature(builder_of(shape)).parameters.values())
    if any(p.kind is inspect.Parameter.VAR_KEYWORD for p in known):
        known += inspect.signature(check_sizes).parameters.values()
    known = [p for p in known if p.kind is inspect.Parameter.KEYWORD_ONLY]
    return (
        tuple(p.name for p in known if p.default is inspect.Parameter.empty),
        tuple(p.name for p in known if p.default is not inspect.Parameter.empty),
    )


def build(shape: str, **parameters: Any) -> SectionMesh:
    """Mesh a section.

    Args:
        shape: One of `BUILDERS`.
        **parameters: Those of the shape's function (`rectangle`, `disc`, `beam_blank`, `strip`);
            lengths in m. One that is None counts as not given.

    Raises:
        ValueError: The shape or a parameter is unknown, missing or impossible; the message names
            it.
    """
    builder = builder_of(shape)
    given = {name: value for name, value in parameters.items() if value is not None}
    needed, optional = parameters_of(shape)
    problems = []
    for name in given:
        if name not in needed + optional:
            near = difflib.get_close_matches(name, needed + optional, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            problems.append(f"{name} is not a parameter of shape = {shape!r}{hint}")
    missing = [name for name in needed if name not in given]
    if missing:
        problems.append(f"shape = {shape!r} needs {', '.join(missing)}")
    if problems:
        allowed = ", ".join(needed + optional)
        raise ValueError("; ".join(problems) + f" (its parameters: {allowed})")
    return builder(**given)


def build_section(section: Any) -> SectionMesh:
    """Mesh a section from a mapping or a dataclass that holds `shape` and its parameters.

    Raises:
        ValueError: As `build`; also where `shape` is missing.
    """
    if isinstance(section, Mapping):
        parameters = dict(section)
    elif dataclasses.is_dataclass(section) and not isinstance(section, type):
        parameters = {f.name: getattr(section, f.name) for f in dataclasses.fields(section)}
    else:
        raise ValueError(f"a section is a mapping or a dataclass, not {type(section).__name__}")
    shape = parameters.pop("shape", None)
    if shape is None:
        raise ValueError(f"shape is missing: choose one of {', '.join(BUILDERS)}")
    return build(shape, **parameters)
