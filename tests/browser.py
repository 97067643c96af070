"""Pages of results in a browser without window; modules of tests that import this skip without playwright."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

REQUIRED = os.environ.get("SMARTMOT_BROWSER") == "required"
"""In the checks of a change these tests must run; elsewhere they skip where there is no browser."""
if REQUIRED:
    from playwright import sync_api
else:
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
needs_browser = pytest.mark.skipif(
    CHROMIUM is None and not REQUIRED, reason="no chromium on the PATH: no browser tests"
)

WIDTHS = {"phone": (390, 844), "desktop": (1280, 900)}
PICTURE = "document.getElementById('scene').toDataURL()"
"""The drawn scene of a page, as text."""


@contextmanager
def opened(report: Path, width: str) -> Iterator[Any]:
    """A page, loaded; in the end nothing may be on the console or asked of the network.

    Args:
        report: the file.
        width: a name from `WIDTHS`.
    """
    assert CHROMIUM is not None, "no chromium on the PATH, and SMARTMOT_BROWSER is 'required'"
    width_px, height_px = WIDTHS[width]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width_px, "height": height_px})
        console: list[str] = []
        urls: list[str] = []
        page.on("console", lambda message: console.append(message.text))
        page.on("pageerror", lambda error: console.append(str(error)))
        page.on("request", lambda request: urls.append(request.url))
        page.goto(report.as_uri())
        page.wait_for_selector("body[data-ready=true]", timeout=60_000)
        yield page
        browser.close()
    assert console == []
    assert [url for url in urls if not url.startswith(("file:", "blob:", "data:"))] == []
