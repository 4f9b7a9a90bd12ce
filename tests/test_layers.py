"""A package knows only what stands before it, also where only its types need it."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from types import ModuleType

import pytest
from PIL import Image

import castfem

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def packages() -> ModuleType:
    spec = importlib.util.spec_from_file_location("packages", ROOT / "tools" / "packages.py")
    assert spec is not None and spec.loader is not None
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


def test_every_package_has_its_place(packages: ModuleType) -> None:
    there = {unit for unit, _ in packages.files()}
    assert there - set(packages.ORDER) == {"physics", "studies", "post"}  # their words alone
    assert there - {unit for unit, _ in packages.arrows()} <= {
        "base", "meshes", "forms", "physics", "studies", "post"
    }  # fmt: skip


def test_every_package_is_named_by_help(packages: ModuleType) -> None:
    listed = (castfem.__doc__ or "").partition("Packages, upstream first")[2]
    parts = {part for name in packages.ORDER for part in name.split(".")}
    assert set(re.findall(r"[a-z_]+", listed)) >= parts


def test_picture_shows_the_imports_of_today(packages: ModuleType) -> None:
    with Image.open(ROOT / "docs" / "figures" / "packages.png") as picture:
        drawn = picture.info["Description"]
    assert drawn == packages.written(packages.arrows()), "draw it anew: make pages"


def test_types_count(packages: ModuleType, tmp_path: Path) -> None:
    """What is imported for types alone, or within a function, is seen."""
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
