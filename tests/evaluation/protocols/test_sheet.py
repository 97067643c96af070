"""Matrices in the terminal, as a picture and as a page."""

from __future__ import annotations

import io
import re
from itertools import pairwise
from pathlib import Path

import pytest
from lxml import html
from rich.console import Console

from evaluation.protocols import marks
from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.euroncap_2026.protocol import EuroNcap2026
from evaluation.protocols.grid import Cell, Lighting, Measurement
from evaluation.protocols.marks import MARKS, Mark
from evaluation.protocols.registry import PROTOCOLS, named_protocol
from evaluation.protocols.sheet import Sheet, make_sheet
from evaluation.views.matrix.html import matrix_page
from evaluation.views.matrix.matrix import matrix_view
from evaluation.views.matrix.png import matrix_figure
from evaluation.views.plots.strategies import strategy_colour
from tests.figures import text_faults

PROTOCOL = EuroNcap2026()
EVERY_MARK = [*MARKS.values(), *(value for value in vars(marks).values() if isinstance(value, Mark))]


def sheet() -> Sheet:
    """CPNA: a strategy that hits at 60 km/h and 25 % by day and misses a run, and one that avoids all."""
    clean = {cell: Measurement(0.0) for cell in PROTOCOL.cells("CPNA")}
    hit = {**clean, Cell("CPNA", 60.0, 25.0, 5.0): Measurement(23.82)}
    del hit[next(c for c in hit if (c.speed_kmh, c.impact_percent, c.lighting) == (40, 90, Lighting.NIGHT))]
    return make_sheet({"rectangular": PROTOCOL.assess(hit), "map & more": PROTOCOL.assess(clean)}, ["CPNA"])


def luminance(colour: str) -> float:
    """Relative luminance of WCAG 2.1."""
    channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
    return sum(w * c for w, c in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


@pytest.mark.parametrize("mark", EVERY_MARK, ids=lambda mark: mark.name)
def test_texts_stand_out_from_their_colour(mark: Mark) -> None:
    light, dark = sorted((luminance(mark.fill), luminance(mark.ink)), reverse=True)
    assert (light + 0.05) / (dark + 0.05) >= 4.5


def test_colours_of_the_protocol_differ_without_hue() -> None:
    assert len({mark.letter for mark in MARKS.values()}) == len(MARKS)
    grey = sorted(luminance(mark.fill) for mark in MARKS.values())
    steps = [(b + 0.05) / (a + 0.05) for a, b in pairwise(grey)]
    assert min(steps) > 1.2


def test_the_terminal_shows_every_number_letter_and_total() -> None:
    console = Console(width=140, file=io.StringIO(), color_system=None)
    console.print(matrix_view(sheet()))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "23.8 B" in text
    assert "(0 G)" in text  # extended
    assert text.count("CPNA night") >= 2
    assert "standard 0.4792 of 0.5" in text  # 1 of 18 brown by day: 0.5 * (17 + 0.25) / 18
    assert "standard 0.5 of 0.5" in text
    assert "B brown" in text
    assert "Lane Departure" in text


def test_numbers_stay_whole_in_a_narrow_terminal() -> None:
    """What a log of 80 characters shows: the longest labels wrap."""
    runs = {
        cell: Measurement(29.84) for cell in (*PROTOCOL.cells("CBNA"), *PROTOCOL.robustness_cells("CBNA"))
    }
    console = Console(width=80, file=io.StringIO(), color_system=None)
    console.print(matrix_view(make_sheet({"map": PROTOCOL.assess(runs)}, ())))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "…" not in text
    # red up to 40 km/h: 4 speeds at 75 and 50 % under three conditions that forbid red, and under two that
    # ask for no worse than without them, beside 4 speeds at 5 locations
    assert (text.count("29.8! R"), text.count("29.8 R")) == (4 * 2 * 3, 4 * 2 * 2 + 4 * 5)


def test_the_page_needs_no_network_and_holds_every_cell() -> None:
    page = matrix_page(sheet())
    assert not re.search(r"https?:|<script|<link|@import|src=|url\(", page)
    tree = html.fromstring(page)
    cells = tree.xpath("//tbody/tr/td")
    assert len(cells) == 2 * 2 * 30
    assert [c.text for c in cells].count("23.8 B") == 1
    assert len(tree.xpath("//td[@class='extended']")) == 2 * 2 * 12
    assert tree.xpath("//meta[@name='viewport']")
    assert tree.xpath("//h2/text()") == ["rectangular", "map & more"]
    assert "map &amp; more" in page


def test_the_picture_holds_every_cell_inside_itself() -> None:
    figure = matrix_figure(sheet())
    texts = [text.get_text() for axes in figure.axes for text in axes.texts]
    assert texts.count("23.8 B") == 1
    assert len([text for text in texts if re.fullmatch(r"[\d.]+ [GYOBR]", text)]) == 2 * 60 - 1
    assert "extended range" in texts
    assert "VUT (km/h)" in texts
    assert "impact location (%)" in texts
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    width, height = figure.canvas.get_width_height()
    for text in figure.axes[0].texts:
        box = text.get_window_extent(renderer)
        assert box.x0 >= 0, text
        assert box.x1 <= width, text
        assert box.y0 >= 0, text
        assert box.y1 <= height, text


@pytest.mark.parametrize("count", [1, 4])
@pytest.mark.parametrize("family", ["CPNA", "CBTA", "CBNAO", "CCRb"])
def test_texts_of_the_picture_keep_apart(family: str, count: int) -> None:
    """Whatever the names of strategies: those of plug-ins have 40 characters."""
    worst = {cell: Measurement(max(cell.speed_kmh - 0.1, 0.0)) for cell in PROTOCOL.cells(family)}
    names = [f"my_package.monitored.areas:variant_{k}_wide" for k in range(count)]
    scored = make_sheet({name: PROTOCOL.assess(worst) for name in names}, [family])
    assert text_faults(matrix_figure(scored)) == []


def test_a_strategy_has_its_colour_in_page_and_picture() -> None:
    names = ("rectangular", "map & more")
    page, figure = matrix_page(sheet()), matrix_figure(sheet())
    bars = [line.get_color() for axes in figure.axes for line in axes.get_lines()]
    assert bars == [strategy_colour(name) for name in names]
    assert re.findall(r"border-top:4px solid (#\w+)", page) == bars


def test_cell_texts_fit_their_cells() -> None:
    worst = {cell: Measurement(cell.speed_kmh - 0.1) for cell in PROTOCOL.cells("CCRb")}
    figure = matrix_figure(make_sheet({"all": PROTOCOL.assess(worst)}, ["CCRb"]))
    renderer = figure.canvas.get_renderer()  # type: ignore[attr-defined]
    cells = [text for text in figure.axes[0].texts if re.fullmatch(r"[\d.]+ R", text.get_text())]
    widest = max(text.get_window_extent(renderer).width for text in cells) / figure.dpi
    assert any(text.get_text() == "129.9 R" for text in cells)
    assert widest <= 0.52


def test_a_failed_requirement_is_said_everywhere() -> None:
    runs = {cell: Measurement(1.0) for cell in PROTOCOL.cells("CPNA")}
    failed = make_sheet({"all": PROTOCOL.assess(runs)}, ["CPNA"])
    console = Console(width=140, file=io.StringIO(), color_system=None)
    console.print(matrix_view(failed))
    picture = [text.get_text() for text in matrix_figure(failed).axes[0].texts]
    for said in (console.file.getvalue(), matrix_page(failed), " ".join(picture)):  # type: ignore[attr-defined]
        assert "CPNA-75 at 10 km/h is green by day" in said
        assert "CPNA 0 of 1.25 (else " in said


@pytest.mark.parametrize("name", PROTOCOLS)
def test_every_protocol_is_shown_with_what_it_leaves_out(name: str) -> None:
    protocol = named_protocol(name)
    scenario = "CPNA" if name != "fmvss127" else "Lead vehicle stopped"
    runs = {
        cell: Measurement(cell.speed_kmh / 2, warning_ttc_s=1.0, speed_reduction_kmh=20.0)
        for cell in protocol.cells(scenario)
    }
    shown = make_sheet({"map": protocol.assess(runs)})
    assert {score.block.scenario for score in shown.panels["map"]} == {scenario}
    assert matrix_figure(shown).axes
    page = html.fromstring(matrix_page(shown))
    assert set(protocol.unknown) <= set(page.xpath("//li/text()"))


@pytest.mark.parametrize("name", PROTOCOLS)
def test_nothing_sticks_out_of_a_phone(name: str, tmp_path: Path) -> None:
    """390 px wide: neither the page nor a table scrolls sideways, also where columns have long names."""
    browser = pytest.importorskip("tests.browser")
    if browser.CHROMIUM is None and not browser.REQUIRED:
        pytest.skip("no chromium on the PATH: no browser tests")
    protocol = named_protocol(name)
    cells = protocol.cells(*([] if name == "fmvss127" else ["CPNA"]))
    runs = {cell: Measurement(0.0, warning_ttc_s=1.0, speed_reduction_kmh=20.0) for cell in cells}
    path = tmp_path / "matrix.html"
    path.write_text(matrix_page(make_sheet({"map": protocol.assess(runs)})), encoding="utf-8")
    with browser.sync_api.sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=browser.CHROMIUM, args=["--no-sandbox"])
        page = chromium.new_page(viewport={"width": 390, "height": 844})
        page.goto(path.as_uri())
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        widths = page.locator("figure").evaluate_all(
            "(all) => all.map((f) => [f.scrollWidth, f.clientWidth])"
        )
        chromium.close()
    assert widths
    assert all(needed <= given for needed, given in widths)


def test_bad_input_is_named() -> None:
    clean = PROTOCOL.assess({})
    with pytest.raises(ProtocolError, match="no assessment to show"):
        make_sheet({})
    with pytest.raises(ProtocolError, match="nothing to show for CPXX"):
        make_sheet({"map": clean}, ["CPXX"])
    with pytest.raises(ProtocolError, match="nothing to show for any scenario"):
        make_sheet({"map": clean})
    with pytest.raises(ProtocolError, match="different protocols"):
        make_sheet({"a": clean, "b": named_protocol("r152").assess({})})
