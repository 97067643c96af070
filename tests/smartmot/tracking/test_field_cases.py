"""What users met with `default` on detectors that nobody had tuned for, and cases of the same kinds.

Every number is physical: speeds of road users, sizes of their boxes, times that buses take to pass.
"""

import importlib.util
import inspect
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import smartmot
from smartmot import Tracker, TrackerConfig, tracker_config
from smartmot.types import FloatArray, Tracks

CASES = Path(__file__).parents[2] / "data" / "field" / "tracking"
SIZES = {"car": (4.5, 1.8), "truck": (8.0, 2.5), "pedestrian": (0.6, 0.6), "cyclist": (1.8, 0.7)}


def _module(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, CASES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


NAMED = {
    name: case
    for name, case in vars(_module("test_cases")).items()
    # the case of the stall measures time; `test_the_first_contested_frame_imports_nothing` has its cause
    if name.startswith("test_") and name != "test_no_stall_when_boxes_first_compete"
}
FRAME = _module("conftest").frame


@pytest.mark.parametrize("name", NAMED)
def test_a_case_of_the_field(name: str) -> None:
    arguments = {"tracker": Tracker(tracker_config("default")), "step": FRAME}
    NAMED[name](**{key: arguments[key] for key in inspect.signature(NAMED[name]).parameters})


def _step(
    tracker: Tracker,
    stamp_s: float,
    centers: Sequence[Sequence[float]] | FloatArray,
    category: str | Sequence[str] = "car",
    yaw_rad: float | FloatArray = 0.0,
    score: float | FloatArray = 0.9,
) -> Tracks:
    center = np.asarray(centers, dtype=float).reshape(-1, 2)
    names = [category] * len(center) if isinstance(category, str) else list(category)
    size = np.array([SIZES[name] for name in names]).reshape(-1, 2)
    wide = np.broadcast_to(yaw_rad, len(center)), np.broadcast_to(score, len(center))
    return tracker.update_arrays(stamp_s, center, size, wide[0], wide[1], names)


@pytest.fixture
def tracker() -> Tracker:
    return Tracker(tracker_config("default"))


@pytest.mark.parametrize("rate_hz", [2.0, 10.0, 20.0])
@pytest.mark.parametrize("wrong", [0.1, 0.3])
def test_a_class_that_is_sometimes_wrong_is_outvoted(tracker: Tracker, rate_hz: float, wrong: float) -> None:
    """A car of which a share of the detections says truck: after a while it is a car, and one object."""
    rng = np.random.default_rng(7)
    shown = []
    for k in range(60):
        name = "truck" if rng.random() < wrong else "car"
        shown.append(_step(tracker, k / rate_hz, [[3.0 * k / rate_hz, 0.0]], name))
    assert {int(i) for tracks in shown for i in tracks.track_id} == {1}
    cars = np.mean([tracks.category.tolist() == ["car"] for tracks in shown[10:]])
    assert cars > 1.0 - wrong  # better than the detector itself
    if rate_hz > 2.0 and wrong == 0.1:
        assert cars == 1.0


def test_a_rider_who_dismounts_keeps_the_identity(tracker: Tracker) -> None:
    names = ["cyclist"] * 40 + ["pedestrian"] * 40
    shown = [_step(tracker, 0.1 * k, [[0.14 * k, 0.0]], name) for k, name in enumerate(names)]
    assert {int(i) for tracks in shown for i in tracks.track_id} == {1}
    assert all(len(tracks) == 1 for tracks in shown[2:])
    assert [tracks.category.tolist() for tracks in (shown[39], shown[-1])] == [["cyclist"], ["pedestrian"]]


def test_a_pedestrian_beside_a_cyclist_is_another(tracker: Tracker) -> None:
    for k in range(40):
        tracks = _step(tracker, 0.1 * k, [[0.14 * k, 0.0], [0.14 * k, 0.9]], ["pedestrian", "cyclist"])
    assert tracks.category.tolist() == ["pedestrian", "cyclist"]


def test_an_unknown_object_gets_the_class_that_is_known(tracker: Tracker) -> None:
    SIZES["unknown"] = SIZES["car"]
    for k in range(30):
        tracks = _step(tracker, 0.1 * k, [[0.5 * k, 0.0]], "car" if k % 5 == 4 else "unknown")
    assert (tracks.category.tolist(), tracks.track_id.tolist()) == (["car"], [1])


@pytest.mark.parametrize("offset_m", [(0.0, 0.3), (1.2, 0.2), (-0.4, -0.4)])
@pytest.mark.parametrize("category", ["car", "truck"])
def test_a_second_box_of_the_same_object_is_no_track(
    tracker: Tracker, offset_m: tuple[float, float], category: str
) -> None:
    rng = np.random.default_rng(0)
    for k in range(40):
        center = np.array([[1.0 * k, 0.0], [1.0 * k + offset_m[0], offset_m[1]]])
        names = ["car", category]
        tracks = _step(
            tracker, 0.1 * k, center + rng.normal(0, 0.05, (2, 2)), names, score=np.array([0.9, 0.8])
        )
    assert tracks.track_id.tolist() == [1]
    assert tracker.state.merged >= 39  # counted


@pytest.mark.parametrize(("category", "apart_m"), [("car", 2.2), ("pedestrian", 0.7), ("cyclist", 1.0)])
def test_neighbours_side_by_side_are_two(tracker: Tracker, category: str, apart_m: float) -> None:
    rng = np.random.default_rng(1)
    for k in range(40):
        center = np.array([[0.1 * k, 0.0], [0.1 * k, apart_m]]) + rng.normal(0, 0.05, (2, 2))
        tracks = _step(tracker, 0.1 * k, center, category)
    assert tracks.track_id.tolist() == [1, 2]
    assert tracker.state.merged == 0


@pytest.mark.parametrize("flipped", [0.2, 0.5])
@pytest.mark.parametrize(("category", "speed_mps"), [("car", 10.0), ("car", 5.0), ("pedestrian", 1.4)])
def test_headings_of_who_moves(tracker: Tracker, flipped: float, category: str, speed_mps: float) -> None:
    """Front and rear confused at random: who goes forwards is soon seen to face forwards, and stays so."""
    rng = np.random.default_rng(5)
    yaw = np.where(rng.random(80) < flipped, np.pi, 0.0)
    shown = [
        _step(tracker, 0.1 * k, [[0.1 * speed_mps * k, 0.0]], category, yaw[k]).boxes.yaw_rad[0]
        for k in range(80)
    ]
    assert (np.cos(shown[20:]) > 0.9).all()


def test_headings_of_a_parked_car_are_those_of_the_majority(tracker: Tracker) -> None:
    shown = [
        _step(tracker, 0.1 * k, [[5.0, 0.0]], yaw_rad=np.pi if k % 4 == 0 else 0.0).boxes.yaw_rad[0]
        for k in range(60)
    ]
    assert (np.cos(shown[10:]) > 0.9).all()


def test_a_car_in_reverse_gear_keeps_its_heading(tracker: Tracker) -> None:
    """2.5 m/s, 9 km/h, backwards; the detector sees the front where it is."""
    shown = [_step(tracker, 0.1 * k, [[-0.25 * k, 0.0]]).boxes.yaw_rad[0] for k in range(60)]
    np.testing.assert_allclose(shown, 0.0, atol=1e-6)


@pytest.mark.parametrize("hidden_s", [1.5, 3.0, 3.9])
@pytest.mark.parametrize("category", ["car", "truck", "pedestrian", "cyclist"])
def test_what_stands_and_is_hidden_keeps_its_identity(
    tracker: Tracker, hidden_s: float, category: str
) -> None:
    rng = np.random.default_rng(2)
    seen = set()
    for k in range(90):
        there = not 40 <= k < 40 + 10.0 * hidden_s
        center = [np.array([10.0, 3.0]) + rng.normal(0.0, 0.1, 2)] if there else []
        seen |= set(_step(tracker, 0.1 * k, center, category).track_id.tolist())
    assert seen == {1}


def test_who_takes_the_place_of_a_hidden_car_is_another(tracker: Tracker) -> None:
    """After 2 s a car stands 6 m beside where one was parked: no filter may say that it is the same."""
    for k in range(60):
        center = [[10.0, 3.0]] if k < 30 else [] if k < 50 else [[10.0, 9.0]]
        tracks = _step(tracker, 0.1 * k, center)
    assert tracks.track_id.tolist() == [2]


@pytest.mark.parametrize("stops_after", [0, 5, 10])
def test_who_stops_unseen_is_found_again(tracker: Tracker, stops_after: int) -> None:
    """Walks at 1.4 m/s, is hidden for 1.6 s and has stopped on the way; afterwards the filter knows that."""
    seen = set()
    for k in range(60):
        center = [] if 20 <= k < 36 else [[0.14 * min(k, 20 + stops_after), 0.0]]
        tracks = _step(tracker, 0.1 * k, center, "pedestrian")
        seen |= set(tracks.track_id.tolist())
    assert seen == {1}
    assert np.hypot(*tracks.velocity_mps[0]) < 0.3


SCALES = [1.0, 0.6, 0.2, 0.05]


@pytest.mark.parametrize("scale", SCALES)
def test_the_scale_of_the_scores_does_not_matter(scale: float) -> None:
    """Ten cars with scores over half of the greatest, and a flood of weak false detections."""
    rng = np.random.default_rng(0)
    tracker = Tracker(tracker_config("default"))
    for k in range(80):
        cars = np.column_stack((10.0 * np.arange(10) + 1.0 * k, np.zeros(10)))
        false = rng.uniform(-50.0, 50.0, (30, 2)) + np.array([0.0, 100.0])
        score = scale * np.concatenate((rng.uniform(0.5, 1.0, 10), rng.uniform(0.0, 0.05, 30)))
        tracks = _step(tracker, 0.1 * k, np.concatenate((cars, false)), score=score)
    assert len(tracks) == 10
    assert (tracks.boxes.center_m[:, 1] < 50.0).all()


def _ideal(frames: int) -> list[smartmot.Detections]:
    rng = np.random.default_rng(4)
    made = []
    for k in range(frames):
        n = int(rng.integers(0, 6))
        names = rng.choice(["car", "pedestrian", "cyclist"], n).tolist()
        size = np.array([SIZES[name] for name in names]).reshape(-1, 2)
        boxes = smartmot.Boxes(rng.uniform(0.0, 20.0, (n, 2)), size, rng.uniform(-3.0, 3.0, n))
        made.append(smartmot.Detections(0.1 * k, boxes, np.ones(n), np.array(names, dtype=np.str_)))
    return made


def test_a_sure_detector_is_tracked_as_with_fixed_thresholds() -> None:
    """Scores of 1: the reference stays exactly 1, and every number is the same."""
    config = tracker_config("default")
    relative, fixed = Tracker(config), Tracker(replace(config, score_reference=1.0))
    for frame in _ideal(60):
        a, b = relative.update(frame), fixed.update(frame)
        np.testing.assert_array_equal(a.track_id, b.track_id)
        np.testing.assert_array_equal(a.mean, b.mean)
        np.testing.assert_array_equal(a.covariance, b.covariance)


def test_a_config_without_new_settings_has_the_old_rules() -> None:
    """What the presets use."""
    config = TrackerConfig()
    assert (config.score_reference, config.evidence_memory_s, config.merge_duplicates) == (1.0, None, False)
    assert (config.association.hidden_gate_m, config.lifecycle.rest_max_age_s) == (None, None)
    assert config.filter.heading == "track"


def _street_with_clutter(rng: np.random.Generator, k: int) -> FloatArray:
    """Ten cars at 10 m/s in a row, and two false boxes anywhere in 100 m x 200 m."""
    cars = np.column_stack((10.0 * np.arange(10) + 1.0 * k, np.zeros(10))) + rng.normal(0.0, 0.1, (10, 2))
    false = rng.uniform((-50.0, 5.0), (150.0, 105.0), (2, 2)) + np.array([1.0 * k, 0.0])
    return np.concatenate((cars, false))


def test_weak_clutter_breeds_no_tracks(tracker: Tracker) -> None:
    """False boxes with less than 0.4 of the scores that true ones have."""
    rng = np.random.default_rng(3)
    for k in range(80):
        score = np.concatenate((rng.uniform(0.5, 0.9, 10), rng.uniform(0.0, 0.25, 2)))
        tracks = _step(tracker, 0.1 * k, _street_with_clutter(rng, k), score=score)
    assert sorted(tracks.track_id.tolist()) == [*range(1, 11)]


def test_sure_clutter_shows_no_tracks_where_existence_counts() -> None:
    """Scores say nothing: what was seen once does not exist with 0.99, what is seen again does."""
    config = tracker_config("default")
    config = replace(config, report=replace(config.report, existence=0.99))
    rng, tracker, false, missing = np.random.default_rng(4), Tracker(config), 0, 0
    for k in range(100):
        tracks = _step(tracker, 0.1 * k, _street_with_clutter(rng, k))
        if k >= 2:
            shown = tracks.boxes.center_m[:, 1] < 2.0
            false += int(np.count_nonzero(~shown))
            missing += 10 - int(np.count_nonzero(shown))
    assert missing == 0
    assert false <= 4  # of 200 false boxes; two within a gate of each other make a track
