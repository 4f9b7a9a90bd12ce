"""docs/architecture.md: what it names is there."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
ENGINE = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "castfem").rglob("*.py"))


def named(line: str) -> tuple[list[Path], list[str]]:
    """Files in a line of the page, and the identifiers beside them."""
    files: list[Path] = []
    names: list[str] = []
    for word in re.findall(r"`([^`]+)`", line):
        if re.fullmatch(r"[\w/.*-]+", word) and ("/" in word or word.endswith(".py")):
            found = [p for base in ("castfem", ".") for p in (ROOT / base).glob(word)]
            found = found or list((ROOT / "castfem").rglob(word))
            assert found, f"{word}: there is no such file"
            files += found
        elif re.fullmatch(r"@?[A-Za-z_][\w.]*", word):
            names.append(word)
    return files, names


def test_what_a_line_names_is_there() -> None:
    """Each file exists, and one of those in its line has each identifier."""
    lines = [x for x in PAGE.splitlines() if "`" in x]
    assert len(lines) > 20
    for line in lines:
        files, names = named(line)
        texts = [p.read_text(encoding="utf-8") for p in files if p.suffix == ".py"]
        text = "\n".join(texts) or ENGINE
        for name in names:
            if name.startswith("castfem."):
                continue
            assert re.search(rf"\b{name.split('.')[-1].lstrip('@')}\b", text), (name, line)
