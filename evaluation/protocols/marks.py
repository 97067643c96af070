"""How a cell looks: a colour, a letter for those who cannot tell the colours apart, and a text."""

from __future__ import annotations

from dataclasses import dataclass

from evaluation.protocols.bands import Colour

DARK, LIGHT = "#111111", "#ffffff"


@dataclass(frozen=True, slots=True)
class Mark:
    """Appearance of a cell.

    Args:
        name: meaning, for the legend.
        letter: stands in the cell beside its number.
        fill: colour of the cell, as `#rrggbb`.
        ink: colour of the text on it.
    """

    name: str
    letter: str
    fill: str
    ink: str


MARKS = {
    # The protocol's colour names; the shades differ in lightness too, and every text has a contrast of at
    # least 4.5 to its ground (WCAG 2.1, success criterion 1.4.3).
    Colour.GREEN: Mark("green", "G", "#44aa77", DARK),
    Colour.YELLOW: Mark("yellow", "Y", "#fff176", DARK),
    Colour.ORANGE: Mark("orange", "O", "#f5a623", DARK),
    Colour.BROWN: Mark("brown", "B", "#946030", LIGHT),
    Colour.RED: Mark("red", "R", "#a50f26", LIGHT),
}

NOT_RUN = Mark("not run", "–", "#ececec", "#4d4d4d")
INVALID = Mark("invalid test, scores nothing", "×", "#d9b3e6", DARK)
FALSE_ACTIVATION = Mark("false activation, failed", "FA", "#5c0a1a", LIGHT)
UNRATED = Mark("no rating in any source", "?", "#d6e4f0", DARK)
AVOIDED = Mark("avoided", "A", "#44aa77", DARK)
CONTACT = Mark("contact", "C", "#9fb6cc", DARK)
PASSED = Mark("pass", "P", "#44aa77", DARK)
FAILED = Mark("fail", "F", "#a50f26", LIGHT)
NO_WARNING = Mark("fail, not warned as asked", "W", "#f5a623", DARK)
ALL_POINTS = Mark("all points", "A", "#44aa77", DARK)
SOME_POINTS = Mark("part of the points", "P", "#fff176", DARK)
NO_POINTS = Mark("no points", "N", "#a50f26", LIGHT)
