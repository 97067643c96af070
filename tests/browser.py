"""Pages of results in a browser without window; modules of tests that import this skip without playwright."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
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
THEMES = ("light", "dark")
MOST_HIGH_PX = 13_000
"""A page of results is no longer than this on a phone, however many runs it is of."""


def comes_true(page: Any, condition: Callable[[], bool]) -> bool:
    """Whether a condition holds within 20 s; the page's own policy forbids what playwright would ask it."""
    for _ in range(400):
        if condition():
            return True
        page.wait_for_timeout(50)
    return False


_CONTRAST = """() => {
  // WCAG 2.2: relative luminance and contrast ratio; 4.5 for text, 3 for large text (24 px, 18.66 px bold)
  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  const rgba = (colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    const [r, g, b, a] = canvas.getImageData(0, 0, 1, 1).data;
    return [r, g, b, a / 255];
  };
  const over = (top, below) => [0, 1, 2].map((k) => top[k] * top[3] + below[k] * (1 - top[3]));
  const luminance = (colour) => {
    const [r, g, b] = colour
      .map((c) => c / 255)
      .map((c) => (c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const behind = (element) => {
    const layers = [];
    for (let at = element; at; at = at.parentElement) {
      const colour = rgba(getComputedStyle(at).backgroundColor);
      if (colour[3] > 0) layers.push(colour);
      if (colour[3] === 1) break;
    }
    const base = matchMedia("(prefers-color-scheme: dark)").matches ? [18, 18, 18] : [255, 255, 255];
    return layers.reverse().reduce((below, top) => over(top, below), base);
  };
  const faults = [];
  let checked = 0;
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const element = node.parentElement, text = node.textContent.trim();
    const left = "script, style, noscript, .js-plotly-plot, option";
    if (!text || element.closest(left) || !element.checkVisibility()) continue;
    const style = getComputedStyle(element), size = parseFloat(style.fontSize);
    const ground = behind(element), colour = element.closest("svg") ? style.fill : style.color;
    const light = luminance(over(rgba(colour), ground)), dark = luminance(ground);
    const ratio = (Math.max(light, dark) + 0.05) / (Math.min(light, dark) + 0.05);
    const isLarge = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 700);
    checked += 1;
    if (ratio < (isLarge ? 3 : 4.5)) faults.push(`${ratio.toFixed(2)}: ${text.slice(0, 40)}`);
  }
  return [checked, faults];
}"""


def contrast_faults(page: Any) -> list[str]:
    """Texts of a page with less contrast than WCAG's level AA asks for, with the ratio.

    Texts in Plotly's charts are left out.
    """
    checked, faults = page.evaluate(_CONTRAST)
    assert checked > 0
    return list(faults)


def tab_stops(page: Any) -> list[str]:
    """What the tabulator key comes to, from the top to where it leaves the page, each with its outline.

    Returns:
        Tag, id or text of each, and `outline` or `no outline`.
    """
    page.evaluate("() => { document.activeElement.blur(); scrollTo(0, 0); }")
    stops = []
    for _ in range(3000):
        page.keyboard.press("Tab")
        stop = page.evaluate(
            "() => { const e = document.activeElement; if (!e || e === document.body) return null;"
            "const s = getComputedStyle(e);"
            "const seen = parseFloat(s.outlineWidth) >= 2 && s.outlineStyle !== 'none';"
            "const name = e.id || e.textContent.trim().slice(0, 30);"
            "return `${e.tagName} ${name}: ${seen ? '' : 'no '}outline`; }"
        )
        if stop is None:
            return stops
        stops.append(stop)
    raise AssertionError(f"the keyboard does not leave the page; last it was at {stops[-3:]}")


@contextmanager
def opened(
    report: Path, width: str, theme: str = "light", at: str = "", ready: str = "body[data-ready=true]"
) -> Iterator[Any]:
    """A page, loaded; in the end nothing may be on the console or asked of the network.

    Args:
        report: the file.
        width: a name from `WIDTHS`.
        theme: one of `THEMES`.
        at: what follows the file in its address, such as `#run=NAME`.
        ready: what is there when the page is.
    """
    assert CHROMIUM is not None, "no chromium on the PATH, and SMARTMOT_BROWSER is 'required'"
    width_px, height_px = WIDTHS[width]
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": width_px, "height": height_px}, color_scheme=theme)
        console: list[str] = []
        urls: list[str] = []
        page.on("console", lambda message: console.append(message.text))
        page.on("pageerror", lambda error: console.append(str(error)))
        page.on("request", lambda request: urls.append(request.url))
        page.goto(report.as_uri() + at)
        page.wait_for_selector(ready, timeout=60_000)
        yield page
        browser.close()
    assert console == []
    assert [url for url in urls if not url.startswith(("file:", "blob:", "data:"))] == []
