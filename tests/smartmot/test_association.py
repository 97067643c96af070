from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from smartmot.association import (
    COMPATIBLE,
    AssociationConfig,
    OverlapThenDistance,
    assign,
    associate,
    gate_reach_m,
)
from smartmot.errors import ConfigError
from smartmot.geometry import iou_matrix
from smartmot.types import CATEGORIES, Boxes, FloatArray

CODE = {name: code for code, name in enumerate(CATEGORIES)}


def _squares(*centers: tuple[float, float], size: float = 0.5) -> Boxes:
    return Boxes(np.array(centers), np.full((len(centers), 2), size), np.zeros(len(centers)))


def _match(tracks: Boxes, detections: Boxes, reach: float) -> dict[int, int]:
    return _match_all(tracks, detections, np.full(len(tracks), reach))


def _match_all(tracks: Boxes, detections: Boxes, reach: FloatArray) -> dict[int, int]:
    codes = [np.full(len(b), CODE["pedestrian"]) for b in (tracks, detections)]
    found = associate(tracks, codes[0], detections, codes[1], reach, OverlapThenDistance())
    return dict(zip(found.track.tolist(), found.detection.tolist(), strict=True))


def _best_total(affinity: FloatArray) -> float:
    a = affinity if affinity.shape[0] <= affinity.shape[1] else affinity.T
    rows = range(len(a))
    return max(float(sum(a[i, p[i]] for i in rows)) for p in permutations(range(a.shape[1]), len(a)))


@pytest.mark.parametrize("shape", [(1, 1), (2, 5), (5, 2), (4, 4), (6, 5)])
@pytest.mark.parametrize("seed", range(5))
def test_assignment_is_optimal_and_complete(shape: tuple[int, int], seed: int) -> None:
    rng = np.random.default_rng(seed)
    affinity = np.where(rng.random(shape) < 0.4, 0.0, rng.random(shape))
    found = assign(affinity)
    assert affinity[found.track, found.detection].sum() == pytest.approx(_best_total(affinity))
    assert (affinity[found.track, found.detection] > 0.0).all()
    assert sorted([*found.track, *found.unmatched_tracks]) == list(range(shape[0]))
    assert sorted([*found.detection, *found.unmatched_detections]) == list(range(shape[1]))


@pytest.mark.parametrize("shape", [(0, 0), (0, 3), (2, 0)])
def test_nothing_to_match(shape: tuple[int, int]) -> None:
    found = assign(np.zeros(shape))
    assert len(found.track) == len(found.detection) == 0
    assert (len(found.unmatched_tracks), len(found.unmatched_detections)) == shape


@pytest.mark.parametrize("seed", range(20))
def test_distance_matches_never_cost_overlap(seed: int) -> None:
    # The overlap that the paper's rule finds alone is kept, up to its own threshold.
    rng = np.random.default_rng(seed)
    tracks = _squares(*rng.uniform(0, 3, (7, 2)).tolist(), size=0.8)
    detections = _squares(*rng.uniform(0, 3, (6, 2)).tolist(), size=0.8)
    iou = np.where(iou_matrix(tracks, detections) >= 0.001, iou_matrix(tracks, detections), 0.0)
    with_fallback = OverlapThenDistance()(tracks, detections, np.full(7, 5.0))
    found = assign(with_fallback)
    assert iou[found.track, found.detection].sum() > _best_total(iou) - 0.001
    assert len(found.track) >= np.count_nonzero(iou[assign(iou).track, assign(iou).detection])


@pytest.mark.parametrize("seed", range(30))
def test_overlaps_left_out_for_uncontested_pairs_change_no_match(seed: int) -> None:
    rng = np.random.default_rng(seed)
    m, n = rng.integers(1, 12, 2)
    extent = float(rng.choice([2.0, 6.0, 20.0]))
    tracks = _squares(*rng.uniform(0, extent, (m, 2)).tolist(), size=0.8)
    detections = _squares(*rng.uniform(0, extent, (n, 2)).tolist(), size=0.8)
    reach = rng.uniform(0, 2, m)
    offset = tracks.center_m[:, None] - detections.center_m
    near = np.maximum(1.0 - np.hypot(offset[..., 0], offset[..., 1]) / reach[:, None], 0.0)
    iou = iou_matrix(tracks, detections)
    complete = assign(np.where(iou >= 0.001, iou, near * 0.001 / (min(m, n) + 1)))
    found = _match_all(tracks, detections, reach)
    assert found == dict(zip(complete.track.tolist(), complete.detection.tolist(), strict=True))


def test_overlap_is_preferred_to_a_nearer_chain() -> None:
    # Track 0 overlaps detection 0; two distance matches instead would serve both tracks.
    tracks, detections = _squares((0, 0), (0.9, 0)), _squares((0.3, 0), (-0.6, 0))
    assert _match(tracks, detections, reach=1.0) == {0: 0}
    assert _match(tracks, detections, reach=2.0) == {0: 0, 1: 1}


@pytest.mark.parametrize(
    ("offset", "reach", "matched"),
    [(0.7, 0.8, True), (0.7, 0.6, False), (0.49, 0.0, True), (0.7, 0.0, False)],
)
def test_gate_without_overlap(offset: float, reach: float, matched: bool) -> None:
    found = _match(_squares((0, 0)), _squares((offset, 0)), reach)
    assert found == ({0: 0} if matched else {})


def test_nearer_detection_wins_without_overlap() -> None:
    assert _match(_squares((0, 0)), _squares((0.9, 0), (0, -0.7)), reach=2.0) == {0: 1}


def test_categories_must_be_compatible() -> None:
    def compatible(a: str, b: str) -> bool:
        return bool(COMPATIBLE[CODE[a], CODE[b]])

    assert all(compatible(name, name) and compatible(name, "unknown") for name in CATEGORIES)
    assert not compatible("pedestrian", "car")
    assert not compatible("pedestrian", "cyclist")
    assert compatible("car", "truck")
    np.testing.assert_array_equal(COMPATIBLE, COMPATIBLE.T)


def test_incompatible_boxes_stay_apart_though_they_coincide() -> None:
    box = _squares((0, 0))
    found = associate(
        box, np.array([CODE["car"]]), box, np.array([CODE["pedestrian"]]), np.ones(1), OverlapThenDistance()
    )
    assert found.unmatched_tracks.tolist() == found.unmatched_detections.tolist() == [0]


def test_gate_by_hand() -> None:
    # Chi-square with two degrees of freedom: 99.9 % at 13.816.
    covariance = np.zeros((2, 9, 9))
    covariance[0, 0, 0] = covariance[0, 1, 1] = 0.75
    size, codes = np.full((2, 2), 0.5), np.full(2, CODE["pedestrian"])
    reach = gate_reach_m(covariance, 0.25, size, codes, 0.2, AssociationConfig())
    assert reach[0] == pytest.approx(np.sqrt(13.8155), rel=1e-5)
    assert reach[1] == pytest.approx(np.sqrt(13.8155 * 0.25), rel=1e-5)
    reach = gate_reach_m(covariance, 1e-6, size, codes, 0.2, AssociationConfig())
    assert reach[1] == pytest.approx(0.25 + 0.2 * 15 / 3.6)
    assert not gate_reach_m(covariance, 1.0, size, codes, 0.2, AssociationConfig(gate_probability=0.0)).any()


@pytest.mark.parametrize(
    ("name", "value"), [("iou_threshold", 0.0), ("iou_threshold", 1.5), ("gate_probability", 1.0)]
)
def test_rejects_impossible_limits(name: str, value: float) -> None:
    change: dict[str, Any] = {name: value}
    with pytest.raises(ConfigError, match=f"AssociationConfig.{name}"):
        replace(AssociationConfig(), **change)
