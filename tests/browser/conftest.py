"""A browser that tools/browser.sh has started (`make test-browser`); left out without it."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from playwright.sync_api import Browser

collect_ignore_glob = [] if "CASTFEM_BROWSER" in os.environ else ["test_*.py"]


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        port = os.environ["CASTFEM_BROWSER"]
        found = playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{port}")
        yield found
        found.close()
