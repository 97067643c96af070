"""The pages hang together: as files too, and the site's own code does what it says."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from markdown_it import MarkdownIt

from tests.documents.blocks import PAGES, ROOT

SITE = ROOT / "docs" / "site"


def targets(page: str) -> list[str]:
    """Where the links and pictures of a page lead, without those to other hosts."""
    tokens = MarkdownIt("commonmark").enable("table").parse((ROOT / page).read_text(encoding="utf-8"))
    children = [child for token in tokens for child in token.children or ()]
    links = [str(child.attrs.get("href") or child.attrs.get("src") or "") for child in children]
    return [link for link in links if link and "://" not in link]


def anchors(page: Path) -> set[str]:
    """Names of the headings of a page, as GitHub and the site make them."""
    tokens = MarkdownIt("commonmark").parse(page.read_text(encoding="utf-8"))
    headings = [tokens[i + 1].content for i, token in enumerate(tokens) if token.type == "heading_open"]
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_to_files_and_headings(page: str) -> None:
    wrong = []
    for link in targets(page):
        name, _, anchor = link.partition("#")
        target = (ROOT / page).parent / name if name else ROOT / page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            wrong.append(link)
    assert wrong == []


def test_every_page_is_in_the_order_of_the_site() -> None:
    """From `docs/index.md` through the lists of pages."""
    seen: set[Path] = set()
    waiting = [ROOT / "docs" / "index.md"]
    while waiting:
        page = waiting.pop()
        if page in seen:
            continue
        seen.add(page)
        for listed in re.findall(r"```\{toctree\}\n(.*?)```", page.read_text(encoding="utf-8"), re.S):
            names = [line for line in listed.splitlines() if line and not line.startswith(":")]
            waiting += [(page.parent / f"{name}.md").resolve() for name in names]
    assert {ROOT / page for page in PAGES if page.startswith("docs/")} - seen == set()


def test_the_gallery_has_every_kind_of_figure() -> None:
    """One of each file name; folders with the same figure for other conditions may be left out."""
    shown = {Path(link).name for link in targets("docs/gallery.md")}
    kept = {path.name for path in (ROOT / "reports").rglob("*.png")}
    assert kept - shown == set()


def test_the_glossary_is_in_order_and_names_each_term_once() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    terms = re.findall(r"^(.+)\n: ", text, re.M)
    assert len(terms) > 40
    assert len(terms) == len(set(terms))
    for section in text.split("\n## ")[1:]:
        names = [name.lower() for name in re.findall(r"^(.+)\n: ", section, re.M)]
        assert names == sorted(names)


class TestMadePages:
    """`docs/site/made_pages.py` needs Sphinx to be imported, which `make docs` has."""

    @pytest.fixture
    def made(self, monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
        pytest.importorskip("sphinx", reason="Sphinx is not installed: `make docs` installs it")
        monkeypatch.syspath_prepend(str(SITE))
        monkeypatch.delitem(sys.modules, "made_pages", raising=False)
        import made_pages

        return made_pages

    def test_an_example_that_fails_ends_the_build(self, made: SimpleNamespace, tmp_path: Path) -> None:
        script = tmp_path / "broken.py"
        script.write_text("print('so far')\nraise ValueError('no map')\n")
        with pytest.raises(RuntimeError, match=r"(?s)broken.py ends with exit status 1.*so far.*no map"):
            made.run_example(script, tmp_path / "out", [])

    def test_an_example_runs_in_a_folder_of_its_own(self, made: SimpleNamespace, tmp_path: Path) -> None:
        script = tmp_path / "fine.py"
        script.write_text(
            "import pathlib\nopen('a.png', 'w').close()\nprint(len(list(pathlib.Path().iterdir())))"
        )
        assert made.run_example(script, tmp_path / "out", []) == "1\n"
        assert made.run_example(script, tmp_path / "out", []) == "1\n"

    def test_every_command_and_option_is_in_the_reference(self, made: SimpleNamespace) -> None:
        import typer

        group = typer.main.get_command(made.command_line)
        text = "\n".join(made.command_lines(group, "smartmot-eval"))
        for name, command in group.commands.items():
            assert f"## smartmot-eval {name}\n" in text
            for parameter in getattr(command, "params", ()):
                if not getattr(parameter, "hidden", False):
                    assert all(option in text for option in parameter.opts if option.startswith("-"))
