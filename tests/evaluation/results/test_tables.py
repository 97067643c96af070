"""A table on the terminal and as Markdown."""

from __future__ import annotations

import io
from dataclasses import replace

from evaluation.results.by_speed import comparison_table
from evaluation.results.tables import Table, markdown_table, rich_table
from tests.evaluation.results.conftest import HIT, PUBLISHED, STOPPED, runs_of


def test_markdown_has_a_line_per_row() -> None:
    text = markdown_table(comparison_table(runs_of(STOPPED, HIT, HIT), PUBLISHED))
    lines = text.splitlines()
    assert lines[1].count("---:") == 9
    assert lines[2].startswith("| 50 | 23.00 | 0.00 | 23.82 | -0.82 |")
    assert lines[3].startswith("| **total** |  | **0.00/2** |")
    assert lines[5] == "Means over up to 2 runs per speed and strategy."


def printed_table(table: Table, width: int) -> str:
    from rich.console import Console

    console = Console(width=width, file=io.StringIO(), record=True)
    console.print(rich_table(table, "CPNA"))
    return console.export_text()


def test_rich_table_prints_every_cell() -> None:
    table = comparison_table(runs_of(STOPPED, HIT, replace(HIT, scenario="[bold]")), PUBLISHED)
    printed = printed_table(table, width=140)
    for row in (*table.rows, *table.totals):
        for cell in row:
            assert cell in printed
    assert "CPNA" in printed


def test_rich_table_of_two_strategies_fits_a_terminal_of_80_columns() -> None:
    rows = [
        replace(row, v_test_kmh=speed) for row in (STOPPED, HIT) for speed in (10.0, 20.0, 30.0, 40.0, 50.0)
    ]
    published: dict[str, dict[float, tuple[float, float | None]]]
    published = {name: {row.v_test_kmh: (0.0, 2.0) for row in rows} for name in ("rectangular", "map")}
    table = comparison_table(runs_of(*rows), published)
    printed = printed_table(table, width=80)
    assert max(map(len, printed.splitlines())) <= 80
    for row in (*table.rows, *table.totals):
        assert any(all(cell in line for cell in row) for line in printed.splitlines())
