"""A package imports only packages upstream of it, also where only its types need them."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from PIL import Image
from scipy.sparse.csgraph import connected_components

import castfem

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def packages() -> ModuleType:
    spec = importlib.util.spec_from_file_location("packages", ROOT / "tools" / "packages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_dependence_has_one_direction(packages: ModuleType) -> None:
    place = {name: i for i, name in enumerate(packages.ORDER)}
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {unit} imports {needed}"
        for unit, path in packages.files()
        for line, needed in packages.imported(path)
        if needed in place and place[needed] > place[unit]
    ]
    assert not wrong, "\n".join(wrong)


def test_no_cycle_of_more_than_three_files(packages: ModuleType) -> None:
    """Files that import each other, types and imports within functions included."""
    paths = [path for _, path in packages.files()]
    modules = [
        ".".join(("castfem", *path.relative_to(ROOT).with_suffix("").parts))
        .replace("castfem.castfem", "castfem")
        .removesuffix(".__init__")
        for path in paths
    ]
    place = {module: i for i, module in enumerate(modules)}
    table = np.zeros((len(paths), len(paths)))
    for i, path in enumerate(paths):
        for _, name in packages.named(path):
            needed = place.get(name, place.get(name.rpartition(".")[0]))
            if needed is not None and needed != i:
                table[i, needed] = 1.0
    assert table.sum() > 2 * len(paths)
    _, circle = connected_components(table, connection="strong")
    members = [[m for m, c in zip(modules, circle, strict=True) if c == k] for k in set(circle)]
    assert not [names for names in members if len(names) > 3]


def test_every_package_is_in_the_order(packages: ModuleType) -> None:
    units = {unit for unit, _ in packages.files()}
    assert units - set(packages.ORDER) == {"physics", "studies", "post"}  # only their docstrings
    assert units - {unit for unit, _ in packages.arrows()} <= {
        "base", "meshes", "forms", "physics", "studies", "post"
    }  # fmt: skip


def test_every_package_is_named_by_help(packages: ModuleType) -> None:
    listed = (castfem.__doc__ or "").partition("Packages, upstream first")[2]
    parts = {part for name in packages.ORDER for part in name.split(".")}
    assert set(re.findall(r"[a-z_]+", listed)) >= parts


def test_picture_has_the_present_imports(packages: ModuleType) -> None:
    with Image.open(ROOT / "docs" / "figures" / "packages.png") as picture:
        drawn = picture.info["Description"]
    assert drawn == packages.written(packages.arrows()), "draw it again: make pages"


def test_types_count(packages: ModuleType, tmp_path: Path) -> None:
    """Imports for types only, or within a function, are found."""
    path = tmp_path / "module.py"
    path.write_text(
        "from typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from castfem.physics.coupling.staggered import Coupler\n"
        "def f():\n    import castfem.cli\n    from castfem import forms\n"
    )
    assert {name for _, name in packages.imported(path)} == {
        "physics.coupling",
        "cli",
        "forms",
    }
