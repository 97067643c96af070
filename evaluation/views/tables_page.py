"""Tables as a page that needs nothing but itself: light and dark, from phone to desk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

from evaluation.results.tables import Table

_STYLE = """
:root {
  color-scheme: light dark;
  --ink: #1a1a1a; --paper: #fff; --line: #c9c9c9; --quiet: #595959; --focus: #0072b2;
}
@media (prefers-color-scheme: dark) {
  :root { --ink: #ececec; --paper: #16181a; --line: #45494d; --quiet: #a9adb1; --focus: #6db9ec; }
}
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 auto;
  padding: 12px; max-width: 1200px; }
h1 { font-size: 1.3em; margin: 0 0 .3em; } h2 { font-size: 1.1em; margin: 1.5em 0 .3em; }
p { margin: .2em 0; overflow-wrap: anywhere; }
.table { overflow: auto; max-height: 75vh; } :focus-visible { outline: 3px solid var(--focus); }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { text-align: left; padding: 3px 14px 3px 0; border-bottom: 1px solid var(--line);
  vertical-align: top; }
th { font-weight: 600; } .quiet { color: var(--quiet); font-size: .9em; }
@media (max-width: 480px) { body { padding: 8px; font-size: 14px; } th, td { padding-right: 9px; } }
"""


@dataclass(frozen=True, slots=True)
class Section:
    """A table under its title."""

    title: str
    table: Table


def tables_page(title: str, lead: Sequence[str], sections: Sequence[Section]) -> str:
    """The page, without any reference to a network.

    Args:
        title: of the page.
        lead: paragraphs before the first table.
        sections: the tables.
    """
    parts = [
        "<!doctype html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>",
        f"<body><main><h1>{escape(title)}</h1>",
        *(f"<p>{escape(line)}</p>" for line in lead),
        *map(_section, sections),
        "</main></body></html>",
    ]
    return "\n".join(parts) + "\n"


def _section(section: Section) -> str:
    table = section.table
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in table.header)
    rows = "\n".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
        for row in (*table.rows, *table.totals)
    )
    caption = f'<p class="quiet">{escape(table.caption)}</p>' if table.caption else ""
    # a table that is wider than the screen scrolls for itself, with the keyboard too
    frame = f'<div class="table" tabindex="0" role="region" aria-label="{escape(section.title)}">'
    return (
        f"<h2>{escape(section.title)}</h2>{caption}{frame}<table><thead><tr>{head}</tr></thead>"
        f"<tbody>\n{rows}\n</tbody></table></div>"
    )
