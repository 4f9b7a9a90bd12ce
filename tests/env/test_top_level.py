"""The top level of the project holds what is known, and no note that somebody left there."""

from __future__ import annotations

import os
from fnmatch import fnmatch
from pathlib import Path

ROOT = Path(__file__).parents[2]
KNOWN = {
    *(".ci", ".gitignore", "CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "Dockerfile"),
    *("LICENSE", "LICENSE.GPL", "MANIFEST.in", "Makefile", "README.md", "apptainer.def"),
    *("environment.yml", "pixi.toml", "pyproject.toml"),
    *("benchmarks", "cases", "castfem", "docs", "findings", "forms", "meshes", "tests", "tools"),
}
OF_AN_ARCHIVE = {".git", "PKG-INFO", "setup.cfg"}  # what git or a packager adds beside the files


def present(root: Path) -> list[str]:
    """Names in a checkout or an unpacked archive, without what .gitignore names."""
    ignored = [*OF_AN_ARCHIVE]
    if (root / ".gitignore").exists():
        ignored += [line.strip("/") for line in (root / ".gitignore").read_text().split()]
    names = [path.name for path in root.iterdir()]
    return [name for name in names if not any(fnmatch(name, one) for one in ignored)]


def test_the_top_level_holds_what_is_known() -> None:
    assert {*present(ROOT)} - KNOWN == set()


def test_what_was_left_in_an_archive_is_found(tmp_path: Path) -> None:
    (tmp_path / ".gitignore").write_text(".castfem/\n*.egg-info/\n/results/\n")
    for name in ("castfem", ".castfem", "castfem.egg-info", "results", "PKG-INFO", "notes.md"):
        (tmp_path / name).mkdir()
    assert {*present(tmp_path)} - KNOWN == {"notes.md"}


def test_scripts_can_be_run() -> None:
    """All that name the program that runs them; what other scripts read does not."""
    files = [*(ROOT / "findings").glob("*.sh"), *(ROOT / "tools").glob("*.sh"), ROOT / ".ci/run"]
    scripts = [file for file in files if file.read_bytes().startswith(b"#!")]
    assert {file.name for file in scripts} >= {"run", "test.sh", "cobyqa_nan.sh"}
    assert [file.name for file in scripts if not os.access(file, os.X_OK)] == []
