"""Files, tests, benchmarks, commands and their options that a page names are there."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from benchmarks.__main__ import BENCHMARKS

ROOT = Path(__file__).parents[2]
PAGES = [*sorted((ROOT / "docs").rglob("*.md")), ROOT / "README.md"]
PLACES = ("castfem", "tests", "forms", "meshes", "docs", "cases", "benchmarks", "tools")
PATH = re.compile(rf"`((?:{'|'.join(PLACES)})/[\w./*-]+)`")
SHIPPED = re.compile(r"`((?:billet125|slab1200|copper200|tensile|verification)/\w+)`")
COMMAND = re.compile(r"castfem ([a-z]+)((?: [^`\n#|]*)?)")
SECTION = re.compile(r"^## castfem (\w+)\n(.*?)(?=^## |\Z)", re.MULTILINE | re.DOTALL)


@cache
def options() -> dict[str, set[str]]:
    """Options of each command, by the page made of the commands themselves."""
    text = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    return {
        name: {"-h", "--help", *re.findall(r"`(--?[a-zA-Z][\w-]*)`", body)}
        for name, body in SECTION.findall(text)
    }


def missing(text: str) -> list[str]:
    """What a text names that is not there."""
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
        # A key outside of an option would be taken for a case.
        keys = [word for word in words if re.match(r"[a-z_]+\.[\w.]+=", word)]
        before = dict(zip(words[1:], words, strict=False))
        found += [f"castfem {command} {key}" for key in keys if before.get(key) not in given]
    names = re.findall(r"python -m benchmarks (\w+)", text)
    more = {"NAME", "tables", "reference", "makes", "writes"}
    return found + [name for name in names if name not in BENCHMARKS and name not in more]


def test_what_a_page_names_is_there() -> None:
    texts = {page: page.read_text(encoding="utf-8") for page in PAGES}
    assert not {page: found for page, text in texts.items() if (found := missing(text))}


def test_what_is_not_there_is_found() -> None:
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
