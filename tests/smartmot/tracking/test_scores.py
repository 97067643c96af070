import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.errors import ShapeError
from smartmot.tracking.scores import COUNT_INTERVAL_S, ScoreScale, reference_scores
from smartmot.types import CATEGORIES

CAR = np.zeros(1, dtype=np.int64)


def _reference(score: np.ndarray) -> float:
    return float(reference_scores(np.zeros(len(score), dtype=np.int64), score)[0])


def test_reference_by_hand() -> None:
    """Sums of scores, weakest first: 0.2, 0.6, 1.2, 2.0; three quarters of 2.0 are reached by 0.8."""
    assert _reference(np.array([0.8, 0.2, 0.6, 0.4])) == pytest.approx(0.8, rel=0.05)
    # 1.5 of 2.0 is reached by the third of four equal scores
    assert _reference(np.full(4, 0.5)) == pytest.approx(0.5, rel=0.05)


def test_sure_detections_have_exactly_one() -> None:
    assert _reference(np.ones(7)) == 1.0
    assert reference_scores(np.zeros(0, dtype=np.int64), np.zeros(0)).tolist() == [1.0] * len(CATEGORIES)


@given(st.lists(st.floats(0.2, 1.0), min_size=1, max_size=50), st.floats(0.02, 1.0))
@settings(deadline=None)
def test_references_scale_with_the_scores(scores: list[float], factor: float) -> None:
    score = np.array(scores)
    assert _reference(factor * score) == pytest.approx(factor * _reference(score), rel=0.06)


def test_a_flood_of_weak_detections_hardly_moves_it() -> None:
    rng = np.random.default_rng(0)
    score = rng.uniform(0.5, 0.9, 1_000)
    flooded = np.concatenate((score, rng.uniform(0.0, 0.02, 10_000)))
    assert _reference(flooded) == pytest.approx(_reference(score), rel=0.1)


def test_online_it_begins_with_a_sure_detector_and_ends_with_this_one() -> None:
    scale = ScoreScale.empty()
    assert scale.reference.tolist() == [1.0] * len(CATEGORIES)
    score, code = np.full(10, 0.4), np.zeros(10, dtype=np.int64)
    first = scale.after(0.0, code, score)
    # one detection of 1 and ten of 0.4: the geometric mean
    assert first.reference[0] == pytest.approx(0.4 ** (10.0 / 11.0), rel=0.05)
    for k in range(1, 400):
        scale = first = first.after(COUNT_INTERVAL_S * k, code, score)
    assert scale.reference[0] == pytest.approx(0.4, rel=0.06)
    assert scale.reference[1:].tolist() == [1.0] * (len(CATEGORIES) - 1)


def test_frames_in_between_are_not_counted() -> None:
    scale = ScoreScale.empty().after(10.0, CAR, np.array([0.3]))
    assert scale.after(10.3, CAR, np.array([0.9])) is scale
    assert scale.after(10.5, CAR, np.array([0.9])) is not scale


@pytest.mark.parametrize(
    "change", [{"mass": np.zeros((2, 2))}, {"reference": np.zeros(6)}, {"counted_s": np.nan}]
)
def test_a_scale_is_checked(change: dict) -> None:
    empty = ScoreScale.empty()
    values = {"counted_s": 0.0, "mass": empty.mass, "reference": empty.reference}
    with pytest.raises(ShapeError, match="score scale"):
        ScoreScale(**(values | change))
