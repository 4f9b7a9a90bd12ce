"""The manual's pages: each is in one table of contents, and each link in them leads somewhere.

It needs no Sphinx: anchors are those of a forge, and `docs/conf.py` has Sphinx make the same.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
DATA = DOCS / "data" / "README.md"  # beside the manual, not of it
PAGES = sorted(set(DOCS.rglob("*.md")) - {DATA})
OTHERS = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + [DATA]
FENCE = re.compile(r"^(`{3,})(.*?)\n(.*?)^\1`*[ ]*$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#{1,6} +(.+?)(?: +#+)?$", re.MULTILINE)
LINK = re.compile(r"(?<!\\)(!?)\[[^\]]*\]\(([^)\s]+)\)")


@cache
def prose(page: Path) -> str:
    """A page without its blocks of code."""
    return FENCE.sub("", page.read_text(encoding="utf-8"))


@cache
def anchors(page: Path) -> set[str]:
    """What a forge calls the headings of a page."""
    found, before = set[str](), Counter[str]()
    for title in HEADING.findall(prose(page)):
        plain = LINK.sub(lambda m: m[0][m[0].index("[") + 1 : m[0].index("]")], title)
        slug = re.sub(r"[^\w\- ]", "", plain.strip().lower()).replace(" ", "-")
        before[slug] += 1  # the second of a name gets -1, the third -2
        slug = f"{slug}-{before[slug] - 1}" if before[slug] > 1 else slug
        found.add(slug)
    return found


def links(page: Path) -> list[tuple[bool, str]]:
    """Whether it is a picture, and the target, of each link of a page."""
    text = re.sub(r"`[^`\n]+`", "", prose(page))
    return [(mark == "!", unquote(target)) for mark, target in LINK.findall(text)]


def broken(page: Path) -> list[str]:
    """The links of a page that lead nowhere."""
    found = []
    for _, target in links(page):
        if re.match(r"[a-z]+:", target):
            continue
        name, _, anchor = target.partition("#")
        file = (page.parent / name).resolve() if name else page
        inside = page not in PAGES or file.is_relative_to(DOCS)
        good = inside and file.exists() and file.is_relative_to(ROOT)
        if not good or (anchor and (file.suffix != ".md" or anchor not in anchors(file))):
            found.append(target)
    return found


def contents(page: Path) -> list[Path]:
    """The pages in the tables of contents of a page."""
    text = page.read_text(encoding="utf-8")
    bodies = [body for _, kind, body in FENCE.findall(text) if kind == "{toctree}"]
    names = [line.strip() for body in bodies for line in body.splitlines()]
    return [page.parent / f"{name}.md" for name in names if name and name[0] != ":"]


def test_links_lead_somewhere() -> None:
    """To a file, to a heading of it; from the manual to what lies within it."""
    assert not {page: found for page in (*PAGES, *OTHERS) if (found := broken(page))}


def test_each_page_stands_in_one_table_of_contents() -> None:
    """Of pages that are reached from the first one."""
    reached = [DOCS / "index.md"]
    for page in reached:
        reached += contents(page)
    assert sorted(reached) == PAGES


def test_each_picture_is_shown() -> None:
    shown = {
        (page.parent / target).resolve()
        for page in [*PAGES, ROOT / "README.md"]
        for picture, target in links(page)
        if picture
    }
    assert shown == set((DOCS / "figures").glob("*.png"))


def test_a_broken_link_and_a_lost_page_are_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROOT", "DOCS"):
        monkeypatch.setitem(globals(), name, tmp_path)
    page = tmp_path / "a.md"
    text = "# One\n## Two (2)\n## Two (2)\n[x](a.md#two-2) [x](#two-2-1) ![p](no.png) "
    code = "\n```\n[x](in_code.md)\n```\n`[x](in_code.md)`\n"
    page.write_text(f"{text}[x](a.md#three) [x](/etc/passwd){code}")
    assert anchors(page) == {"one", "two-2", "two-2-1"}
    assert broken(page) == ["no.png", "a.md#three", "/etc/passwd"]
    page.write_text("```{toctree}\n:hidden:\n\nb\n```\n")
    assert contents(page) == [tmp_path / "b.md"]
