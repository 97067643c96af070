"""Boxes against labels from above, against brute force and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.metrics.detection.from_above import ScoredBoxes, joined, match_from_above
from smartmot.types import Boxes


def row_of(x: list[float], size: float = 2.0) -> Boxes:
    """Squares along a line."""
    count = len(x)
    return Boxes(np.column_stack((x, np.zeros(count))), np.full((count, 2), size), np.zeros(count))


def everyone(count: int) -> np.ndarray:
    return np.ones(count, dtype=np.bool_)


def test_overlap_over_the_limit_is_right_and_equal_to_it_is_not() -> None:
    # squares of 2 m shifted by d overlap by (2 - d) / (2 + d): 1/3 at 1 m
    for limit, right in ((0.33, 1), (0.34, 0)):
        matched = match_from_above(row_of([1.0]), np.array([0.9]), row_of([0.0]), everyone(1), limit)
        assert matched.counts(0.0).true_positives == right
        assert matched.counts(0.0).untouched == 0


def test_the_surer_box_gets_the_label_and_the_other_is_false() -> None:
    matched = match_from_above(row_of([0.1, 0.0]), np.array([0.8, 0.6]), row_of([0.0]), everyone(1), 0.5)
    counts = matched.counts(0.0)
    assert (counts.true_positives, counts.false_positives, counts.missed) == (1, 1, 0)
    assert matched.counts(0.7).false_positives == 0


def test_a_box_on_a_label_that_does_not_count_is_neither_right_nor_wrong() -> None:
    counts = np.array([True, False])
    matched = match_from_above(
        row_of([0.0, 10.0, 20.0]), np.array([0.9, 0.8, 0.7]), row_of([0.0, 10.0]), counts, 0.5
    )
    result = matched.counts(0.0)
    assert (result.true_positives, result.false_positives, result.missed) == (1, 1, 0)
    assert len(matched.label_score) == 1


def test_a_box_where_nothing_is_labelled_counts_only_if_it_is_right() -> None:
    where = np.array([True, True, False])
    matched = match_from_above(
        row_of([0.0, 10.0, 20.0]), np.array([0.9, 0.8, 0.7]), row_of([0.0]), everyone(1), 0.5, where
    )
    result = matched.counts(0.0)
    assert (result.true_positives, result.false_positives, result.missed) == (1, 1, 0)


def test_without_a_fault_precision_is_1_and_without_boxes_0() -> None:
    x = [0.0, 10.0, 20.0]
    perfect = match_from_above(row_of(x), np.array([0.5, 0.6, 0.7]), row_of(x), everyone(3), 0.5)
    assert perfect.average_precision == 1.0
    assert perfect.counts(perfect.best_score).f1() == 1.0
    assert perfect.best_score == 0.5
    nothing = match_from_above(row_of([]), np.zeros(0), row_of(x), everyone(3), 0.5)
    assert nothing.average_precision == 0.0
    assert nothing.best_score == math.inf
    assert math.isnan(joined([]).average_precision)


def test_average_precision_of_a_hand_made_list() -> None:
    # right, wrong, right, of 4 labels: precision 1 to a recall of 1/4, 2/3 to 1/2, then nothing
    boxes = ScoredBoxes(
        np.array([0.9, 0.8, 0.7]), np.array([True, False, True]), np.array([0.9, 0.7, -np.inf, -np.inf]),
        np.full(4, -np.inf),
    )  # fmt: skip
    assert boxes.average_precision == pytest.approx((10 * 1.0 + 10 * 2.0 / 3.0) / 40)
    # F1 is 2/5 after the first box, 2 * 2 / (3 + 4) after the third
    assert boxes.best_score == 0.7
    assert boxes.counts(0.7).f1() == pytest.approx(4.0 / 7.0)


@given(st.integers(0, 2**32 - 1))
def test_a_score_limit_is_as_if_the_other_boxes_were_not_there(seed: int) -> None:
    rng = np.random.default_rng(seed)
    x, labels = rng.uniform(0.0, 12.0, 9).tolist(), rng.uniform(0.0, 12.0, 5).tolist()
    # some of one score
    score = rng.integers(1, 6, 9) / 5.0
    counts = rng.random(5) < 0.7
    matched = match_from_above(row_of(x), score, row_of(labels), counts, 0.3)
    for limit in (0.2, 0.6, 1.0):
        kept = score >= limit
        alone = match_from_above(row_of(np.array(x)[kept].tolist()), score[kept], row_of(labels), counts, 0.3)
        assert matched.counts(limit) == alone.counts(0.0)
    best = max(matched.counts(limit).f1() for limit in (0.2, 0.4, 0.6, 0.8, 1.0)) if counts.any() else 0.0
    if math.isfinite(matched.best_score):
        assert matched.counts(matched.best_score).f1() == best


def test_frames_are_joined_in_their_order() -> None:
    one = match_from_above(row_of([0.0]), np.array([0.4]), row_of([0.0]), everyone(1), 0.5)
    other = match_from_above(row_of([50.0]), np.array([0.9]), row_of([0.0]), everyone(1), 0.5)
    both = joined([one, other])
    assert both.score.tolist() == [0.4, 0.9]
    counts = both.counts(0.0)
    assert (counts.true_positives, counts.false_positives, counts.missed, counts.untouched) == (1, 1, 1, 1)
