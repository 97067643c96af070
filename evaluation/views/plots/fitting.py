"""Texts that fit: measured, wrapped and made smaller, so that no name is too long for a picture."""

from __future__ import annotations

import itertools
import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evaluation.views.plots.style import FONT_PT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SMALLEST_PT = 7.0
"""Headings become smaller to this size, then they get more lines."""
_STEP_PT = 0.5
_LINE_SPACING, _PT_PER_IN = 1.2, 72.0
"""Of matplotlib's texts, and the size of its point."""
_PIECE = re.compile(r"\S+\s*|\s+")
_JOINT = re.compile(r"[._:/,;=-]")
"""A name that is too long for a line is divided after one of these, as those of modules have them."""


class Fitted(NamedTuple):
    """A text with its line breaks and its size."""

    text: str
    size_pt: float

    @property
    def more_in(self) -> float:
        """Height of its lines but the first, inches."""
        return self.text.count("\n") * self.size_pt * _LINE_SPACING / _PT_PER_IN


def text_size_in(figure: Figure, text: str, size_pt: float) -> tuple[float, float]:
    """Width and height of a text on a figure, inches."""
    if not text:
        return 0.0, 0.0
    artist = figure.text(0.0, 0.0, text, fontsize=size_pt)
    box = artist.get_window_extent()
    artist.remove()
    return float(box.width / figure.dpi), float(box.height / figure.dpi)


def wrapped(figure: Figure, text: str, width_in: float, size_pt: float) -> str:
    """A text in lines of at most a width, as matplotlib draws them.

    Lines end between words; a word that is too long is divided after a dot, colon, stroke, comma or the
    like, or else anywhere. Line breaks of the text stay.

    Args:
        figure: with the canvas on which it is measured.
        text: what to write.
        width_in: of a line.
        size_pt: of the letters.
    """

    def fits(part: str) -> bool:
        return text_size_in(figure, part.rstrip(), size_pt)[0] <= width_in

    lines = []
    for paragraph in text.split("\n"):
        line = ""
        for piece in _PIECE.findall(paragraph):
            if line and not fits(line + piece):
                lines.append(line.rstrip())
                line = ""
            word = piece
            while not fits(word) and len(word) > 1:
                ends = [joint.end() for joint in _JOINT.finditer(word[:-1])]
                end = next((end for end in reversed(ends) if fits(word[:end])), 0)
                end = end or next((end for end in range(len(word) - 1, 1, -1) if fits(word[:end])), 1)
                lines.append(word[:end])
                word = word[end:]
            line += word
        lines.append(line.rstrip())
    return "\n".join(lines)


def fitted(figure: Figure, text: str, width_in: float, size_pt: float = FONT_PT) -> Fitted:
    """A heading in as few lines as fit a width, in letters of `size_pt` down to `SMALLEST_PT`."""
    sizes = [*np.arange(size_pt, SMALLEST_PT - 1e-9, -_STEP_PT).tolist()] or [size_pt]
    for lines in itertools.count(1):
        for size in sizes:
            broken = wrapped(figure, text, width_in, size)
            if broken.count("\n") < lines:
                return Fitted(broken, size)
    raise AssertionError("lines are counted without end")  # pragma: no cover


def set_title(axes: Axes, title: Fitted) -> None:
    """Heading above axes."""
    axes.set_title(title.text, fontsize=title.size_pt, pad=4.0)
