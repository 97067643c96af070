"""Cases of the kinds in which trackers failed their users, with other numbers than the cured ones."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pytest
from numpy.typing import ArrayLike

from smartmot import Tracker, Tracks, tracker_config

CAR, WALKER, RIDER = (4.5, 1.8), (0.6, 0.6), (1.7, 0.6)


def step(
    tracker: Tracker,
    stamp_s: float,
    center_m: ArrayLike,
    size_m: ArrayLike = CAR,
    yaw_rad: ArrayLike = 0.0,
    score: ArrayLike = 0.9,
    category: ArrayLike = "car",
) -> Tracks:
    places = np.asarray(center_m, dtype=float).reshape(-1, 2)
    n = len(places)
    return tracker.update_arrays(
        stamp_s,
        places,
        np.broadcast_to(size_m, (n, 2)),
        np.broadcast_to(yaw_rad, (n,)),
        np.broadcast_to(score, (n,)),
        np.broadcast_to(category, (n,)),
    )


@pytest.fixture
def tracker() -> Tracker:
    return Tracker(tracker_config("default"))


@pytest.mark.parametrize(("interval_s", "speed_mps"), [(0.5, 8.0), (0.5, 12.0), (0.25, 10.0)])
def test_a_car_at_2_hz_that_is_a_truck_in_every_fourth_frame(
    tracker: Tracker, interval_s: float, speed_mps: float
) -> None:
    for k in range(30):
        t = interval_s * k
        name = "truck" if k % 4 == 1 else "car"
        tracks = step(tracker, t, [speed_mps * t, 0.0], category=name)
        assert tracks.track_id.tolist() == [1]
        assert k < 3 or tracks.category.tolist() == ["car"]


def test_a_rider_at_2_hz_who_is_a_pedestrian_in_every_third_frame(tracker: Tracker) -> None:
    ids = set()
    for k in range(30):
        name = "pedestrian" if k % 3 == 2 else "cyclist"
        tracks = step(tracker, 0.5 * k, [2.0 * k, 0.0], RIDER, category=name)
        ids |= set(tracks.track_id.tolist())
    assert (len(ids), tracks.category.tolist()) == (1, ["cyclist"])


@pytest.mark.parametrize(
    ("names", "sizes"),
    [(("car", "truck"), ((4.6, 1.9), (5.5, 2.1))), (("cyclist", "motorcycle"), (RIDER, (2.0, 0.8)))],
)
def test_one_object_that_is_reported_as_two_classes(
    tracker: Tracker, names: tuple[str, str], sizes: tuple[tuple[float, float], tuple[float, float]]
) -> None:
    rng, ids = np.random.default_rng(1), set()
    for k in range(60):
        x = 0.5 * k
        center = np.array([[x, 0.0], [x + 0.15, 0.05]]) + rng.normal(0.0, 0.04, (2, 2))
        tracks = step(tracker, 0.1 * k, center, sizes, score=(0.85, 0.8), category=names)
        ids |= set(tracks.track_id[tracks.confirmed].tolist())
        assert np.count_nonzero(tracks.confirmed) <= 1
    assert (len(ids), tracks.category.tolist()) == (1, [names[0]])


@pytest.mark.parametrize(("speed_mps", "every"), [(5.0, 3), (12.0, 2), (4.5, 2)])
def test_front_and_rear_confused_on_a_street_that_runs_askew(
    tracker: Tracker, speed_mps: float, every: int
) -> None:
    yaw = 0.7
    for k in range(80):
        way = 0.1 * k * speed_mps * np.array([np.cos(yaw), np.sin(yaw)])
        tracks = step(tracker, 0.1 * k, way, yaw_rad=yaw + np.pi * (k % every == 0))
        assert k < 12 or np.cos(tracks.boxes.yaw_rad[0] - yaw) > 0.9


def test_a_car_that_parks_in_reverse_keeps_its_heading(tracker: Tracker) -> None:
    for k in range(80):
        tracks = step(tracker, 0.1 * k, [-0.15 * k, 0.0])
        assert k < 10 or np.cos(tracks.boxes.yaw_rad[0]) > 0.9


@pytest.mark.parametrize("hidden", [20, 30, 38])
def test_a_parked_car_behind_what_passes(tracker: Tracker, hidden: int) -> None:
    ids = set()
    for k in range(120):
        parked = [] if 40 <= k < 40 + hidden else [[12.0 + 0.02 * np.sin(k), -4.0]]
        ids |= set(step(tracker, 0.1 * k, [*parked, [-30.0 + 1.1 * k, 3.0]]).track_id.tolist())
    assert ids == {1, 2}


@pytest.mark.parametrize("hidden", [10, 16, 22])
def test_a_pedestrian_who_stops_unseen_just_after_being_hidden(tracker: Tracker, hidden: int) -> None:
    ids = set()
    for k in range(60):
        seen = [] if 21 <= k < 21 + hidden else [[0.15 * min(k, 22), 0.0]]
        ids |= set(step(tracker, 0.1 * k, seen, WALKER, category="pedestrian").track_id.tolist())
    assert ids == {1}


@pytest.mark.parametrize("scale", [0.02, 0.3, 1.0])
def test_scores_of_any_scale(tracker: Tracker, scale: float) -> None:
    rng, ids = np.random.default_rng(0), set()
    for k in range(60):
        center = np.column_stack((10.0 * np.arange(6) + 0.9 * k, np.zeros(6)))
        tracks = step(tracker, 0.1 * k, center, score=scale * rng.uniform(0.5, 0.95, 6))
        ids |= set(tracks.track_id.tolist())
    assert len(ids) == len(tracks) == 6


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"score": 87.0}, "20 have a score outside \\[0, 1\\]: give probabilities"),
        ({"score": -2.0}, "20 have a score outside"),
        ({"category": "Car"}, "20 have a class that is none of car, pedestrian"),
        ({"category": "vehicle.car"}, "20 have a class that is none of car"),
        ({"size_m": (4500.0, 1800.0)}, "20 have no place or no size that a road user has, in metres"),
    ],
)
def test_a_detector_of_which_no_box_can_be_taken_is_said_once(
    tracker: Tracker, given: dict[str, ArrayLike], text: str
) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for k in range(60):
            assert not len(step(tracker, 0.1 * k, [1.0 * k, 0.0], **given))
    (warning,) = told
    assert re.search(text, str(warning.message))
    assert warning.filename == __file__  # where the user calls it
    assert tracker.rejected == 60


def test_single_boxes_that_cannot_be_are_no_warning(tracker: Tracker) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        step(tracker, 0.0, [0.0, 0.0])
        for k in range(1, 60):
            step(tracker, 0.1 * k, [1.0 * k, 0.0], score=1.5)
    assert tracker.rejected == 59
