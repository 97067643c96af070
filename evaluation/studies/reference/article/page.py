"""The article as one page that needs no network, and as a PDF that a browser prints from it."""

from __future__ import annotations

import base64
import html
import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError

PAGE = "article.html"
PRINTED = "article.pdf"

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
TIMEOUT_S = 120.0
"""After which a browser that prints nothing is given up."""


def page(markdown: str, folder: Path) -> str:
    """The article as HTML with its figures in it.

    Args:
        markdown: the article.
        folder: that its figures are in.

    Raises:
        ResultsError: a figure is missing.
    """
    from markdown_it import MarkdownIt

    body = str(MarkdownIt("commonmark").enable("table").render(markdown))
    body = re.sub(
        r'<p><img src="([^"]+)" alt="([^"]*)" ?/?></p>',
        lambda match: _figure(folder / match[1], match[2]),
        body,
    )
    style = files(__package__).joinpath("article.css").read_text(encoding="utf-8")
    title = html.escape(markdown.split("\n", 1)[0].lstrip("# "))
    return (
        f'<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<title>{title}</title>\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>\n{style}</style>\n</head>\n<body>\n{body}</body>\n</html>\n"
    )


def _figure(path: Path, caption: str) -> str:
    try:
        data = base64.b64encode(path.read_bytes()).decode()
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}; make it with smartmot-eval reference") from None
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def print_pdf(source: Path, target: Path) -> None:
    """Print a page by a browser.

    Raises:
        ArgumentError: there is no browser, or it prints nothing.
    """
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise ArgumentError(
            f"--pdf: needs a browser ({', '.join(BROWSERS)}); install Chromium, or print {source}"
        )
    target.unlink(missing_ok=True)
    command = [
        browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-pdf-header-footer",
        f"--print-to-pdf={target.resolve()}", source.resolve().as_uri(),
    ]  # fmt: skip
    try:
        ended = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ArgumentError(f"--pdf: {browser} printed nothing ({error}); print {source} by hand") from None
    if not target.is_file():
        last = (ended.stderr.strip().splitlines() or ["no message"])[-1]
        raise ArgumentError(f"--pdf: {browser} printed nothing ({last}); print {source} by hand")
