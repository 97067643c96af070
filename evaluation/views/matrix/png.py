"""Matrices as a picture."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, TypeVar

from evaluation.protocols.grid import Block, Layer
from evaluation.protocols.marks import DARK, Mark
from evaluation.protocols.sheet import Sheet, gate_line, total_line
from evaluation.views.plots.strategies import strategy_looks
from evaluation.views.plots.style import FONT_PT, SMALL_PT, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from evaluation.protocols.assessment import BlockScore

_Item = TypeVar("_Item")

_CELL_W_IN, _CELL_H_IN = 0.52, 0.3
_GAP_IN, _HEAD_IN, _FOOT_IN = 0.3, 0.62, 0.14
_MARGIN_IN, _TITLE_IN, _STRATEGY_IN, _LINE_IN = 0.15, 0.4, 0.34, 0.16
_WIDEST_IN, _NARROWEST_IN = 14.0, 5.0
_BAR_IN = 0.06
_SWATCH_IN = (0.2, 0.15)
_DASHES = (0, (2, 2))
_CHARACTER_IN, _BOLD_IN = 0.062, 0.085  # mean width of a small character, and of a bold one of usual size


def matrix_figure(sheet: Sheet) -> Figure:
    """Draw the matrices, one strategy below the other.

    A cell shows its number and its letter on its colour; extended cells have a dashed frame.
    """
    lines = {name: _in_lines(scores, _panel_width, _WIDEST_IN) for name, scores in sheet.panels.items()}
    width = max(
        _NARROWEST_IN,
        *(sum(map(_panel_width, line)) + _MARGIN_IN for all_ in lines.values() for line in all_),
    )
    foot = _wrapped(f"Cells: {sheet.unit}.", *sheet.notes, width=width)
    heights = {name: [max(map(_panel_height, line)) for line in all_] for name, all_ in lines.items()}
    notes = {name: _headline(sheet, name, width) for name in lines}
    total = (
        _TITLE_IN
        + sum(sum(h) + _STRATEGY_IN + _LINE_IN * (len(notes[name]) - 1) for name, h in heights.items())
        + _LINE_IN * (len(foot) + len(_legend_lines(sheet, width)))
        + 4 * _MARGIN_IN
    )
    figure = new_figure(total)
    figure.set_size_inches(width, total)
    page = figure.add_axes((0, 0, 1, 1))
    page.set_xlim(0, width)
    page.set_ylim(total, 0)  # y runs down the page, in inches
    page.axis("off")
    y = _MARGIN_IN
    _write(page, _MARGIN_IN, y, sheet.title, fontsize=FONT_PT + 2, fontweight="bold", va="top")
    _write(page, width - _MARGIN_IN, y + 0.03, sheet.protocol, va="top", ha="right")
    y += _TITLE_IN
    looks = strategy_looks(lines)
    for name, rows in lines.items():
        # the strategy's colour, a bar above its part
        page.plot([_MARGIN_IN, width - _MARGIN_IN], [y - _BAR_IN] * 2, color=looks[name][0], linewidth=2.5)
        for index, (text, weight) in enumerate(notes[name]):
            size = FONT_PT if weight == "bold" else SMALL_PT
            _write(page, _MARGIN_IN, y + _LINE_IN * index, text, fontsize=size, fontweight=weight, va="top")
        y += _STRATEGY_IN + _LINE_IN * (len(notes[name]) - 1)
        for line, height in zip(rows, heights[name], strict=True):
            x = _MARGIN_IN
            for score in line:
                _draw(page, score, x, y)
                x += _panel_width(score)
            y += height
    y += _MARGIN_IN
    for marks in _legend_lines(sheet, width):
        _draw_legend(page, marks, y, extended=sheet.extended and marks[-1] == sheet.marks[-1])
        y += _LINE_IN * 1.4
    for text in foot:
        _write(page, _MARGIN_IN, y, text, va="top")
        y += _LINE_IN
    return figure


def _write(page: Axes, x: float, y: float, text: str, **style: Any) -> None:
    """A text, by default small and dark, with its middle at the height y."""
    page.text(x, y, text, **{"fontsize": SMALL_PT, "va": "center", "color": DARK, **style})


def _frame(page: Axes, x: float, y: float, size_in: tuple[float, float], fill: str, **style: Any) -> None:
    """A filled box; dashed, that of an extended cell."""
    from matplotlib.patches import Rectangle

    page.add_patch(Rectangle((x, y), *size_in, facecolor=fill, edgecolor=DARK, **style))


def _in_lines(
    items: Iterable[_Item], width_in: Callable[[_Item], float], widest_in: float
) -> list[list[_Item]]:
    """Items side by side, in lines that are not too wide."""
    lines: list[list[_Item]] = [[]]
    used = 0.0
    for item in items:
        width = width_in(item)
        if lines[-1] and used + width > widest_in:
            lines.append([])
            used = 0.0
        lines[-1].append(item)
        used += width
    return lines


def _panel_width(score: BlockScore) -> float:
    cells = _label_width(score.block) + len(score.block.columns) * _cell_width(score.block)
    widths = [len(text) * _CHARACTER_IN for text in _points(score)]
    # the column header stands in the middle of the columns and may be wider than they are
    head = _label_width(score.block) + len(score.block.column_header) * _CHARACTER_IN
    return max(cells, head, len(score.block.name) * _BOLD_IN, *widths) + _GAP_IN


def _cell_width(block: Block) -> float:
    """Of all cells of a matrix; names of columns need more than numbers do."""
    return max(_CELL_W_IN, max(map(len, block.columns), default=0) * _CHARACTER_IN + 0.1)


def _label_width(block: Block) -> float:
    longest = max(len(text) for text in (block.row_header, *(row.label for row in block.rows)))
    return longest * _CHARACTER_IN + 0.1


def _panel_height(score: BlockScore) -> float:
    return _HEAD_IN + len(score.block.rows) * _CELL_H_IN + len(score.totals) * _LINE_IN + _FOOT_IN


def _points(score: BlockScore) -> list[str]:
    """Totals of a matrix, one line each."""
    return [total_line((total,)) for total in score.totals]


def _draw(page: Axes, score: BlockScore, x: float, y: float) -> None:
    block = score.block
    cell_in = _cell_width(block)
    left, top = x + _label_width(block), y + _HEAD_IN
    _write(page, x, y, block.name, fontsize=FONT_PT, fontweight="bold", va="top")
    _write(page, left + len(block.columns) * cell_in / 2, y + 0.3, block.column_header, ha="center")
    _write(page, left - 0.08, top - 0.1, block.row_header, ha="right")
    for j, name in enumerate(block.columns):
        _write(page, left + (j + 0.5) * cell_in, top - 0.1, name, ha="center")
    for i, row in enumerate(block.rows):
        middle = top + (i + 0.5) * _CELL_H_IN
        _write(page, left - 0.08, middle, row.label, ha="right")
        for j, cell in enumerate(row.cells):
            if cell is None:
                continue
            outcome = score.scores[cell]
            x0, y0 = left + j * cell_in + 0.02, top + i * _CELL_H_IN + 0.02
            line = _DASHES if cell.layer is Layer.EXTENDED else "-"
            size = (cell_in - 0.04, _CELL_H_IN - 0.04)
            _frame(page, x0, y0, size, outcome.mark.fill, linewidth=0.8, linestyle=line)
            _write(
                page, left + (j + 0.5) * cell_in, middle, str(outcome), ha="center", color=outcome.mark.ink
            )
    below = top + len(block.rows) * _CELL_H_IN + 0.06
    for i, text in enumerate(_points(score)):
        _write(page, x, below + i * _LINE_IN, text, va="top")


def _legend_lines(sheet: Sheet, width: float) -> list[list[Mark]]:
    return _in_lines(sheet.marks, _mark_width, width - 1.6)


def _mark_width(mark: Mark) -> float:
    return 0.45 + len(mark.name) * _CHARACTER_IN


def _draw_legend(page: Axes, marks: list[Mark], y: float, *, extended: bool) -> None:
    x = _MARGIN_IN
    for mark in marks:
        _frame(page, x, y, _SWATCH_IN, mark.fill, linewidth=0.5)
        _write(page, x + 0.1, y + 0.075, mark.letter, fontsize=SMALL_PT - 1, ha="center", color=mark.ink)
        _write(page, x + 0.26, y + 0.075, mark.name)
        x += _mark_width(mark)
    if extended:
        _frame(page, x, y, _SWATCH_IN, "white", linewidth=0.8, linestyle=_DASHES)
        _write(page, x + 0.26, y + 0.075, "extended range")


def _headline(sheet: Sheet, name: str, width: float) -> list[tuple[str, str]]:
    """Lines with their weight: strategy with its first total, the others and what requirement failed."""
    totals = sheet.totals[name]
    first = f"{name}: {total_line(totals[:1])}" if totals else name
    bold = textwrap.wrap(first, int((width - 2 * _MARGIN_IN) / _BOLD_IN))
    usual = _wrapped(total_line(totals[1:]), gate_line(sheet.gates[name]), width=width)
    return [*((text, "bold") for text in bold), *((text, "normal") for text in usual)]


def _wrapped(*texts: str, width: float) -> list[str]:
    characters = int((width - 2 * _MARGIN_IN) / _CHARACTER_IN)
    return [line for text in texts if text for line in textwrap.wrap(text, characters)]
