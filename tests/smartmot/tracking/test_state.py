import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from smartmot.errors import ConfigError, ShapeError
from smartmot.filters.motion_models import ConstantAcceleration, ConstantTurnRate
from smartmot.tracking.configs import TRACKER_CONFIGS
from smartmot.tracking.state import COLUMNS, FILE_VERSION, TrackerState
from smartmot.tracking.tracker import Tracker, TrackerConfig
from smartmot.types import Boxes, Detections


def _frames(count: int) -> list[Detections]:
    rng = np.random.default_rng(0)
    frames = []
    for k in range(count):
        n = int(rng.integers(0, 8))
        boxes = Boxes(rng.uniform(0, 15, (n, 2)), rng.uniform(0.5, 4, (n, 2)), rng.uniform(-3, 3, n))
        names = rng.choice(["car", "pedestrian", "cyclist", "unknown"], n).astype(np.str_)
        frames.append(Detections(1.7e9 + 0.1 * k, boxes, rng.uniform(0, 1, n), names))
    return frames


CONFIGS = TRACKER_CONFIGS | {
    "turning": TrackerConfig(motion=ConstantTurnRate()),
    "accelerating": TrackerConfig(motion=ConstantAcceleration()),
}


@pytest.mark.parametrize("name", CONFIGS)
def test_a_resumed_tracker_goes_on_as_if_never_stopped(name: str, tmp_path: Path) -> None:
    config = CONFIGS[name]
    frames, path = _frames(40), tmp_path / "state.npz"
    whole, first = Tracker(config), Tracker(config)
    for frame in frames[:20]:
        whole.update(frame)
        first.update(frame)
    first.state.save(path)
    second = Tracker(config)
    second.state = TrackerState.load(path)
    for frame in frames[20:]:
        a, b = whole.update(frame), second.update(frame)
        for field in ("track_id", "category", "score", "mean", "covariance", "velocity_mps", "confirmed"):
            np.testing.assert_array_equal(getattr(a, field), getattr(b, field))
        np.testing.assert_array_equal(a.boxes.center_m, b.boxes.center_m)
    assert whole.state.next_id == second.state.next_id > 1


@pytest.mark.parametrize("name", CONFIGS)
def test_a_tracker_can_be_copied_to_another_process(name: str) -> None:
    whole, frames = Tracker(CONFIGS[name]), _frames(30)
    for frame in frames[:15]:
        whole.update(frame)
    copied = pickle.loads(pickle.dumps(whole))
    for frame in frames[15:]:
        a, b = whole.update(frame), copied.update(frame)
        np.testing.assert_array_equal(a.track_id, b.track_id)
        np.testing.assert_array_equal(a.mean, b.mean)


def test_an_empty_state_survives_the_file(tmp_path: Path) -> None:
    TrackerState.empty().save(tmp_path / "state")
    state = TrackerState.load(tmp_path / "state")
    assert state.stamp_s is None
    assert (state.next_id, len(state)) == (1, 0)
    assert len(Tracker().step(state, _frames(1)[0])[0]) >= 0


def test_columns_can_be_read() -> None:
    tracker = Tracker()
    for frame in _frames(5):
        tracks = tracker.update(frame)
    np.testing.assert_array_equal(tracker.state.track_id, tracks.track_id)
    np.testing.assert_array_equal(tracker.state.confirmed, tracks.confirmed)
    assert tracker.state.category_code.dtype == np.int64


@pytest.mark.parametrize(
    "content",
    [b"", b"not a file of arrays", b"PK\x03\x04 broken"],
    ids=["empty", "text", "broken zip"],
)
def test_a_wrong_file_is_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "state.npz"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=r"state\.npz: not a readable tracker state"):
        TrackerState.load(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"version": np.array(FILE_VERSION + 1)}, "tracker state of version 2, this release reads 1"),
        ({"rows": np.zeros((2, 3))}, "not a readable tracker state"),
        ({"stamp_s": np.array("now")}, "not a readable tracker state"),
    ],
)
def test_a_file_of_another_kind_is_refused(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    content = {
        "version": np.array(FILE_VERSION),
        "stamp_s": np.array(1.0),
        "next_id": np.array(1),
        "rows": np.zeros((0, len(COLUMNS))),
        "filtered": np.zeros((0, 25)),
    }
    np.savez(tmp_path / "state.npz", **(content | change))
    with pytest.raises(ConfigError, match=message):
        TrackerState.load(tmp_path / "state.npz")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="nowhere"):
        TrackerState.load(tmp_path / "nowhere")


def test_another_motion_model_does_not_take_the_state() -> None:
    tracker, frames = Tracker(), _frames(5)
    for frame in frames[:4]:
        tracker.update(frame)
    other = Tracker(TrackerConfig(motion=ConstantTurnRate()))
    other.state = tracker.state
    with pytest.raises(ConfigError, match="resume with the configuration that made the state"):
        other.update(frames[4])


def test_rows_must_agree() -> None:
    with pytest.raises(ShapeError, match="tracker state: expected"):
        TrackerState(0.0, 1, np.zeros((2, len(COLUMNS))), np.zeros((1, 25)))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"stamp_s": 1.8e18}, "looks like nanoseconds"),
        ({"track_id": [1, 1]}, "must differ and be less than next_id"),
        ({"track_id": [1, 3]}, "must differ and be less than next_id"),
        ({"track_id": [1, np.nan]}, "must be finite"),
        ({"category_code": [0, 6]}, "must lie in 0 ... 5"),
        ({"category_code": [0, 0.5]}, "must lie in 0 ... 5"),
        ({"filtered": np.full((2, 25), np.nan)}, "must be finite"),
    ],
)
def test_a_state_is_checked(change: dict[str, Any], told: str) -> None:
    def state(**change: Any) -> TrackerState:
        rows = np.zeros((2, len(COLUMNS)))
        rows[:, COLUMNS.index("track_id")] = 1, 2
        for name in set(change) & set(COLUMNS):
            rows[:, COLUMNS.index(name)] = change[name]
        return TrackerState(change.get("stamp_s", 0.0), 3, rows, change.get("filtered", np.zeros((2, 25))))

    assert state().track_id.tolist() == [1, 2]
    with pytest.raises(ShapeError, match=told):
        state(**change)
