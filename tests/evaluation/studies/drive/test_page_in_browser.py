"""The page of drives in a browser without window: it opens, its matrix leads to drives, its replay moves."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from evaluation.cli.entry import main
from tests.browser import PICTURE, WIDTHS, needs_browser, opened
from tests.evaluation.studies.drive.conftest import written

pytestmark = needs_browser


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two recordings: in one a person is driven over, in the other nobody is where the detector sees one."""
    root = tmp_path_factory.mktemp("drives")
    written(root / "data" / "there", [(50.0, 0.0)], seconds=6.0)
    ghost = written(root / "data" / "ghost", [(50.0, 0.0)], seconds=8.0)
    labels = (ghost / "labels.csv").read_text().splitlines()
    (ghost / "labels.csv").write_text(
        "\n".join([labels[0], *(row.replace(",0.0,", ",40.0,") for row in labels[1:])])
    )
    words = ("drive", root / "data", "--out", root / "out", "--strategy", "path,all", "--preset", "physical")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, words), "--quiet"])
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code
    return root / "out" / "report.html"


@pytest.fixture(scope="module", params=list(WIDTHS))
def page(report: Path, request: pytest.FixtureRequest) -> Iterator[Any]:
    """The page, loaded once per width."""
    with opened(report, request.param) as page:
        yield page


def test_verdicts_and_exposure_are_there(page: Any) -> None:
    text = page.locator("main").inner_text()
    for said in ("1 of 2 requests false activations, 1 undecided", "on 0.14 km", "pedestrian"):
        assert said in text
    assert page.locator(".matrix tbody tr").count() == 2
    assert page.locator(".matrix button").count() == 4


def test_nothing_sticks_out_sideways(page: Any) -> None:
    inner, wide = page.evaluate("[innerWidth, document.documentElement.scrollWidth]")
    assert wide <= inner


def test_a_place_of_the_matrix_leads_to_its_drive(page: Any) -> None:
    for button in (page.locator(".matrix button").first, page.locator(".matrix button").last):
        button.click()
        page.wait_for_selector(f"body[data-run='{button.get_attribute('data-log')}']")
        assert button.get_attribute("aria-current") == "true"


def test_the_replay_moves_and_says_what_is_requested(page: Any) -> None:
    log = next(
        log
        for log in page.locator(".matrix button").evaluate_all("(all) => all.map((b) => b.dataset.log)")
        if "there" in log
    )
    page.locator(f".matrix button[data-log='{log}']").click()
    page.wait_for_selector(f"body[data-run='{log}']")
    slider, seen, told = page.locator("#slider"), set(), []
    last = int(slider.get_attribute("max"))
    assert last == 60
    for at in (0, 30, 45, last):
        slider.evaluate("(s, at) => { s.value = at; s.dispatchEvent(new Event('input')); }", at)
        assert int(page.locator("#scene").get_attribute("data-frame")) == at
        seen.add(page.evaluate(PICTURE))
        told.append(page.locator("#story").inner_text())
    assert len(seen) == 4
    assert told[0] == "Drives as recorded; nothing is requested."
    assert any(text.startswith("Emergency brake requested at t = ") for text in told)
