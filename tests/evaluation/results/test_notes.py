"""What is told after finished runs."""

from __future__ import annotations

from evaluation.results.notes import told_notes


def test_notes_about_the_same_are_one_line() -> None:
    first, second = (f"the file asks for {a} m/s2 of 'VRU' (Bicycle), whose ..." for a in (2.48, 2.6))
    other = "SpeedAction of 'B' at 1.000 s is not carried out: it refers to 'A', which is deleted"
    assert told_notes([(first,), (), (second, other)]) == [
        f"{first} (in 2 of 3 runs)",
        f"{other} (in 1 of 3 runs)",
    ]
