"""Blocks of code in the pages that users read."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from markdown_it import MarkdownIt

ROOT = Path(__file__).parents[2]
PAGES = [
    name.relative_to(ROOT).as_posix()
    for name in (ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md")))
]


@dataclass(frozen=True, slots=True)
class Block:
    """A block of code.

    Args:
        page: path from the root.
        line: of its first line, from 1.
        language: after the fence; empty: none, or the block is indented.
        code: as printed.
    """

    page: str
    line: int
    language: str
    code: str


@cache
def blocks(page: str) -> tuple[Block, ...]:
    """Every block of a page, fenced or indented."""
    tokens = MarkdownIt("commonmark").parse((ROOT / page).read_text(encoding="utf-8"))
    return tuple(
        Block(page, (token.map or [0])[0] + 1, token.info.strip(), token.content)
        for token in tokens
        if token.type in ("fence", "code_block")
    )


def python_of(page: str) -> list[str]:
    """The Python blocks of a page."""
    return [block.code for block in blocks(page) if block.language == "python"]


def commands_of(page: str) -> list[list[str]]:
    """The words of every command line in the shell blocks of a page."""
    lines = [
        line
        for block in blocks(page)
        if block.language == "sh"
        for line in block.code.replace("\\\n", " ").splitlines()
    ]
    return [words for line in lines if (words := shlex.split(line, comments=True))]
