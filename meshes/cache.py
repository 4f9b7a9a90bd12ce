"""Meshes kept on disk under the hash of their parameters.

Reading one imports neither gmsh nor a builder and takes a few milliseconds.
"""

from __future__ import annotations

import hashlib
import json
import logging
import os
import tempfile
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from castfem.meshes.quality import vertex_count
from castfem.meshes.section_mesh import SectionMesh

MESH_VERSION = 4
"""Raised whenever the same parameters give another mesh, so that old files are not found."""

_ARRAYS = ("points", "cells", "facets", "facet_group")

_log = logging.getLogger(__name__)


def cached(
    builder: Callable[..., SectionMesh], folder: str | os.PathLike[str], **parameters: Any
) -> SectionMesh:
    """The mesh `builder(**parameters)`, read from a folder if it is there, else built and kept.

    A file that cannot be read is built again and replaced. A folder that cannot be written to only
    costs the time to build again.

    Args:
        builder: Function that builds a mesh from the parameters.
        folder: Folder of the cache, created if missing.
        **parameters: Numbers, strings, booleans or None.

    Raises:
        ValueError: The builder refuses its parameters.
    """
    path = Path(folder) / cache_name(builder, parameters)
    mesh = _read(path)
    if mesh is not None:
        return mesh
    mesh = builder(**parameters)
    try:
        write_mesh(mesh, path)
    except OSError as error:
        _log.warning("the mesh cannot be kept in %s: %s", path.parent, error)
    return mesh


def cache_name(builder: Callable[..., SectionMesh], parameters: dict[str, Any]) -> str:
    """File name for a builder and its parameters; it changes with `MESH_VERSION`."""
    name = getattr(builder, "__qualname__", type(builder).__qualname__)
    plain = {k: v.item() if isinstance(v, np.generic) else v for k, v in parameters.items()}
    text = json.dumps([MESH_VERSION, name, plain], sort_keys=True)
    return f"{plain.get('shape', name)}-{hashlib.sha256(text.encode()).hexdigest()[:24]}.npz"


def write_mesh(mesh: SectionMesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh to an .npz file, which appears whole or not at all."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    names = list(mesh.probes)
    rest = {
        "cell": mesh.cell,
        "order": mesh.order,
        "groups": list(mesh.groups),
        "probes": names,
        "multiplicity": mesh.multiplicity,
        "exact_area": mesh.exact_area,
    }
    arrays = {name: getattr(mesh, name) for name in _ARRAYS}
    arrays["probes"] = np.array([mesh.probes[name] for name in names]).reshape(-1, 2, 2)
    arrays["rest"] = np.array(json.dumps(rest))
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=".mesh-", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, allow_pickle=False, **arrays)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def read_mesh(path: str | os.PathLike[str]) -> SectionMesh:
    """Read a mesh written by `write_mesh`.

    Raises:
        OSError: The file cannot be opened.
        ValueError: It is not a mesh, or damaged.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in _ARRAYS}
            lines, rest = file["probes"], json.loads(str(file["rest"]))
        mesh = SectionMesh(
            **arrays,
            cell=rest["cell"],
            order=rest["order"],
            groups=tuple(rest["groups"]),
            probes={name: (a, b) for name, (a, b) in zip(rest["probes"], lines, strict=True)},
            multiplicity=rest["multiplicity"],
            exact_area=rest["exact_area"],
        )
        nodes = {(3, 1): 3, (3, 2): 6, (4, 1): 4, (4, 2): 9}[vertex_count(mesh.cell), mesh.order]
        sound = (
            mesh.points.shape[1:] == (2,)
            and mesh.cells.shape[1:] == (nodes,)
            and mesh.facets.shape == (len(mesh.facet_group), 2)
            and 0 <= mesh.cells.min() <= mesh.cells.max() < len(mesh.points)
            and 0 <= mesh.facets.min() <= mesh.facets.max() < len(mesh.points)
            and 0 <= mesh.facet_group.min() <= mesh.facet_group.max() < len(mesh.groups)
        )
    except (zipfile.BadZipFile, KeyError, TypeError, EOFError, AttributeError) as error:
        raise ValueError(f"{path} holds no mesh: {error}") from error
    if not sound:
        raise ValueError(f"{path} holds no mesh: its arrays do not fit together")
    return mesh


def _read(path: Path) -> SectionMesh | None:
    """Read a mesh, or None where there is none or it is damaged."""
    try:
        return read_mesh(path)
    except (OSError, ValueError):
        return None
