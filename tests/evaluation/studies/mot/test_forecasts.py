"""Forecasts of objects whose motion is known in closed form, with and without a map."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.metrics.forecast_quality import ForecastScore
from evaluation.studies.mot.forecasts import (
    MODELS,
    carried_on,
    motions,
    score_forecasts,
)
from evaluation.studies.mot.lanes import LaneForecast, require_cover
from evaluation.studies.mot.map_filter import filter_by_map
from evaluation.studies.mot.run import track_dataset
from evaluation.studies.mot.tracking import TrackedSequence
from opendrive import RoadNetwork, load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Objects, Sequence
from scenarios.recorded.formats import read_dataset
from smartmot.filters.motion_models import ConstantVelocity
from smartmot.forecast import ForecastConfig
from smartmot.tracking.configs import forecast_of, tracker_config
from smartmot.types import FloatArray

FRAMES = 60


def tracked(objects: Any, sequence: Any, path_m: np.ndarray, **state: np.ndarray) -> TrackedSequence:
    """A car that is tracked exactly where its label is, with the given states."""
    rows = [(k, 1, x, y) for k, (x, y) in enumerate(path_m.tolist())]
    labels = objects(rows)
    tracks = objects(rows, velocity_mps=state["velocity_mps"])
    return TrackedSequence(
        sequence=sequence(len(rows), labels),
        tracks=tracks,
        yaw_rate_radps=state.get("yaw_rate_radps", np.zeros(len(rows))),
        acceleration_mps2=state.get("acceleration_mps2", np.zeros((len(rows), 2))),
        coasted_s=np.zeros(len(rows)),
    )


def quality(model: str, one: TrackedSequence, **options: Any) -> dict[tuple[str, bool, float], ForecastScore]:
    found = score_forecasts({model: [one]}, ["car"], ForecastConfig(model="class"), **options)
    return {(s.objects, s.with_map, s.horizon_s): s for s in found}


def test_motion_that_the_model_knows_has_no_error(objects: Any, sequence: Any) -> None:
    time = 0.1 * np.arange(FRAMES)
    straight = np.column_stack((8.0 * time, 3.0 * time))
    velocity = np.tile((8.0, 3.0), (FRAMES, 1))
    rate, radius = 0.3, 20.0
    turn = radius * np.column_stack((np.sin(rate * time), 1.0 - np.cos(rate * time)))
    along = radius * rate * np.column_stack((np.cos(rate * time), np.sin(rate * time)))
    braking = np.column_stack((20.0 * time - 1.5 * time**2, np.zeros(FRAMES)))
    slower = np.column_stack((20.0 - 3.0 * time, np.zeros(FRAMES)))
    cases = {
        "cv": tracked(objects, sequence, straight, velocity_mps=velocity),
        "ctrv": tracked(objects, sequence, turn, velocity_mps=along, yaw_rate_radps=np.full(FRAMES, rate)),
        "ca": tracked(
            *(objects, sequence, braking),
            velocity_mps=slower,
            acceleration_mps2=np.tile((-3.0, 0.0), (FRAMES, 1)),
        ),
    }
    for model, one in cases.items():
        scores = [score for score in quality(model, one).values() if score.forecasts]
        assert len(scores) == 9  # all, moving and followed
        for score in scores:
            assert score.ade_m == pytest.approx(0.0, abs=1e-9)
            assert score.fde_m == pytest.approx(0.0, abs=1e-9)
            assert score.miss_rate_percent == 0.0


def test_errors_of_constant_velocity_behind_a_braking_car(objects: Any, sequence: Any) -> None:
    """After t seconds the forecast is 1.5 t^2 too far; the mean of k^2 for k = 1..n is (n+1)(2n+1)/6."""
    time = 0.1 * np.arange(FRAMES)
    path = np.column_stack((30.0 * time - 1.5 * time**2, np.zeros(FRAMES)))
    velocity = np.column_stack((30.0 - 3.0 * time, np.zeros(FRAMES)))
    found = quality("cv", tracked(objects, sequence, path, velocity_mps=velocity))
    for horizon_s, frames, missed in ((1.0, 10, 0.0), (2.0, 20, 100.0), (3.0, 30, 100.0)):
        score = found["all", False, horizon_s]
        assert score.fde_m == pytest.approx(1.5 * horizon_s**2)
        assert score.ade_m == pytest.approx(1.5 * 0.01 * (frames + 1) * (2 * frames + 1) / 6)
        assert score.miss_rate_percent == missed
        assert score.forecasts == FRAMES - frames


def test_standing_objects_are_not_among_the_moving(objects: Any, sequence: Any) -> None:
    path = np.zeros((FRAMES, 2))
    found = quality("cv", tracked(objects, sequence, path, velocity_mps=np.zeros((FRAMES, 2))))
    assert found["all", False, 1.0].forecasts == FRAMES - 10
    assert found["moving", False, 1.0].forecasts == 0
    assert np.isnan(found["moving", False, 1.0].fde_m)


def test_only_matched_tracks_and_known_labels_count(objects: Any, sequence: Any) -> None:
    """Labels at 0..29 and from 45 on: of the first run 20 frames know the next second."""
    known = [k for k in range(FRAMES) if k < 30 or k >= 45]
    labels = objects([(k, 1, 0.0, 0.0) for k in known])
    away = objects(
        [(k, 1, 0.0, 5.0 if k < 5 else 0.0) for k in range(FRAMES)], velocity_mps=np.zeros((FRAMES, 2))
    )
    zeros = np.zeros(FRAMES)
    one = TrackedSequence(sequence(FRAMES, labels), away, zeros, np.zeros((FRAMES, 2)), zeros)
    # frames 5..19 and 45..49; a label that comes back after 1.5 s is not at the horizon of 1 s
    assert quality("cv", one)["all", False, 1.0].forecasts == 15 + 5


def test_models_on_real_data(kitti: Path) -> None:
    """Every model's filter gives forecasts; over 1 s parked and moving cars are foretold to about a metre."""
    data = read_dataset(kitti)
    data = type(data)("kitti", data.sequences[3:4], log_odds=True)
    config = tracker_config("default")
    by_model = {
        name: track_dataset(data, replace(config, motion=m)) for name, m in motions(config.motion).items()
    }
    found = score_forecasts(by_model, ["car"], forecast_of(config))
    assert {s.model for s in found} == set(MODELS)
    assert all(s.fde_m < 2.0 for s in found if s.horizon_s == 1.0 and s.objects == "all")


def test_the_tracker_s_own_noise_is_kept() -> None:
    own = ConstantVelocity(velocity_m2ps3=2.5)
    assert motions(own)["cv"] is own
    assert motions(own)["ca"] is MODELS["ca"]


Curve = tuple[RoadNetwork, FloatArray, FloatArray]


@pytest.fixture(scope="module")
def curve() -> Curve:
    """A map and a drive at 8 m/s along the middle of a lane about a bend: positions and velocities."""
    network = load_map(shipped_map("urban_bend"))
    lanes = network.lanes
    lane = int(np.flatnonzero((np.array(lanes.lane_type) == "driving") & (np.array(lanes.direction) > 0))[0])
    s = np.linspace(lanes.s_start_m[lane], lanes.s_end_m[lane], 20_000)
    x, y, _, heading = network.center_line(lane, s)
    station = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    half_turn = np.flatnonzero(np.abs(heading - heading[0]) > 0.5 * np.abs(heading[-1] - heading[0]))[0]
    at = station[half_turn] + 0.8 * (np.arange(FRAMES) - FRAMES / 2)
    path = np.column_stack([np.interp(at, station, values) for values in (x, y)])
    course = np.interp(at, station, heading)
    return network, path, 8.0 * np.column_stack((np.cos(course), np.sin(course)))


def test_along_lanes(objects: Any, sequence: Any, curve: Curve) -> None:
    """A car that keeps to its lane in a bend is foretold to a few centimetres with the map."""
    network, path, velocity = curve
    one = tracked(objects, sequence, path, velocity_mps=velocity)
    found = quality("class", one, along_lanes=LaneForecast(network).along_lanes)
    assert found["all", True, 3.0].fde_m < 0.1
    assert found["all", False, 3.0].fde_m > 4.0
    assert found["all", True, 3.0].forecasts == found["all", False, 3.0].forecasts > 0


def test_pedestrians_and_crossing_cars_move_freely(objects: Any, sequence: Any, curve: Curve) -> None:
    network, path, velocity = curve
    across = np.column_stack((-velocity[:, 1], velocity[:, 0]))
    one = tracked(objects, sequence, path, velocity_mps=across)
    rows, times = np.arange(FRAMES), np.full(FRAMES, 2.0)
    free = carried_on("class")
    hypotheses = LaneForecast(network).along_lanes(free)(one, rows, times)
    assert hypotheses.shape == (FRAMES, 6, 2)
    assert (hypotheses == free(one, rows, times)[:, None]).all()


def test_a_braking_car_stops_and_does_not_turn_back(objects: Any, sequence: Any, curve: Curve) -> None:
    network, path, velocity = curve
    one = tracked(objects, sequence, path, velocity_mps=velocity, acceleration_mps2=-2.5 * velocity)
    carry = LaneForecast(network).first(carried_on("class"))
    first, later = (carry(one, np.arange(1), np.array([t])) for t in (2.5, 3.0))
    # 8 m/s and -20 m/s2 that fades over 0.5 s: it stands after 0.8 s, where 8 - 10 (1 - exp(-t / 0.5)) is 0
    stop_s = -0.5 * np.log(0.2)
    way = 8.0 * stop_s - 10.0 * (stop_s - 0.5 * 0.8)
    assert later == pytest.approx(first, abs=0.05)  # the lane counts more later
    assert np.linalg.norm(first[0] - path[0]) == pytest.approx(way, abs=0.05)


def test_a_map_of_another_place_is_refused(curve: Curve) -> None:
    network = curve[0]
    with pytest.raises(DatasetError, match="does not cover the data: map x"):
        require_cover(network, np.array([[1e5, 1e5]]), "detections")
    require_cover(network, curve[1], "detections")


def drive(path: np.ndarray, velocity: np.ndarray, objects: Any, poses: bool = True) -> Sequence:
    """A vehicle on a lane; detections, all labelled: on the lane ahead, 40 m beside it and 200 m away."""
    yaw = np.arctan2(velocity[:, 1], velocity[:, 0])
    pose = np.tile(np.eye(4), (len(path), 1, 1))
    pose[:, 0, 0] = pose[:, 1, 1] = np.cos(yaw)
    pose[:, 1, 0], pose[:, 0, 1] = np.sin(yaw), -np.sin(yaw)
    pose[:, :2, 3] = path
    unit = velocity / np.linalg.norm(velocity, axis=1, keepdims=True)
    rows = []
    for k in range(len(path)):
        ahead, far = path[k] + 10.0 * unit[k], path[k] + 200.0 * unit[k]
        field = path[k] + 10.0 * unit[k] + 40.0 * np.array([unit[k, 1], -unit[k, 0]])
        rows += [(k, i, *point) for i, point in enumerate((ahead, field, far))]
    found: Objects = objects(rows, yaw_rad=np.repeat(yaw, 3))
    stamps = 0.1 * np.arange(len(path))
    names = tuple(map(str, range(len(path))))
    return Sequence("s", stamps, names, found, found, pose if poses else None)


def test_the_map_filter_keeps_what_is_on_lanes(objects: Any, curve: Curve) -> None:
    network, path, velocity = curve
    path, velocity = path[:20], velocity[:20]
    filtered = filter_by_map(Dataset("csv", (drive(path, velocity, objects),)), network)
    [sequence] = filtered.data.sequences
    assert set(sequence.detections.object_id.tolist()) == {0}
    assert (len(sequence.detections), filtered.dropped, filtered.off_map) == (20, 40, 0)
    assert sequence.labels is not None
    assert sequence.labels.ignored.tolist() == [False, True, True] * 20


def test_the_map_filter_needs_poses_on_the_map(objects: Any, curve: Curve) -> None:
    network, path, velocity = curve
    with pytest.raises(DatasetError, match="sequence s has no ego poses"):
        filter_by_map(Dataset("csv", (drive(path, velocity, objects, poses=False),)), network)
    with pytest.raises(DatasetError, match="does not cover the data"):
        filter_by_map(Dataset("csv", (drive(path + 1e4, velocity, objects),)), network)


def test_standing_and_followed_objects_are_scored_apart(objects: Any, sequence: Any) -> None:
    """A car stands for 3 s and then drives at 8 m/s; its track is a second old after 10 frames."""
    time = 0.1 * np.arange(FRAMES)
    path = np.column_stack((8.0 * np.maximum(time - 3.0, 0.0), np.zeros(FRAMES)))
    velocity = np.column_stack((np.where(time > 3.0 - 1e-9, 8.0, 0.0), np.zeros(FRAMES)))
    found = quality("cv", tracked(objects, sequence, path, velocity_mps=velocity))
    counts = {name: found[name, False, 1.0].forecasts for name in ("all", "moving", "standing", "followed")}
    # 0.5 m within the next second: from frame 21 on (0.8 m); all of these tracks are over a second old
    assert counts == {"all": 50, "moving": 29, "standing": 21, "followed": 29}
    assert found["standing", False, 1.0].fde_m == pytest.approx(0.0)
    assert found["followed", False, 3.0].forecasts == FRAMES - 30 - 10
    assert found["moving", False, 3.0].forecasts == FRAMES - 30 - 2


def test_the_best_hypothesis_is_scored_beside_the_most_likely(objects: Any, sequence: Any) -> None:
    """The first hypothesis stands; the second is right."""
    time = 0.1 * np.arange(FRAMES)
    path = np.column_stack((8.0 * time, np.zeros(FRAMES)))
    one = tracked(objects, sequence, path, velocity_mps=np.tile((8.0, 0.0), (FRAMES, 1)))

    def two(free: Any) -> Any:
        def hypotheses(tracks: TrackedSequence, rows: Any, time_s: Any) -> FloatArray:
            return np.stack((tracks.tracks.center_m[rows], free(tracks, rows, time_s)), axis=1)

        return hypotheses

    score = quality("class", one, along_lanes=two)["moving", True, 3.0]
    assert (score.fde_m, score.min_fde_6_m) == (pytest.approx(24.0), pytest.approx(0.0, abs=1e-9))
    assert (score.ade_m, score.min_ade_6_m) == (pytest.approx(12.4), pytest.approx(0.0, abs=1e-9))
