"""The page in a browser without window: it loads, moves, listens to keys, and fits phone and desktop."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.browser import PICTURE, WIDTHS, comes_true, needs_browser, opened, tab_stops

pytestmark = needs_browser


@pytest.fixture(scope="module", params=list(WIDTHS))
def page(report: Path, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The page, loaded once per width."""
    with opened(report, request.param) as page:
        yield page


def frame(page: Any) -> int:
    return int(page.locator("#scene").get_attribute("data-frame"))


def test_nothing_sticks_out_sideways(page: Any) -> None:
    inner, wide = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    assert wide <= inner
    canvas = page.locator("#scene").bounding_box()
    assert canvas["width"] > 0.85 * min(inner, 1180)
    headings = page.locator(".matrix th").evaluate_all("(all) => all.map((one) => one.offsetHeight)")
    assert max(headings) < 100
    smallest = page.evaluate(
        "Math.min(...[...document.querySelectorAll('main p, main td, main th, main button')]"
        ".map((e) => parseFloat(getComputedStyle(e).fontSize)))"
    )
    assert smallest >= 12


def test_the_slider_moves_the_scene(page: Any) -> None:
    slider = page.locator("#slider")
    seen = set()
    for at in (0, 20, 60):
        slider.evaluate("(s, at) => { s.value = at; s.dispatchEvent(new Event('input')); }", at)
        assert frame(page) == at
        seen.add(page.evaluate(PICTURE))
        assert slider.get_attribute("aria-valuetext") == page.locator("#clock").inner_text()
    assert len(seen) == 3


def test_arrow_keys_step_and_space_plays_and_pauses(page: Any) -> None:
    page.locator("#scene").focus()
    page.keyboard.press("Home")
    assert frame(page) == 0
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowLeft")
    assert frame(page) == 1
    page.keyboard.press(" ")
    assert page.locator("#play").inner_text() == "Pause"
    assert comes_true(page, lambda: frame(page) > 4)
    page.keyboard.press(" ")
    assert page.locator("#play").inner_text() == "Play"
    stopped = frame(page)
    page.wait_for_timeout(200)
    assert frame(page) == stopped
    page.keyboard.press("End")
    assert frame(page) == int(page.locator("#slider").get_attribute("max"))


def test_arrow_keys_on_the_slider_step_one_frame(page: Any) -> None:
    page.locator("#slider").focus()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    assert frame(page) == 1


def test_another_run_can_be_chosen_and_says_what_happened(page: Any) -> None:
    before = page.evaluate(PICTURE)
    options = page.locator("#run option").evaluate_all("(all) => all.map((one) => one.value)")
    assert len(options) == 4
    other = next(name for name in options if name != page.locator("#run").input_value())
    page.locator("#run").select_option(other)
    page.wait_for_selector(f"body[data-run='{other}']")
    assert page.evaluate(PICTURE) != before
    assert page.locator("#finding").inner_text().endswith(".")
    assert "Emergency brake since" in page.locator("#story").inner_text()


def test_a_place_of_the_matrix_opens_its_run(page: Any) -> None:
    button = page.locator(".matrix button").last
    button.click()
    page.wait_for_selector(f"body[data-run='{button.get_attribute('data-log')}']")
    assert button.get_attribute("aria-current") == "true"


def test_an_event_moves_the_replay_there(page: Any) -> None:
    button = page.locator("#events button").first
    button.click()
    assert frame(page) == 0
    assert page.locator("#story").inner_text() == "Follows its lane."


def test_zoom_and_layers_change_the_picture(page: Any) -> None:
    seen = [page.evaluate(PICTURE)]
    page.locator("#closer").click()
    seen.append(page.evaluate(PICTURE))
    page.get_by_label("monitored area", exact=True).uncheck()
    seen.append(page.evaluate(PICTURE))
    assert len(set(seen)) == 3


def test_the_diagram_follows_the_replay(page: Any) -> None:
    page.locator("#scene").focus()
    page.keyboard.press("Home")
    page.keyboard.press("ArrowRight")
    cursor = "document.getElementById('diagram').layout.shapes[0].x0"
    assert comes_true(page, lambda: page.evaluate(cursor) == pytest.approx(0.05))


def test_buttons_can_be_hit_by_a_finger(page: Any) -> None:
    """WCAG 2.2, target size (minimum): 24 px."""
    boxes = page.locator("#replay button").evaluate_all(
        "(all) => all.map((one) => { const b = one.getBoundingClientRect(); return [b.width, b.height]; })"
    )
    assert boxes
    assert min(min(box) for box in boxes) >= 24


def test_the_keyboard_comes_to_everything_and_leaves_again(page: Any) -> None:
    stops = tab_stops(page)
    assert [stop for stop in stops if "no outline" in stop] == []
    buttons = page.locator("button:visible, select:visible, a[href]:visible").count()
    assert len(stops) >= buttons
