from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from opendrive import load_map
from smartmot import (
    Boxes,
    Detections,
    EgoState,
    EverythingArea,
    MapArea,
    MapAreaConfig,
    Pipeline,
    PipelineConfig,
    ShapeError,
    Tracker,
    TrackerConfig,
    Tracks,
    route_ahead,
    tracks_from_arrays,
)
from smartmot.errors import PluginError
from smartmot.tracking.own import DYNAMIC_MPS, own, update_own

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"


def frame(stamp_s: float, *centers: tuple[float, float]) -> Detections:
    n = len(centers)
    center = np.array(centers, dtype=np.float64).reshape(-1, 2)
    boxes = Boxes(center, np.full((n, 2), 0.5), np.zeros(n))
    return Detections(stamp_s, boxes, np.ones(n), np.full(n, "pedestrian"))


def follow(detections: Detections, **more: Any) -> Tracks:
    """Every detection a track, numbered in order, at rest."""
    boxes, n = detections.boxes, len(detections)
    values: dict[str, Any] = {"velocity_mps": np.zeros((n, 2)), "category": detections.category} | more
    return tracks_from_arrays(
        detections.stamp_s, range(n), boxes.center_m, boxes.size_m, boxes.yaw_rad, **values
    )


class Following:
    """Tracks as a function of the frame makes them."""

    def __init__(self, made: Callable[[Detections], Any] = follow) -> None:
        self.made = made
        self.frames: list[Detections] = []

    def update(self, detections: Detections) -> Any:
        self.frames.append(detections)
        return self.made(detections)


def test_what_is_left_out_has_the_told_default() -> None:
    velocity = [[DYNAMIC_MPS, 0.0], [0.0, -1.01 * DYNAMIC_MPS]]
    tracks = tracks_from_arrays(
        2.0, [7, 3], [[1, 2], [3, 4]], [[4, 2], [0.5, 0.5]], [0.0, 1.0], ["car", "pedestrian"], velocity
    )
    assert tracks.stamp_s == 2.0
    assert tracks.track_id.tolist() == [7, 3]
    assert tracks.score.tolist() == [1.0, 1.0]
    assert tracks.yaw_rate_radps.tolist() == [0.0, 0.0]
    assert tracks.age_s.tolist() == [np.inf, np.inf]
    assert tracks.coasted_s.tolist() == [0.0, 0.0]
    assert tracks.confirmed.tolist() == [True, True]
    assert tracks.dynamic.tolist() == [False, True]
    assert tracks.mean.shape == (2, 0)
    assert tracks.covariance.shape == (2, 0, 0)
    assert len(tracks[tracks.dynamic]) == 1
    assert len(tracks_from_arrays(0.0, [], [], [], [], [], [])) == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"track_id": [1, 2]},
        {"velocity_mps": [[1.0, 0.0], [0.0, 0.0]]},
        {"age_s": [1.0, 2.0]},
        {"size_m": [[0.0, 1.0]]},
        {"center_m": [[np.nan, 1.0]]},
        {"confirmed": [True, False]},
    ],
)
def test_arrays_that_do_not_fit_are_refused(wrong: dict[str, Any]) -> None:
    good: dict[str, Any] = {
        "stamp_s": 0.0, "track_id": [1], "center_m": [[0.0, 0.0]], "size_m": [[1.0, 1.0]], "yaw_rad": [0.0],
        "category": ["car"], "velocity_mps": [[0.0, 0.0]],
    }  # fmt: skip
    assert len(tracks_from_arrays(**good)) == 1
    with pytest.raises(ShapeError):
        tracks_from_arrays(**good | wrong)


@pytest.mark.parametrize(
    ("made", "told"),
    [
        (lambda d: None, "returned NoneType; return smartmot.Tracks"),
        (lambda d: replace(follow(d), stamp_s=9.0), "the tracks are of 9 s; give the frame's time"),
        (lambda d: replace(follow(d), track_id=np.array([4, 4])), "an identifier comes twice"),
        (lambda d: follow(d, category=["pedestrian", "ghost"]), "got 2 with ['ghost']"),
        (lambda d: follow(d, category=["pedestrian"]), "expected 2 categories"),
        (lambda d: follow(d, velocity_mps=[[np.nan, 0], [0, 0]]), "not finite"),
        (lambda d: follow(d, age_s=[1.0]), "age_s: expected shape (2,)"),
        (lambda d: 1 / 0, "ZeroDivisionError: division by zero ("),
    ],
)
def test_what_a_tracker_must_not_return_is_named(made: Callable[[Detections], Any], told: str) -> None:
    with pytest.raises(PluginError) as caught:
        update_own(Following(made), frame(1.5, (1, 2), (3, 4)))
    message = str(caught.value)
    assert told in message
    assert "test_own:Following, frame at 1.5 s" in message
    assert "\n" not in message


def test_what_has_no_update_is_no_tracker() -> None:
    with pytest.raises(PluginError, match=r"made list, which has no update\(\); see docs/plugins.md"):
        own(list)  # type: ignore[arg-type]


def test_our_own_tracker_plugged_in_gives_what_it_gives_from_within() -> None:
    """Without filtering of tracks nothing tells the two ways apart, frame after frame."""
    config = TrackerConfig()
    settings = PipelineConfig(filter_tracks=False)
    inside = Pipeline(EverythingArea(), replace(settings, tracker=config))
    outside = Pipeline(EverythingArea(), replace(settings, tracker=lambda: Tracker(config)))
    a, b = inside.initial(), outside.initial()
    flags = 0
    for k in range(40):
        t = 0.05 * k
        ego = EgoState(t, 8.0 * t, 0.0, 0.0, 8.0)
        seen = frame(t, (25.0, -4.0 + 1.4 * t), (12.0, 6.0))
        (a, first), (b, second) = inside.step(a, seen, ego), outside.step(b, seen, ego)
        assert first.tracks.track_id.tolist() == second.tracks.track_id.tolist()
        np.testing.assert_array_equal(first.tracks.boxes.center_m, second.tracks.boxes.center_m)
        assert first.command == second.command
        flags += first.command.emergency
    assert 0 < flags < 40


def test_the_monitored_area_filters_what_goes_in_and_what_comes_out() -> None:
    """Eastbound on a street; one on the lane, one 30 m off, and a tracker that reports another there."""

    def with_a_ghost(detections: Detections) -> Tracks:
        n = len(detections) + 1
        center = np.vstack((detections.boxes.center_m, [[5.0, 30.0]]))
        return tracks_from_arrays(
            detections.stamp_s, range(n), center, np.full((n, 2), 0.5), np.zeros(n), ["pedestrian"] * n,
            np.zeros((n, 2)),
        )  # fmt: skip

    network = load_map(MAPS / "urban_street.xodr")
    area = MapArea(
        network, route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, 0.0), MapAreaConfig()
    )
    for filters, shown in ((True, [0]), (False, [0, 1])):
        tracker = Following(with_a_ghost)
        pipeline = Pipeline(
            area, PipelineConfig(tracker=lambda tracker=tracker: tracker, filter_tracks=filters)
        )
        ego = EgoState(0.0, 10.0, -1.75, 0.0, 10.0)
        _, result = pipeline.step(pipeline.initial(), frame(0.0, (16.0, -1.75), (16.0, -30.0)), ego)
        assert [len(seen) for seen in tracker.frames] == [1]
        assert result.tracks.track_id.tolist() == shown
