from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest

import smartmot
from smartmot import Boxes, ConfigError, Detections, Tracker, TrackerConfig, tracker_config
from smartmot.filters.motion_models import ConstantAcceleration
from smartmot.forecast import ForecastConfig, forecast_times, forecast_tracks
from smartmot.tracking.configs import TRACKER_CONFIGS, forecast_config, forecast_of

NAMES = ["ab3dmot", "centerpoint", "default", "imm", "smartmot", "ukf"]


def _frame(
    stamp_s: float, x: float, category: str = "car", score: float = 0.9, yaw: float = 0.0
) -> Detections:
    boxes = Boxes(np.array([[x, 0.0]]), np.array([[4.4, 1.8]]), np.array([yaw]))
    return Detections(stamp_s, boxes, np.array([score]), np.array([category]))


def test_names() -> None:
    assert sorted(TRACKER_CONFIGS) == NAMES
    assert tracker_config("smartmot") == TrackerConfig.paper()
    with pytest.raises(
        ConfigError,
        match="'sort' is unknown; choose one of ab3dmot, centerpoint, default, imm, smartmot, ukf",
    ):
        tracker_config("sort")


@pytest.mark.parametrize("name", NAMES)
def test_configurations_are_frozen_and_hashable_parts(name: str) -> None:
    config = tracker_config(name)
    with pytest.raises(FrozenInstanceError):
        config.score_threshold = 0.5  # type: ignore[misc]
    assert config == tracker_config(name)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("category", ["car", "pedestrian", "cyclist"])
def test_each_follows_a_moving_object(name: str, category: str) -> None:
    tracker = Tracker(tracker_config(name))
    for k in range(30):
        tracks = tracker.update(_frame(0.1 * k, 0.12 * k, category))
    assert tracks.track_id.tolist() == [1]
    np.testing.assert_allclose(tracks.velocity_mps, [[1.2, 0.0]], atol=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_a_pedestrian_who_sets_off_is_seen_to_move_within_a_second(name: str) -> None:
    """5 km/h at 20 Hz with 5 cm of noise, after a second of standing: only who moves can raise a flag."""
    rng, tracker = np.random.default_rng(3), Tracker(tracker_config(name))
    for k in range(40):
        x = max(k - 20, 0) * 0.05 * 5 / 3.6
        box = Boxes(np.array([[x, 0.0]]) + rng.normal(0.0, 0.05, (1, 2)), np.array([[0.5, 0.5]]), np.zeros(1))
        tracks = tracker.update(Detections(0.05 * k, box, np.ones(1), np.array(["pedestrian"])))
    assert tracks.dynamic.tolist() == [True]


def test_centerpoint_shows_no_coasted_track_and_keeps_the_detected_shape() -> None:
    tracker = Tracker(tracker_config("centerpoint"))
    for k in range(10):
        tracks = tracker.update(_frame(0.1 * k, 0.5 * k, yaw=0.1 * (-1) ** k))
    assert tracks.boxes.yaw_rad[0] == pytest.approx(-0.1)
    assert len(tracker.update(Detections.empty(1.0))) == 0
    assert tracker.update(_frame(1.1, 5.5)).track_id.tolist() == [1]
    assert len(tracker.update(Detections.empty(1.6))) == 0
    assert tracker.update(_frame(1.7, 8.5)).track_id.tolist() == [2]


@pytest.mark.parametrize(("horizon_s", "expected_s"), [(None, 2.0), (0.5, 0.5), (4.0, 4.0)])
def test_centerpoints_forecast_is_a_straight_line(horizon_s: float | None, expected_s: float) -> None:
    tracker = Tracker(tracker_config("centerpoint"))
    for k in range(30):
        tracks = tracker.update(_frame(0.1 * k, 0.8 * k, yaw=0.05 * k))
    config = forecast_config("centerpoint", horizon_s)
    times = forecast_times(config.min_horizon_s, config.step_s)
    forecast = forecast_tracks(tracks, times, config)
    expected = tracks.boxes.center_m[0] + times[:, None] * tracks.velocity_mps[0]
    assert times[-1] == pytest.approx(expected_s)
    np.testing.assert_allclose(forecast.center_m[0], expected, atol=1e-9)


def test_forecasts_of_the_other_configurations() -> None:
    """The paper's and its peer's turn; ours move by category, and so does what has their motion."""
    assert forecast_config("smartmot") == forecast_config("ab3dmot") == ForecastConfig()
    for name in ("default", "imm", "ukf"):
        assert forecast_config(name) == ForecastConfig(model="class")
        assert forecast_of(replace(tracker_config(name), score_reference=0.7)) == ForecastConfig(
            model="class"
        )
    assert forecast_of(tracker_config("centerpoint")) == forecast_config("centerpoint")
    assert forecast_of(TrackerConfig(motion=ConstantAcceleration())) == ForecastConfig()
    assert forecast_config("smartmot", 5.0).min_horizon_s == 5.0
    with pytest.raises(ConfigError, match="'sort' is unknown"):
        forecast_config("sort")
    with pytest.raises(ConfigError, match="min_horizon_s"):
        forecast_config("centerpoint", 0.0)


def test_ab3dmot_confirms_a_car_at_the_third_hit_and_shows_one_missed_frame() -> None:
    tracker = Tracker(tracker_config("ab3dmot"))
    shown = [len(tracker.update(_frame(0.1 * k, 0.5 * k))) for k in range(5)]
    shown += [len(tracker.update(Detections.empty(0.5))), len(tracker.update(Detections.empty(0.6)))]
    assert shown == [0, 0, 1, 1, 1, 1, 0]


def test_default_gives_weak_detections_to_known_tracks_only() -> None:
    """Weak means under 0.4 of what the detector's sure detections have: here that of a car far away, 0.9."""
    tracker = Tracker(tracker_config("default"))

    def shown(k: int, score: float) -> list[int]:
        boxes = Boxes(np.array([[0.0, 0.0], [500.0, 0.0]]), np.array([[4.4, 1.8]] * 2), np.zeros(2))
        frame = Detections(0.1 * k, boxes, np.array([score, 0.9]), np.array(["car"] * 2))
        tracks = tracker.update(frame)
        return tracks.track_id[tracks.boxes.center_m[:, 0] < 250.0].tolist()

    assert shown(0, 0.3) == []
    assert shown(1, 0.9) == [2]
    assert shown(2, 0.3) == [2]
    # A detection so weak still steers the track, but the mean score falls under 0.36: nobody is told.
    assert [shown(k, 0.1) for k in range(3, 9)][-1] == []
    assert [shown(k, 0.9) for k in range(9, 13)][-1] == [2]


@pytest.mark.parametrize(("category", "frames"), [("car", 1), ("pedestrian", 4), ("cyclist", 1)])
def test_default_shows_a_missed_object_for_a_short_time(category: str, frames: int) -> None:
    tracker = Tracker(tracker_config("default"))
    for k in range(10):
        tracker.update(_frame(0.1 * k, 0.1 * k, category))
    shown = [len(tracker.update(Detections.empty(0.1 * k))) for k in range(10, 16)]
    assert shown == [1] * frames + [0] * (6 - frames)


def test_default_forgives_a_wrong_first_heading() -> None:
    tracker = Tracker(tracker_config("default"))
    shown = [
        tracker.update(_frame(0.1 * k, 0.5 * k, yaw=np.pi if k in (0, 5) else 0.1)).boxes.yaw_rad[0]
        for k in range(9)
    ]
    turned = np.abs(np.array(shown)) > np.pi / 2
    assert turned.tolist()[0] is True
    assert not turned[2:].any()  # the second frame may already outvote the first, a single later one never
    assert shown[-1] == pytest.approx(0.1, abs=0.05)


def test_default_confirms_a_cyclist_at_the_third_hit_and_forgives_one_miss() -> None:
    for missing, expected in [((), [0, 0, 1, 1]), ((1,), [0, 0, 1, 1]), ((1, 2), [0, 0, 0, 0])]:
        tracker = Tracker(tracker_config("default"))
        shown = []
        for k in range(4):
            empty = Detections.empty(0.1 * k)
            tracks = tracker.update(empty if k in missing else _frame(0.1 * k, 0.3 * k, "cyclist"))
            shown.append(len(tracks))
        assert shown == expected, missing


def test_a_user_forecasts_with_public_names() -> None:
    """A car at 5 m/s, two seconds ahead in a straight line."""
    tracker = smartmot.Tracker(smartmot.tracker_config("centerpoint"))
    for k in range(20):
        tracks = tracker.update_arrays(0.1 * k, [[0.5 * k, 0.0]], [[4.5, 1.8]], [0.0], [0.9], ["car"])
    config = smartmot.forecast_config("centerpoint")
    forecast = smartmot.forecast_tracks(tracks, np.linspace(0.0, config.max_horizon_s, 5), config)
    np.testing.assert_allclose(forecast.center_m[0, -1], [9.5 + 10.0, 0.0], atol=0.1)


def test_a_user_needs_ten_lines() -> None:
    tracker = smartmot.Tracker(smartmot.tracker_config("default"))
    for stamp_s in (0.0, 0.1, 0.23, 0.3):
        tracks = tracker.update_arrays(
            stamp_s,
            center_m=[[10.0 + 5.0 * stamp_s, 2.0], [30.0, -1.0]],
            size_m=[[4.5, 1.8], [0.6, 0.6]],
            yaw_rad=[0.0, 1.0],
            score=[0.9, 0.8],
            category=["car", "pedestrian"],
        )
    assert tracks.track_id.tolist() == [1, 2]
    np.testing.assert_allclose(tracks.velocity_mps, [[5.0, 0.0], [0.0, 0.0]], atol=0.05)
    assert tracks.category.tolist() == ["car", "pedestrian"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("category", ["car", "pedestrian", "cyclist"])
def test_jitter_of_the_stamps_changes_nothing(name: str, category: str) -> None:
    """Frames 0.1 s apart, give or take 4 ms: the same tracks are shown as without the jitter."""
    rng = np.random.default_rng(0)
    seen = [True, True, False, True, True, True, False, False, False, True, *[False] * 30, True, True, True]
    shown = []
    for jitter_s in (np.zeros(len(seen)), rng.uniform(-0.004, 0.004, len(seen))):
        tracker = Tracker(tracker_config(name))
        tracks = [
            tracker.update(_frame(t, 0.0, category) if found else Detections.empty(t))
            for t, found in zip((0.1 * np.arange(len(seen)) + jitter_s).tolist(), seen, strict=True)
        ]
        shown.append([one.track_id.tolist() for one in tracks])
    assert shown[0] == shown[1]
    assert any(shown[0])
