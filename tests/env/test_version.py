"""Version and headings of CHANGELOG.md say the same."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import castfem

ROOT = Path(__file__).parents[2]
HEADING = re.compile(r"^## \[?v?(\d+\.\d+\.\d+)\b", re.MULTILINE)
CHANGES = "# Changes\n\n## Unreleased\n\n## 0.2.0 (2027-01-31)\n\n## [0.1.0]\n"


def numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split("."))


def faults(version: str, changes: str) -> list[str]:
    """What disagrees: the code is at the version that was released last, which stands first."""
    released, found = HEADING.findall(changes), []
    if released != sorted(released, key=numbers, reverse=True):
        found.append("the latest version does not stand first in CHANGELOG.md")
    if released and released[0] != version:
        found.append(f"CHANGELOG.md is at {released[0]}, the code at {version}")
    return found


def test_code_and_changes_agree() -> None:
    assert faults(castfem.__version__, (ROOT / "CHANGELOG.md").read_text("utf-8")) == []


@pytest.mark.parametrize(
    ("version", "changes", "told"),
    [
        ("0.2.0", CHANGES, []),
        ("0.1.0", "## Unreleased\n", []),
        ("0.3.0", CHANGES, ["CHANGELOG.md is at 0.2.0, the code at 0.3.0"]),
        ("0.1.0", "## 0.1.0\n## 0.10.0\n", ["the latest version does not stand"]),
    ],
)
def test_what_disagrees_is_found(version: str, changes: str, told: list[str]) -> None:
    found = faults(version, changes)
    assert len(found) == len(told)
    assert all(one.startswith(start) for one, start in zip(found, told, strict=True))
