"""F1 of boxes by hand, and scores that become probabilities."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.metrics.detection.from_above import ScoredBoxes, joined
from evaluation.studies.training.quality import calibrated, match_frame, rescored
from smartmot.lidar.learned import PillarGrid
from smartmot.pointcloud import Boxes3D

GRID = PillarGrid()

SIZE = (0.6, 0.6, 1.8)


def people(*places: tuple[float, float]) -> Boxes3D:
    return Boxes3D(
        np.array([(x, y, 0.9) for x, y in places]).reshape(-1, 3),
        np.tile(SIZE, (len(places), 1)),
        np.zeros(len(places)),
    )


def matched(found: Boxes3D, score: list[float], labels: Boxes3D, counts: list[int]) -> ScoredBoxes:
    names = np.full(len(found), "pedestrian"), np.full(len(labels), "pedestrian")
    return joined(
        [
            match_frame(
                "pedestrian", found, np.array(score), names[0], labels, names[1], np.array(counts), 5, GRID
            )
        ]
    )


def test_the_surest_box_on_a_label_is_right_and_the_second_is_not() -> None:
    found = people((10.0, 0.05), (10.0, 0.0), (20.0, 5.0))
    each = matched(found, [0.5, 0.9, 0.7], people((10.0, 0.0), (30.0, 0.0)), [50, 50])
    assert each.score.tolist() == [0.9, 0.7, 0.5]
    assert each.is_true.tolist() == [True, False, False]
    assert each.labels == 2
    assert each.f1(0.0) == pytest.approx(2 * 1 / (3 + 2))
    assert each.f1(0.8) == pytest.approx(2 * 1 / (1 + 2))
    assert each.f1(0.95) == 0.0


def test_labels_with_few_points_or_too_far_away_count_neither_way() -> None:
    found = people((10.0, 0.0), (20.0, 0.0), (45.0, 0.0))
    each = matched(found, [0.9, 0.9, 0.9], people((10.0, 0.0), (20.0, 0.0), (45.0, 0.0)), [4, 50, 50])
    assert each.labels == 1
    assert each.score.tolist() == [0.9]  # on the label with few points lies a box that counts neither way
    assert each.f1(0.5) == 1.0


def test_labels_and_boxes_off_the_grid_count_neither_way() -> None:
    """The network sees nothing behind the sensor, nor beyond 28.8 m to a side."""
    labels = people((10.0, 0.0), (-5.0, 0.0), (5.0, 30.0), (5.0, -28.9))
    each = matched(people((10.0, 0.0), (5.0, -28.9)), [0.9, 0.9], labels, [50] * 4)
    assert each.labels == 1
    assert each.is_true.tolist() == [True]
    assert each.f1(0.5) == 1.0


def test_without_labels_or_boxes_f1_is_0() -> None:
    nobody = people()
    assert matched(nobody, [], nobody, []).f1(0.5) == 0.0
    assert matched(nobody, [], people((10.0, 0.0)), [50]).f1(0.5) == 0.0
    assert matched(people((10.0, 0.0)), [0.9], nobody, []).f1(0.5) == 0.0


def test_calibrated_scores_are_as_often_right_as_they_say() -> None:
    """Scores whose logits are twice those of the truth, and shifted."""
    rng = np.random.default_rng(2)
    logit = rng.normal(0.0, 1.5, 20_000)
    is_right = rng.random(len(logit)) < 1.0 / (1.0 + np.exp(-logit))
    scale, offset = calibrated(1.0 / (1.0 + np.exp(-(2.0 * logit + 1.0))), is_right)
    assert scale == pytest.approx(0.5, abs=0.02)
    assert offset == pytest.approx(-0.5, abs=0.03)


def test_calibrated_scores_keep_every_count() -> None:
    rng = np.random.default_rng(4)
    score, none = np.sort(rng.random(50))[::-1], np.array([-np.inf])
    each = ScoredBoxes(score, rng.random(50) < 0.5, np.append(score[:20], none), np.append(score[:20], none))
    made = rescored(each, 0.5, -0.5)
    expected = 1.0 / (1.0 + np.exp(-(0.5 * np.log(0.8 / 0.2) - 0.5)))
    assert made.counts(expected) == each.counts(0.8)
    assert made.counts(0.0) == each.counts(0.0)
    assert made.label_score[-1] == -np.inf


def test_scores_that_say_nothing_stay_as_they_are() -> None:
    """Where the higher scores are more often wrong a calibration would turn their order round."""
    score = np.linspace(0.1, 0.9, 200)
    assert calibrated(score, score < 0.5) == (1.0, 0.0)


def test_of_few_boxes_nothing_is_learned() -> None:
    assert calibrated(np.full(10, 0.5), np.arange(10) > 4) == (1.0, 0.0)
    assert calibrated(np.full(100, 0.5), np.ones(100, dtype=bool)) == (1.0, 0.0)
