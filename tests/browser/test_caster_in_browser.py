"""The page of a caster in a real browser: its slider moves all parts, nothing is loaded."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import html5lib
import pytest
from rolled_case import rolled

from castfem.cli import execute

if TYPE_CHECKING:
    from playwright.sync_api import Page

PLANT = {
    "time": ["0 s", "10 s", "11 s", "40 s"],
    "speed": ["1.5 m/min", "1.5 m/min", "0.9 m/min", "0.9 m/min"],
    "event": ["", "slower", "", ""],
}


@pytest.fixture(scope="session")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the page of a small slab."""
    home = tmp_path_factory.mktemp("caster")
    case = rolled(caster={"plant": PLANT, "spacing": "0.2 m", "every": "5 s"})
    (home / "case.toml").write_text(case.resolved_toml())
    folder = home / "out"
    assert execute(["caster", str(home / "case.toml"), "-q", "-o", str(folder)]) == 0
    assert execute(["report", str(folder)]) == 0
    return folder / "report.html"


def test_page_is_valid_html(file: Path) -> None:
    html5lib.HTMLParser(strict=True).parse(file.read_bytes())


def test_slider_moves_curves_and_strand(page: Page) -> None:
    known = json.loads(str(page.locator("#strand").text_content()))
    slider = page.locator("#clock")
    curve = page.locator("figure.chart path").first
    pieces = page.locator("#side polygon")
    curves, colours = [], []
    for i in range(len(known["instants"])):
        slider.fill(str(i))
        assert page.locator("#head").inner_text() == known["heads"][i]
        curves.append(curve.get_attribute("d"))
        colours.append(pieces.evaluate_all("all => all.map(p => p.getAttribute('fill')).join()"))
    assert len(set(curves)) == len(curves) and len(set(colours)) == len(colours)
    assert "slower" in known["heads"][2]
    before = colours[-1]
    page.locator("#shown").select_option(index=page.locator("#shown option").count() - 2)
    now = pieces.evaluate_all("all => all.map(p => p.getAttribute('fill')).join()")
    assert now != before
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, "the page is wider than its window"
