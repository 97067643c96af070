"""What a comparison says as text: the sentences, tables and figures of its Markdown, read back."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path

from evaluation.results.files import ResultsError, one_line, require_file
from evaluation.results.tables import Table

READ = "How to read it"
"""Heading of the notes."""
_CELLS = re.compile(r"(?<!\\)\|")
_FIGURE = re.compile(r"!\[.*\]\((?P<file>[^)]+)\)")


@dataclass(slots=True)
class Words:
    """What stands in the Markdown that the command wrote.

    Args:
        title: its first heading; may be empty.
        sentences: the answer.
        tables: by heading.
        figures: names of files.
        notes: how to read it.
    """

    title: str = ""
    sentences: list[str] = field(default_factory=list)
    tables: list[tuple[str, Table]] = field(default_factory=list)
    figures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def read_words(path: Path, first_heading: str) -> Words:
    """Read `table.md` or `answer.md`.

    Args:
        path: the file.
        first_heading: of a table without one.

    Raises:
        ResultsError: it is missing or damaged.
    """
    require_file(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ResultsError(f"{path}: cannot be read ({one_line(error)}); run the comparison again") from None
    words, heading, is_caption = Words(), "", False
    for block in re.split(r"\n\s*\n", text.strip()):
        lines = block.strip().splitlines()
        if lines and lines[0].startswith("# ") and not words.title:
            words.title = lines.pop(0)[2:].strip()
        if lines and lines[0].startswith("## "):
            heading, is_caption = lines.pop(0)[3:].strip(), False
        if not lines:
            continue
        if lines[0].startswith("|"):
            rows = [_cells(line) for line in lines if line.startswith("|")]
            if len(rows) < 2 or any(len(row) != len(rows[0]) for row in rows):
                raise ResultsError(f"{path}: a table of it is damaged; run the comparison again")
            title = heading or first_heading
            words.tables.append((title, Table(rows[0], tuple(rows[2:]))))
            is_caption = True
        elif match := _FIGURE.fullmatch(lines[0]):
            words.figures.append(match["file"])
        elif is_caption:
            title, table = words.tables[-1]
            words.tables[-1] = title, Table(table.header, table.rows, caption=" ".join(lines))
            is_caption = False
        else:
            texts = [line.removeprefix("- ") for line in lines]
            (words.notes if heading == READ else words.sentences).extend(texts)
    return words


def _cells(line: str) -> tuple[str, ...]:
    """Cells of a line of a table, without marks of bold."""
    cells = _CELLS.split(line.strip())[1:-1]
    return tuple(cell.strip().replace("\\|", "|").removeprefix("**").removesuffix("**") for cell in cells)
