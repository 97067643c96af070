"""Labels and tracks side by side, and their assignment, against trying everything."""

import itertools
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.metrics.matching import Comparison, assigned_pairs, compare, match_threshold, pairs_of_frames
from scenarios.errors import DatasetError


def test_a_track_twice_in_a_frame_is_refused(objects: Any, sequence: Any) -> None:
    truth = objects([(0, 1, 0.0, 0.0)])
    with pytest.raises(DatasetError, match="track id 5 appears twice"):
        compare(sequence(1, truth), objects([(0, 5, 0.0, 0.0), (0, 5, 9.0, 0.0)]), "car", "distance")


@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=6))
def test_pairs_are_every_combination_of_each_frame(counts: list[tuple[int, int]]) -> None:
    a_start, b_start = (
        np.concatenate(([0], np.cumsum([c[k] for c in counts], dtype=np.int64))) for k in (0, 1)
    )
    a, b = pairs_of_frames(a_start.astype(np.int64), b_start.astype(np.int64))
    expected = [
        (i, j)
        for k in range(len(counts))
        for i in range(int(a_start[k]), int(a_start[k + 1]))
        for j in range(int(b_start[k]), int(b_start[k + 1]))
    ]
    assert list(zip(a.tolist(), b.tolist(), strict=True)) == expected


def one_frame(similarity: np.ndarray) -> Comparison:
    """Labels times tracks of a single frame."""
    labels, tracks = similarity.shape
    pair_label, pair_track = pairs_of_frames(np.array([0, labels]), np.array([0, tracks]))
    zeros = np.zeros(max(labels, tracks), dtype=np.int64)
    return Comparison(
        frame_count=1,
        label_frame=zeros[:labels],
        label_id=np.arange(labels),
        label_counts=np.ones(labels, dtype=np.bool_),
        track_frame=zeros[:tracks],
        track_id=np.arange(tracks),
        track_score=np.ones(tracks),
        track_ignored=np.zeros(tracks, dtype=np.bool_),
        pair_label=pair_label,
        pair_track=pair_track,
        similarity=similarity.ravel(),
    )


@given(st.integers(1, 4), st.integers(1, 4), st.integers(0, 2**32 - 1))
def test_the_assignment_has_the_greatest_similarity_of_all(labels: int, tracks: int, seed: int) -> None:
    similarity = np.random.default_rng(seed).uniform(0.0, 1.0, (labels, tracks)).round(2)
    least = 0.5
    c = one_frame(similarity)
    row, column = assigned_pairs(c, np.ones(labels, np.bool_), np.ones(tracks, np.bool_), least)
    assert len(set(row.tolist())) == len(row)
    assert len(set(column.tolist())) == len(column)
    assert (similarity[row, column] >= least).all()
    possible = np.where(similarity >= least, similarity, 0.0)
    padded = np.zeros((labels, labels + tracks))  # a label may also stay without a track
    padded[:, :tracks] = possible
    best = max(
        sum(padded[i, j] for i, j in enumerate(choice))
        for choice in itertools.permutations(range(labels + tracks), labels)
    )
    assert similarity[row, column].sum() == pytest.approx(best)


def test_only_those_that_take_part_are_assigned() -> None:
    c = one_frame(np.array([[0.9, 0.8], [0.9, 0.0]]))
    first, second = np.array([True, False]), np.array([False, True])
    both = np.ones(2, dtype=np.bool_)
    assert [part.tolist() for part in assigned_pairs(c, first, both, 0.5)] == [[0], [0]]
    assert [part.tolist() for part in assigned_pairs(c, both, second, 0.5)] == [[0], [1]]
    row, column = assigned_pairs(c, both, both, 0.5)
    assert sorted(zip(row.tolist(), column.tolist(), strict=True)) == [(0, 1), (1, 0)]


def test_a_match_of_boxes_needs_less_overlap_where_they_are_small() -> None:
    assert [match_threshold(name, "iou") for name in ("car", "pedestrian", "truck")] == [0.5, 0.25, 0.5]
    assert match_threshold("pedestrian", "distance") == 0.5
