"""The page by day and by night, and links to a run and a time, in a browser without window."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.browser import THEMES, WIDTHS, comes_true, contrast_faults, needs_browser, opened

pytestmark = needs_browser


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_texts_are_legible_by_day_and_night(report: Path, width: str, theme: str) -> None:
    with opened(report, width, theme) as page:
        assert contrast_faults(page) == []
        ground = page.evaluate("getComputedStyle(document.body).backgroundColor")
        assert (ground == "rgb(255, 255, 255)") == (theme == "light")


def test_a_link_opens_a_run_at_its_time(report: Path) -> None:
    with opened(report, "phone") as page:
        options = page.locator("#run option").evaluate_all("(all) => all.map((one) => one.value)")
        other = next(name for name in options if name != page.locator("#run").input_value())
    with opened(report, "phone", at=f"#run={other}&t=3.4") as page:
        assert page.locator("body").get_attribute("data-run") == other
        assert page.locator("#clock").inner_text() == "3.40 s"
        assert page.evaluate("document.getElementById('replay').getBoundingClientRect().top < innerHeight")
        # the link of each moment is one of this kind, and a link on an open page moves it
        page.locator("#forward").click()
        assert page.locator("#moment").get_attribute("href") == f"#run={other}&t=3.45"
        page.evaluate("location.hash = '#run=' + document.getElementById('run').options[0].value + '&t=1'")
        assert comes_true(page, lambda: page.locator("#clock").inner_text() == "1.00 s")


@pytest.mark.parametrize("at", ["#run=none_such&t=1", "#replay", "#run=", "#t=3"])
def test_a_link_to_what_is_not_there_opens_the_page_as_ever(report: Path, at: str) -> None:
    with opened(report, "desktop", at=at) as page:
        assert page.locator("body").get_attribute("data-run") == page.locator("#run").input_value()
        named = "The link is to the run none_such, whose replay is not in this page."
        assert (page.locator("#finding").inner_text() == named) == ("none_such" in at)
