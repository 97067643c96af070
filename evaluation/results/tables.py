"""A finished table of texts, and what writes one: for the terminal, as Markdown, as CSV."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import rich.table

EMPTY = "–"
"""Stands where there is no number."""


@dataclass(frozen=True, slots=True)
class Table:
    """A finished table as text, for the terminal, a report or a test.

    Args:
        header: name of each column, with its unit.
        rows: one tuple per line, as long as the header.
        totals: lines at the foot, as long as the header.
        caption: what the reader has to know about the numbers, may be empty.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    totals: tuple[tuple[str, ...], ...] = ()
    caption: str = ""


def fixed(value: float, digits: int, sign: str = "") -> str:
    """A number with so many decimals, never as a negative zero; `EMPTY` where there is none (NaN).

    Args:
        value: the number.
        digits: decimals.
        sign: "+" to write that of a positive number as well; 0 has none.
    """
    if math.isnan(value):
        return EMPTY
    rounded = round(value, digits)
    return f"{rounded:{sign}.{digits}f}" if rounded else f"{0.0:.{digits}f}"


def csv_bytes(header: Iterable[str], rows: Iterable[Iterable[object]]) -> bytes:
    """A table of values as CSV.

    None and NaN are empty fields, truth values `true` and `false`; numbers are written in full, so that they
    come back as they are.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(map(_field, row) for row in rows)
    return text.getvalue().encode()


def _field(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def rich_table(table: Table, title: str | None = None, texts: int = 0) -> rich.table.Table:
    """The table for the terminal.

    Args:
        table: what it holds.
        title: stands above it, in the middle, or to the left where its first column is.
        texts: how many of the first columns are texts, to the left; the others are to the right.
    """
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table as RichTable

    view = RichTable(
        title=title,
        title_justify="left" if texts else "center",
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 0),
        caption=table.caption or None,
        caption_justify="left",
    )
    columns = zip(table.header, *table.rows, *table.totals, strict=True)
    for index, (name, *cells) in enumerate(columns):
        # Wide enough for every cell and every word of the header, so that only headers break, at spaces.
        width = max(map(len, [*name.split(), *cells]))
        view.add_column(escape(name), justify="left" if index < texts else "right", width=width)
    for index, row in enumerate(table.rows):
        view.add_row(*map(escape, row), end_section=index == len(table.rows) - 1)
    for row in table.totals:
        view.add_row(*map(escape, row), style="bold")
    return view


def markdown_table(table: Table) -> str:
    """The table as Markdown, with its caption below; ends with a line break."""
    lines = [table.header, ("---:",) * len(table.header), *table.rows]
    lines += [tuple(f"**{text}**" if text else "" for text in row) for row in table.totals]
    text = "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)
    return f"{text}\n{table.caption}\n" if table.caption else text
