"""Each fails today. What a user sees is in the docstring; the numbers are physical and not fitted to any data set."""

import subprocess
import sys

import numpy as np


def test_class_follows_the_evidence(tracker, step):
    """One frame says truck, the next 99 say car, all equally sure: the track is a truck for ever."""
    for k in range(100):
        tracks = step(tracker, 0.1 * k, [[0.3 * k, 0.0]], category="truck" if k == 0 else "car")
    assert tracks.category.tolist() == ["car"]


def test_rider_first_seen_as_pedestrian(tracker, step):
    """A cyclist is called pedestrian for the first second, cyclist afterwards: the same object gets a new
    identity, and for two frames both exist."""
    seen, most = set(), 0
    for k in range(60):
        name = "pedestrian" if k < 10 else "cyclist"
        tracks = step(tracker, 0.1 * k, [[0.4 * k, 0.0]], size=(1.6, 0.7), category=name)
        seen |= set(tracks.track_id.tolist())
        most = max(most, len(tracks))
    assert len(seen) == 1 and most == 1 and tracks.category.tolist() == ["cyclist"]


def test_same_object_reported_twice(tracker, step):
    """A detector without non-maximum suppression: two boxes 0.3 m apart, every frame, one car."""
    rng = np.random.default_rng(0)
    for k in range(50):
        center = np.array([[1.0 * k, 0.0], [1.0 * k + 0.3, 0.1]]) + rng.normal(0, 0.05, (2, 2))
        tracks = step(tracker, 0.1 * k, center, score=(0.9, 0.8))
    assert int(tracks.confirmed.sum()) == 1


def test_heading_of_a_car_that_drives(tracker, step):
    """The detector confuses front and rear in every second frame; the car drives forward at 10 m/s. Half of the
    reported boxes face backwards."""
    wrong = 0
    for k in range(60):
        tracks = step(tracker, 0.1 * k, [[1.0 * k, 0.0]], yaw=np.pi if k % 2 else 0.0)
        wrong += k >= 10 and np.cos(tracks.boxes.yaw_rad[0]) < 0.0
    assert wrong == 0


def test_pedestrian_who_stops_unseen(tracker, step):
    """Walks at 1.4 m/s, disappears behind a van, stops there, is seen again after 1.6 s, 2.2 m from where a straight
    walk would have led. `max_age_s` is 2.55 s, yet the identity is lost: the gate is capped at 2 m."""
    seen = set()
    for k in range(45):
        where = [] if 20 <= k < 36 else [[0.14 * min(k, 20), 0.0]]
        tracks = step(tracker, 0.1 * k, where, size=(0.6, 0.6), category="pedestrian")
        seen |= set(tracks.track_id.tolist())
    assert len(seen) == 1


def test_parked_car_hidden_for_two_seconds(tracker, step):
    """A parked car, measured 30 times at the same place, hidden by a passing bus for 2 s: new identity, as if a car
    could have been replaced. In street scenes most identity switches of cars are of this kind."""
    seen = set()
    for k in range(80):
        passing = [[-20.0 + 0.8 * k, -3.0]]
        parked = [] if 30 <= k < 50 else [[10.0, 3.0]]
        tracks = step(tracker, 0.1 * k, passing + parked)
        seen |= set(tracks.track_id.tolist())
    assert len(seen) == 2


def test_no_stall_when_boxes_first_compete():
    """A fresh process tracks two cars that meet after 4 s. One update takes hundreds of milliseconds, 1,000 times
    the median, because a library is imported in it. Real-time users need that at construction."""
    program = (
        "import time, numpy as np, smartmot\n"
        "t = smartmot.Tracker(smartmot.tracker_config('default')); spent = []\n"
        "for k in range(60):\n"
        "    a = time.process_time()\n"
        "    t.update_arrays(.1 * k, [[0, 0], [20 - .35 * k, 0]], [[4.5, 1.8]] * 2, [0, 0], [.9, .9], ['car'] * 2)\n"
        "    spent.append(time.process_time() - a)\n"
        "print(max(spent[5:]) / np.median(spent[5:]))\n"
    )
    ratio = float(
        subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    )
    assert ratio < 30.0


def test_weak_but_steady_detections(tracker, step):
    """A detector whose scores lie between 0.2 and 0.55, as those of many networks do on far objects and on other data
    sets: ten cars, seen in every frame, and `default` shows no track at all; nothing says why. Either tracks or a
    warning is expected."""
    import warnings

    rng = np.random.default_rng(0)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        for k in range(50):
            center = np.column_stack((10.0 * np.arange(10) + 1.0 * k, np.zeros(10)))
            tracks = step(tracker, 0.1 * k, center, score=rng.uniform(0.2, 0.55, 10))
    assert len(tracks) == 10 or told


def test_stamps_that_are_not_seconds(tracker, step):
    """nuScenes counts microseconds and Argoverse nanoseconds. Given such integers, every frame starts all tracks
    anew, silently: one identity per frame. A refusal or a warning that names the unit is expected."""
    import warnings

    seen = set()
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        try:
            for k in range(10):
                tracks = step(tracker, 315973157899927214 + 100_000_000 * k, [[1.0 * k, 0.0]])
                seen |= set(tracks.track_id.tolist())
        except smartmot_errors():
            return
    assert told or len(seen) == 1


def smartmot_errors():
    from smartmot.errors import SmartMotError

    return SmartMotError
