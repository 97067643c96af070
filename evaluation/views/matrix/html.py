"""Matrices as a page that needs nothing but itself."""

from __future__ import annotations

from html import escape

from evaluation.protocols.assessment import BlockScore
from evaluation.protocols.grid import Cell, Layer
from evaluation.protocols.sheet import Sheet, gate_line, total_line
from evaluation.views.plots.strategies import strategy_looks

_STYLE = """
:root { color-scheme: light; }
body { font: 15px/1.45 system-ui, sans-serif; color: #111; background: #fff; margin: 0 auto; padding: 12px;
  max-width: 1500px; }
h1 { font-size: 1.3em; margin: 0; } h2 { font-size: 1.1em; margin: 1.4em 0 .2em; }
p { margin: .3em 0; }
section { margin-top: 1.2em; } section h2 { margin-top: .4em; }
.panels { display: flex; flex-wrap: wrap; gap: 18px 28px; }
figure { margin: 0; max-width: 100%; overflow-x: auto; }
table { border-collapse: separate; border-spacing: 2px; font-variant-numeric: tabular-nums; }
caption { text-align: left; font-weight: 600; padding-bottom: 2px; width: max-content;
  max-width: calc(100vw - 24px); }
th { font-weight: 400; font-size: .85em; padding: 0 3px; text-align: right; white-space: nowrap; }
thead th { text-align: center; }
tr th:first-child { width: 1%; }
td { min-width: 46px; height: 26px; text-align: center; border: 1.5px solid #111; font-size: .9em;
  white-space: nowrap; padding: 0 2px; }
td.extended { border: 1.5px dashed #111; }
td.none { border: 0; }
figcaption { font-size: .85em; }
.legend span { display: inline-block; margin: 0 14px 4px 0; white-space: nowrap; }
.legend b { display: inline-block; min-width: 1.5em; text-align: center; border: 1px solid #111;
  margin-right: 5px; font-weight: 400; }
.gate { font-weight: 600; color: #a50f26; }
ul { padding-left: 1.2em; font-size: .85em; }
@media (max-width: 480px) {
  body { padding: 8px; font-size: 14px; }
  td { min-width: 30px; font-size: .8em; padding: 0 1px; white-space: normal; }
  th, .legend span { white-space: normal; }
}
"""


def matrix_page(sheet: Sheet) -> str:
    """The sheet as an HTML page, without any reference to a network."""
    title = f"{sheet.title}, {sheet.protocol}"
    parts = [
        "<!doctype html>",
        '<html lang="en">',
        '<head><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title><style>{_STYLE}</style></head>",
        f"<body><h1>{escape(sheet.title)}</h1><p>{escape(sheet.protocol)}</p>",
        f"<p>Cells: {escape(sheet.unit)}.</p>",
        _legend(sheet),
    ]
    looks = strategy_looks(sheet.panels)
    for strategy, scores in sheet.panels.items():
        colour, _ = looks[strategy]
        parts.append(f'<section style="border-top:4px solid {colour}"><h2>{escape(strategy)}</h2>')
        parts.append(f"<p>{escape(total_line(sheet.totals[strategy]))}</p>")
        failed = gate_line(sheet.gates[strategy])
        if failed:
            parts.append(f'<p class="gate">{escape(failed)}</p>')
        parts.append('<div class="panels">')
        parts += [_figure(score) for score in scores]
        parts.append("</div></section>")
    parts += ["<ul>", *(f"<li>{escape(note)}</li>" for note in sheet.notes), "</ul></body></html>"]
    return "\n".join(parts) + "\n"


def _legend(sheet: Sheet) -> str:
    spans = [
        f'<span><b style="background:{mark.fill};color:{mark.ink}">{escape(mark.letter)}</b>'
        f"{escape(mark.name)}</span>"
        for mark in sheet.marks
    ]
    if sheet.extended:
        spans.append('<span><b style="border:1.5px dashed #111">&nbsp;</b>extended range</span>')
    return f'<p class="legend">{"".join(spans)}</p>'


def _figure(score: BlockScore) -> str:
    block = score.block
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in block.columns)
    over = ""
    if block.column_header:
        wide = f'<th colspan="{len(block.columns)}">{escape(block.column_header)}</th>'
        over = f'<tr><td class="none"></td>{wide}</tr>'
    lines = [
        "<figure><table>",
        f"<caption>{escape(block.name)}</caption>",
        f"<thead>{over}",
        f'<tr><th scope="col">{escape(block.row_header)}</th>{head}</tr></thead><tbody>',
    ]
    for row in block.rows:
        cells = "".join(_cell(score, cell) for cell in row.cells)
        lines.append(f'<tr><th scope="row">{escape(row.label)}</th>{cells}</tr>')
    lines.append(f"</tbody></table><figcaption>{escape(total_line(score.totals))}</figcaption></figure>")
    return "\n".join(lines)


def _cell(score: BlockScore, cell: Cell | None) -> str:
    if cell is None:
        return '<td class="none"></td>'
    outcome = score.scores[cell]
    extended = ' class="extended"' if cell.layer is Layer.EXTENDED else ""
    invalid = outcome.measurement.invalid if outcome.measurement else ""
    why = f" ({invalid})" if invalid else ""
    return (
        f'<td{extended} title="{escape(f"{cell}: {outcome.mark.name}{why}")}" '
        f'style="background:{outcome.mark.fill};color:{outcome.mark.ink}">{escape(str(outcome))}</td>'
    )
