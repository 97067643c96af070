"""The article: a page that needs no network, and its PDF."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest

from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.studies.reference import command
from evaluation.studies.reference.article.article import ARTICLE
from evaluation.studies.reference.article.page import BROWSERS, PAGE, PRINTED, page, print_pdf

REPORTS = Path(__file__).parents[4] / "reports"
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360f8cfc0000003010100c9fe92ef0000000049454e44ae426082"
)


def test_every_section_has_its_numbers_and_every_claim_a_command() -> None:
    text = (REPORTS / ARTICLE).read_text(encoding="utf-8")
    results = text.split("## 6 Results")[1].split("## 7 Limits")[0]
    sections = re.split(r"^### ", results, flags=re.MULTILINE)[1:]
    assert [section for section in sections if not re.search(r"\[[-+0-9., ]+\]", section)] == []
    claims = text.split("## 8 Every claim")[1]
    for section in (section.split()[0] for section in sections):
        assert re.search(rf"^\| {re.escape(section)} \| .*`smartmot-eval ", claims, flags=re.MULTILINE), (
            section
        )
    assert "nan" not in text.lower().split()


def test_the_page_holds_its_figures_and_loads_nothing() -> None:
    text = (REPORTS / PAGE).read_text(encoding="utf-8")
    assert text.count("<figure>") == (REPORTS / ARTICLE).read_text(encoding="utf-8").count("\n![")
    assert text.count("data:image/png;base64,") == text.count("<figure>") >= 4
    assert not re.search(r"(src|href)=\"https?:", text)
    assert "<script" not in text


def test_the_kept_pdf_has_the_pages_of_an_article() -> None:
    printed = (REPORTS / PRINTED).read_bytes()
    assert printed.startswith(b"%PDF")
    assert 4 <= len(re.findall(rb"/Type\s*/Page\b", printed)) <= 14


def test_a_figure_stands_in_the_page_and_one_that_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(PIXEL)
    text = page("# A & B\n\n![Speed < 3](a.png)\n\n| a | b |\n| --- | --- |\n| 1 | 2 |\n", tmp_path)
    assert "<title>A &amp; B</title>" in text
    assert "<figcaption>Speed &lt; 3</figcaption>" in text
    assert "<td>2</td>" in text
    with pytest.raises(ResultsError, match=r"b\.png: No such file"):
        page("# A\n\n![x](b.png)\n", tmp_path)


def test_without_a_browser_the_pdf_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(ArgumentError, match=r"--pdf: needs a browser .*install Chromium"):
        print_pdf(tmp_path / "a.html", tmp_path / "a.pdf")
    with pytest.raises(ResultsError, match=r"article\.html: missing; make it with"):
        command.print_article(tmp_path)


@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="no browser to print with")
def test_a_browser_prints_the_page(tmp_path: Path) -> None:
    (tmp_path / PAGE).write_text(page("# Title\n\nText.\n", tmp_path), encoding="utf-8")
    assert command.print_article(tmp_path).read_bytes().startswith(b"%PDF")
