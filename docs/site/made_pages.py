"""What the documentation site makes of the program: the reference of commands, examples with their output."""

from __future__ import annotations

import ast
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import typer
from docutils import nodes
from docutils.parsers.rst import directives
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from evaluation.cli import app as command_line

PICTURES = (".png", ".svg", ".gif")
_SECONDS = 300
"""Limit of an example's time."""


class CommandReference(SphinxDirective):
    """Every command with its arguments and options, as `--help` has them."""

    def run(self) -> list[nodes.Node]:
        """The sections of all commands."""
        group = typer.main.get_command(command_line)
        return _parsed(self, "\n".join(command_lines(group, "smartmot-eval")))


class Example(SphinxDirective):
    """A script of `examples/`, run: its code, what it prints, and the pictures that it writes."""

    required_arguments = 1
    option_spec: ClassVar[dict[str, Any]] = {"arguments": directives.unchanged}

    def run(self) -> list[nodes.Node]:
        """Code, output and figures; an example that fails ends the build."""
        _, name = self.env.relfn2path(self.arguments[0])
        script = Path(name)
        self.env.note_dependency(str(script))
        folder = Path(self.env.srcdir) / "build" / "examples" / script.stem
        output = run_example(script, folder, self.options.get("arguments", "").split())
        lines = ["```python", *_without_docstring(script.read_text(encoding="utf-8")).splitlines(), "```", ""]
        if output.strip():
            lines += ["It prints", "", "```text", *output.rstrip().splitlines(), "```", ""]
        pictures = sorted(path for path in folder.rglob("*") if path.suffix in PICTURES)
        for picture in pictures:
            shown = picture.relative_to(folder)
            lines += [f"![{shown}](/{picture.relative_to(self.env.srcdir).as_posix()})", "", f"*{shown}*", ""]
        return _parsed(self, "\n".join(lines))


def _parsed(directive: SphinxDirective, markdown: str) -> list[nodes.Node]:
    parent = nodes.Element()
    parent.document = directive.state.document
    content = StringList(markdown.splitlines(), source=directive.get_source_info()[0])
    directive.state.nested_parse(content, 0, parent, match_titles=True)
    return parent.children


def run_example(script: Path, folder: Path, arguments: list[str]) -> str:
    """What a script prints, run in an empty folder.

    Args:
        script: Python.
        folder: that it is run in; what was there is removed.
        arguments: of its command line.

    Raises:
        RuntimeError: it fails; the message has its output.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    run = subprocess.run(
        [sys.executable, str(script), *arguments],
        cwd=folder,
        env={**os.environ, "MPLBACKEND": "agg", "COLUMNS": "100", "NO_COLOR": "1"},
        capture_output=True,
        text=True,
        timeout=_SECONDS,
        check=False,
    )
    if run.returncode:
        raise RuntimeError(f"{script.name} ends with exit status {run.returncode}:\n{run.stdout}{run.stderr}")
    return run.stdout


def _without_docstring(code: str) -> str:
    first = ast.parse(code).body[0]
    is_docstring = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
    end = first.end_lineno if is_docstring and first.end_lineno else 0
    return "\n".join(code.splitlines()[end:]).strip()


def command_lines(command: Any, name: str) -> Iterator[str]:
    """Markdown of a command and its subcommands, groups first.

    Args:
        command: of typer.
        name: with the commands above it.
    """
    subcommands = getattr(command, "commands", None)
    depth = 2 if name.count(" ") <= 1 else 3
    if name.count(" "):
        yield from ("", f"{'#' * depth} {name}", "")
    yield from (_joined(command.help or ""), "")
    if subcommands is not None:
        for sub_name, sub in subcommands.items():
            if not sub.hidden:
                yield from command_lines(sub, f"{name} {sub_name}")
        return
    shown = [parameter for parameter in command.params if not getattr(parameter, "hidden", False)]
    arguments = [parameter for parameter in shown if parameter.param_type_name == "argument"]
    usage = " ".join(_argument(parameter) for parameter in arguments)
    yield from ("```text", f"{name} {usage} [OPTIONS]".replace("  ", " "), "```", "")
    rows: dict[str, list[str]] = {}
    for parameter in shown:
        panel = getattr(parameter, "rich_help_panel", None) or ""
        rows.setdefault(panel, []).append(_row(parameter))
    for panel, lines in rows.items():
        yield from ("", f"**{panel}**", "") if panel else ("",)
        yield from ("| option | meaning | default |", "| --- | --- | --- |", *lines, "")
    yield from _examples(command.epilog or "")


def _argument(parameter: Any) -> str:
    shown = parameter.metavar or parameter.name.upper()
    return shown if parameter.required or shown.startswith("[") else f"[{shown}]"


def _row(parameter: Any) -> str:
    if parameter.param_type_name == "argument":
        names = f"`{_argument(parameter)}`"
    else:
        metavar = "" if parameter.is_flag or not parameter.metavar else f" {parameter.metavar}"
        names = ", ".join(f"`{option}{metavar}`" for option in (*parameter.opts, *parameter.secondary_opts))
    default = parameter.default
    if default is None or default == () or callable(default):
        shown = "needed" if parameter.required else ""
    elif isinstance(default, bool):
        shown = "on" if default else "off"
    else:
        shown = f"`{', '.join(map(str, default)) if isinstance(default, (list, tuple)) else default}`"
    return f"| {names} | {_cell(_joined(parameter.help or ''))} | {shown} |"


def _joined(text: str) -> str:
    """Paragraphs of help without the line breaks inside them."""
    return "\n\n".join(" ".join(part.split()) for part in text.replace("\b", "").split("\n\n"))


def _cell(text: str) -> str:
    """Text for a cell of a table; what Markdown would read as its own is kept as it is."""
    text = text.replace("\n\n", " ")
    for mark in "\\|*_<>[]":
        text = text.replace(mark, f"\\{mark}")
    return text


def _examples(epilog: str) -> Iterator[str]:
    """An epilog: paragraphs that are commands as one block of code, others as text."""
    parts = [
        " ".join(part.split()) for part in epilog.split("\n\n") if part.strip() not in ("", "**Examples**")
    ]
    commands = [part.strip("`") for part in parts if part.count("`") == 2 and part[0] == part[-1] == "`"]
    if commands:
        yield from ("", "Examples:", "", "```sh", *commands, "```", "")
    yield from (line for part in parts if part.strip("`") not in commands for line in (part, ""))


def _page_of_a_table(app: Sphinx, docname: str, content: list[str]) -> None:
    """Title for the tables of reference results, which have none; they are reached by links alone."""
    parts = docname.split("/")
    if parts[0] == "reports" and len(parts) > 2:
        title = "" if content[0].startswith("# ") else f"# {', '.join(parts[1:])}\n\n"
        content[0] = f"---\norphan: true\n---\n{title}{content[0]}"


def setup(app: Sphinx) -> dict[str, bool]:
    """Make the directives known to Sphinx."""
    app.add_directive("command-reference", CommandReference)
    app.add_directive("example", Example)
    app.connect("source-read", _page_of_a_table)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
