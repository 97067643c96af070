"""Texts that users read name things as the field does: UN R152, FMVSS 127, Euro NCAP and the AEB literature.

False activation, unnecessary braking, collision avoided, mitigated, target, vehicle under test.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("smartmot", "opendrive", "scenarios", "evaluation")

FALSE_TERMS = {
    r"false (emergency )?stops?": "false activation",
    r"(stop\w*|wait\w*|brak\w*) for (nobody|somebody|who\b)": "unnecessary braking",
    r"needless stops?": "unnecessary stop",
    r"\bmere(ly)?\b": "only, alone",
    r"contacts? avoided|avoids? (\d+ |most )?contacts?": "collision avoided",
}
"""Terms that no text of the project holds, docstrings and comments included, and what the field says."""

LOOSE_WORDS = {
    r"\b(no|some)body('s)?\b": "the object, the ego, no road user",
    r"\btold\b": "said, named, set, known",
}
"""Words that no text for users holds."""


def found(text: str, *bans: dict[str, str]) -> list[str]:
    """What is banned in a text, with what to write instead."""
    flat = " ".join(text.split())
    return [
        f"{match.group()!r} in '...{flat[max(match.start() - 40, 0) : match.end() + 20]}...': write {better}"
        for ban in bans
        for pattern, better in ban.items()
        for match in re.finditer(pattern, flat, re.IGNORECASE)
    ]


def sources() -> list[Path]:
    return [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]


def literals(path: Path) -> Iterator[tuple[int, str]]:
    """Line and text of the string literals of a module but docstrings; those of a command are help."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docstrings = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    if path.parent.name == "cli":
        docstrings.clear()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings:
            yield node.lineno, node.value


def pages() -> list[Path]:
    """Documentation, and what pages and reports are made from."""
    templates = [
        path
        for package in PACKAGES
        for path in (ROOT / package).rglob("*")
        if path.suffix in (".j2", ".js", ".css")
    ]
    # moved.md lists names of earlier versions
    documents = [page for page in sorted((ROOT / "docs").rglob("*.md")) if page.name != "moved.md"]
    return [*documents, ROOT / "README.md", ROOT / "CONTRIBUTING.md", *templates]


@pytest.mark.parametrize("path", pages(), ids=lambda path: path.name)
def test_pages_use_the_terms_of_the_field(path: Path) -> None:
    assert found(path.read_text(encoding="utf-8"), FALSE_TERMS, LOOSE_WORDS) == []


def test_texts_of_the_program_use_the_terms_of_the_field() -> None:
    texts = [(path, line, text) for path in sources() for line, text in literals(path)]
    assert len(texts) > 3000
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {problem}"
        for path, line, text in texts
        for problem in found(text, FALSE_TERMS, LOOSE_WORDS)
    ]
    assert wrong == []


def test_sources_use_the_terms_of_the_field() -> None:
    wrong = [
        f"{path.relative_to(ROOT)}: {problem}"
        for path in sources()
        for problem in found(path.read_text(encoding="utf-8"), FALSE_TERMS)
    ]
    assert wrong == []


@pytest.mark.parametrize(
    "text",
    [
        "It stops for nobody.", "waits for nobody", "3 of 4 false stops", "by mere speed adaptation",
        "needless stops (%)", "12 contacts avoided", "As told in the file", "Somebody's car",
    ],
)  # fmt: skip
def test_the_scan_finds_what_it_is_for(text: str) -> None:
    assert found(text, FALSE_TERMS, LOOSE_WORDS)


@pytest.mark.parametrize(
    "text", ["false activation", "unnecessary braking", "the brake waits until it is near"]
)
def test_the_scan_lets_the_terms_of_the_field_pass(text: str) -> None:
    assert found(text, FALSE_TERMS, LOOSE_WORDS) == []


HOLLOW_NAMES = {"found", "one", "told", "mine", "rest", "whole", "here"}
"""Names of variables that do not say what the value is."""


def assigned_names(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of every argument and every variable that a module binds; fields of classes are none."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    classes = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    fields = {id(part.target) for node in classes for part in node.body if isinstance(part, ast.AnnAssign)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store) and id(node) not in fields:
            yield node.lineno, node.id
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg


def test_values_have_nouns() -> None:
    names = [(path, line, name) for path in sources() for line, name in assigned_names(path)]
    assert len(names) > 10_000
    wrong = [f"{path.relative_to(ROOT)}:{line}: {name}" for path, line, name in names if name in HOLLOW_NAMES]
    assert wrong == []
