"""Palette, sizes and the bare figure that all pictures share."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LineStyle = Literal["-", "--", ":"]

BLACK, GREY = "#000000", "#8c8c8c"
BLUE, SKY, GREEN = "#0072b2", "#56b4e9", "#009e73"
ORANGE, VERMILLION, PURPLE, WINE = "#e69f00", "#d55e00", "#cc79a7", "#882255"

WIDTH_IN = 5.0
FONT_PT = 9.0
SMALL_PT = 8.0
MPS_TO_KMH = 3.6


def new_figure(height_in: float) -> Figure:
    """An empty figure with a canvas of its own, on which texts can be measured."""
    return plain_figure((WIDTH_IN, height_in), dpi=200)


def plain_figure(size_in: tuple[float, float], dpi: float) -> Figure:
    """An empty figure whose texts are what they say: names of the user's may have dollar signs.

    matplotlib takes what is between two of them for a formula, and fails where it is none. It asks for this
    whenever a text is made, so that it is turned off for the whole process.
    """
    import matplotlib as mpl
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    mpl.rcParams["text.parse_math"] = False
    figure = Figure(figsize=size_in, dpi=dpi, facecolor="white")
    FigureCanvasAgg(figure)
    return figure


def set_style(axes: Axes) -> None:
    """Fine grid behind everything and texts of the pictures' size."""
    axes.grid(visible=True, color="#e6e6e6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=SMALL_PT)
