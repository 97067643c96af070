"""Tables of the documents are tables: a header, a rule, and rows of as many cells."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGES = sorted(
    page
    for folder in (".", "docs", "reports")
    for page in (ROOT / folder).glob("**/*.md" if folder != "." else "*.md")
)
RULE = re.compile(r"^\|(\s*:?-+:?\s*\|)+$")


def blocks(text: str) -> list[tuple[int, list[str]]]:
    """Runs of lines that begin with a bar, outside code, each with the number of its first line."""
    tables: list[tuple[int, list[str]]] = []
    code, last = False, -2
    for number, line in enumerate(text.splitlines()):
        if line.lstrip().startswith("```"):
            code = not code
        if code or not line.startswith("|"):
            continue
        if number == last + 1:
            tables[-1][1].append(line)
        else:
            tables.append((number + 1, [line]))
        last = number
    return tables


def cells(row: str) -> int:
    """Bars inside code end a cell as well (GitHub Flavored Markdown, Tables)."""
    return len(re.findall(r"(?<!\\)\|", row)) - 1


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_rows_belong_to_a_header_and_have_its_cells(page: Path) -> None:
    for number, rows in blocks(page.read_text()):
        assert len(rows) > 2, f"line {number}: rows without a header"
        assert RULE.match(rows[1].strip()), f"line {number}: rows without a header"
        expected = cells(rows[1])
        for at, row in enumerate(rows):
            assert cells(row.rstrip()) == expected, (
                f"line {number + at}: {cells(row.rstrip())} cells, not {expected}"
            )
