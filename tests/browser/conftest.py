"""A browser started by tools/browser.sh (`make test-browser`); excluded without it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

collect_ignore_glob = [] if "CASTFEM_BROWSER" in os.environ else ["test_*.py"]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        port = os.environ["CASTFEM_BROWSER"]
        found = playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{port}")
        yield found
        found.close()


@pytest.fixture
def page(browser: Browser, file: Path) -> Iterator[Page]:
    """Open the page; its console must have no errors, and it must load nothing else."""
    context = browser.new_context(viewport={"width": 1100, "height": 900})
    found = context.new_page()
    wrong: list[str] = []
    fetched: list[str] = []
    found.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    found.on("pageerror", lambda error: wrong.append(str(error)))
    found.on("request", lambda request: fetched.append(request.url))
    found.goto(file.as_uri())
    yield found
    context.close()
    assert not wrong
    assert [url for url in fetched if not url.startswith("data:")] == [file.as_uri()]
