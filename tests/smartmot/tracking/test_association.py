from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from smartmot.errors import ConfigError
from smartmot.filters.kalman import Estimate
from smartmot.overlap import bev_giou, bev_iou
from smartmot.tracking import association
from smartmot.tracking.assignment import solve
from smartmot.tracking.association import COMPATIBLE, AssociationConfig, Associator
from smartmot.types import CATEGORIES, Boxes, FloatArray

CODE = {name: code for code, name in enumerate(CATEGORIES)}


def _squares(*centers: tuple[float, float], size: float = 0.5) -> Boxes:
    return Boxes(np.array(centers), np.full((len(centers), 2), size), np.zeros(len(centers)))


def _estimate(boxes: Boxes) -> Estimate:
    still = np.zeros(len(boxes))
    return Estimate(boxes.center_m, boxes.size_m, boxes.yaw_rad, np.zeros((len(boxes), 2)), still)


def _match(
    tracks: Boxes,
    detections: Boxes,
    reach: float = 1.0,
    variance: float = 0.0,
    first: list[bool] | None = None,
    **settings: Any,
) -> dict[int, int]:
    """Matches of pedestrians with a gate of `reach`, whatever the filter says."""
    config = AssociationConfig(**({"gate_m": reach} | settings))
    codes = [np.full(len(b), CODE["pedestrian"]) for b in (tracks, detections)]
    spread = np.full(len(tracks), variance)
    track, detection = Associator(config, np.full(len(CATEGORIES), 0.01)).match(
        _estimate(tracks),
        codes[0],
        (spread, spread, 0.0 * spread),
        detections,
        codes[1],
        0.1,
        None if first is None else np.array(first),
    )
    return dict(zip(track.tolist(), detection.tolist(), strict=True))


def _best_total(affinity: FloatArray) -> float:
    a = affinity if affinity.shape[0] <= affinity.shape[1] else affinity.T
    rows = range(len(a))
    return max(float(sum(a[i, p[i]] for i in rows)) for p in permutations(range(a.shape[1]), len(a)))


def _assign(affinity: FloatArray, method: str = "hungarian") -> dict[int, int]:
    i, j = np.indices(affinity.shape).reshape(2, -1)
    won = solve(i, j, affinity.ravel(), method)
    return dict(zip(i[won].tolist(), j[won].tolist(), strict=True))


@pytest.mark.parametrize("seed", range(20))
def test_distance_matches_never_cost_overlap(seed: int) -> None:
    # The overlap that the paper's rule finds alone is kept, up to its own threshold.
    rng = np.random.default_rng(seed)
    tracks = _squares(*rng.uniform(0, 3, (7, 2)).tolist(), size=0.8)
    detections = _squares(*rng.uniform(0, 3, (6, 2)).tolist(), size=0.8)
    iou = np.where(bev_iou(tracks, detections) >= 0.001, bev_iou(tracks, detections), 0.0)
    found = _match(tracks, detections, 5.0)
    assert sum(iou[i, j] for i, j in found.items()) > _best_total(iou) - 0.001
    assert len(found) >= len(_assign(iou))


@pytest.mark.parametrize("few_pairs", [0, 1000])
@pytest.mark.parametrize("seed", range(20))
def test_overlaps_left_out_for_uncontested_pairs_change_no_match(
    monkeypatch: pytest.MonkeyPatch, seed: int, few_pairs: int
) -> None:
    monkeypatch.setattr(association, "_FEW_PAIRS", few_pairs)
    rng = np.random.default_rng(seed)
    m, n = rng.integers(1, 12, 2)
    extent = float(rng.choice([2.0, 6.0, 20.0]))
    tracks = _squares(*rng.uniform(0, extent, (m, 2)).tolist(), size=0.8)
    detections = _squares(*rng.uniform(0, extent, (n, 2)).tolist(), size=0.8)
    reach = float(rng.uniform(0.1, 2))
    offset = tracks.center_m[:, None] - detections.center_m
    near = np.maximum(1.0 - np.hypot(offset[..., 0], offset[..., 1]) / reach, 0.0)
    iou = bev_iou(tracks, detections)
    complete = _assign(np.where(iou >= 0.001, iou, near * 0.001 / (min(m, n) + 1)))
    assert _match(tracks, detections, reach) == complete


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
    box, none = _squares((0, 0)), np.zeros(1)
    associator = Associator(AssociationConfig(), np.ones(6))
    car, pedestrian = np.array([CODE["car"]]), np.array([CODE["pedestrian"]])
    assert len(associator.match(_estimate(box), car, (none, none, none), box, pedestrian, 0.1)[0]) == 0
    assert len(associator.match(_estimate(box), car, (none, none, none), box, car, 0.1)[0]) == 1


def test_gate_by_hand() -> None:
    # Chi-square with two degrees of freedom: 99.9 % at 13.816.
    codes, longest = np.full(2, CODE["pedestrian"]), np.full(2, 0.5)
    predicted = np.array([0.75, 0.0])
    reach = Associator(AssociationConfig(), np.full(6, 0.25)).reach_m(predicted, longest, codes, 0.2)
    assert reach[0] == pytest.approx(np.sqrt(13.8155), rel=1e-5)
    assert reach[1] == pytest.approx(np.sqrt(13.8155 * 0.25), rel=1e-5)
    reach = Associator(AssociationConfig(), np.full(6, 1e-6)).reach_m(predicted, longest, codes, 0.2)
    assert reach[1] == pytest.approx(0.25 + 0.2 * 15 / 3.6)
    narrow = Associator(AssociationConfig(widest_gate_m=0.7), np.ones(6))
    assert narrow.reach_m(predicted, longest, codes, 0.2).tolist() == [0.7, 0.7]
    closed = Associator(AssociationConfig(gate_probability=0.0), np.ones(6))
    assert not closed.reach_m(predicted, longest, codes, 0.2).any()


@pytest.mark.parametrize(
    ("gap", "threshold", "matched"), [(0.2, -0.2, True), (0.8, -0.2, False), (0.8, -0.9, True)]
)
def test_generalised_overlap_matches_boxes_apart(gap: float, threshold: float, matched: bool) -> None:
    # Two squares of 0.5 m with a gap g: hull 0.5 (1 + g), union 0.5, so -g / (1 + g).
    tracks, detections = _squares((0, 0)), _squares((0.5 + gap, 0))
    assert bev_giou(tracks, detections)[0] == pytest.approx(-gap / (1.0 + gap))
    found = _match(tracks, detections, 3.0, cost="generalised_overlap", giou_threshold=threshold)
    assert found == ({0: 0} if matched else {})


def test_mahalanobis_allows_what_the_filter_expects() -> None:
    # Quantile 13.8 of the squared distance; variance 0.01 of the measurement.
    tracks, detections = _squares((0, 0)), _squares((1.0, 0))
    for variance, matched in ((0.05, False), (0.08, True)):
        found = _match(tracks, detections, 5.0, variance, cost="mahalanobis")
        assert found == ({0: 0} if matched else {})


@pytest.mark.parametrize("cost", ["distance", "mahalanobis", "generalised_overlap", "overlap"])
def test_every_cost_prefers_the_nearer(cost: str) -> None:
    found = _match(_squares((0, 0)), _squares((0.3, 0), (0.1, 0.1)), 2.0, 1.0, cost=cost)
    assert found == {0: 1}


def test_greedy_takes_the_best_pair_first() -> None:
    affinity = np.array([[0.9, 0.8], [0.7, 0.0]])
    assert _assign(affinity, "greedy") == {0: 0}
    assert _assign(affinity, "hungarian") == {0: 1, 1: 0}


def test_low_scores_have_the_tracks_that_are_left() -> None:
    tracks, detections = _squares((0, 0), (2, 0)), _squares((0.0, 0), (0.2, 0), (2.1, 0))
    assert _match(tracks, detections, 0.5) == {0: 0, 1: 2}
    assert _match(tracks, detections, 0.5, first=[False, True, False]) == {0: 1, 1: 2}


def test_each_category_has_its_own_rule() -> None:
    costs = tuple("distance" if name == "car" else "overlap" for name in CATEGORIES)
    associator = Associator(AssociationConfig(cost=costs, gate_m=5.0), np.ones(6))
    tracks, detections = _squares((0, 0), (0, 50), (0, 100)), _squares((3, 0), (3, 50), (0, 100))
    code = np.array([CODE["car"], CODE["pedestrian"], CODE["pedestrian"]])
    track, detection = associator.match(_estimate(tracks), code, (np.zeros(3),) * 3, detections, code, 0.1)
    assert sorted(zip(track.tolist(), detection.tolist(), strict=True)) == [(0, 0), (2, 2)]


def test_an_unknown_detection_is_given_to_one_track_only() -> None:
    costs = tuple("distance" if name == "car" else "overlap" for name in CATEGORIES)
    associator = Associator(AssociationConfig(cost=costs, gate_m=5.0), np.ones(6))
    tracks, detections = _squares((0, 0), (0.1, 0)), _squares((0, 0))
    code = np.array([CODE["car"], CODE["pedestrian"]])
    _, detection = associator.match(
        _estimate(tracks), code, (np.zeros(2),) * 3, detections, np.array([CODE["unknown"]]), 0.1
    )
    assert detection.tolist() == [0]


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("iou_threshold", 0.0),
        ("iou_threshold", 1.5),
        ("gate_probability", 1.0),
        ("cost", "closeness"),
        ("method", ("greedy",)),
        ("giou_threshold", -2.0),
        ("gate_m", -1.0),
    ],
)
def test_rejects_impossible_settings(name: str, value: Any) -> None:
    change: dict[str, Any] = {name: value}
    with pytest.raises(ConfigError, match=f"AssociationConfig.{name}"):
        replace(AssociationConfig(), **change)


def test_a_distance_cost_needs_a_gate() -> None:
    with pytest.raises(ConfigError, match="distance needs gate_m"):
        AssociationConfig(cost="distance", gate_probability=0.0)
