import copy
import pickle
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

from smartmot.detection_input import detections_from_arrays
from smartmot.errors import ShapeError, SmartMotError, StampError
from smartmot.tracking.settings import TrackerConfig
from smartmot.tracking.state import TrackerState
from smartmot.tracking.tracker import Tracker
from smartmot.types import Boxes, Detections, EgoState, Forecast, Threats, Tracks


def _boxes(n: int) -> Boxes:
    return Boxes(np.arange(2.0 * n).reshape(n, 2), np.ones((n, 2)), np.zeros(n))


def _tracks(n: int) -> Tracks:
    zeros, flags = np.zeros(n), np.ones(n, dtype=bool)
    return Tracks(
        0.0, np.arange(n), _boxes(n), np.array(["car"] * n), zeros, np.zeros((n, 9)), np.zeros((n, 9, 9)),
        np.zeros((n, 2)), zeros, zeros, zeros, flags, flags,
    )  # fmt: skip


def test_arrays_are_copied_and_read_only() -> None:
    source = np.zeros((3, 2))
    boxes = Boxes(source, np.ones((3, 2)), np.zeros(3))
    source[0] = 7.0
    assert boxes.center_m[0, 0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        boxes.center_m[0] = 1.0


@pytest.mark.parametrize(
    ("center", "size", "yaw", "message"),
    [
        ([[0.0]], [[1.0, 1.0]], [0.0], "center_m: expected shape"),
        ([[0.0, 0.0]], [[1.0, 1.0]] * 2, [0.0], "size_m: expected shape"),
        ([[0.0, 0.0]], [[1.0, 1.0]], [0.0, 1.0], "yaw_rad: expected shape"),
        ([[0.0, 0.0]], [[1.0, 0.0]], [0.0], "must be positive"),
        ([[0.0, np.nan]], [[1.0, 1.0]], [0.0], "finite"),
        ([["a", "b"]], [[1.0, 1.0]], [0.0], "expected numbers"),
    ],
)
def test_boxes_reject(center: object, size: object, yaw: object, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        Boxes(center, size, yaw)  # type: ignore[arg-type]


def test_named_errors_are_value_errors() -> None:
    assert issubclass(ShapeError, SmartMotError)
    assert issubclass(SmartMotError, ValueError)


def test_subsets_and_lengths() -> None:
    tracks = _tracks(4)
    assert len(tracks[np.array([True, False, True, False])]) == 2
    assert tracks[1:].track_id.tolist() == [1, 2, 3]
    detections = Detections(0.0, _boxes(3), np.ones(3), np.array(["car", "truck", "car"]))
    assert detections[np.array([2, 1])].category.tolist() == ["car", "truck"]
    assert len(Boxes.empty()) == len(Detections.empty(1.0)) == 0


@pytest.mark.parametrize("category", [["car"], ["car", "tram"]])
def test_detections_reject_wrong_categories(category: list[str]) -> None:
    with pytest.raises(ShapeError, match="category: expected 2 names"):
        Detections(0.0, _boxes(2), np.ones(2), np.array(category))


def test_forecast_and_threats_check_their_shapes() -> None:
    with pytest.raises(ShapeError, match="center_m"):
        Forecast(np.zeros(2), np.zeros((1, 3, 2)), np.zeros((1, 2)), np.ones((1, 2)), np.ones((1, 2)) > 0)
    with pytest.raises(ShapeError, match="gap_m"):
        Threats(np.array([1]), np.zeros(1), np.zeros(2), np.zeros(1))
    assert len(Threats(np.array([1]), np.zeros(1), np.zeros(1), np.zeros(1))) == 1


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"category": np.array(["car"] * 3)}, "expected 2 categories"),
        ({"category": np.array(["car", "elephant"])}, r"with \['elephant'\]"),
        ({"track_id": np.array([7, 7])}, "an identifier comes twice"),
        ({"track_id": np.array([1, 2, 3])}, "track_id: expected shape"),
        ({"boxes": _boxes(3)}, "expected shape"),
        ({"boxes": np.zeros((2, 5))}, "boxes must be smartmot.Boxes, got ndarray"),
        ({"score": np.array([0.5, 1.5])}, r"every score must lie in \[0, 1\]"),
        ({"score": np.array([0.5, np.nan])}, r"every score must lie in \[0, 1\]"),
        ({"mean": np.full((2, 9), np.inf)}, "mean: a value is not finite"),
        ({"covariance": np.full((2, 9, 9), np.nan)}, "covariance: a value is not finite"),
        ({"covariance": np.zeros((2, 9, 8))}, "covariance: expected shape"),
        ({"velocity_mps": np.array([[0.0, np.nan], [0.0, 0.0]])}, "velocity_mps: a value is not finite"),
        ({"yaw_rate_radps": np.array([0.0, -np.inf])}, "yaw_rate_radps: a value is not finite"),
        ({"age_s": np.array([0.0, -0.1])}, "age_s: every time must be 0 or more"),
        ({"coasted_s": np.array([np.nan, 0.0])}, "coasted_s: every time must be 0 or more"),
        ({"confirmed": np.ones(1, dtype=bool)}, "confirmed: expected shape"),
        ({"dynamic": np.ones((2, 1), dtype=bool)}, "dynamic: expected shape"),
        ({"stamp_s": np.nan}, "expected a finite number of seconds"),
        ({"stamp_s": "1.0"}, "expected a number of seconds, got '1.0'"),
        ({"track_id": [1.5, 2.5]}, "track_id: expected whole numbers"),
        ({"track_id": [np.nan, 1.0]}, "track_id: expected whole numbers"),
        ({"track_id": [np.inf, 1.0]}, "track_id: expected whole numbers"),
        ({"track_id": [2**70, 1]}, "track_id: expected whole numbers"),
        ({"confirmed": [np.nan, 1.0]}, "confirmed: expected true or false"),
        ({"dynamic": ["False", "True"]}, "dynamic: expected true or false"),
        ({"yaw_rate_radps": np.array([1j, 0.0])}, "yaw_rate_radps: expected numbers"),
        ({"category": [["car"], ["car", "car"]]}, "category: expected 2 categories"),
    ],
)
def test_tracks_reject(wrong: dict[str, Any], told: str) -> None:
    assert len(replace(_tracks(2), age_s=np.array([0.0, np.inf]))) == 2  # nobody knows when it was born
    with pytest.raises(ShapeError, match=told):
        replace(_tracks(2), **wrong)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({name: value}, "must be finite")
        for name in ("x_m", "y_m", "yaw_rad", "speed_mps", "accel_mps2", "yaw_rate_radps")
        for value in (np.nan, np.inf, -np.inf)
    ]
    + [
        ({name: value}, "length and width must be positive and finite")
        for name in ("length_m", "width_m")
        for value in (np.nan, np.inf, 0.0, -1.0)
    ]
    + [
        ({name: value}, "every value must be a number")
        for name in ("x_m", "speed_mps", "length_m")
        for value in (None, "1.0", [1.0])
    ],
)
def test_an_ego_is_finite_and_has_an_outline(wrong: dict[str, Any], told: str) -> None:
    with pytest.raises(ShapeError, match=told):
        replace(EgoState(0.0, 0.0, 0.0, 0.0, 0.0), **wrong)


# 28 November 2026, 12:00 UTC
NOON_S = 1_795_867_200


@pytest.mark.parametrize("stamp", [0.0, -3.0, 1e-3, NOON_S, np.float32(2.5), np.int64(NOON_S)])
def test_a_stamp_in_seconds_is_taken(stamp: float) -> None:
    assert Detections.empty(stamp).stamp_s == stamp
    assert EgoState(stamp, 0.0, 0.0, 0.0, 0.0).stamp_s == stamp


@pytest.mark.parametrize(
    ("stamp", "told"),
    [
        (NOON_S * 10**3, r"looks like milliseconds; give seconds \(divide by 1000\)"),
        (NOON_S * 10**6, r"looks like microseconds; give seconds \(divide by 1e\+06\)"),
        (NOON_S * 10**9, r"looks like nanoseconds; give seconds \(divide by 1e\+09\)"),
        (-NOON_S * 10**9, "looks like nanoseconds"),
        (np.int64(315_973_157_899_927_214), "looks like nanoseconds"),  # a frame of Argoverse 2
        (1_532_402_927_647_951, "looks like microseconds"),  # a frame of nuScenes
        (np.nan, "expected a finite number of seconds, got nan"),
        (np.inf, "expected a finite number of seconds, got inf"),
        (None, "expected a number of seconds, got None"),
        ("noon", "expected a number of seconds, got 'noon'"),
        (10**400, "expected a number of seconds"),
    ],
)
def test_a_stamp_in_another_unit_is_refused_by_name(stamp: Any, told: str) -> None:
    boxes, one, names = _boxes(1), np.ones(1), np.array(["car"])
    for make in (
        lambda: Detections(stamp, boxes, one, names),
        lambda: Detections.empty(stamp),
        lambda: detections_from_arrays(stamp, [[0.0, 0.0]], [[4.0, 2.0]], [0.0]),
        lambda: EgoState(stamp, 0.0, 0.0, 0.0, 0.0),
        lambda: replace(_tracks(1), stamp_s=stamp),
    ):
        with pytest.raises(StampError, match=told):
            make()


def test_detections_have_no_infinite_velocity() -> None:
    unknown = np.array([[np.nan, np.nan], [1.0, 0.0]])
    assert len(Detections(0.0, _boxes(2), np.ones(2), np.array(["car"] * 2), unknown)) == 2
    with pytest.raises(ShapeError, match="velocity_mps: infinite; give NaN"):
        Detections(0.0, _boxes(1), np.ones(1), np.array(["car"]), np.array([[np.inf, 0.0]]))


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"time_s": np.array([0.1, 0.2])}, "ascend from 0"),
        ({"time_s": np.array([0.0, 0.0])}, "ascend from 0"),
        ({"time_s": np.array([0.0, np.nan])}, "ascend from 0"),
        ({"size_m": np.array([[0.0, 1.0]])}, "positive"),
        ({"size_m": np.array([[np.nan, 1.0]])}, "positive"),
        ({"center_m": np.full((1, 2, 2), np.nan)}, "every pose that counts must be finite"),
        ({"yaw_rad": np.array([[0.0, np.inf]])}, "every pose that counts must be finite"),
    ],
)
def test_forecasts_reject(wrong: dict[str, Any], told: str) -> None:
    good = Forecast(
        np.array([0.0, 0.1]), np.zeros((1, 2, 2)), np.zeros((1, 2)), np.ones((1, 2)), np.ones((1, 2)) > 0
    )
    unseen = {"valid": np.zeros((1, 2), dtype=bool), "center_m": np.full((1, 2, 2), np.nan)}
    assert len(replace(good, **unseen)) == 1
    with pytest.raises(ShapeError, match=told):
        replace(good, **wrong)


def test_threats_come_in_the_order_of_their_times() -> None:
    ids, two = np.array([1, 2]), np.ones(2)
    assert len(Threats(ids, two, two, np.array([np.inf, 1.0]))) == 2
    with pytest.raises(ShapeError, match="nearest in time first"):
        Threats(ids, np.array([2.0, 1.0]), two, two)
    with pytest.raises(ShapeError, match="gap_m: every value must be 0 or more"):
        Threats(ids, two, np.array([-1.0, 1.0]), two)


@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]
)
def test_copies_are_read_only_too(copied: Callable[[Any], Any]) -> None:
    boxes = Boxes(np.array([[1.0, 2.0]]), np.array([[4.0, 2.0]]), np.array([0.1]))
    detections = Detections(1.5, boxes, np.array([0.5]), np.array(["car"]))
    tracker = Tracker(TrackerConfig())
    state, tracks = tracker.step(TrackerState.empty(), detections)
    for value in (boxes, detections, tracks, state):
        again = copied(value)
        assert type(again) is type(value)
        for name in value.__slots__:
            array = getattr(again, name)
            if isinstance(array, np.ndarray):
                assert not array.flags.writeable, name
                np.testing.assert_array_equal(array, getattr(value, name))
    assert copied(detections).boxes.center_m.tolist() == [[1.0, 2.0]]
    with pytest.raises(ValueError, match="read-only"):
        copied(detections).boxes.center_m[0] = 0.0


def pickled(value: object) -> object:
    return pickle.loads(pickle.dumps(value))


@dataclass(frozen=True, slots=True, eq=False)
class _Weighed(Boxes):
    """A user's boxes with a column of their own."""

    mass_kg: float = 1500.0


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
def test_copies_of_derived_classes_keep_their_kind(copied: Callable[[Any], Any]) -> None:
    again = copied(_Weighed(np.zeros((1, 2)), np.ones((1, 2)), np.zeros(1), 900.0))
    assert type(again) is _Weighed
    assert again.mass_kg == 900.0
    assert again.size_m.tolist() == [[1.0, 1.0]]
