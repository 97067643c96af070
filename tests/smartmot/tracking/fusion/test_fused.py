"""Several detectors into one tracker: late measurements, scales, trust, times that coincide."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot import (
    Boxes,
    ConfigError,
    Detections,
    DetectorProfile,
    FusedTracker,
    ShapeError,
    Tracker,
    detections_from_arrays,
    tracker_config,
)
from smartmot.tracking.fusion import fused
from smartmot.tracking.fusion.fused import LeftOut
from smartmot.tracking.profile import CategoryProfile

CONFIG = tracker_config("default")
LIDAR, CAMERA = DetectorProfile("lidar", 10.0), DetectorProfile("camera", 15.0, delay_s=0.2, trust=0.7)
BOTH = {"lidar": LIDAR, "camera": CAMERA}


def _frame(
    detector: str, stamp_s: float, center: object, score: float = 0.9, category: str = "car"
) -> Detections:
    places = np.asarray(center, dtype=float).reshape(-1, 2)
    n = len(places)
    size = (0.6, 0.6) if category == "pedestrian" else (4.5, 1.8)
    made, dropped = detections_from_arrays(
        stamp_s, places, [size] * n, [0.0] * n, [score] * n, [category] * n, detector=detector
    )
    assert dropped == 0
    return made


def _drive(seed: int) -> list[Detections]:
    """1.2 s of two cars and a pedestrian seen by both detectors, at some times by both at once."""
    rng = np.random.default_rng(seed)
    made = []
    for detector, step_s in (("lidar", 0.1), ("camera", 0.0625)):
        for k in range(int(1.2 / step_s)):
            t = k * step_s
            center = np.array([[5.0 * t, 0.0], [20.0 - 3.0 * t, 4.0], [8.0, 1.4 * t - 4.0]])
            seen = rng.random(3) < 0.9
            noisy = center[seen] + rng.normal(0.0, 0.1, (int(seen.sum()), 2))
            made.append(_frame(detector, t, noisy, float(rng.uniform(0.4, 1.0))))
    return sorted(made, key=lambda each: each.stamp_s)


def _sum(tracker: FusedTracker, reason: str) -> int:
    return sum(getattr(each, reason) for each in tracker.left_out.values())


def _same(a: FusedTracker, b: FusedTracker) -> None:
    np.testing.assert_array_equal(a.state.tracker.rows, b.state.tracker.rows)
    np.testing.assert_array_equal(a.state.tracker.filtered, b.state.tracker.filtered)
    assert a.state.tracker.next_id == b.state.tracker.next_id
    assert set(a.state.scales) == set(b.state.scales)
    for name, scale in a.state.scales.items():
        np.testing.assert_array_equal(scale.mass, b.state.scales[name].mass)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 50), delays=st.lists(st.floats(0.0, 0.99), min_size=30, max_size=30))
def test_any_order_of_arrival_ends_where_the_order_of_time_ends(seed: int, delays: list[float]) -> None:
    measurements = _drive(seed)
    ordered, shuffled = FusedTracker(CONFIG, BOTH), FusedTracker(CONFIG, BOTH)
    for each in measurements:
        ordered.update(each)
    arrivals = zip(measurements, delays, strict=True)
    for each, _ in sorted(arrivals, key=lambda pair: pair[0].stamp_s + pair[1]):
        tracks = shuffled.update(each)
    assert _sum(shuffled, "too_late") == 0
    _same(ordered, shuffled)
    np.testing.assert_array_equal(tracks.track_id, ordered.at(tracks.stamp_s).track_id)  # type: ignore[union-attr]


def test_one_sure_detector_is_the_plain_tracker() -> None:
    sure = DetectorProfile("lidar", 10.0, {"car": CategoryProfile(100, 1.0)})
    plain, several = Tracker(CONFIG), FusedTracker(CONFIG, {"lidar": sure})
    for each in _drive(3):
        if each.detector == "lidar":
            exact = Detections(each.stamp_s, each.boxes, np.ones(len(each)), each.category, detector="lidar")
            plain.update(exact)
            several.update(exact)
    np.testing.assert_array_equal(plain.state.rows, several.state.tracker.rows)
    np.testing.assert_array_equal(plain.state.filtered, several.state.tracker.filtered)


def test_a_measurement_later_than_the_buffer_is_left_out_and_counted() -> None:
    tracker = FusedTracker(CONFIG, BOTH, buffer_s=0.5)
    for k in range(20):
        tracker.update(_frame("lidar", 0.1 * k, [[1.0 * k, 0.0]]))
    before = tracker.state
    tracks = tracker.update(_frame("camera", 1.3, [[50.0, 50.0]]))
    assert (tracker.left_out, tracks.stamp_s) == (
        {"lidar": LeftOut(), "camera": LeftOut(too_late=1)},
        pytest.approx(1.9),
    )
    assert tracker.state is before
    tracker.update(_frame("camera", 1.45, [[14.5, 0.0]]))
    assert tracker.left_out["camera"].too_late == 1
    assert len(tracker._measurements) == 7  # bounded: 1.4 to 1.9 s, and the late one


def test_the_buffer_is_bounded_in_measurements_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fused, "MOST_MEASUREMENTS", 5)
    tracker = FusedTracker(CONFIG, BOTH, buffer_s=100.0)
    for k in range(20):
        tracker.update(_frame("lidar", 0.1 * k, [[1.0 * k, 0.0]]))
    assert len(tracker._measurements) == 5
    tracker.update(_frame("camera", 0.25, [[2.5, 0.0]]))
    assert tracker.left_out["camera"].too_late == 1


@pytest.mark.parametrize("wrong", ["lidar", "camera"])
def test_a_stamp_of_a_wrong_clock_makes_no_other_too_late(wrong: str) -> None:
    frames = _drive(3)
    clean, disturbed = FusedTracker(CONFIG, BOTH), FusedTracker(CONFIG, BOTH)
    for k, frame in enumerate(frames):
        clean.update(frame)
        if k in (5, 6, 12):  # twice one after the other, once alone; a minute and a day ahead
            tracks = disturbed.update(
                _frame(wrong, frame.stamp_s + (60.0 if k < 12 else 86400.0), [[0.0, 0.0]])
            )
            assert tracks.stamp_s <= frame.stamp_s
        disturbed.update(frame)
    other = "camera" if wrong == "lidar" else "lidar"
    assert (disturbed.left_out[wrong].too_early, disturbed.waiting) == (3, 0)
    assert disturbed.left_out[other] == clean.left_out[other]
    _same(disturbed, clean)


def test_a_detector_whose_clock_is_always_ahead_stops_nobody() -> None:
    lidar, tracker = [k * 0.1 for k in range(40)], FusedTracker(CONFIG, BOTH)
    for stamp_s in lidar:
        tracker.update(_frame("lidar", stamp_s, [[2.0, 3.0]]))
        for early in (0.0, 0.03):
            tracker.update(_frame("camera", stamp_s + early + 3600.0, [[2.0, 3.0]]))
    assert _sum(tracker, "too_late") == 0
    assert tracker.state.tracker.stamp_s == pytest.approx(3.9)
    assert tracker.left_out == {"lidar": LeftOut(), "camera": LeftOut(too_early=2 * 39)}
    assert tracker.waiting == 2
    assert tracker.finish()["camera"].too_early == 2 * 40


def test_after_a_pause_the_second_detector_confirms_the_time_and_alone_a_second_of_measurements() -> None:
    def after(later: list[tuple[str, float]]) -> FusedTracker:
        tracker = FusedTracker(CONFIG, BOTH)
        for name, stamp_s in [("lidar", 0.0), ("camera", 0.05), *later]:
            tracker.update(_frame(name, stamp_s, [[2.0, 3.0]]))
        return tracker

    waiting = after([("lidar", 9.0)])
    assert (waiting.waiting, waiting.state.tracker.stamp_s) == (1, 0.05)
    both = after([("lidar", 9.0), ("camera", 9.02)])
    assert (both.waiting, _sum(both, "too_early"), both.state.tracker.stamp_s) == (0, 0, 9.02)
    _same(both, after([("camera", 9.02), ("lidar", 9.0)]))
    alone = after([("lidar", 9.0 + 0.1 * k) for k in range(12)])
    assert alone.state.tracker.stamp_s == pytest.approx(10.1)
    assert (alone.waiting, _sum(alone, "too_early")) == (0, 0)


def test_the_same_measurement_twice_counts_once() -> None:
    tracker = FusedTracker(CONFIG, BOTH)
    for _ in range(2):
        tracker.update(_frame("lidar", 0.0, [[0.0, 0.0]]))
    assert (tracker.left_out["lidar"].repeated, tracker.state.tracker.rows.shape[0]) == (1, 1)


def test_two_detectors_at_one_time_make_one_track_and_a_surer_one() -> None:
    """Equal noise: two detections halve the variance of the first."""
    alone, both = FusedTracker(CONFIG, BOTH), FusedTracker(CONFIG, BOTH)
    alone.update(_frame("lidar", 0.0, [[0.0, 0.0]]))
    both.update(_frame("lidar", 0.0, [[0.0, 0.0]]))
    tracks = both.update(_frame("camera", 0.0, [[0.2, 0.0]]))
    assert tracks.track_id.tolist() == [1]
    one, two = (t._tracker._filter.position_covariance(t.state.tracker.filtered)[0][0] for t in (alone, both))
    assert two == pytest.approx(0.5 * one)
    np.testing.assert_allclose(tracks.boxes.center_m, [[0.1, 0.0]])


@pytest.mark.parametrize(
    ("sigma_m", "expected_m"), [(0.2, 0.5), (0.02, 1.0 / (1.0 + 0.01)), (2.0, 0.01 / 1.01)]
)
def test_noise_of_the_profile_weighs(sigma_m: float, expected_m: float) -> None:
    """The lidar's configured 0.2 m at 0, then the camera's sigma at 1 m: inverse variances."""
    camera = DetectorProfile("camera", 10.0, {"car": CategoryProfile(9, 1.0, sigma_m)})
    tracker = FusedTracker(CONFIG, {"lidar": None, "camera": camera})
    tracker.update(_frame("lidar", 0.0, [[0.0, 0.0]]))
    tracks = tracker.update(_frame("camera", 0.0, [[1.0, 0.0]]))
    np.testing.assert_allclose(tracks.boxes.center_m, [[expected_m, 0.0]], rtol=1e-9)


def test_a_detector_that_is_hardly_trusted_starts_no_track_and_follows_those_of_others() -> None:
    doubtful = DetectorProfile("camera", 10.0, trust=0.3)  # under `default`'s 0.4 of a sure detection
    tracker = FusedTracker(CONFIG, {"lidar": LIDAR, "camera": doubtful})
    for k in range(20):
        tracks = tracker.update(_frame("camera", 0.1 * k, [[1.0 * k, 0.0]]))
    assert len(tracks) == 0
    tracker.update(_frame("lidar", 2.0, [[20.0, 0.0]]))
    for k in range(21, 60):
        tracks = tracker.update(_frame("camera", 0.1 * k, [[1.0 * k, 0.0]]))
    assert tracker.state.tracker.track_id.tolist() == [1]
    np.testing.assert_allclose(tracker.state.tracker.rows[0, 7], 5.9)  # matched at the last frame


@pytest.mark.parametrize("category", ["car", "cyclist"])
@pytest.mark.parametrize("trust", [0.05, 0.3, 1.0])
def test_sure_boxes_of_little_trust_hide_no_track(category: str, trust: float) -> None:
    """Nine in ten boxes are the camera's: the track is shown in every frame once it is confirmed."""
    camera = DetectorProfile("camera", 20.0, {category: CategoryProfile(9, 0.9)}, trust=trust)
    tracker = FusedTracker(CONFIG, {"lidar": LIDAR, "camera": camera})
    for k in range(100):
        frame = _frame("camera" if k % 10 else "lidar", 0.05 * k, [[0.5 * k, 0.0]], 0.9, category)
        tracks = tracker.update(frame)
        assert len(tracks) == (k >= 3 or category == "car"), k  # cyclists are confirmed after 0.15 s
        # the score is that of the last detection on the common scale, whatever the trust
        np.testing.assert_allclose(tracks.score, np.minimum(0.9 / (0.9 if k % 10 else 1.0), 1.0), atol=0.11)


def test_scores_count_by_each_detectors_own_scale() -> None:
    """A detector whose sure scores are 0.3 starts tracks beside one whose sure scores are 0.95."""
    low = DetectorProfile("camera", 10.0, {"car": CategoryProfile(9, 0.3)})
    tracker = FusedTracker(CONFIG, {"lidar": LIDAR, "camera": low})
    for k in range(10):
        tracker.update(_frame("lidar", 0.1 * k, [[0.0, 0.0]], 0.95))
        tracks = tracker.update(_frame("camera", 0.1 * k, [[0.0, 20.0]], 0.28))
    assert len(tracks) == 2
    assert (tracks.score > 0.85).all()


def test_tracks_of_the_past_are_seen_with_what_came_late() -> None:
    tracker = FusedTracker(CONFIG, BOTH)
    tracker.update(_frame("lidar", 0.0, [[0.0, 0.0]]))
    tracker.update(_frame("lidar", 0.2, [[2.0, 0.0]]))
    tracker.update(_frame("camera", 0.1, [[1.0, 0.0], [1.0, 30.0]]))
    past = tracker.at(0.1)
    assert past is not None
    assert past.track_id.tolist() == [1, 2]
    assert tracker.at(0.15) is None


def test_what_is_wrong_is_named() -> None:
    with pytest.raises(ConfigError, match="one detector or more"):
        FusedTracker(CONFIG, {})
    with pytest.raises(ConfigError, match="buffer_s"):
        FusedTracker(CONFIG, BOTH, buffer_s=-1.0)
    with pytest.raises(ConfigError, match="TrackerConfig"):
        FusedTracker("default", BOTH)  # type: ignore[arg-type]
    tracker = FusedTracker(CONFIG, BOTH)
    with pytest.raises(ConfigError, match="the detectors are lidar, camera"):
        tracker.update(_frame("radar", 0.0, [[0.0, 0.0]]))
    with pytest.raises(ShapeError, match="Detections"):
        tracker.update([1, 2])  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="name"):
        Detections(0.0, Boxes.empty(), np.zeros(0), np.zeros(0, dtype=np.str_), detector=3)  # type: ignore[arg-type]
    for wrong in ({"trust": 0.0}, {"trust": 1.5}, {"delay_s": -1.0}, {"delay_s": True}):
        with pytest.raises(ConfigError, match=r"trust|delay_s"):
            DetectorProfile("camera", 10.0, **wrong)  # type: ignore[arg-type]


def test_delay_and_trust_are_saved_with_a_profile(tmp_path: object) -> None:
    from pathlib import Path

    path = Path(str(tmp_path)) / "camera.json"
    CAMERA.save(path)
    assert DetectorProfile.load(path) == CAMERA


def test_what_only_the_slow_detector_sees_does_not_flicker() -> None:
    """A camera at 2 Hz, 0.3 s late, and a lidar at 10 Hz: shown in every frame once it is known."""
    slow = DetectorProfile("camera", 2.0, delay_s=0.3)
    tracker = FusedTracker(CONFIG, {"lidar": LIDAR, "camera": slow})
    shown = []
    for k in range(60):
        if k >= 3 and (k - 3) % 5 == 0:
            tracker.update(_frame("camera", 0.1 * (k - 3), [[0.0, 30.0]], category="cyclist"))
        tracks = tracker.update(_frame("lidar", 0.1 * k, [[1.0 * k, 0.0]]))
        shown.append("cyclist" in tracks.category.tolist())
    assert all(shown[9:])  # a cyclist is confirmed by the second match


def test_weak_boxes_are_counted_for_the_detector_that_reports_them() -> None:
    sure = {"car": CategoryProfile(100, 0.5)}
    profiles = {
        "lidar": DetectorProfile("lidar", 10.0, sure),
        "camera": DetectorProfile("camera", 10.0, sure, trust=0.5),
    }
    tracker = FusedTracker(replace(CONFIG, score_threshold=0.4), profiles)
    for name in profiles:  # scores of 0.3 count 0.6 of one, and 0.3 of the other
        tracker.update(_frame(name, 0.0, [[0.0, 0.0], [20.0, 0.0]], score=0.3))
    assert tracker.left_out == {"lidar": LeftOut(), "camera": LeftOut(dropped=2, weak=2)}
