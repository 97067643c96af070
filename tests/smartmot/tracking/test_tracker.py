import subprocess
import sys
from collections.abc import Sequence

import numpy as np
import pytest

from smartmot.errors import ConfigError, ShapeError, TimeOrderError
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    PerCategory,
)
from smartmot.tracking.association import AssociationConfig, Pairs
from smartmot.tracking.lifecycle import LifecycleConfig
from smartmot.tracking.tracker import ReportConfig, Tracker, TrackerConfig, TrackerState
from smartmot.types import BoolArray, Boxes, Detections, FloatArray, StrArray, Tracks

WALK_MPS = 5.0 / 3.6
SIZES = {"car": (4.4, 1.8), "pedestrian": (0.5, 0.5), "cyclist": (1.8, 0.6), "unknown": (1.0, 1.0)}


def _frame(
    stamp_s: float,
    centers: Sequence[Sequence[float]] | FloatArray,
    category: str | Sequence[str] = "pedestrian",
    yaw: float | FloatArray = 0.0,
    score: float | Sequence[float] = 0.9,
) -> Detections:
    center = np.array(centers, dtype=float).reshape(-1, 2)
    names = [category] * len(center) if isinstance(category, str) else list(category)
    boxes = Boxes(center, np.array([SIZES[n] for n in names]), np.broadcast_to(yaw, len(center)))
    return Detections(stamp_s, boxes, np.broadcast_to(score, len(center)), np.array(names, dtype=np.str_))


def _walk(
    runs: int, frames: int, *, speed: float = WALK_MPS, yaw_noise: float = 0.0, seed: int = 0
) -> list[Tracks]:
    """Many pedestrians 100 m apart walk to the north from the first frame, 20 Hz, 0.05 m of noise."""
    rng = np.random.default_rng(seed)
    tracker, start = Tracker(), 100.0 * np.arange(runs)
    results = []
    for k in range(frames):
        center = np.column_stack((start, np.full(runs, 0.05 * k * speed))) + rng.normal(0, 0.05, (runs, 2))
        results.append(
            tracker.update(_frame(0.05 * k, center, yaw=np.pi / 2 + rng.normal(0, yaw_noise, runs)))
        )
    return results


def test_first_frame_starts_tracks_at_rest() -> None:
    tracks = Tracker().update(_frame(3.0, [[1, 2], [8, 9]]))
    assert tracks.track_id.tolist() == [1, 2]
    assert tracks.stamp_s == 3.0
    assert tracks.confirmed.all()
    assert not tracks.dynamic.any()
    assert not tracks.velocity_mps.any()
    assert not tracks.age_s.any()
    np.testing.assert_allclose(tracks.boxes.center_m, [[1, 2], [8, 9]])
    np.testing.assert_allclose(tracks.boxes.size_m, 0.5)


@pytest.mark.parametrize("yaw_noise", [0.0, 0.05])
def test_velocity_and_turn_rate_settle_within_half_a_second(yaw_noise: float) -> None:
    tracks = _walk(400, 11, yaw_noise=yaw_noise)[-1]
    assert len(tracks) == 400
    error = tracks.velocity_mps - np.array([0.0, WALK_MPS])
    assert np.sqrt((error**2).mean(axis=0)).max() < 0.2
    assert abs(error.mean(axis=0)).max() < 0.05
    assert tracks.yaw_rate_radps.std() < 0.1
    assert tracks.dynamic.all()


def test_covariance_is_no_smaller_than_the_error() -> None:
    tracks = _walk(400, 40)[-1]
    claimed = tracks.covariance[:, 5, 5].mean()
    assert tracks.velocity_mps[:, 0].var() < claimed


def test_noise_does_not_set_a_standing_pedestrian_moving() -> None:
    results = _walk(400, 40, speed=0.0)
    assert np.mean([t.dynamic.mean() for t in results]) < 0.02
    assert np.mean([t.dynamic.mean() for t in results[10:]]) < 0.002


@pytest.mark.parametrize("noise_m", [0.0, 0.05])
def test_a_start_from_standstill_is_seen_within_three_tenths(noise_m: float) -> None:
    rng, runs = np.random.default_rng(1), 300
    tracker, start = Tracker(), 100.0 * np.arange(runs)
    for k in range(46):
        walked = max(0.0, 0.05 * k - 2.0) * WALK_MPS
        center = np.column_stack((start, np.full(runs, walked))) + rng.normal(0, noise_m, (runs, 2))
        tracks = tracker.update(_frame(0.05 * k, center))
        if k == 40:
            assert tracks.dynamic.mean() < 0.02
    # k = 45 is 0.25 s after the first step.
    assert tracks.dynamic.mean() > 0.95


def test_velocity_is_exact_without_noise() -> None:
    tracker = Tracker()
    for k in range(60):
        tracks = tracker.update(_frame(0.05 * k, [[12.0 * 0.05 * k, 3.0]], "car"))
    np.testing.assert_allclose(tracks.velocity_mps, [[12.0, 0.0]], atol=0.01)
    np.testing.assert_allclose(tracks.boxes.center_m, [[12.0 * 0.05 * 59, 3.0]], atol=1e-3)


def test_turning_car_has_its_turn_rate() -> None:
    tracker, rate, speed = Tracker(), 0.4, 6.0
    for k in range(80):
        yaw = rate * 0.05 * k
        center = speed / rate * np.array([[np.sin(yaw), 1.0 - np.cos(yaw)]])
        tracks = tracker.update(_frame(0.05 * k, center, "car", yaw=yaw))
    assert tracks.yaw_rate_radps[0] == pytest.approx(rate, abs=0.01)
    assert np.hypot(*tracks.velocity_mps[0]) == pytest.approx(speed, rel=0.02)


def test_velocity_follows_hard_braking() -> None:
    tracker, x, speed, worst = Tracker(), 0.0, 15.0, 0.0
    for k in range(70):
        tracks = tracker.update(_frame(0.05 * k, [[x, 0]], "car"))
        if k > 25:
            worst = max(worst, abs(speed - tracks.velocity_mps[0, 0]))
        brake = 8.0 if k >= 30 and speed > 0.0 else 0.0
        x += 0.05 * speed - 0.5 * brake * 0.05**2
        speed = max(0.0, speed - brake * 0.05)
    assert worst < 1.5
    assert not tracks.dynamic[0]


def test_flipped_headings_do_not_turn_the_track() -> None:
    tracker = Tracker()
    for k in range(30):
        tracks = tracker.update(_frame(0.05 * k, [[0, 0]], "car", yaw=0.2 + np.pi * (k % 3 == 1)))
    assert tracks.boxes.yaw_rad[0] == pytest.approx(0.2, abs=1e-9)
    assert tracks.yaw_rate_radps[0] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("first_step_m", [0.7, 15 / 3.6 * 0.2])
def test_a_runner_at_5_hz_keeps_its_id(first_step_m: float) -> None:
    # 0.5 m wide, more than its own size per frame: the boxes never overlap before the speed is known.
    tracker = Tracker()
    ids = [tracker.update(_frame(0.2 * k, [[0, first_step_m * k]])).track_id.tolist() for k in range(20)]
    assert ids == [[1]] * 20


def test_a_sudden_start_at_5_hz_keeps_its_id() -> None:
    tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(max_age_s=0.5)))
    position = np.cumsum([0.0] * 10 + [15 / 3.6 * 0.2] * 10)
    ids = [tracker.update(_frame(0.2 * k, [[0, y]])).track_id.tolist() for k, y in enumerate(position)]
    assert ids == [[1]] * 20


def test_the_papers_rule_loses_the_runner() -> None:
    tracker = Tracker(TrackerConfig.paper())
    ids = [tracker.update(_frame(0.2 * k, [[0, 0.7 * k]])).track_id.tolist() for k in range(4)]
    assert ids == [[1], [2], [3], [4]]


@pytest.mark.parametrize("config", [TrackerConfig(), TrackerConfig.paper()], ids=["default", "paper"])
def test_crossing_pedestrians_keep_their_ids(config: TrackerConfig) -> None:
    rng = np.random.default_rng(2)
    tracker = Tracker(config)
    for k in range(80):
        t = 0.05 * k - 2.0
        centers = np.array([[WALK_MPS * t, 0.3], [-WALK_MPS * t, -0.3], [0.3, 3.0 * WALK_MPS * t]])
        tracks = tracker.update(_frame(0.05 * k, centers + rng.normal(0, 0.02, (3, 2))))
        assert tracks.track_id.tolist() == [1, 2, 3]
    np.testing.assert_allclose(tracks.boxes.center_m, centers, atol=0.2)


def test_pedestrian_beside_a_car_is_its_own_track() -> None:
    tracker = Tracker()
    for k in range(10):
        order = [0, 1] if k % 2 else [1, 0]
        frame = _frame(0.05 * k, [[0, 0], [0.5, 0.5]], ["car", "pedestrian"])
        tracks = tracker.update(frame[np.array(order)])
    assert dict(zip(tracks.track_id.tolist(), tracks.category.tolist(), strict=True)) == {
        1: "pedestrian",
        2: "car",
    }


def test_unknown_track_learns_its_category() -> None:
    tracker = Tracker()
    tracker.update(_frame(0.0, [[0, 0]], "unknown"))
    tracks = tracker.update(_frame(0.05, [[0, 0]], "cyclist"))
    tracks = tracker.update(_frame(0.10, [[0, 0]], "unknown"))
    assert (tracks.track_id.tolist(), tracks.category.tolist()) == ([1], ["cyclist"])


@pytest.mark.parametrize("dt_s", [0.01, 0.05, 0.1, 0.15])
def test_a_track_dies_by_time_not_by_frames(dt_s: float) -> None:
    tracker = Tracker()
    tracker.update(_frame(0.0, [[0, 0]]))
    for k in range(1, 30):
        tracks = tracker.update(Detections.empty(dt_s * k))
        assert len(tracks) == (dt_s * k <= 0.15 + 1e-6)
        if len(tracks):
            assert tracks.coasted_s[0] == pytest.approx(dt_s * k)


def test_a_coasting_track_moves_on_and_is_found_again() -> None:
    tracker = Tracker()
    for k in range(20):
        tracker.update(_frame(0.05 * k, [[0.5 * k, 0]], "car"))
    for k in range(20, 23):
        tracks = tracker.update(Detections.empty(0.05 * k))
        assert tracks.boxes.center_m[0, 0] == pytest.approx(0.5 * k, abs=0.05)
    tracks = tracker.update(_frame(0.05 * 23, [[0.5 * 23, 0]], "car"))
    assert tracks.track_id.tolist() == [1]
    assert tracks.coasted_s.tolist() == [0.0]


def test_ids_are_never_used_again() -> None:
    tracker, other = Tracker(), Tracker()
    tracker.update(_frame(0.0, [[0, 0], [9, 9]]))
    tracker.update(Detections.empty(1.0))
    assert tracker.update(_frame(2.0, [[0, 0]])).track_id.tolist() == [3]
    assert other.update(_frame(2.0, [[0, 0]])).track_id.tolist() == [1]
    tracker.reset()
    assert tracker.update(_frame(0.0, [[0, 0]])).track_id.tolist() == [1]


@pytest.mark.parametrize(("pause_s", "same"), [(0.5, True), (1.9, True), (2.1, False), (1e9, False)])
def test_a_pause_in_the_recording_ends_the_tracks(pause_s: float, same: bool) -> None:
    tracker = Tracker()
    for k in range(10):
        tracker.update(_frame(0.1 * k, [[0, 0]]))
    tracks = tracker.update(_frame(0.9 + pause_s, [[0, 0]]))
    assert tracks.track_id.tolist() == [1 if same else 2]


@pytest.mark.parametrize("motion", [ConstantVelocity(), ConstantAcceleration(), ConstantTurnRate()])
@pytest.mark.parametrize("cost", ["overlap_then_distance", "generalised_overlap", "mahalanobis"])
def test_whatever_comes_in_numbers_come_out(
    motion: ConstantVelocity | ConstantAcceleration | ConstantTurnRate, cost: str
) -> None:
    """Damaged rows, boxes in one heap, frames of any spacing: finite states, covariances and unique ids."""
    rng = np.random.default_rng(5)
    damage = [np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-320, 1e300]
    tracker = Tracker(TrackerConfig(motion=motion, association=AssociationConfig(cost=cost)))
    stamp_s = 1.7e9
    for _ in range(60):
        stamp_s += rng.choice([1e-4, 0.05, 0.1, 1.0, 30.0, 1e6])
        n = int(rng.integers(0, 10))
        rows = np.column_stack(
            (rng.normal(0, 4, (n, 2)), rng.uniform(0.3, 5, (n, 2)), rng.normal(0, 3, (n, 3)), rng.random(n))
        )
        wrong = rng.random(rows.shape) < 0.02
        rows[wrong] = rng.choice(damage, np.count_nonzero(wrong))
        tracks = tracker.update_arrays(
            *(stamp_s, rows[:, :2], rows[:, 2:4], rows[:, 4], rows[:, 7]),
            category=rng.choice(["car", "pedestrian", "cyclist", "unknown"], n),
            velocity_mps=rows[:, 5:7],
        )
        assert len(np.unique(tracks.track_id)) == len(tracks)
        for values in (tracks.mean, tracks.boxes.center_m, tracks.velocity_mps, tracks.yaw_rate_radps):
            assert np.isfinite(values).all()
        if len(tracks):
            least = np.linalg.eigvalsh(tracks.covariance).min()
            assert least >= -1e-9 * np.abs(tracks.covariance).max()
    assert tracker.rejected > 0


def test_irregular_frame_times() -> None:
    rng = np.random.default_rng(3)
    stamps = np.cumsum(rng.uniform(0.01, 0.14, 60))
    tracker = Tracker()
    for stamp in stamps:
        tracks = tracker.update(_frame(stamp, [[3.0 * stamp, -1.0 * stamp]]))
        assert tracks.track_id.tolist() == [1]
    np.testing.assert_allclose(tracks.velocity_mps, [[3.0, -1.0]], atol=0.02)
    assert tracks.age_s[0] == pytest.approx(stamps[-1] - stamps[0])


@pytest.mark.parametrize("stamp", [1.0, 0.5])
def test_time_must_advance(stamp: float) -> None:
    tracker = Tracker()
    tracker.update(_frame(1.0, [[0, 0]]))
    with pytest.raises(TimeOrderError, match=rf"frame at {stamp!r} s is not newer .* 1\.0 s"):
        tracker.update(_frame(stamp, [[0, 0]]))
    assert tracker.update(_frame(1.05, [[0, 0]])).track_id.tolist() == [1]


@pytest.mark.parametrize("stamp", [np.nan, np.inf, -np.inf])
def test_a_stamp_must_be_a_number(stamp: float) -> None:
    for frame in (Detections.empty, lambda stamp_s: _frame(stamp_s, [[0, 0]])):
        with pytest.raises(TimeOrderError, match="finite"):
            Tracker().update(frame(stamp))


def test_the_first_contested_frame_imports_nothing() -> None:
    """Two cars that meet, so that both want the same boxes; and a heap so large that its pairs are searched.

    An import in a frame was a stall of 300 ms.
    """
    program = """
import sys
import numpy as np
import smartmot
trackers = [smartmot.Tracker(smartmot.tracker_config(name)) for name in smartmot.TRACKER_CONFIGS]
before = set(sys.modules)
x = 4.0 * np.arange(400.0)
for tracker in trackers:
    for k in range(60):
        place = [[0.0, 0.0], [20.0 - 0.35 * k, 0.0]]
        tracker.update_arrays(0.1 * k, place, [[4.5, 1.8]] * 2, [0, 0], [0.9, 0.9], ["car"] * 2)
    for k in range(60, 64):
        place = np.column_stack((x + 0.5 * k, np.zeros(400)))
        tracker.update_arrays(0.1 * k, place, [[4.5, 1.8]] * 400, [0] * 400, [0.9] * 400, ["car"] * 400)
print(sorted(set(sys.modules) - before))
"""
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (run.stdout.strip(), run.stderr) == ("[]", "")


def test_empty_frames() -> None:
    tracker = Tracker()
    assert len(tracker.update(Detections.empty(0.0))) == 0
    assert len(tracker.update(Detections.empty(0.1))) == 0
    assert tracker.update(_frame(0.2, [[0, 0]])).track_id.tolist() == [1]


def test_low_scores_are_dropped() -> None:
    tracks = Tracker().update(_frame(0.0, [[0, 0], [9, 0], [18, 0]], score=[0.29, 0.3, 0.9]))
    assert tracks.score.tolist() == [0.3, 0.9]
    np.testing.assert_allclose(tracks.boxes.center_m[:, 0], [9, 18])


def _ahead(boxes: Boxes, category: StrArray) -> BoolArray:
    assert len(boxes) == len(category)
    inside: BoolArray = boxes.center_m[:, 0] > 0.0
    return inside


def test_no_birth_outside_the_monitored_area() -> None:
    tracker = Tracker()
    tracks = tracker.update(_frame(0.0, [[-5, 0], [5, 0]]), _ahead)
    assert tracks.track_id.tolist() == [1]
    assert tracks.boxes.center_m[0, 0] == 5.0


def test_a_track_dies_when_outside_for_longer_than_max_age() -> None:
    tracker = Tracker()
    alive = [
        len(tracker.update(_frame(0.05 * k, [[0.51 - 0.1 * k, 0]], "cyclist"), _ahead)) for k in range(12)
    ]
    # Outside from k = 6 on: the last frame inside is 5, three more survive.
    assert alive == [1] * 9 + [0] * 3


def test_a_short_visit_outside_is_forgiven() -> None:
    tracker = Tracker()
    ids = [
        tracker.update(_frame(0.05 * k, [[0.01 if k % 3 else -0.01, 0]]), _ahead).track_id.tolist()
        for k in range(1, 30)
    ]
    assert ids == [[1]] * 29


def test_monitored_must_answer_for_every_track() -> None:
    with pytest.raises(ShapeError, match="monitored: expected"):
        Tracker().update(_frame(0.0, [[0, 0], [9, 9]]), lambda center, category: np.array([True]))


def test_confirmation_by_time() -> None:
    tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(confirm_s=0.1)))
    confirmed = [bool(tracker.update(_frame(0.05 * k, [[0, 0]])).confirmed[0]) for k in range(4)]
    assert confirmed == [False, False, True, True]


def test_outliers_are_rejected_by_category() -> None:
    config = TrackerConfig(outlier_speed_mps=PerCategory(60, 5, 25, 60, 60, 60))
    tracker = Tracker(config)
    for k in range(30):
        frame = _frame(0.05 * k, [[8 * 0.05 * k, 0], [8 * 0.05 * k, 9]], ["pedestrian", "car"])
        tracks = tracker.update(frame)
    assert tracks.dynamic.tolist() == [False, True]
    np.testing.assert_allclose(tracks.velocity_mps, [[0, 0], [8, 0]], atol=0.05)
    assert tracks.mean[0, 5] == pytest.approx(8.0, abs=0.05)


def test_step_is_a_function_of_its_arguments() -> None:
    tracker, rng = Tracker(), np.random.default_rng(4)
    frames = [_frame(0.05 * k, rng.normal(0, 5, (6, 2))) for k in range(10)]
    states = [TrackerState.empty()]
    for frame in frames:
        states.append(tracker.step(states[-1], frame)[0])
    again, tracks = tracker.step(states[4], frames[4])
    np.testing.assert_array_equal(again.rows, states[5].rows)
    np.testing.assert_array_equal(again.filtered, states[5].filtered)
    assert len(tracker.state) == 0
    assert tracks.track_id.tolist() == states[5].track_id.tolist()
    with pytest.raises(ValueError, match="read-only"):
        again.filtered[0] = 0.0


def test_update_equals_step() -> None:
    rng = np.random.default_rng(5)
    tracker, state = Tracker(), TrackerState.empty()
    for k in range(10):
        frame = _frame(0.05 * k, rng.normal(0, 3, (5, 2)))
        state, functional = Tracker().step(state, frame)
        stateful = tracker.update(frame)
        np.testing.assert_array_equal(functional.mean, stateful.mean)
        np.testing.assert_array_equal(functional.track_id, stateful.track_id)


def test_tracks_do_not_depend_on_where_the_map_origin_is() -> None:
    rng, shift = np.random.default_rng(6), np.array([1234.0, -4321.0])
    near, far = Tracker(), Tracker()
    for k in range(30):
        centers = np.array([[0.2 * k, 0.0], [5.0, 0.07 * k]]) + rng.normal(0, 0.05, (2, 2))
        here, there = near.update(_frame(0.05 * k, centers)), far.update(_frame(0.05 * k, centers + shift))
    np.testing.assert_allclose(there.boxes.center_m - shift, here.boxes.center_m, atol=1e-9)
    np.testing.assert_allclose(there.velocity_mps, here.velocity_mps, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "value"), [("score_threshold", 1.1), ("dynamic_speed_mps", -1.0), ("dynamic_sigmas", np.nan)]
)
def test_rejects_impossible_settings(name: str, value: float) -> None:
    with pytest.raises(ConfigError, match=f"TrackerConfig.{name}: allowed"):
        TrackerConfig(**{name: value})  # type: ignore[arg-type]


def test_what_is_no_configuration_and_no_frame_is_named() -> None:
    with pytest.raises(
        ConfigError, match=r"expected a TrackerConfig, got 'default'; smartmot.tracker_config"
    ):
        Tracker("default")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="motion: expected a motion model, got 'cv'"):
        Tracker(TrackerConfig(motion="cv"))  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="got dict; plain arrays go to update_arrays"):
        Tracker().update({"center_m": []})  # type: ignore[arg-type]
    with pytest.raises(ShapeError, match="stamp_s: expected a number of seconds, got 'now'"):
        Tracker().update_arrays("now", [], [], [])  # type: ignore[arg-type]


def test_paper_thresholds() -> None:
    assert TrackerConfig.paper().dynamic_speed_mps == 0.5
    assert TrackerConfig.paper(with_map=False).dynamic_speed_mps == 1.0


def test_what_is_reported() -> None:
    def ids(report: ReportConfig, confirm_s: float = 0.1) -> list[list[int]]:
        lifecycle = LifecycleConfig(confirm_s=confirm_s, max_age_s=0.5)
        tracker = Tracker(TrackerConfig(lifecycle=lifecycle, report=report, score_threshold=0.0))
        scores: list[float | None] = [0.6, 0.6, 0.2, None, None]
        return [
            tracker.update(
                Detections.empty(0.1 * k) if score is None else _frame(0.1 * k, [[0, 0]], score=score)
            ).track_id.tolist()
            for k, score in enumerate(scores)
        ]

    assert ids(ReportConfig()) == [[1], [1], [1], [1], [1]]
    assert ids(ReportConfig(tentative=False)) == [[], [1], [1], [1], [1]]
    assert ids(ReportConfig(coasted_s=0.1)) == [[1], [1], [1], [1], []]
    assert ids(ReportConfig(coasted_s=0.0)) == [[1], [1], [1], [], []]
    assert ids(ReportConfig(score=0.5)) == [[1], [1], [], [], []]
    assert ids(ReportConfig(mean_score=0.5)) == [[1], [1], [], [], []]


def test_detected_boxes_have_no_lag_and_coasted_ones_are_predicted() -> None:
    filtered, detected = Tracker(), Tracker(TrackerConfig(report=ReportConfig(detected_boxes=True)))
    rng = np.random.default_rng(8)
    for k in range(20):
        center = np.array([[0.3 * k, 0.0], [0.0, 9.0]]) + rng.normal(0, 0.1, (2, 2))
        frame = _frame(0.1 * k, center, yaw=rng.normal(0, 0.1, 2))
        smooth, raw = filtered.update(frame), detected.update(frame)
        np.testing.assert_array_equal(raw.boxes.center_m[np.argsort(raw.track_id)], center)
        np.testing.assert_array_equal(raw.mean, smooth.mean)
    assert not np.allclose(smooth.boxes.center_m, center, atol=1e-3)
    end = Detections.empty(2.0)
    np.testing.assert_allclose(detected.update(end).boxes.center_m, filtered.update(end).boxes.center_m)


def test_detected_boxes_are_reported_with_a_monitored_area_too() -> None:
    tracker = Tracker(TrackerConfig(report=ReportConfig(detected_boxes=True)))
    for k in range(3):
        detections = _frame(0.1 * k, [[0.1 * k, 0.0], [5.0, 0.0]])
        tracks = tracker.update(detections, lambda boxes, category: boxes.center_m[:, 0] > -1.0)
        np.testing.assert_array_equal(tracks.boxes.center_m, detections.boxes.center_m)


def test_a_coasting_track_stays_hidden_when_another_dies_in_the_same_frame() -> None:
    # One track has no detection, another has one but has left the monitored area: two rules in one frame.
    tracker = Tracker(
        TrackerConfig(lifecycle=LifecycleConfig(max_age_s=0.1), report=ReportConfig(coasted_s=0.0))
    )
    all_three = [[0, 0], [5, 0], [10, 0]]
    tracker.update(_frame(0.0, all_three))
    for stamp in (0.05, 0.1):
        tracker.update(_frame(stamp, all_three), lambda boxes, category: boxes.center_m[:, 0] < 9.0)
    tracks = tracker.update(_frame(0.15, all_three[1:]), lambda boxes, category: boxes.center_m[:, 0] < 9.0)
    assert tracker.state.track_id.tolist() == [1, 2]
    assert tracks.track_id.tolist() == [2]


def test_weak_detections_start_nothing_and_come_second() -> None:
    tracker = Tracker(TrackerConfig(score_threshold=0.0, second_stage_score=0.5))
    assert len(tracker.update(_frame(0.0, [[0, 0]], score=0.4))) == 0
    assert tracker.update(_frame(0.1, [[0, 0]], score=0.9)).track_id.tolist() == [1]
    # The weak one is nearer, but the strong one is asked first.
    tracks = tracker.update(_frame(0.2, [[0, 0], [0.1, 0]], score=[0.4, 0.9]))
    assert (tracks.track_id.tolist(), tracks.score.tolist()) == ([1], [0.9])
    assert tracker.update(_frame(0.3, [[0.1, 0]], score=0.4)).coasted_s.tolist() == [0.0]


def test_birth_score_limits_births_only() -> None:
    tracker = Tracker(TrackerConfig(lifecycle=LifecycleConfig(birth_score=0.6), score_threshold=0.0))
    assert tracker.update(_frame(0.0, [[0, 0], [9, 9]], score=[0.5, 0.7])).track_id.tolist() == [1]
    assert tracker.update(_frame(0.1, [[9, 9]], score=0.1)).coasted_s.tolist() == [0.0]


@pytest.mark.parametrize("motion", [ConstantVelocity(), ConstantAcceleration(), ConstantTurnRate()])
def test_a_detectors_velocity_is_used_from_the_first_frame(motion: ConstantVelocity) -> None:
    def frame(stamp_s: float) -> Detections:
        plain = _frame(stamp_s, [[10.0 * stamp_s, 0.0]], "car")
        return Detections(plain.stamp_s, plain.boxes, plain.score, plain.category, np.array([[10.0, 0.0]]))

    config = TrackerConfig(motion=motion, filter=BevFilterConfig(velocity_sigma_mps=0.2))
    tracks = Tracker(config).update(frame(0.0))
    np.testing.assert_allclose(tracks.velocity_mps, [[10.0, 0.0]], atol=0.02)
    assert tracks.dynamic[0]
    ignoring = Tracker(TrackerConfig(motion=motion, filter=BevFilterConfig(use_velocity=False)))
    assert not ignoring.update(frame(0.0)).velocity_mps.any()


def test_constant_acceleration_follows_braking_without_lag() -> None:
    tracker, x, speed = Tracker(TrackerConfig(motion=ConstantAcceleration())), 0.0, 20.0
    for k in range(40):
        tracks = tracker.update(_frame(0.05 * k, [[x, 0]], "car"))
        x, speed = x + 0.05 * speed - 0.5 * 6.0 * 0.05**2, speed - 6.0 * 0.05
    assert tracks.velocity_mps[0, 0] == pytest.approx(speed + 0.3, abs=0.1)
    assert tracks.mean[0, 9] == pytest.approx(-6.0, abs=0.3)


def test_many_objects_equal_few_at_a_time() -> None:
    # Beyond some thousand pairs the gate is a tree; groups far apart must not notice each other.
    rng = np.random.default_rng(9)
    groups = [rng.uniform(0, 30, (40, 2)) + np.array([300.0 * g, 0.0]) for g in range(6)]
    together, alone = Tracker(), [Tracker() for _ in groups]
    for k in range(8):
        moved = [g + 0.1 * k + np.random.default_rng(k).normal(0, 0.05, g.shape) for g in groups]
        whole = together.update(_frame(0.1 * k, np.concatenate(moved)))
        parts = [t.update(_frame(0.1 * k, m)) for t, m in zip(alone, moved, strict=True)]
    np.testing.assert_allclose(
        np.sort(whole.boxes.center_m, axis=0),
        np.sort(np.concatenate([p.boxes.center_m for p in parts]), axis=0),
        atol=1e-9,
    )
    assert together.state.next_id - 1 == sum(t.state.next_id - 1 for t in alone)


def test_a_users_own_affinity_takes_the_costs_place() -> None:
    def likes_the_south(pairs: Pairs, threshold: FloatArray) -> FloatArray:
        wanted: FloatArray = np.where(pairs.offset_m[:, 1] < 0.0, 1.0, 0.0)
        return wanted

    tracker = Tracker(TrackerConfig(), likes_the_south)
    tracker.update(_frame(0.0, [[0, 0]]))
    tracks = tracker.update(_frame(0.1, [[0, 0.1], [0, -0.3]]))
    matched = tracks[tracks.track_id == 1]
    assert matched.coasted_s.tolist() == [0.0]
    assert matched.boxes.center_m[0, 1] < 0.0


@pytest.mark.parametrize(
    ("config", "drop", "start"),
    [
        (TrackerConfig(), 0.3, 0.3),
        (TrackerConfig(score_threshold=0.1, second_stage_score=0.5), 0.1, 0.5),
        (TrackerConfig(lifecycle=LifecycleConfig(birth_score=0.6)), 0.3, 0.6),
        (TrackerConfig(report=ReportConfig(score=0.7)), 0.3, 0.7),
        (TrackerConfig(report=ReportConfig(mean_score=0.8)), 0.3, 0.8),
    ],
)
def test_score_limits_say_which_detections_are_dropped_and_which_can_be_reported(
    config: TrackerConfig, drop: float, start: float
) -> None:
    limits = Tracker(config).score_limits
    scores = [drop - 0.01, drop, start - 0.01, start]
    frame = _frame(0.0, [[20.0 * k, 0.0] for k in range(4)], score=scores)
    assert limits.counts(frame) == (sum(s < drop for s in scores), sum(s >= start for s in scores))
    assert limits.counts(Detections.empty(0.0)) == (0, 0)
    for score in (start - 0.01, start):  # what the limits say is what comes out
        shown = Tracker(config).update(_frame(0.0, [[0.0, 0.0]], score=score))
        assert len(shown) == (score >= start)


def test_score_limits_go_by_category() -> None:
    least = PerCategory(0.2, pedestrian=0.6, cyclist=0.2, truck=0.2, motorcycle=0.2, unknown=0.2)
    limits = Tracker(TrackerConfig(score_threshold=least)).score_limits
    frame = _frame(0.0, [[0.0, 0.0], [20.0, 0.0]], category=["car", "pedestrian"], score=0.4)
    assert limits.counts(frame) == (1, 1)
