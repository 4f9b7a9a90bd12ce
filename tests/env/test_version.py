"""Version, headings of CHANGELOG.md and tags say the same."""

from __future__ import annotations

import re
from collections.abc import Collection
from pathlib import Path

import pytest

import castfem

ROOT = Path(__file__).parents[2]
HEADING = re.compile(r"^## \[?v?(\d+\.\d+\.\d+)\b", re.MULTILINE)
CHANGES = "# Changes\n\n## Unreleased\n\n## 0.2.0 (2027-01-31)\n\n## [0.1.0]\n"


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def faults(version: str, changes: str, tags: Collection[str]) -> list[str]:
    """What disagrees: the code is at the version that was released last, and its tag is the newest.

    Args:
        version: Of the code.
        changes: CHANGELOG.md.
        tags: "v0.1.0" ... of the repository; the release that is being made has none yet.
    """
    released, found = HEADING.findall(changes), []
    if released != sorted(released, key=numbers, reverse=True):
        found.append("the latest version does not stand first in CHANGELOG.md")
    if released and released[0] != version:
        found.append(f"CHANGELOG.md is at {released[0]}, the code at {version}")
    tagged = {tag.removeprefix("v") for tag in tags}
    found += [f"the tag v{one} has no heading in CHANGELOG.md" for one in tagged - {*released}]
    found += [f"{one} has no tag" for one in released[1:] if one not in tagged]
    return found


def tags_of(root: Path) -> list[str] | None:
    """Tags of versions of a repository, read without git; None where there is no repository."""
    home = root / ".git"
    if home.is_file():  # a work tree beside its repository
        home = root / home.read_text(encoding="utf-8").removeprefix("gitdir:").strip()
    if not home.is_dir():
        return None
    common = home / "commondir"
    if common.is_file():
        home = (home / common.read_text(encoding="utf-8").strip()).resolve()
    packed = home / "packed-refs"
    names = [path.name for path in (home / "refs" / "tags").glob("v*")]
    if packed.is_file():
        names += re.findall(r" refs/tags/(v\S+)$", packed.read_text("utf-8"), re.MULTILINE)
    return sorted({name for name in names if re.fullmatch(r"v\d+\.\d+\.\d+", name)})


def test_code_changes_and_tags_agree() -> None:
    tags = tags_of(ROOT)
    if tags is None:
        pytest.skip("no repository here (an sdist, say): its tags are not known")
    assert faults(castfem.__version__, (ROOT / "CHANGELOG.md").read_text("utf-8"), tags) == []


@pytest.mark.parametrize(
    ("version", "changes", "tags", "told"),
    [
        ("0.2.0", CHANGES, ["v0.1.0", "v0.2.0"], []),
        ("0.2.0", CHANGES, ["v0.1.0"], []),  # about to be tagged
        ("0.1.0", "## Unreleased\n", [], []),
        ("0.3.0", CHANGES, ["v0.1.0"], ["CHANGELOG.md is at 0.2.0, the code at 0.3.0"]),
        ("0.2.0", CHANGES, [], ["0.1.0 has no tag"]),
        ("0.1.0", "## Unreleased\n", ["v0.1.0"], ["the tag v0.1.0 has no heading"]),
        ("0.1.0", "## 0.1.0\n## 0.10.0\n", ["v0.10.0"], ["the latest version does not stand"]),
    ],
)
def test_what_disagrees_is_found(
    version: str, changes: str, tags: list[str], told: list[str]
) -> None:
    found = faults(version, changes, tags)
    assert len(found) == len(told)
    assert all(one.startswith(start) for one, start in zip(found, told, strict=True))


def test_tags_are_read_from_files_and_packed_ones(tmp_path: Path) -> None:
    assert tags_of(tmp_path) is None
    (tmp_path / ".git" / "refs" / "tags").mkdir(parents=True)
    (tmp_path / ".git" / "refs" / "tags" / "v0.2.0").touch()
    (tmp_path / ".git" / "packed-refs").write_text(
        "# pack-refs\nabc refs/tags/v0.1.0\n^def\nabc refs/tags/nightly\nabc refs/heads/v9.9.9\n"
    )
    assert tags_of(tmp_path) == ["v0.1.0", "v0.2.0"]
    beside = tmp_path / "beside"
    (tmp_path / ".git" / "worktrees" / "w").mkdir(parents=True)
    (tmp_path / ".git" / "worktrees" / "w" / "commondir").write_text("../..\n")
    beside.mkdir()
    (beside / ".git").write_text(f"gitdir: {tmp_path}/.git/worktrees/w\n")
    assert tags_of(beside) == ["v0.1.0", "v0.2.0"]
