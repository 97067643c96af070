"""Texts are measured, wrapped and made smaller until they fit."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluation.views.plots.fitting import SMALLEST_PT, Fitted, fitted, text_size_in, wrapped
from evaluation.views.plots.style import new_figure

FIGURE = new_figure(1.0)


def test_a_text_is_as_wide_as_its_letters() -> None:
    """The letters of DejaVu Sans are 0.5 to 0.7 of its size wide: 20 of 9 points about 1.5 inches."""
    width, height = text_size_in(FIGURE, "twenty letters wide.", 9.0)
    assert 1.1 < width < 1.8
    assert 9 / 72 * 0.6 < height < 9 / 72 * 1.4
    assert text_size_in(FIGURE, "", 9.0) == (0.0, 0.0)
    assert FIGURE.texts == []


def test_what_fits_stays_as_it_is() -> None:
    assert wrapped(FIGURE, "map, 50 km/h", 4.0, 9.0) == "map, 50 km/h"
    assert fitted(FIGURE, "map, 50 km/h", 4.0) == Fitted("map, 50 km/h", 9.0)


def test_lines_end_between_words_and_names_after_their_joints() -> None:
    assert wrapped(FIGURE, "rectangular, map", 0.9, 9.0) == "rectangular,\nmap"
    assert wrapped(FIGURE, "my_package.areas:narrow", 1.3, 9.0) == "my_package.areas:\nnarrow"
    assert wrapped(FIGURE, "one\ntwo", 4.0, 9.0) == "one\ntwo"


@settings(max_examples=40, deadline=None)
@given(st.text("abc_.: ,m", max_size=60), st.floats(0.3, 3.0))
def test_no_line_is_wider_than_asked_for_and_no_letter_is_lost(text: str, width_in: float) -> None:
    lines = wrapped(FIGURE, text, width_in, 9.0).split("\n")
    assert all(text_size_in(FIGURE, line, 9.0)[0] <= width_in + 1e-9 for line in lines)
    assert "".join(lines).replace(" ", "") == text.replace(" ", "")


@pytest.mark.parametrize(("letters", "lines"), [(30, 1), (70, 1), (130, 2), (300, 4)])
def test_long_headings_get_smaller_and_then_more_lines(letters: int, lines: int) -> None:
    heading = fitted(FIGURE, ("words and " * 40)[:letters].strip(), 4.0)
    assert heading.size_pt >= SMALLEST_PT
    assert heading.text.count("\n") == lines - 1
    assert heading.more_in == pytest.approx((lines - 1) * heading.size_pt * 1.2 / 72)


def test_a_letter_wider_than_the_line_stands_alone() -> None:
    assert wrapped(FIGURE, "mm", 0.01, 9.0) == "m\nm"
