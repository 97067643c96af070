"""Matrices for the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evaluation.protocols.grid import Layer
from evaluation.protocols.sheet import Sheet, gate_line, total_line

if TYPE_CHECKING:
    import rich.console
    import rich.table

    from evaluation.protocols.assessment import BlockScore


def matrix_view(sheet: Sheet) -> rich.console.RenderableType:
    """Everything that the sheet holds, to be printed by a rich console.

    A cell shows its number and its letter on its colour, so that it can be read without colours; extended
    cells are in brackets.
    """
    from rich.columns import Columns
    from rich.console import Group
    from rich.text import Text

    parts: list[rich.console.RenderableType] = [Text(f"{sheet.title}, {sheet.protocol}", style="bold")]
    for strategy, scores in sheet.panels.items():
        parts += [Text(""), Text(strategy, style="bold underline")]
        parts.append(Columns([_table(score) for score in scores], padding=(1, 3)))
        line = total_line(sheet.totals[strategy])
        parts += [Text(text, style="bold") for text in (line, gate_line(sheet.gates[strategy])) if text]
    parts += [Text(""), Text(f"Cells: {sheet.unit}. {legend(sheet)}")]
    parts += [Text(f"- {note}") for note in sheet.notes]
    return Group(*parts)


def legend(sheet: Sheet) -> str:
    """Meaning of the letters, in one line."""
    words = [f"{mark.letter} {mark.name}" for mark in sheet.marks]
    return ", ".join(words) + ("; in brackets: extended range." if sheet.extended else ".")


def _table(score: BlockScore) -> rich.table.Table:
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    block = score.block
    table = Table(
        title=f"{block.name}: {block.column_header}",
        title_style="",
        title_justify="left",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 0),
        caption=total_line(score.totals),
        caption_justify="left",
        caption_style="",
    )
    # where it is narrow the labels wrap, and the numbers stay whole
    table.add_column(block.row_header, justify="right")
    for column in block.columns:
        table.add_column(column, justify="right", no_wrap=True)
    for row in block.rows:
        cells = []
        for cell in row.cells:
            if cell is None:
                cells.append(Text(""))
                continue
            outcome = score.scores[cell]
            text = f"({outcome})" if cell.layer is Layer.EXTENDED else f" {outcome} "
            style = f"{outcome.mark.ink} on {outcome.mark.fill}"
            cells.append(Text(text.rjust(8), style=style))
        table.add_row(row.label, *cells)
    return table
