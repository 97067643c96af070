"""Classes of boxes in notes: few, short and in one line, whatever their names."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from scenarios.recorded.classes import most_common


def test_the_most_come_first_and_the_others_are_summed_up() -> None:
    counts = {f"class{k}": k for k in range(1, 11)}
    assert most_common(counts, "none").startswith("10 class10, 9 class9, 8 class8")
    assert most_common(counts, "none").endswith("3 class3, 3 of 2 more classes")
    assert most_common({"": 2, "bus": 2}, "without a class") == "2 without a class, 2 bus"
    assert most_common({}, "none") == ""


@given(st.dictionaries(st.text(max_size=200), st.integers(1, 10**9)))
def test_any_names_make_one_short_line(counts: dict[str, int]) -> None:
    note = most_common(counts, "none")
    assert len(note.splitlines()) <= 1
    assert len(note) < 1000
