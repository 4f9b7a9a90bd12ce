"""The top level of the project holds what is known, and no note that somebody left there."""

from __future__ import annotations

import struct
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


def tracked(root: Path) -> list[str]:
    """Paths of the files that git knows of, from its index: git itself is not in the userland.

    The format: https://git-scm.com/docs/index-format.
    """
    git = root / ".git"
    if git.is_file():  # of a worktree
        git = root / git.read_text().removeprefix("gitdir:").strip()
    index = (git / "index").read_bytes()
    signature, version, count = struct.unpack_from(">4sII", index)
    assert signature == b"DIRC" and version in (2, 3, 4)
    found, at, name = [], 12, b""
    for _ in range(count):
        start, (flags,) = at, struct.unpack_from(">H", index, at + 60)
        at += 64 if flags & 0x4000 else 62
        if version == 4:  # how much of the name before is cut off, seven bits a byte; what follows
            cut = index[at] & 127
            while index[at] & 128:
                at += 1
                cut = (cut + 1 << 7) + (index[at] & 127)
            at += 1
            end = index.index(b"\0", at)
            name, at = name[: len(name) - cut] + index[at:end], end + 1
        else:
            end = index.index(b"\0", at)
            name, at = index[at:end], start + (end - start) // 8 * 8 + 8
        found.append(name.decode())
    return found


def present(root: Path) -> list[str]:
    """Names in an unpacked archive of the project, without what .gitignore names."""
    ignored = [*OF_AN_ARCHIVE]
    if (root / ".gitignore").exists():
        ignored += [line.strip("/") for line in (root / ".gitignore").read_text().split()]
    names = [path.name for path in root.iterdir()]
    return [name for name in names if not any(fnmatch(name, one) for one in ignored)]


def test_the_top_level_holds_what_is_known() -> None:
    if (ROOT / ".git").exists():
        paths = tracked(ROOT)
        assert {path.split("/")[0] for path in paths} == KNOWN
        assert "castfem/__init__.py" in paths and "tests/env/test_top_level.py" in paths
    else:
        assert {*present(ROOT)} - KNOWN == set()


def test_what_was_left_in_an_archive_is_found(tmp_path: Path) -> None:
    (tmp_path / ".gitignore").write_text(".castfem/\n*.egg-info/\n/results/\n")
    for name in ("castfem", ".castfem", "castfem.egg-info", "results", "PKG-INFO", "notes.md"):
        (tmp_path / name).mkdir()
    assert {*present(tmp_path)} - KNOWN == {"notes.md"}
