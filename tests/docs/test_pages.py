"""The pages: links, equations, names of the code, notebooks."""

from __future__ import annotations

import itertools
import re
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from urllib.parse import unquote

import matplotlib.pyplot as plt
import pytest

from benchmarks.__main__ import BENCHMARKS

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
DATA = DOCS / "data" / "README.md"  # not a page of the manual
PAGES = sorted(set(DOCS.rglob("*.md")) - {DATA})
OTHERS = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")] + [DATA]
FENCE = re.compile(r"^(`{3,})(.*?)\n(.*?)^\1`*[ ]*$", re.MULTILINE | re.DOTALL)
HEADING = re.compile(r"^#{1,6} +(.+?)(?: +#+)?$", re.MULTILINE)
LINK = re.compile(r"(?<!\\)(!?)\[[^\]]*\]\(([^)\s]+)\)")


@cache
def prose(page: Path) -> str:
    return FENCE.sub("", page.read_text(encoding="utf-8"))


@cache
def anchors(page: Path) -> set[str]:
    """Return the anchors that a forge gives the headings of a page."""
    found, before = set[str](), Counter[str]()
    for title in HEADING.findall(prose(page)):
        plain = LINK.sub(lambda m: m[0][m[0].index("[") + 1 : m[0].index("]")], title)
        slug = re.sub(r"[^\w\- ]", "", plain.strip().lower()).replace(" ", "-")
        before[slug] += 1  # the second of a name gets -1, the third -2
        slug = f"{slug}-{before[slug] - 1}" if before[slug] > 1 else slug
        found.add(slug)
    return found


def links(page: Path) -> list[tuple[bool, str]]:
    """Return for each link of a page whether it is a picture, and its target."""
    text = re.sub(r"`[^`\n]+`", "", prose(page))
    return [(mark == "!", unquote(target)) for mark, target in LINK.findall(text)]


def broken(page: Path) -> list[str]:
    """Return the links of a page without a target."""
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
    """Return the pages in the tables of contents of a page."""
    text = page.read_text(encoding="utf-8")
    bodies = [body for _, kind, body in FENCE.findall(text) if kind == "{toctree}"]
    names = [line.strip() for body in bodies for line in body.splitlines()]
    return [page.parent / f"{name}.md" for name in names if name and name[0] != ":"]


def test_links_have_targets() -> None:
    """A file, or a heading in it; links of the manual stay within it."""
    assert not {page: found for page in (*PAGES, *OTHERS) if (found := broken(page))}


def test_each_page_is_in_one_table_of_contents() -> None:
    """Of the pages that are reached from the first one."""
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


def test_broken_link_and_lost_page_are_found(
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


# Equations of the manual are written in a form that a forge and Sphinx both draw.
#
# tests/browser/test_manual.py tests their appearance.


EQUATION_PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md"]
EQUATION_FENCE = re.compile(r"^( *)(`{3,})(.*?)\n(.*?)^\1\2$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<![\\$])\$(?!\s)([^$\n]+?)(?<!\s)\$(?![\d$])")
ENVIRONMENT = re.compile(r"\\(begin|end)\{(\w+\*?)\}")


def indented(text: str) -> Iterator[str]:
    """Yield first lines of blocks that Markdown takes for code by indentation, outside lists."""
    listed = False
    for before, line in itertools.pairwise(["", *text.splitlines()]):
        if line and not line[0].isspace():
            listed = bool(re.match(r"[-*] |\d+\. ", line))
        elif line.startswith("    ") and not before.strip() and not listed:
            yield line.strip()


def faults(text: str) -> list[str]:
    """Return the faults of equations of a page, which would be drawn wrong or not at all."""
    found = []
    equations = [body for _, _, kind, body in EQUATION_FENCE.findall(text) if kind == "math"]
    prose = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", EQUATION_FENCE.sub("", text))
    equations += INLINE.findall(prose)
    left = INLINE.sub("", prose)
    if "$" in left:
        found.append("a dollar sign that is part of no formula")
    found += [f"TeX outside of a formula: {tex}" for tex in re.findall(r"\\[a-zA-Z]+", left)]
    found += [f"an indented block, which is code: {line}" for line in indented(left)]
    found += [
        f"MyST leaves out a line that begins so: {line}"
        for line in re.findall(r"^ *%.*", prose, re.MULTILINE)
    ]
    for body in equations:
        if body.count("{") != body.count("}"):
            found.append(f"braces: {body}")
        begun, ended = (
            sorted(name for kind, name in ENVIRONMENT.findall(body) if kind == which)
            for which in ("begin", "end")
        )
        if begun != ended:
            found.append(f"environments: {body}")
        if re.search(r"\n\s*\n", body.strip("\n")):
            found.append(f"an empty line, which ends a formula of TeX: {body}")
        if len(re.findall(r"\\left\b", body)) != len(re.findall(r"\\right\b", body)):
            found.append(f"left and right: {body}")
        if not body.isascii():
            found.append(f"not TeX: {body}")
    return found


def test_equations_of_a_page_can_be_drawn() -> None:
    texts = {page: page.read_text(encoding="utf-8") for page in EQUATION_PAGES}
    assert not {page: found for page, text in texts.items() if (found := faults(text))}


def test_pages_of_the_theory_have_equations() -> None:
    numbered = "\n".join(page.read_text(encoding="utf-8") for page in EQUATION_PAGES)
    assert {"23", "24", "37", "38", "94", "163", "239", "273", "300", "329"} <= set(
        re.findall(r"^ *\\tag\{(\d+)\}$", numbered, re.MULTILINE)
    )


def test_faults_of_equations_are_found() -> None:
    good = "A $x^2$ and `$HOME`.\n\n```math\n\\frac{a}{b}\n\\tag{3}\n```\n\n* x\n\n  y\n"
    assert not faults(good)
    for bad in (
        "costs $5 more",
        "so \\frac{a}{b} is",
        "it obeys\n\n    dH/dt = q\n\nhere",
        "$\\frac{a}{b$",
        "$a ≤ b$",
        "```math\n\\begin{matrix} a\n```",
        "```math\na\n\nb\n```",
        "```math\n\\left( a )\n```",
        "$$a$$",
        "less by 5\n% of it",
    ):
        assert faults(bad), bad


# Files, tests, benchmarks, commands and their options that a page names exist


NAMED_PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
PLACES = ("castfem", "tests", "forms", "meshes", "docs", "cases", "benchmarks", "tools")
PATH = re.compile(rf"`((?:{'|'.join(PLACES)})/[\w./*-]+)`")
SHIPPED = re.compile(r"`((?:billet125|slab1200|copper200|tensile|verification)/\w+)`")
COMMAND = re.compile(r"castfem ([a-z]+)((?: [^`\n#|]*)?)")
SECTION = re.compile(r"^## castfem (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


@cache
def options() -> dict[str, set[str]]:
    """Return the options of each command, by the page made from the commands."""
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    return {
        name: {"-h", "--help", *re.findall(r"`(--?[a-zA-Z][\w-]*)`", body)}
        for name, body in SECTION.findall(text)
    }


def missing(text: str) -> list[str]:
    """Return names in a text of things that do not exist."""
    found = [path for path in PATH.findall(text) if not list(ROOT.glob(path))]
    shipped = SHIPPED.findall(text)
    found += [case for case in shipped if not (ROOT / "cases" / f"{case}.toml").exists()]
    for command, rest in COMMAND.findall(text.replace("\\\n", " ")):
        words = rest.split()
        known = options().get(command)
        if known is None:
            continue
        given = {word.split("=")[0] for word in words if re.match(r"--?[a-zA-Z]", word)}
        found += [f"castfem {command} {word}" for word in sorted(given - known)]
        # A key without an option would be taken for a case.
        keys = [word for word in words if re.match(r"[a-z_]+\.[\w.]+=", word)]
        before = dict(zip(words[1:], words, strict=False))
        found += [f"castfem {command} {key}" for key in keys if before.get(key) not in given]
    names = re.findall(r"python -m benchmarks (\w+)", text)
    more = {"NAME", "tables", "reference", "makes", "writes"}
    return found + [name for name in names if name not in BENCHMARKS and name not in more]


def test_names_on_pages_exist() -> None:
    texts = {page: page.read_text(encoding="utf-8") for page in NAMED_PAGES}
    assert not {page: found for page, text in texts.items() if (found := missing(text))}


def test_missing_names_are_found() -> None:
    assert len(options()) > 20
    good = (
        "`castfem run CASE --set casting.speed=2 -o x`, `tests/docs/test_*.py`, `billet125/thermal`"
    )
    assert not missing(good + ", `python -m benchmarks billet`")
    assert missing("`castfem run CASE --accurracy fine`") == ["castfem run --accurracy"]
    assert missing("`castfem sweep CASE casting.speed=2`") == ["castfem sweep casting.speed=2"]
    assert missing("`tests/docs/test_no.py`, `billet125/no`, `python -m benchmarks no`") == [
        "tests/docs/test_no.py",
        "billet125/no",
        "no",
    ]


# The notebooks of the manual run, block by block, and print the output below each block


NOTEBOOK_PAGES = sorted((Path(__file__).parents[2] / "docs" / "notebooks").glob("*.md"))
BLOCK = re.compile(r"^```python\n(.*?)^```\n(?:\n```text\n(.*?)^```\n)?", re.M | re.S)
NUMBER = re.compile(r"\d+(?:\.\d+)?")


def parts(text: str) -> tuple[list[str], list[float]]:
    """Return the words and the numbers of a text."""
    return NUMBER.sub("#", text).split(), [float(one) for one in NUMBER.findall(text)]


@pytest.mark.slow
@pytest.mark.parametrize("page", [page for page in NOTEBOOK_PAGES if page.stem != "index"], ids=str)
def test_notebook_prints_its_output(
    page: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = BLOCK.findall(page.read_text(encoding="utf-8"))
    assert sum(bool(shown) for _, shown in blocks) >= 1
    names: dict[str, object] = {"__name__": "notebook"}
    for number, (code, shown) in enumerate(blocks, start=1):
        exec(compile(code, f"{page.name}, block {number}", "exec"), names)
        (words, values), (theirs, expected) = parts(capsys.readouterr().out), parts(shown)
        assert words == theirs
        assert values == pytest.approx(expected, rel=0.02)  # versions of the libraries differ
    plt.close("all")
