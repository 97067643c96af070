"""Pages of comparisons and of `diff` in a browser without window: legible, short, and for the keyboard."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path
from typing import Any

import pytest

from evaluation.cli import main
from evaluation.studies.comparison_page.page import write_comparison_page
from tests.browser import (
    MOST_HIGH_PX,
    THEMES,
    WIDTHS,
    comes_true,
    contrast_faults,
    needs_browser,
    opened,
    tab_stops,
)

pytestmark = needs_browser
REPORTS = Path(__file__).parents[4] / "reports"
NAMES = ("frontier_physical", "gain", "drives/kitti", "logged", "diff")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory, logged: Path) -> dict[str, Path]:
    """Of 55 scenes and 13 sides, of a study with 10,800 runs, of drives, of runs with replays, of a diff."""
    folder = tmp_path_factory.mktemp("pages")
    made = {}
    for name in ("frontier_physical", "gain", "drives/kitti"):
        made[name], _ = write_comparison_page(REPORTS / name, folder / f"{Path(name).name}.html")
    made["logged"], _ = write_comparison_page(logged)
    both = (str(REPORTS / name) for name in ("frontier_physical", "frontier_paper"))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", "diff", *both, "--quiet", "--out", str(folder / "diff")])
        with pytest.raises(SystemExit):
            main()
    made["diff"] = folder / "diff" / "diff.html"
    return made


@pytest.mark.parametrize("name", NAMES)
def test_pages_are_legible_short_and_for_the_keyboard(pages: dict[str, Path], name: str) -> None:
    """Loaded anew for each width and theme, in one browser."""
    ready = "main" if name == "diff" else "body[data-ready]"
    with opened(pages[name], "desktop", ready=ready) as page:
        for width, theme in itertools.product(WIDTHS, THEMES):
            width_px, height_px = WIDTHS[width]
            page.set_viewport_size({"width": width_px, "height": height_px})
            page.emulate_media(color_scheme=theme)
            page.reload()
            page.wait_for_selector(ready, timeout=60_000)
            inner, wide, high = page.evaluate(
                "[innerWidth, document.documentElement.scrollWidth, document.documentElement.scrollHeight]"
            )
            assert inner == width_px
            assert wide <= inner, (width, theme)
            assert high < MOST_HIGH_PX, (width, theme)
            stops = tab_stops(page)
            assert stops
            assert [stop for stop in stops if "no outline" in stop] == [], (width, theme)
            page.evaluate("document.querySelectorAll('details').forEach((e) => { e.open = true; })")
            assert contrast_faults(page) == [], (width, theme)


@pytest.mark.parametrize("width", WIDTHS)
def test_a_point_opens_its_runs_and_a_run_its_replay(pages: dict[str, Path], width: str) -> None:
    def runs_seen(page: Any) -> bool:
        return bool(page.locator("#point-2").is_visible())

    with opened(pages["logged"], width) as page:
        assert not runs_seen(page)
        page.locator("svg.points a[href='#point-2']").first.focus()
        page.keyboard.press("Enter")
        assert comes_true(page, lambda: runs_seen(page))
        watch = page.locator("#point-2 button[data-log]").first
        log = watch.get_attribute("data-log")
        watch.click()
        page.wait_for_selector(f"body[data-run='{log}']")
        assert page.locator("#run").input_value() == log
        moment = page.locator("#moment").get_attribute("href")
    with opened(pages["logged"], width, at=str(moment)) as page:
        assert page.locator("body").get_attribute("data-run") == log
    with opened(pages["logged"], width, at="#point-2") as page:
        assert comes_true(page, lambda: runs_seen(page))
