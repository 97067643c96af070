"""What a comparison wrote as Markdown comes back as it was."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.results.files import ResultsError
from evaluation.results.tables import Table, markdown_table
from evaluation.studies.answers.study import Answer
from evaluation.studies.comparison_page.words import read_words

CELLS = st.text("ab 0|%[],.–", min_size=1, max_size=8).map(str.strip).filter(bool)
TEXTS = st.text("abc :;,.[]0", min_size=3, max_size=40).map(lambda text: "x" + text.strip())
TABLES = st.integers(1, 4).flatmap(
    lambda width: st.builds(
        Table,
        st.tuples(*[CELLS] * width),
        st.lists(st.tuples(*[CELLS] * width), max_size=3).map(tuple),
        st.just(()),
        TEXTS,
    )
)


@given(st.lists(TEXTS, min_size=1, max_size=4), st.lists(TABLES, max_size=3), st.lists(TEXTS, max_size=2))
def test_an_answer_comes_back(
    tmp_path_factory: pytest.TempPathFactory, sentences: list[str], tables: list[Table], notes: list[str]
) -> None:
    path = tmp_path_factory.mktemp("words") / "answer.md"
    named = {f"table {k}": table for k, table in enumerate(tables)}
    path.write_bytes(Answer("What for?", sentences, named, notes=tuple(notes)).markdown())
    words = read_words(path, "Results")
    assert (words.title, words.sentences, words.notes) == ("What for?", sentences, notes)
    assert words.tables == list(named.items())


def test_a_table_without_heading_and_sentences_below(tmp_path: Path) -> None:
    path = tmp_path / "table.md"
    table = Table(("a", "b"), (("1", "2"),), caption="Rates.")
    path.write_text(f"{markdown_table(table)}\nFirst.\n\nSecond.\n\n## More\n\n{markdown_table(table)}")
    words = read_words(path, "Summary")
    assert words.sentences == ["First.", "Second."]
    assert words.tables == [("Summary", table), ("More", table)]


def test_a_damaged_table_is_refused_in_a_line(tmp_path: Path) -> None:
    path = tmp_path / "table.md"
    path.write_text("| a | b |\n| ---: | ---: |\n| 1 |\n")
    with pytest.raises(ResultsError, match=r"table\.md: a table of it is damaged; run the comparison again"):
        read_words(path, "Summary")
    with pytest.raises(ResultsError, match="no such file"):
        read_words(tmp_path / "absent.md", "Summary")
