"""The manual (`make docs`) in a browser: equations are drawn, on screen and paper, offline."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

MANUAL = Path(__file__).parents[2] / "build" / "docs"
LOADED = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*?\b(?:src|href)=\"([^\"]+)\"")
DRAWN = "window.MathJax && MathJax.isReady && !MathJax.Hub.queue.pending"
STATE = """() => {
  const text = document.querySelector("article").cloneNode(true);
  text.querySelectorAll("pre, code, script, .MathJax_SVG").forEach(e => e.remove());
  const edge = document.querySelector("article").getBoundingClientRect().right;
  const drawn = [...document.querySelectorAll(".math")].map(e => {
    const box = e.querySelector("svg")?.getBoundingClientRect();
    if (!box) return null;
    const cut = e.closest("table") ? 0 : box.right - edge;
    return [box.width, box.height, cut];
  });
  const wrong = [...document.querySelectorAll("[data-mathml]")].map(e => e.dataset.mathml);
  return { text: text.textContent, drawn, wrong: wrong.filter(m => m.includes("<merror")) };
}"""

BROKEN = r"""() => new Promise(done => {
  const added = document.createElement("p");
  added.className = "math";
  added.textContent = "\\(\\frac{a}{b\\)";
  document.querySelector("article").append(added);
  MathJax.Hub.Queue(["Typeset", MathJax.Hub, added], done);
})"""


def pages(word: str = "") -> list[Path]:
    """Return the pages of the manual that contain a word."""
    found = sorted(MANUAL.rglob("*.html"))
    assert found, "there is no manual: make docs"
    found = [page for page in found if "_static" not in page.parts]
    return [page for page in found if word in page.read_text(encoding="utf-8")]


@pytest.fixture(scope="module")
def page(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport={"width": 1200, "height": 900}, offline=True)
    yield context.new_page()
    context.close()


def test_everything_is_loaded_from_the_manual() -> None:
    """No script, style, font or picture of a page is remote; all files exist."""
    for page in pages():
        for target in LOADED.findall(page.read_text(encoding="utf-8")):
            assert "//" not in target, (page.name, target)
            assert target[0] in "#d" or (page.parent / re.split("[?#]", target)[0]).exists()


def test_equations_are_drawn(page: Page) -> None:
    """Each formula is a drawing, also in print; none is in error, none is left as TeX."""
    errors: list[str] = []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("requestfailed", lambda request: errors.append(request.url))
    with_equations = pages('class="math')
    assert len(with_equations) > 10
    assert pages("MathJax.js") == with_equations
    for file in with_equations:
        for media, width in (("screen", 1200), ("print", 720)):  # a sheet of A4 less its margins
            page.emulate_media(media=media)
            page.set_viewport_size({"width": width, "height": 900})
            if media == "screen":
                page.goto(file.as_uri())
                page.wait_for_function(DRAWN)
            state = page.evaluate(STATE)
            assert not state["wrong"], file.name
            assert all(box and min(box[:2]) > 2.0 for box in state["drawn"]), (file.name, media)
            assert all(box[2] < 1.0 for box in state["drawn"]), f"{file.name}: cut off in {media}"
            assert not re.findall(r"\\\w+|\$\$|\\\[", state["text"]), file.name
            wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
            assert wide <= 0, f"{file.name} is wider than its window"
    page.evaluate(BROKEN)
    assert len(page.evaluate(STATE)["wrong"]) == 1, "a formula in error is not found"
    assert not errors
