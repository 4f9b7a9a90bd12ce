"""The report page in a browser: slider, pointer, print; no error, valid HTML, a small file."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import TYPE_CHECKING

import html5lib
import pytest

from castfem.cli import execute
from castfem.post.html.page import LARGEST
from castfem.runs.output.fields import Fields
from castfem.runs.output.folder import OutputFolder

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

BILLET = ("billet125/taper_1", "--accuracy", "coarse", "--set", "casting.length=120 mm")
SHORT = ("--set", "casting.length=2 m", "--set", "output.every=10 s")
SLAB = ("slab1200/slab", "--accuracy", "coarse", *SHORT)
RUNS = {
    "billet": BILLET,
    "fast": (*BILLET, "--set", "casting.speed=4 m/min"),
    "slab": SLAB,
}
PAGES = {"one": ("billet",), "two": ("billet", "fast"), "slab": ("slab",)}
HEADINGS = {
    "one": (
        "Headline numbers",
        "Remarks",
        "The section along the strand",
        "Curves along the strand",
    ),
    "two": ("Headline numbers", "Differences between the cases", "The section along the strand"),
    "slab": ("Headline numbers", "The section along the strand", "Pictures of the strand"),
}


@pytest.fixture(scope="session")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folders of the runs, coarse and short."""
    home = tmp_path_factory.mktemp("runs")
    for name, words in RUNS.items():
        assert execute(["run", *words, "-q", "-o", str(home / name)]) == 0
    return home


@pytest.fixture(scope="session", params=PAGES)
def file(request: pytest.FixtureRequest, runs: Path) -> Path:
    target = runs / f"{request.param}.html"
    folders = [str(runs / name) for name in PAGES[request.param]]
    assert execute(["report", *folders, "-o", str(target)]) == 0
    return target


def test_page_is_valid_html_and_small(file: Path) -> None:
    html5lib.HTMLParser(strict=True).parse(file.read_bytes())
    assert file.stat().st_size < LARGEST


def test_all_parts_exist(page: Page, file: Path) -> None:
    headings = page.locator("h2").all_inner_texts()
    assert [h for h in HEADINGS[file.stem] if h not in headings] == []
    assert page.locator("img").evaluate_all("all => all.every(i => i.naturalWidth > 100)")
    for link in page.locator("nav a").all():
        link.click()
        top = page.locator(str(link.get_attribute("href"))).bounding_box()
        assert top is not None and top["y"] < 900
    wide = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert wide <= 0, "the page is wider than its window"


def test_slider_moves_the_section(page: Page, file: Path, runs: Path) -> None:
    """Each place has its own colours, and the numbers at the pointer are those of the fields."""
    figure = page.locator("figure.slice").first
    cells = figure.locator("defs polygon")
    slider = figure.locator("input[type=range]")
    places = int(str(slider.get_attribute("max"))) + 1
    assert places > 3
    known = json.loads(str(page.locator(f"#{figure.get_attribute('data-slice')}").text_content()))
    seen = []
    for place in range(places):
        slider.fill(str(place))
        shown = figure.locator("output").inner_text()
        assert shown == known["places"][place]
        seen.append(cells.evaluate_all("all => all.map(c => c.getAttribute('fill')).join()"))
    assert len(set(seen)) > places // 2
    box = figure.locator("svg[role]").bounding_box()
    pointed = figure.locator(".pointed")
    mouse = page.mouse
    mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
    found = re.fullmatch(r"temperature (\d+(\.\d+)?) °C", pointed.inner_text())
    assert found is not None, pointed.inner_text()
    with Fields(runs / PAGES[file.stem][0]) as fields:
        middle = fields.values("temperature", -1).max() - 273.15
    assert float(found[1]) == pytest.approx(middle, abs=3.0)  # a mean over a cell, in 4 digits
    names = figure.locator("select option").all_inner_texts()
    figure.locator("select").select_option(label=names[-1])
    mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.51 * box["height"])
    assert pointed.inner_text().startswith(names[-1])


def test_pointer_reads_the_curves(page: Page, file: Path) -> None:
    charts = page.locator("figure.chart")
    assert charts.count() > 4
    for chart in (charts.first, charts.nth(charts.count() - 1)):
        drawing = chart.locator("svg[role]")
        drawing.scroll_into_view_if_needed()
        drawing.hover(position={"x": 400, "y": 100})
        at = re.fullmatch(r"at (\d+) mm", chart.locator(".at").inner_text())
        assert at is not None and int(at[1]) > 0
        values = chart.locator(".value").all_inner_texts()
        data = json.loads(str(page.locator(f"#{chart.get_attribute('data-chart')}").text_content()))
        assert len(values) == len(data["curves"])
        for value, curve in zip(values, data["curves"], strict=True):
            numbers = [y for y in curve["y"] if y is not None]
            slack = 1e-3 * max(map(abs, numbers))
            assert value == "-" or min(numbers) - slack <= float(value) <= max(numbers) + slack
        assert chart.locator(".cursor").get_attribute("visibility") == "visible"
        page.mouse.move(2, 2)
        assert chart.locator(".cursor").get_attribute("visibility") == "hidden"


def test_page_prints(page: Page, file: Path) -> None:
    """On A4, without controls, and nothing cut off on the right."""
    page.emulate_media(media="print")
    for control in page.locator(".controls input, .controls select, nav").all():
        assert not control.is_visible()
    page.set_viewport_size({"width": 720, "height": 1000})  # A4 within its margins
    assert page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0
    printed = page.pdf(format="A4", margin={"top": "10mm", "left": "10mm", "right": "10mm"})
    file.with_suffix(".pdf").write_bytes(printed)
    sheets = len(re.findall(rb"/Type\s*/Page\b", printed))
    assert printed.startswith(b"%PDF") and 2 <= sheets <= 40


def test_page_of_an_active_run_reloads_until_its_end(
    browser: Browser, runs: Path, tmp_path: Path
) -> None:
    """`castfem watch --html`: the browser loads new versions, and stops after the last."""
    import shutil

    from castfem.post.watch.show import Page as Written
    from castfem.post.watch.status import Watcher

    folder = tmp_path / "run"
    shutil.copytree(runs / "billet", folder)
    whole = (folder / "history.csv").read_text().splitlines(keepends=True)
    work = OutputFolder(folder)
    work.begin((folder / "case.toml").read_text())
    (folder / "history.csv").write_text("".join(whole[:4]))
    watcher, written = Watcher(folder), Written(folder, tmp_path / "page.html", 1.0)
    written.write_run(watcher.status())
    context = browser.new_context()
    page = context.new_page()
    page.goto(written.target.as_uri())
    bar = page.locator("#work progress")
    before = float(str(bar.get_attribute("value")))
    (folder / "history.csv").write_text("".join(whole[:-2]))
    written._next = 0.0
    written.write_run(watcher.status())
    page.wait_for_function(
        "before => Number(document.querySelector('#work progress').value) > before", arg=before
    )
    (folder / "history.csv").write_text("".join(whole))
    shutil.copy(runs / "billet" / "summary.json", folder)
    work.finish()
    work.close()
    written.write_run(watcher.status())
    page.wait_for_function("document.querySelector('#work') === null")
    page.evaluate("window.mine = true")
    page.wait_for_timeout(2500)
    assert page.evaluate("window.mine") is True  # it has not been reloaded
    context.close()
