"""The cache of meshes, and their pictures."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import matplotlib.image
import numpy as np
import pytest

from castfem.meshes import SectionMesh, build, cache, cached, read_mesh, write_mesh
from castfem.meshes.draw import draw

from .sections import BEAM, ROUNDED, SLAB, STRIP


class Counting:
    def __init__(self) -> None:
        self.calls = 0

    def __call__(self, **parameters: Any) -> SectionMesh:
        self.calls += 1
        return build(**parameters)


def same(a: SectionMesh, b: SectionMesh) -> None:
    for name in ("points", "cells", "facets", "facet_group"):
        x, y = getattr(a, name), getattr(b, name)
        assert x.dtype == y.dtype
        np.testing.assert_array_equal(x, y)
    for name in ("cell", "order", "groups", "multiplicity", "exact_area"):
        assert getattr(a, name) == getattr(b, name)
    assert list(a.probes) == list(b.probes)
    for name in a.probes:
        np.testing.assert_array_equal(a.probes[name], b.probes[name])


def test_second_call_reads_the_stored_mesh(tmp_path: Path) -> None:
    builder = Counting()
    first = cached(builder, tmp_path / "new" / "folder", **ROUNDED, order=2, symmetry="half")
    again = cached(builder, tmp_path / "new" / "folder", **ROUNDED, order=2, symmetry="half")
    assert builder.calls == 1
    same(first, again)
    (file,) = (tmp_path / "new" / "folder").iterdir()  # nothing else is left behind
    assert file.name.startswith("rectangle-") and file.suffix == ".npz"


def test_file_name_depends_on_parameters_and_version(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    builder = Counting()
    cached(builder, tmp_path, **STRIP)
    cached(builder, tmp_path, **dict(reversed(STRIP.items())))  # independent of the order
    cached(builder, tmp_path, **STRIP | {"length": np.float64(0.1)})
    assert builder.calls == 1
    cached(builder, tmp_path, **STRIP | {"length": 0.1000001})
    assert builder.calls == 2
    monkeypatch.setattr(cache, "MESH_VERSION", cache.MESH_VERSION + 1)
    cached(builder, tmp_path, **STRIP)
    assert builder.calls == 3


@pytest.mark.parametrize("damage", ["empty", "cut", "text", "flipped", "other arrays", "misfit"])
def test_invalid_file_is_built_again(tmp_path: Path, damage: str) -> None:
    builder = Counting()
    first = cached(builder, tmp_path, **STRIP)
    (file,) = tmp_path.iterdir()
    content = file.read_bytes()
    if damage == "other arrays":
        np.savez(file, a=np.zeros(3))
    elif damage == "misfit":
        with np.load(file) as kept:
            arrays = dict(kept)
        arrays["cells"] = arrays["cells"] + 1000
        np.savez(file, **arrays)
    else:
        half = len(content) // 2
        broken = {
            "empty": b"",
            "cut": content[:half],
            "text": b"no mesh",
            "flipped": content[:600] + bytes(255 - c for c in content[600:700]) + content[700:],
        }
        file.write_bytes(broken[damage])
    with pytest.raises(ValueError, match=r"holds no mesh|zip|pickle|No data"):
        read_mesh(file)
    same(first, cached(builder, tmp_path, **STRIP))
    assert builder.calls == 2
    same(first, read_mesh(file))


def test_unwritable_folder_is_allowed(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    assert len(cached(build, blocked, **STRIP).cells) > 0


def test_rejected_parameters_leave_no_file(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="is impossible"):
        cached(build, tmp_path, **STRIP | {"length": -1.0})
    assert list(tmp_path.iterdir()) == []


def test_failed_write_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = build(**STRIP)

    def fail(*_: Any, **__: Any) -> None:
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", fail)
    with pytest.raises(OSError, match="disk full"):
        write_mesh(mesh, tmp_path / "mesh.npz")
    assert list(tmp_path.iterdir()) == []


def test_reading_imports_neither_gmsh_nor_a_builder(tmp_path: Path) -> None:
    cached(build, tmp_path, **STRIP)
    script = (
        "import sys\n"
        "from castfem.meshes import build, cached\n"
        f"mesh = cached(build, {str(tmp_path)!r}, **{STRIP!r})\n"
        "assert len(mesh.cells) > 0\n"
        "bad = {'gmsh', 'dolfinx', 'mpi4py', 'matplotlib', 'castfem.meshes.rectangle'}\n"
        "print(sorted(bad & set(sys.modules)))\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert result.stdout.strip() == "[]"


@pytest.mark.parametrize(
    "parameters",
    [ROUNDED | {"order": 2}, SLAB | {"symmetry": "half"}, BEAM | {"cell": "triangle"}, STRIP],
)
def test_picture_shows_groups_in_colour(tmp_path: Path, parameters: dict[str, object]) -> None:
    picture = tmp_path / "mesh.png"
    draw(build(**parameters), picture)
    image = matplotlib.image.imread(picture)[..., :3]
    assert min(image.shape[:2]) > 400
    spread = image.max(axis=2) - image.min(axis=2)
    assert (spread > 0.4).mean() > 5e-4  # coloured boundary
    assert (image.min(axis=2) > 0.99).mean() > 0.3  # white between the lines


def test_focus_must_be_a_probe(tmp_path: Path) -> None:
    mesh = build(**STRIP)
    draw(mesh, tmp_path / "mesh.svg", focus="mid_face", zoom=0.02)
    assert (tmp_path / "mesh.svg").stat().st_size > 1000
    with pytest.raises(ValueError, match="focus = 'corner' is no probe; choose one of mid_face"):
        draw(mesh, tmp_path / "other.png", focus="corner")
