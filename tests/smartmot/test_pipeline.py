import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from smartmot.area import EverythingArea, MapArea, MapAreaConfig, RectangularArea, RectangularConfig
from smartmot.decision.braking import BrakingDistance
from smartmot.detection_input import detections_from_arrays
from smartmot.errors import ConfigError, TimeOrderError
from smartmot.forecast import ForecastConfig
from smartmot.maps.route import route_ahead
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig
from smartmot.tracking.lifecycle import LifecycleConfig
from smartmot.tracking.tracker import TrackerConfig
from smartmot.types import Boxes, Detections, Dropped, EgoState

MAPS = Path(__file__).parents[2] / "scenarios" / "maps"
SIZES = {"car": (4.4, 1.8), "pedestrian": (0.5, 0.5), "cyclist": (1.8, 0.6), "truck": (9.0, 2.5)}
LANE_Y = -1.75
KERB_Y = -3.5
WALK_MPS = 5 / 3.6
FRAME_S = 0.05

Object = tuple[str, tuple[float, float], tuple[float, float]]
"""Category, place at t = 0 and velocity."""


@cache
def _map_area(name: str = "urban_street", reach_m: float | None = None) -> MapArea:
    """Eastbound on a shipped street."""
    network = load_map(MAPS / f"{name}.xodr")
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, 0.0)
    return MapArea(network, route, MapAreaConfig(reach_m=reach_m))


def _detections(stamp_s: float, objects: Sequence[Object], noise: np.ndarray | float = 0.0) -> Detections:
    if not objects:
        return Detections.empty(stamp_s)
    center = np.array([np.array(p) + np.array(v) * stamp_s for _, p, v in objects]) + noise
    yaw = np.array([np.arctan2(v[1], v[0]) for _, _, v in objects])
    size = np.array([SIZES[c] for c, _, _ in objects])
    names = np.array([c for c, _, _ in objects])
    return Detections(stamp_s, Boxes(center, size, yaw), np.full(len(objects), 0.9), names)


def _drive(
    objects: Sequence[Object],
    speed: float,
    duration_s: float,
    *,
    start_x: float = 100.0,
    pipeline: Pipeline | None = None,
    latency_s: float = 0.0,
    noise_m: float = 0.0,
    length_m: float = 4.4,
) -> list[FrameResult]:
    """The ego drives along the lane at constant speed, whatever the pipeline commands.

    Its front is where that of a car with its centre at `start_x` is.
    """
    pipeline = pipeline or Pipeline(_map_area(), PipelineConfig())
    rng = np.random.default_rng(11)
    state, results = pipeline.initial(), []
    for k in range(round(duration_s / FRAME_S)):
        now = k * FRAME_S
        x = start_x - (length_m - 4.4) / 2 + speed * now
        ego = EgoState(now, x, LANE_Y, 0.0, speed, length_m=length_m)
        noise = rng.normal(0.0, noise_m, (len(objects), 2)) if noise_m else 0.0
        state, result = pipeline.step(state, _detections(now - latency_s, objects, noise), ego)
        results.append(result)
    return results


def _flagged(results: list[FrameResult]) -> list[int]:
    return [k for k, result in enumerate(results) if result.command.emergency]


def _events(results: list[FrameResult]) -> list[str]:
    return [event.name for result in results for event in result.events]


def _crossing(kmh: float) -> tuple[Object, float]:
    """CPNA: the pedestrian starts 4 m beside the lane's middle; both would meet at the impact point."""
    speed = kmh / 3.6
    ahead = speed * 4.0 / WALK_MPS + 2.2
    return ("pedestrian", (100.0 + ahead, LANE_Y - 4.0), (0.0, WALK_MPS)), speed


@pytest.mark.parametrize("kmh", [20, 40, 60])
@pytest.mark.parametrize("area", ["rectangular", "map", "map_near", "all"])
def test_a_bus_brakes_where_a_car_with_the_same_front_does(area: str, kmh: int) -> None:
    """Distances count from where a car's centre would be, so that a long vehicle is not late."""
    crosser, speed = _crossing(kmh)
    areas = {
        "rectangular": lambda: RectangularArea(RectangularConfig(), BrakingDistance()),
        "map": _map_area,
        "map_near": lambda: _map_area(reach_m=22.2),
        "all": EverythingArea,
    }
    flags = [
        _flagged(
            _drive([crosser], speed, 3.0, pipeline=Pipeline(areas[area](), PipelineConfig()), length_m=length)
        )
        for length in (4.4, 12.0)
    ]
    assert flags[0]
    assert flags[1][0] == flags[0][0]


# --- what goes in -------------------------------------------------------------------------------------


def test_ground_truth_has_no_way_in() -> None:
    names = list(inspect.signature(Pipeline.step).parameters)
    assert names == ["self", "state", "detections", "ego", "path", "localised"]
    annotations = inspect.get_annotations(Pipeline.step, eval_str=True)
    assert annotations["detections"] is Detections
    assert annotations["ego"] is EgoState


def test_a_step_is_a_function_of_its_arguments() -> None:
    pipeline = Pipeline(_map_area(), PipelineConfig())
    crosser, speed = _crossing(50)
    state = pipeline.initial()
    for k in range(30):
        ego = EgoState(k * FRAME_S, 100.0 + speed * k * FRAME_S, LANE_Y, 0.0, speed)
        detections = _detections(k * FRAME_S, [crosser])
        once, first = pipeline.step(state, detections, ego)
        _, second = pipeline.step(state, detections, ego)
        assert first.events == second.events
        assert first.command == second.command
        np.testing.assert_array_equal(first.tracks.mean, second.tracks.mean)
        np.testing.assert_array_equal(first.forecast.center_m, second.forecast.center_m)
        state = once


def test_what_was_seen_once_neither_brakes_nor_slows_the_ego() -> None:
    """One false positive in the lane: its track coasts, and nothing more is known of it with time."""
    pipeline = Pipeline(_map_area(), PipelineConfig())
    seen: list[Object] = [("car", (112.0, LANE_Y), (0.0, 0.0))]
    for frames, brakes in ((1, False), (2, True)):
        state, results = pipeline.initial(), []
        for k in range(5):
            ego = EgoState(k * FRAME_S, 100.0, LANE_Y, 0.0, 10.0)
            state, result = pipeline.step(state, _detections(k * FRAME_S, seen if k < frames else ()), ego)
            results.append(result)
        assert len(results[2].tracks) == 1  # for 0.15 s
        assert any(r.command.emergency for r in results) == brakes
        assert any(r.lead is not None for r in results) == brakes


def test_irrelevant_detections_are_dropped_before_tracking() -> None:
    objects: list[Object] = [
        ("car", (120.0, LANE_Y), (0, 0)),  # in the lane
        ("car", (120.0, 1.75), (0, 0)),  # oncoming lane
        ("car", (120.0, -4.5), (0, 0)),  # on the sidewalk
        ("pedestrian", (120.0, -4.5), (0, 0)),  # on the sidewalk, in the margin
        ("pedestrian", (120.0, -5.5), (0, 0)),  # beyond the margin
        ("pedestrian", (120.0, 5.0), (0, 0)),  # on the other sidewalk
        ("car", (180.0, LANE_Y), (0, 0)),  # too far ahead
        ("car", (60.0, LANE_Y), (0, 0)),  # too far behind
    ]
    result = _drive(objects, 10.0, 0.2)[-1]
    assert result.kept.tolist() == [True, False, False, True, False, False, False, False]
    assert len(result.detections) == 8
    assert result.tracks.category.tolist() == ["car", "pedestrian"]
    everything = Pipeline(EverythingArea(), PipelineConfig())
    assert len(_drive(objects, 10.0, 0.2, pipeline=everything)[-1].tracks) == 8


def test_unsure_detections_start_no_tracks() -> None:
    pipeline = Pipeline(_map_area(), PipelineConfig())
    detections = _detections(0.0, [("car", (120.0, LANE_Y), (0, 0))])
    weak = Detections(0.0, detections.boxes, np.array([0.29]), detections.category)
    ego = EgoState(0.0, 100.0, LANE_Y, 0.0, 15.0)
    _, result = pipeline.step(pipeline.initial(), weak, ego)
    assert result.kept.all()
    assert len(result.tracks) == 0
    assert not result.command.emergency


def test_a_frame_tells_what_was_dropped() -> None:
    """One score under the tracker's 0.3; one name and one box that the detector's arrays had."""
    found, _ = detections_from_arrays(
        0.0, [[120.0, LANE_Y]] * 4, [[4.0, 2.0]] * 3 + [[0.0, 2.0]], [0.0] * 4, [0.2, 0.9, 0.9, 0.9],
        ["car", "car", "unicorn", "car"],
    )  # fmt: skip
    pipeline = Pipeline(_map_area(), PipelineConfig())
    _, result = pipeline.step(pipeline.initial(), found, EgoState(0.0, 100.0, LANE_Y, 0.0, 10.0))
    assert result.dropped == Dropped(score=1, category=1, box=1)
    assert result.trackable == 1
    assert len(result.tracks) == 1


def test_frames_must_come_in_order() -> None:
    pipeline = Pipeline(_map_area(), PipelineConfig())
    ego = EgoState(1.0, 100.0, LANE_Y, 0.0, 10.0)
    state, _ = pipeline.step(pipeline.initial(), Detections.empty(1.0), ego)
    with pytest.raises(TimeOrderError):
        pipeline.step(state, Detections.empty(1.0), ego)
    with pytest.raises(TimeOrderError, match="newer than the ego's state"):
        pipeline.step(state, Detections.empty(1.1), ego)


def test_a_bystander_does_not_arm_the_brake_for_somebody_else() -> None:
    """At 30 km/h a crossing pedestrian is braked for at the same moment, whoever stands on the sidewalk."""
    crosser, speed = _crossing(30)
    bystander = ("pedestrian", (crosser[1][0] - 8.0, KERB_Y - 0.9), (0.0, 0.0))
    alone, watched = _drive([crosser], speed, 3.0), _drive([crosser, bystander], speed, 3.0)
    assert _flagged(alone)
    assert _flagged(alone)[0] == _flagged(watched)[0]


def test_an_empty_road() -> None:
    results = _drive([], 20.0, 1.0)
    assert _events(results) == ["run_start", "follow_path"]
    assert not _flagged(results)
    assert all(r.lead is None and len(r.threats) == len(r.forecast) == 0 for r in results)


# --- when nobody must brake ---------------------------------------------------------------------------


@pytest.mark.parametrize("kmh", [20, 50, 80])
def test_cars_parked_beside_the_lane_never_brake_the_ego(kmh: float) -> None:
    """Cars on the parking strip, 2.75 m beside the lane's middle, 8 m apart."""
    pipeline = Pipeline(_map_area("urban_street_parking"), PipelineConfig())
    parked: list[Object] = [("car", (105.0 + 8 * k, LANE_Y - 2.75), (0.0, 0.0)) for k in range(12)]
    results = _drive(parked, kmh / 3.6, 4.0, pipeline=pipeline, noise_m=0.05)
    assert not _flagged(results)
    assert _events(results) == ["run_start", "follow_path"]
    assert all(r.lead is None for r in results)


@pytest.mark.parametrize("velocity", [WALK_MPS, -WALK_MPS, 3.0])
@pytest.mark.parametrize("beside", [-4.2, -5.0])
def test_walking_along_the_sidewalk_raises_no_flag(velocity: float, beside: float) -> None:
    walker: Object = ("pedestrian", (140.0, beside), (velocity, 0.0))
    results = _drive([walker], 50 / 3.6, 4.0)
    assert max(len(r.tracks) for r in results) == 1
    assert _events(results) == ["run_start", "follow_path"]
    # with position noise the course is unsure, but nobody brakes
    assert not _flagged(_drive([walker], 50 / 3.6, 4.0, noise_m=0.05))


def test_standing_at_the_kerb_is_watched_and_no_more() -> None:
    results = _drive([("pedestrian", (140.0, -4.0), (0.0, 0.0))], 50 / 3.6, 3.5, noise_m=0.05)
    assert len(results[20].tracks) == 1
    assert not _flagged(results)
    assert all(r.lead is None for r in results)


def test_walking_away_from_the_road_raises_no_flag() -> None:
    results = _drive([("pedestrian", (120.0, -3.6), (0.0, -WALK_MPS))], 50 / 3.6, 2.0)
    assert _events(results) == ["run_start", "follow_path"]


def test_oncoming_traffic_is_not_met() -> None:
    results = _drive([("car", (180.0, 1.75), (-14.0, 0.0))], 50 / 3.6, 3.0)
    assert not _flagged(results)
    assert not any(r.kept.any() for r in results)


@pytest.mark.parametrize("ahead", [12.0, 20.0, 30.0])
def test_a_car_ahead_at_the_same_speed_is_no_obstacle_when_first_seen(ahead: float) -> None:
    results = _drive([("car", (100.0 + ahead, LANE_Y), (14.0, 0.0))], 14.0, 1.0, noise_m=0.05)
    assert not _flagged(results)


# --- when somebody must -------------------------------------------------------------------------------


@pytest.mark.parametrize("kmh", [20, 30, 40, 50, 60])
def test_a_pedestrian_is_flagged_before_he_enters_the_lane(kmh: float) -> None:
    crosser, speed = _crossing(kmh)
    results = _drive([crosser], speed, 4.0 / WALK_MPS, noise_m=0.02)
    first = _flagged(results)[0]
    at = first * FRAME_S
    assert crosser[1][1] + WALK_MPS * at + 0.25 < KERB_Y or kmh < 40
    assert crosser[1][1] + WALK_MPS * at < LANE_Y - 0.9  # and in any case before he is in the ego's path
    # the condition of the paper: nearer than the braking distance or than 12 m, and not before that
    near = max(BrakingDistance().at(speed), 12.0)
    distance = [crosser[1][0] - 0.25 - (100.0 + speed * k * FRAME_S) for k in (first - 1, first)]
    assert distance[1] < near + 0.1
    assert distance[0] > near - 0.1
    assert _flagged(results) == list(range(first, len(results)))


def test_events_of_a_crossing_in_the_order_of_figure_4() -> None:
    crosser, speed = _crossing(40)
    results = _drive([crosser], speed, 4.0 / WALK_MPS)
    assert _events(results) == [
        "run_start",
        "follow_path",
        "forecasted_pedestrian",
        "unexpected",
        "collision",
        "predicted_collision",
    ]
    stamps = [e.stamp_s for r in results for e in r.events]
    assert stamps == sorted(stamps)
    threat = results[_flagged(results)[0]].threats
    assert threat.track_id.tolist() == [1]
    # centres are to meet 2.2 m of ego later than its front reaches the line
    expected = 4.0 / WALK_MPS - results[_flagged(results)[0]].events[0].stamp_s
    assert threat.time_to_collision_s[0] == pytest.approx(expected, abs=0.35)


def test_after_the_stop_the_ego_drives_on_when_the_lane_is_free() -> None:
    """Braked to a stand for a crossing pedestrian: held until he has left the lane, plus 0.15 s."""
    pipeline = Pipeline(_map_area(), PipelineConfig())
    state, x, speed, freed = pipeline.initial(), 100.0, 10.0, None
    crosser: Object = ("pedestrian", (122.0, LANE_Y - 3.0), (0.0, WALK_MPS))
    flagged = False
    for k in range(200):
        now = k * FRAME_S
        ego = EgoState(now, x, LANE_Y, 0.0, speed)
        state, result = pipeline.step(state, _detections(now, [crosser]), ego)
        flagged |= result.command.emergency
        if flagged and not result.command.emergency:
            freed = now
            break
        x += speed * FRAME_S
        speed = max(speed - (8.0 * FRAME_S if result.command.emergency else 0.0), 0.0)
    left_lane_s = (3.0 + 1.75) / WALK_MPS
    assert speed == 0.0
    assert freed is not None
    assert left_lane_s + 0.15 - 1e-9 <= freed <= left_lane_s + 0.15 + 2 * FRAME_S
    assert [e.name for e in result.events] == ["free_lane", "end_unexpected", "follow_path"]


@pytest.mark.parametrize("kmh", [30, 50])
def test_a_car_standing_in_the_lane_brakes_the_ego(kmh: float) -> None:
    results = _drive([("car", (140.0, LANE_Y), (0.0, 0.0))], kmh / 3.6, 3.5 if kmh < 40 else 2.5)
    first = _flagged(results)[0]
    near = max(BrakingDistance().at(kmh / 3.6), 12.0)
    assert 140.0 - 2.2 - (100.0 + kmh / 3.6 * first * FRAME_S) == pytest.approx(near, abs=kmh / 3.6 * FRAME_S)
    assert "forecasted_pedestrian" not in _events(results)


def test_beyond_the_reach_nobody_counts() -> None:
    """With a reach of 22.2 m the flag comes when the pedestrian's near side is that far from the centre."""
    pipeline = Pipeline(_map_area("urban_street", 22.2), PipelineConfig())
    crosser, speed = _crossing(60)
    results = _drive([crosser], speed, 4.0 / WALK_MPS, pipeline=pipeline)
    first = _flagged(results)[0]
    distance = crosser[1][0] - 0.25 - (100.0 + speed * first * FRAME_S)
    assert 22.2 - speed * FRAME_S < distance <= 22.2 + 1e-6


def test_rectangle_flags_no_sooner_than_its_length() -> None:
    rectangle = RectangularArea(RectangularConfig(max_length_m=12.0), BrakingDistance())
    crosser, speed = _crossing(50)
    results = _drive([crosser], speed, 4.0 / WALK_MPS, pipeline=Pipeline(rectangle, PipelineConfig()))
    distance = crosser[1][0] - 0.25 - (100.0 + speed * _flagged(results)[0] * FRAME_S)
    assert 12.0 - speed * FRAME_S < distance <= 12.0 + 1e-6


def test_unconfirmed_tracks_do_not_count() -> None:
    slow = PipelineConfig(tracker=TrackerConfig(lifecycle=LifecycleConfig(confirm_s=0.5)))
    car: Object = ("car", (112.0, LANE_Y), (0.0, 0.0))
    assert _flagged(_drive([car], 5.0, 0.8))[0] == 1  # one frame shows no velocity
    results = _drive([car], 5.0, 0.8, pipeline=Pipeline(_map_area(), slow))
    assert _flagged(results)[0] == 10
    assert [r.lead is None for r in results[:11]] == [True] * 10 + [False]


# --- adapting the speed -------------------------------------------------------------------------------


@pytest.mark.parametrize("category", ["car", "truck", "cyclist"])
def test_a_vehicle_ahead_is_the_lead_object(category: str) -> None:
    """30 m ahead at 8 m/s, the ego at 10 m/s; after 1 s the gap is 28 m less half both lengths."""
    results = _drive([(category, (130.0, LANE_Y), (8.0, 0.0))], 10.0, 1.05)
    lead = results[-1].lead
    assert lead is not None
    assert lead.track_id == 1
    assert lead.gap_m == pytest.approx(28.0 - 2.2 - SIZES[category][0] / 2, abs=0.02)
    assert lead.speed_mps == pytest.approx(8.0, abs=0.05)
    assert not _flagged(results)


def test_the_nearest_of_several_on_the_lane_leads() -> None:
    objects: list[Object] = [
        ("car", (145.0, LANE_Y), (10.0, 0.0)),
        ("car", (125.0, LANE_Y), (10.0, 0.0)),
        ("pedestrian", (115.0, -4.0), (0.0, 0.0)),  # beside the lane
        ("car", (90.0, LANE_Y), (10.0, 0.0)),  # behind
    ]
    lead = _drive(objects, 10.0, 1.0)[-1].lead
    assert lead is not None
    assert lead.gap_m == pytest.approx(25.0 - 4.4, abs=0.02)


def test_a_pedestrian_on_a_collision_course_does_not_lead() -> None:
    """He stands in the lane: on a collision course he is the brake's, not the speed control's."""
    standing: Object = ("pedestrian", (125.0, LANE_Y), (0.0, 0.0))
    results = _drive([standing], 12.0, 1.0)
    assert len(results[-1].threats) == 1
    assert results[-1].lead is None
    # in front of a standing ego he is no threat
    lead = _drive([standing], 0.0, 1.0)[-1].lead
    assert lead is not None
    assert lead.speed_mps == 0.0


def test_a_car_on_a_collision_course_still_leads() -> None:
    result = _drive([("car", (125.0, LANE_Y), (0.0, 0.0))], 12.0, 1.0)[-1]
    assert result.threats.track_id.tolist() == [1]
    assert result.lead is not None
    assert result.lead.track_id == 1


def test_a_truck_that_reaches_into_the_path_from_outside_the_lane_is_braked_for() -> None:
    """Its centre is 0.37 m beyond the kerb, its side 0.1 m inside the ego's outline of 1.8 m."""
    side = LANE_Y - 0.9 + 0.1
    truck = ("truck", (150.0, side - 1.25), (0.0, 0.0))
    assert truck[1][1] < KERB_Y
    results = _drive([truck], 50 / 3.6, 3.0)
    assert any(result.kept.all() for result in results)
    assert _flagged(results)


def test_a_truck_beside_the_path_but_over_the_lane_border_is_passed() -> None:
    """Its side reaches 0.3 m into the lane and leaves 0.55 m beside the ego."""
    truck = ("truck", (150.0, KERB_Y + 0.3 - 1.25), (0.0, 0.0))
    results = _drive([truck], 50 / 3.6, 5.0)
    assert any(result.kept.all() for result in results)
    assert not _flagged(results)
    assert all(result.lead is None for result in results)


# --- settings -----------------------------------------------------------------------------------------


def _swerve(filter_tracks: bool) -> FrameResult:
    """A car moves aside at 4 m/s and stops dead, its side 1 cm inside the lane: the estimate overshoots."""
    tracker = TrackerConfig(lifecycle=LifecycleConfig(max_age_s=0.0))
    pipeline = Pipeline(_map_area(), PipelineConfig(tracker=tracker, filter_tracks=filter_tracks))
    state = pipeline.initial()
    gone = KERB_Y - SIZES["car"][1] / 2
    for k in range(42):
        y = max(LANE_Y - 4.0 * FRAME_S * k, gone + 0.01)
        detections = _detections(k * FRAME_S, [("car", (120.0, y), (0.0, 0.0))])
        state, result = pipeline.step(state, detections, EgoState(k * FRAME_S, 100.0, LANE_Y, 0.0, 0.0))
        assert result.kept.all()
        if result.tracks.boxes.center_m[:, 1].min(initial=0.0) < gone or not len(result.tracks):
            break
    else:
        pytest.fail("the estimate never left the lane")
    return result


def test_tracks_that_left_the_area_are_deleted_only_when_asked() -> None:
    assert len(_swerve(filter_tracks=True).tracks) == 0
    assert len(_swerve(filter_tracks=False).tracks) == 1


@pytest.mark.parametrize("latency_s", [0.1, 0.25])
def test_latency_is_compensated(latency_s: float) -> None:
    """The forecast starts where the pedestrian is now, and the flag comes when it would without latency."""
    crosser, speed = _crossing(50)
    prompt = _drive([crosser], speed, 2.5)
    late = _drive([crosser], speed, 2.5, latency_s=latency_s)
    assert abs(_flagged(late)[0] - _flagged(prompt)[0]) <= 1
    k = _flagged(late)[0]
    assert late[k].tracks.stamp_s == pytest.approx(k * FRAME_S - latency_s)
    truth = np.array(crosser[1]) + np.array(crosser[2]) * k * FRAME_S
    np.testing.assert_allclose(late[k].forecast.center_m[0, 0], truth, atol=0.02)


def test_spacing_of_the_forecast_changes_little() -> None:
    """A pedestrian is seen coming at any spacing; also where five steps cross the lane."""
    crosser, speed = _crossing(50)
    opened = []
    for step_s in (0.05, 0.1, 0.5, 1.0):
        config = PipelineConfig(forecast=ForecastConfig(step_s=step_s))
        results = _drive([crosser], speed, 1.0, pipeline=Pipeline(_map_area(), config))
        names = [[e.name for e in r.events] for r in results]
        opened.append(next(k for k, found in enumerate(names) if "forecasted_pedestrian" in found))
    assert max(opened) - min(opened) <= 1


def test_horizon_grows_with_speed() -> None:
    """At 110 km/h the braking distance takes 3.3 s."""
    for kmh, steps in ((50, 31), (110, 34)):
        result = _drive([], kmh / 3.6, 0.05)[0]
        assert len(result.ego_forecast.time_s) == steps


def test_the_strategy_decides_what_is_kept() -> None:
    walker: Object = ("pedestrian", (120.0, 4.0), (0.0, 0.0))
    strategies: dict[str, Callable[[], int]] = {
        "map": lambda: len(_drive([walker], 10.0, 0.1)[-1].tracks),
        "rectangular": lambda: len(
            _drive(
                [walker],
                10.0,
                0.1,
                pipeline=Pipeline(RectangularArea(RectangularConfig(), BrakingDistance()), PipelineConfig()),
            )[-1].tracks
        ),
    }
    assert {name: count() for name, count in strategies.items()} == {"map": 0, "rectangular": 1}


@pytest.mark.parametrize("threshold", [-0.01, 1.0])
def test_impossible_thresholds_are_refused(threshold: float) -> None:
    with pytest.raises(ConfigError):
        replace(PipelineConfig(), iou_threshold=threshold)
