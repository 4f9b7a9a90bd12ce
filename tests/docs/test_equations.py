"""Equations of the manual: as mathematics, in a form that a forge and Sphinx both draw.

How they look when they are drawn is a matter of tests/browser/test_manual.py.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.rglob("*.md")), ROOT / "README.md"]
FENCE = re.compile(r"^( *)(`{3,})(.*?)\n(.*?)^\1\2$", re.MULTILINE | re.DOTALL)
INLINE = re.compile(r"(?<![\\$])\$(?!\s)([^$\n]+?)(?<!\s)\$(?![\d$])")
ENVIRONMENT = re.compile(r"\\(begin|end)\{(\w+\*?)\}")


def indented(text: str) -> Iterator[str]:
    """First lines of blocks that Markdown takes for code by their indentation, outside of lists."""
    listed = False
    for before, line in itertools.pairwise(["", *text.splitlines()]):
        if line and not line[0].isspace():
            listed = bool(re.match(r"[-*] |\d+\. ", line))
        elif line.startswith("    ") and not before.strip() and not listed:
            yield line.strip()


def faults(text: str) -> list[str]:
    """What of the equations of a page would be drawn wrong, or not at all."""
    found = []
    equations = [body for _, _, kind, body in FENCE.findall(text) if kind == "math"]
    prose = re.sub(r"(`+)(?!`).*?(?<!`)\1(?!`)", "", FENCE.sub("", text))
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
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    assert not {page: found for page, text in texts.items() if (found := faults(text))}


def test_pages_of_the_theory_have_equations() -> None:
    numbered = "\n".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert {"23", "24", "37", "38", "94", "163", "239", "273", "300", "329"} <= set(
        re.findall(r"^ *\\tag\{(\d+)\}$", numbered, re.MULTILINE)
    )


def test_what_is_wrong_is_found() -> None:
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
