"""The closed loop against closed forms: contact time, impact speed, determinism."""

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import load_map
from scenarios.brakes import BrakeConfig
from scenarios.catalogue.cpna import LEAD_S, CpnaTest, build, find_site
from scenarios.catalogue.library import shipped_scenario
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.model import (
    Act,
    Action,
    Condition,
    DeleteEntityAction,
    EntityCondition,
    EntityDefinition,
    Event,
    FollowTrajectoryAction,
    LongitudinalDistanceAction,
    Maneuver,
    ManeuverGroup,
    NamedAction,
    Polyline,
    RelativeSpeed,
    ScenarioDefinition,
    SpeedAction,
    StandStillCondition,
    Story,
    SynchronizeAction,
    TeleportAction,
    TimeReference,
    Trajectory,
    TraveledDistanceCondition,
    Vertex,
    VisibilityAction,
    WorldPosition,
)
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.places import MapView, Site
from scenarios.presets import PAPER, PHYSICAL, Preset
from scenarios.sensors.boxes import SensorConfig
from scenarios.simulation.ends import EndReason, StopRule, is_avoided
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.sources.perception import Perception
from scenarios.strategies import make_strategy
from smartmot.area import EverythingArea
from smartmot.decision.rules import Command
from smartmot.maps.route import RouteError
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.types import Detections, EgoState

KMH = 1 / 3.6
FRAME_S = 0.05
WALK_S = 4.0 / (5 * KMH)
HALF_WIDTH_M, HALF_LENGTH_M = 0.25, 2.2  # of the pedestrian across its way, and of the ego
LANE_Y_M = -1.75


class BrakesAt(Pipeline):
    """Brakes at a given time and knows nothing; keeps what it was given."""

    def __init__(self, time_s: float) -> None:
        super().__init__(EverythingArea(), PipelineConfig())
        self.time_s = time_s
        self.given: list[tuple[float, Detections]] = []
        blind = Pipeline.step(self, self.initial(), Detections.empty(0.0), EgoState(0.0, 0.0, 0.0, 0.0, 0.0))
        self._nothing = dataclasses.replace(blind[1], events=())

    def step(
        self, state: PipelineState, detections: Detections, ego: EgoState, path: PlannedPath | None = None
    ) -> tuple[PipelineState, FrameResult]:
        self.given.append((ego.stamp_s, detections))
        command = Command(ego.stamp_s >= self.time_s - 1e-9)
        return state, dataclasses.replace(self._nothing, command=command)


@dataclasses.dataclass(frozen=True)
class Other:
    """Somebody else: box centre, yaw, size, speed; starts when the ego has gone so far."""

    category: str
    x_m: float
    y_m: float
    yaw_rad: float = 0.0
    length_m: float = 4.4
    width_m: float = 1.8
    speed_mps: float = 0.0
    after_m: float = 0.0
    hidden: bool = False


def definition(
    speed_kmh: float, others: list[Other], *, front_m: float = 100.0, map_name: str = "urban_street"
) -> ScenarioDefinition:
    """The ego's front at a station of the street, and anybody else."""
    entities = [EntityDefinition("Ego", "car", "car", 2 * HALF_LENGTH_M, 1.8, 1.5, 0.0, 0.0)]
    init: list[tuple[str | None, Action]] = [
        ("Ego", TeleportAction(WorldPosition(front_m - HALF_LENGTH_M, LANE_Y_M, 0.0))),
        ("Ego", SpeedAction("step", "time", 0.0, speed_kmh * KMH)),
    ]
    events = []
    for number, other in enumerate(others):
        name = f"other {number}"
        size = (other.length_m, other.width_m, 1.5)
        entities.append(EntityDefinition(name, other.category, other.category, *size, 0.0, 0.0))
        init.append((name, TeleportAction(WorldPosition(other.x_m, other.y_m, other.yaw_rad))))
        if other.hidden:
            init.append((name, VisibilityAction(graphics=True, sensors=False, traffic=True)))
        go = SpeedAction("step", "time", 0.0, other.speed_mps)
        if other.speed_mps and other.after_m:
            near = EntityCondition(("Ego",), False, TraveledDistanceCondition(other.after_m))
            start = ((Condition("near", 0.0, "none", near),),)
            events.append(Event(name, "parallel", 1, (NamedAction("go", go, (name,)),), start))
        elif other.speed_mps:
            init.append((name, go))
    group = ManeuverGroup("all", 1, tuple(Maneuver(e.name, (e,)) for e in events))
    stories = (Story("story", (Act("act", (group,), None, None),)),) if events else ()
    path = shipped_map(map_name)
    return ScenarioDefinition(
        Path("made.xosc"), "", {}, {}, path, tuple(entities), tuple(init), stories, None
    )


def simulation(
    speed_kmh: float,
    others: list[Other],
    pipeline: Pipeline | None,
    brakes: BrakeConfig = PHYSICAL.brakes,
    *,
    front_m: float = 100.0,
    sensor: SensorConfig = PHYSICAL.sensor,
    rule: StopRule | None = None,
) -> Simulation:
    preset = dataclasses.replace(PHYSICAL, brakes=brakes, sensor=sensor)
    return decided_by(
        Simulation(
            definition(speed_kmh, others, front_m=front_m),
            preset,
            (lambda scene: EverythingArea()) if pipeline else None,
            rule=rule,
        ),
        pipeline,
    )


def decided_by(built: Simulation, pipeline: Pipeline | None) -> Simulation:
    """The run with another perception and decision."""
    if pipeline is not None:
        built.perception = lambda: Perception(lambda frame: pipeline)  # type: ignore[method-assign]
    return built


@pytest.fixture(scope="module")
def site() -> Site:
    return find_site(load_map(shipped_map("urban_street")), 80.0)


def car_at(rear_m: float, speed_mps: float = 0.0) -> Other:
    return Other("car", rear_m + 2.2, LANE_Y_M, speed_mps=speed_mps)


# ---- closed forms ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("speed_kmh", [*range(5, 141, 5), 33.3])
def test_contact_without_braking_is_at_the_time_of_the_closed_form(site: Site, speed_kmh: float) -> None:
    values = {"Ego_speed_kmh": float(speed_kmh), "Line_x": 560.0}
    outcome = Simulation(load(shipped_scenario("cpna_paper"), values), PAPER, None).run()
    expected = LEAD_S + WALK_S - HALF_WIDTH_M / (speed_kmh * KMH)
    assert outcome.contact is not None
    assert outcome.contact.entity == "Target"
    assert outcome.contact.time_s == pytest.approx(expected, abs=1e-3)
    assert outcome.contact.time_s == pytest.approx(expected, abs=1e-6)  # what it reaches
    assert outcome.impact_speed_mps == pytest.approx(speed_kmh * KMH, abs=1e-9)
    assert outcome.target_start_time_s == pytest.approx(LEAD_S, abs=1e-6)
    assert outcome.flag_time_s is outcome.stop_time_s is outcome.stop_gap_m is None
    assert not outcome.false_activation


@pytest.mark.parametrize("speed_kmh", [30, 50, 60, 80])
@pytest.mark.parametrize("frames_before", [6, 11, 15])
@pytest.mark.parametrize("decel_mps2", [9.0, 5.0])
def test_ideal_brake_hits_at_the_speed_of_the_energy_equation(
    site: Site, speed_kmh: float, frames_before: int, decel_mps2: float
) -> None:
    speed = speed_kmh * KMH
    preset = dataclasses.replace(PAPER, brakes=BrakeConfig(0.0, 0.0, decel_mps2))
    brake_s = round(LEAD_S + WALK_S - frames_before * FRAME_S, 1)
    distance = speed * (LEAD_S + WALK_S - brake_s) - HALF_WIDTH_M
    outcome = _run_with(site, preset, speed_kmh, BrakesAt(brake_s))
    left = speed**2 - 2 * decel_mps2 * distance
    assert outcome.flag_time_s == pytest.approx(brake_s)
    assert outcome.flag_distance_m == pytest.approx(distance, abs=1e-3)
    assert outcome.flag_ttc_s == pytest.approx(distance / speed, abs=1e-3)
    if left < 0:
        assert outcome.contact_time_s is None
        assert outcome.stop_time_s == pytest.approx(brake_s + speed / decel_mps2, abs=0.011)
        assert outcome.stop_gap_m == pytest.approx(-left / (2 * decel_mps2), abs=1e-3)
        return
    impact = math.sqrt(left)
    assert outcome.impact_speed_mps / KMH == pytest.approx(impact / KMH, abs=0.05)
    assert outcome.contact_time_s == pytest.approx(brake_s + (speed - impact) / decel_mps2, abs=1e-3)


def _run_with(site: Site, preset: Preset, speed_kmh: float, pipeline: Pipeline) -> Outcome:
    """The paper's test, with another decision."""
    built = build(CpnaTest(speed_kmh), site, preset, EverythingArea(), StopRule(time_limit_s=9.0))
    return decided_by(built, pipeline).run()


@settings(max_examples=25, deadline=None)
@given(
    speed_kmh=st.floats(10.0, 90.0),
    frame=st.integers(0, 30),
    gap_m=st.floats(0.5, 40.0),
    decel_mps2=st.floats(2.0, 12.0),
)
def test_a_standing_car_is_hit_at_the_speed_of_the_energy_equation(
    speed_kmh: float, frame: int, gap_m: float, decel_mps2: float
) -> None:
    """Any speed, any frame of the request, any distance left then."""
    speed, flag_s = speed_kmh * KMH, frame * FRAME_S
    car = car_at(100.0 + speed * flag_s + gap_m)
    rule = StopRule(time_limit_s=flag_s + speed / decel_mps2 + 0.5)
    outcome = simulation(
        speed_kmh, [car], BrakesAt(flag_s), BrakeConfig(0.0, 0.0, decel_mps2), rule=rule
    ).run()
    left = speed**2 - 2 * decel_mps2 * gap_m
    impact = math.sqrt(max(left, 0.0))
    if abs(left) > 0.01:  # not a touch at walking pace within rounding
        assert (outcome.contact is not None) == (left > 0)
    assert outcome.impact_speed_mps / KMH == pytest.approx(impact / KMH, abs=0.05)


@pytest.mark.parametrize("brakes", [PAPER.brakes, PHYSICAL.brakes])
@pytest.mark.parametrize("ttc_s", [0.4, 0.7])
def test_real_brake_hits_at_the_speed_of_the_profile(brakes: BrakeConfig, ttc_s: float) -> None:
    """Against a standing car, so that only the brakes matter: delay, linear build-up, constant."""
    speed, flag_s = 60 * KMH, 1.0
    rear = 100.0 + speed * (flag_s + ttc_s)
    outcome = simulation(60, [car_at(rear)], BrakesAt(flag_s), brakes).run()
    # fine sum of the profile, trapezoid, 10 microseconds
    time = np.arange(0.0, 1.6, 1e-5)
    decel = np.interp(
        time, [brakes.delay_s, brakes.delay_s + brakes.build_up_s], [0.0, brakes.max_decel_mps2]
    )
    v = speed - np.concatenate(([0.0], np.cumsum((decel[1:] + decel[:-1]) / 2) * 1e-5))
    way = np.concatenate(([0.0], np.cumsum((v[1:] + v[:-1]) / 2) * 1e-5))
    k = int(np.searchsorted(way, speed * ttc_s))
    assert outcome.contact_time_s == pytest.approx(flag_s + time[k], abs=1e-3)
    assert outcome.impact_speed_mps / KMH == pytest.approx(v[k] / KMH, abs=0.05)


def test_contact_is_found_although_the_step_is_long() -> None:
    """The last row of the log is the instant of contact: the outlines touch."""
    outcome = simulation(80, [car_at(140.0)], None).run()
    assert outcome.contact_time_s == pytest.approx(40.0 / (80 * KMH), abs=1e-6)
    table = outcome.log.table()
    ego = {k: v[table["kind"] == "ego"][-1] for k, v in table.items()}
    assert ego["time_s"] == outcome.contact_time_s
    assert ego["x_m"] + HALF_LENGTH_M == pytest.approx(140.0, abs=1e-5)


def test_a_pedestrian_who_walks_into_the_standing_ego_is_a_contact_at_speed_zero() -> None:
    walker = Other("pedestrian", 99.0, LANE_Y_M + 4.0, -math.pi / 2, 0.6, 0.5, 5 * KMH)
    outcome = simulation(1, [walker], BrakesAt(0.0), BrakeConfig(0.0, 0.0, 9.0)).run()
    assert outcome.contact is not None
    assert outcome.impact_speed_mps == 0.0
    assert outcome.contact_time_s == pytest.approx((4.0 - 0.3 - 0.9) / (5 * KMH), abs=1e-3)
    assert outcome.contact.entity_speed_mps == pytest.approx(5 * KMH)


def test_first_of_several_to_be_hit_is_named() -> None:
    contact = simulation(50, [car_at(160.0), car_at(130.0)], None).run().contact
    assert contact is not None
    assert contact.entity == "other 1"


# ---- sensor in time ----------------------------------------------------------------------------------------


def test_latency_delivers_older_detections_later() -> None:
    blind = BrakesAt(math.inf)
    sensor = dataclasses.replace(PHYSICAL.sensor, latency_s=0.2)
    simulation(50, [car_at(180.0)], blind, sensor=sensor, rule=StopRule(1.5)).run()
    times = np.array([t for t, _ in blind.given])
    stamps = np.array([d.stamp_s for _, d in blind.given])
    assert times[0] == pytest.approx(0.2)
    assert times - stamps == pytest.approx(0.2)
    assert np.diff(stamps) == pytest.approx(FRAME_S)
    # what is delivered is where the car was when it was measured
    sensed = [d.boxes.center_m[0, 0] for _, d in blind.given if len(d)]
    assert sensed == pytest.approx([182.2] * len(sensed), abs=0.4)


def test_frames_come_at_the_rate_of_the_sensor() -> None:
    for rate in (10.0, 20.0, 50.0):
        blind = BrakesAt(math.inf)
        sensor = dataclasses.replace(PHYSICAL.sensor, rate_hz=rate)
        simulation(50, [car_at(180.0)], blind, sensor=sensor, rule=StopRule(1.0)).run()
        assert np.diff([t for t, _ in blind.given]) == pytest.approx(1 / rate)


@pytest.mark.parametrize("phase_s", [0.01, 0.03, 0.05])
def test_phase_shifts_every_frame(phase_s: float) -> None:
    blind = BrakesAt(math.inf)
    sensor = dataclasses.replace(PHYSICAL.sensor, phase_s=phase_s)
    simulation(50, [car_at(180.0)], blind, sensor=sensor, rule=StopRule(1.0)).run()
    times = np.array([t for t, _ in blind.given])
    assert times == pytest.approx(phase_s + FRAME_S * np.arange(len(times)))


@pytest.mark.parametrize("changes", [{"rate_hz": 30.0}, {"latency_s": 0.005}, {"phase_s": 0.0125}])
def test_times_between_the_steps_are_refused(changes: dict[str, float]) -> None:
    sensor = dataclasses.replace(PHYSICAL.sensor, **changes)
    with pytest.raises(ScenarioError, match="must be a multiple of the step of 10 ms"):
        simulation(50, [car_at(180.0)], None, sensor=sensor).run()


def test_who_is_invisible_to_sensors_is_hit_all_the_same() -> None:
    blind = BrakesAt(math.inf)
    car = dataclasses.replace(car_at(130.0), hidden=True)
    outcome = simulation(50, [car], blind).run()
    assert outcome.contact is not None
    assert {len(d) for _, d in blind.given} == {0}


# ---- ends --------------------------------------------------------------------------------------------------


def test_time_limit_and_passing_end_a_run() -> None:
    bystander = Other("pedestrian", 130.0, LANE_Y_M + 6.0, 0.0, 0.6, 0.5)
    limited = simulation(36, [bystander], None, rule=StopRule(time_limit_s=1.0)).run()
    assert limited.log.table()["time_s"].max() == pytest.approx(0.95)
    passed = simulation(36, [bystander], None, rule=StopRule(after_pass_m=10.0)).run()
    # the centre starts at 97.8 and is 10 m beyond the bystander after 42.2 m at 10 m/s
    assert passed.log.table()["time_s"].max() == pytest.approx(4.22, abs=0.1)
    assert passed.contact_time_s is None


def test_in_reverse_the_ego_goes_back_to_whom_it_meets() -> None:
    """The target behind is not one that has been passed."""
    outcome = simulation(-4, [car_at(70.0)], None).run()
    assert outcome.contact is not None
    assert outcome.contact.ego_speed_mps == pytest.approx(-4 * KMH)
    assert outcome.impact_speed_mps == pytest.approx(4 * KMH)
    assert outcome.contact_time_s == pytest.approx((100.0 - 4.4 - 74.4) / (4 * KMH), abs=1e-6)


def perceiving(
    speed_kmh: float, others: list[Other], strategy: str, rule: StopRule | None = None
) -> Simulation:
    return Simulation(
        definition(speed_kmh, others),
        PHYSICAL,
        lambda scene: make_strategy(strategy, PHYSICAL, scene),
        rule=rule,
    )


@pytest.mark.parametrize("strategy", ["map", "rectangular"])
@pytest.mark.parametrize("kmh", [4, 8])
def test_in_reverse_the_ego_stops_for_who_stands_behind_it(strategy: str, kmh: float) -> None:
    outcome = perceiving(-kmh, [car_at(80.0), car_at(104.0)], strategy).run()
    assert outcome.contact is None
    assert outcome.flag_distance_m is not None
    assert outcome.stop_gap_m is not None
    # the rear, at 95.6, comes within 3 s of the car behind, at 84.4; a forecast step earlier or later
    assert outcome.flag_distance_m == pytest.approx(3.0 * kmh * KMH, abs=0.15 * kmh * KMH + 0.1)
    # 0.2 s of delay, then a deceleration that grows by 22 m/s2 per second for 0.4 s at most
    speed = kmh * KMH
    growing_s = min(math.sqrt(2 * speed / 22.0), 0.4)
    left = speed - 22.0 * growing_s**2 / 2
    way_m = speed * (0.2 + growing_s) - 22.0 * growing_s**3 / 6 + left**2 / (2 * 8.8)
    assert outcome.flag_distance_m - outcome.stop_gap_m == pytest.approx(way_m, abs=1e-6)


@pytest.mark.parametrize("strategy", ["map", "rectangular"])
def test_in_reverse_nobody_in_front_matters(strategy: str) -> None:
    outcome = perceiving(-8, [car_at(102.0)], strategy, StopRule(5.0)).run()
    assert outcome.flag_time_s is None


def test_a_run_ends_once_the_ego_has_adapted_its_speed() -> None:
    """Behind a car at 20 km/h, long before the time limit; beside one as fast as itself it goes on."""
    slow = perceiving(50, [car_at(140.0, 20 * KMH)], "map").run()
    table = slow.log.table()
    ego = table["kind"] == "ego"
    assert slow.flag_time_s is None
    assert table["time_s"].max() < 30.0
    last = table["speed_mps"][ego][table["time_s"][ego] > table["time_s"].max() - 2.9]
    assert np.abs(last - 20 * KMH).max() < 0.1
    alike = perceiving(50, [car_at(180.0, 50 * KMH)], "map", StopRule(10.0)).run()
    assert alike.log.table()["time_s"].max() == pytest.approx(9.95)


@pytest.mark.parametrize(
    ("brake_s", "starts_after_m", "is_false"),
    [(0.5, 20.0, True), (2.5, 20.0, False), (0.5, 0.0, None), (0.5, 60.0, True), (9.0, 60.0, False)],
)
def test_a_request_before_the_target_has_set_off_is_a_false_activation(
    brake_s: float, starts_after_m: float, is_false: bool | None
) -> None:
    """20 m are gone after 2 s; the ego, stopped before, never gets to 60 m; at 0 m nobody is to set off."""
    walker = Other("pedestrian", 140.0, LANE_Y_M - 4.0, math.pi / 2, 0.6, 0.5)
    if starts_after_m:
        walker = dataclasses.replace(walker, speed_mps=5 * KMH, after_m=starts_after_m)
    outcome = simulation(36, [walker], BrakesAt(brake_s), rule=StopRule(time_limit_s=5.0)).run()
    assert outcome.flag_time_s == (pytest.approx(brake_s) if brake_s < 5.0 else None)
    assert outcome.false_activation is is_false


def test_a_target_that_moves_from_the_start_cannot_be_braked_for_too_early() -> None:
    walker = Other("pedestrian", 140.0, LANE_Y_M - 4.0, math.pi / 2, 0.6, 0.5, speed_mps=1.0)
    outcome = simulation(36, [walker], BrakesAt(0.5), rule=StopRule(time_limit_s=5.0)).run()
    assert outcome.flag_time_s == pytest.approx(0.5)
    assert outcome.false_activation is None


def test_whom_the_ego_hits_does_not_make_its_braking_a_false_activation() -> None:
    """The walker, target of the test, sets off at 1 s; the ego brakes at 1.2 s and hits a car that stands."""
    walker = Other("pedestrian", 140.0, LANE_Y_M - 6.0, math.pi / 2, 0.6, 0.5, speed_mps=0.2, after_m=20.0)
    outcome = simulation(72, [walker, car_at(135.0)], BrakesAt(1.2)).run()
    assert outcome.contact is not None
    assert outcome.contact.entity == "other 1"
    assert (outcome.flag_time_s, outcome.false_activation) == (pytest.approx(1.2), False)


# ---- why a run ends ----------------------------------------------------------------------------------------


def test_a_contact_ends_the_run() -> None:
    outcome = simulation(36, [car_at(150.0)], None).run()
    assert outcome.contact is not None
    assert (outcome.end_reason, outcome.end_time_s) == (EndReason.CONTACT, outcome.contact_time_s)
    assert not outcome.avoided


def test_a_run_that_is_cut_off_avoids_nothing() -> None:
    """The car is reached after about 4.6 s; until then nobody knows what would have come."""
    outcome = simulation(36, [car_at(150.0)], None, rule=StopRule(time_limit_s=2.0)).run()
    assert (outcome.end_reason, outcome.end_time_s) == (EndReason.TIME_LIMIT, pytest.approx(2.0))
    assert outcome.contact is None
    assert not outcome.avoided


def test_a_target_behind_from_the_start_has_not_been_passed() -> None:
    outcome = simulation(36, [car_at(80.0)], None, rule=StopRule(time_limit_s=3.0)).run()
    assert outcome.end_reason is EndReason.TIME_LIMIT


def test_an_ego_that_stands_for_good_behind_a_queue_has_stopped() -> None:
    """By speed adaptation, and with the emergency brake that stays on for the car in its lane."""
    adapted = perceiving(40, [car_at(220.0)], "map").run()
    assert (adapted.end_reason, adapted.avoided) == (EndReason.STOPPED, True)
    held = simulation(36, [car_at(150.0)], BrakesAt(0.5)).run()
    assert (held.end_reason, held.avoided) == (EndReason.STOPPED, True)
    # it stands at about 2.04 s and 3 s later nothing has changed
    assert held.stop_time_s is not None
    assert held.end_time_s == pytest.approx(held.stop_time_s + 3.0, abs=0.06)


def test_standing_while_the_target_is_still_to_set_off_is_no_end() -> None:
    """The walker waits for the ego to be gone 60 m, which it never is: nothing was avoided."""
    walker = Other("pedestrian", 180.0, LANE_Y_M - 4.0, math.pi / 2, 0.6, 0.5, speed_mps=1.0, after_m=60.0)
    outcome = simulation(36, [walker], BrakesAt(0.5), rule=StopRule(time_limit_s=12.0)).run()
    assert outcome.end_reason is EndReason.TIME_LIMIT
    assert not outcome.avoided


@pytest.mark.parametrize(("stop_m", "reason"), [(5.0, EndReason.NOT_BEGUN), (25.0, EndReason.STORYBOARD)])
def test_a_stop_trigger_before_the_target_does_anything_avoids_nothing(
    stop_m: float, reason: EndReason
) -> None:
    """The walker sets off when the ego has gone 20 m."""
    walker = Other("pedestrian", 180.0, LANE_Y_M - 4.0, math.pi / 2, 0.6, 0.5, speed_mps=1.0, after_m=20.0)
    gone = EntityCondition(("Ego",), False, TraveledDistanceCondition(stop_m))
    made = dataclasses.replace(definition(36, [walker]), stop=((Condition("end", 0.0, "none", gone),),))
    outcome = Simulation(made, PHYSICAL, None).run()
    assert outcome.end_reason is reason
    assert outcome.end_time_s == pytest.approx(stop_m / 10.0, abs=0.01)
    assert outcome.avoided is (reason is EndReason.STORYBOARD)


def test_an_ego_that_the_scenario_has_not_yet_set_off_has_not_stopped() -> None:
    """It waits 5 s on a timed trajectory, then drives 47.8 m to the standing car at 10 m/s."""
    waits = FollowTrajectoryAction(
        vertices((0.0, 97.8), (5.0, 97.8001), (15.0, 197.8)), 0.0, TimeReference(True, 1.0, 0.0)
    )
    made = definition(0.0, [car_at(150.0)])
    made = dataclasses.replace(made, init=(*made.init, ("Ego", waits)))
    outcome = Simulation(made, PHYSICAL, None).run()
    assert outcome.end_reason is EndReason.CONTACT
    assert outcome.contact_time_s == pytest.approx(Engine(made).run(20.0).contact_time_s)
    # by an event whose condition is time: a trigger that only comes after 5 s
    made = asking(SpeedAction("step", "time", 0.0, 10.0), initial=False)
    late = ((Condition("late", 5.0, "none", EntityCondition(("Ego",), False, StandStillCondition(0.0))),),)
    event = dataclasses.replace(made.stories[-1].acts[0].groups[0].maneuvers[0].events[0], start=late)
    group = ManeuverGroup("later", 1, (Maneuver("later", (event,)),))
    still = ("Ego", SpeedAction("step", "time", 0.0, 0.0))
    made = dataclasses.replace(
        made, init=(made.init[0], still, made.init[2]), entities=made.entities[:2],
        stories=(Story("later", (Act("later", (group,), None, None),)),),
    )  # fmt: skip
    outcome = Simulation(made, PHYSICAL, None).run()
    assert outcome.end_reason is EndReason.CONTACT
    assert outcome.contact_time_s == pytest.approx(5.0 + 50.0 / 10.0, abs=0.02)


@pytest.mark.parametrize(
    ("collided", "end_reason", "false_activation", "avoided"),
    [
        (False, "stopped", False, True),
        (False, "followed", None, True),
        (False, "", False, True),  # of a folder that does not say it
        (True, "contact", False, False),
        (False, "time_limit", None, False),
        (False, "not_begun", False, False),
        (False, "stopped", True, False),
    ],
)
def test_what_counts_as_avoided(
    collided: bool, end_reason: str, false_activation: bool | None, avoided: bool
) -> None:
    assert is_avoided(collided, end_reason, false_activation) is avoided


# ---- the ego's way -----------------------------------------------------------------------------------------


def test_the_ego_follows_its_lane_through_a_bend() -> None:
    network = load_map(shipped_map("urban_bend"))
    lane = network.lane_index_of(("1", 0, -1))
    x, y, _, yaw = (float(v[0]) for v in network.center_line(lane, [180.0]))
    made = definition(40, [], map_name="urban_bend")
    init = (("Ego", TeleportAction(WorldPosition(x, y, yaw))), made.init[1])
    built = Simulation(dataclasses.replace(made, init=init), PHYSICAL, None, rule=StopRule(12.0))
    route = built.map_view().route
    assert route.lanes == (lane,)
    table = built.run().log.table()
    ego = np.column_stack((table["x_m"], table["y_m"]))[table["kind"] == "ego"]
    assert max(abs(route.project(*p)[1]) for p in ego) < 0.02
    # 133 m further along the lane, which bends
    assert route.project(*ego[-1])[0] - route.project(*ego[0])[0] == pytest.approx(11.95 * 40 * KMH, abs=0.1)


def test_a_way_off_every_lane_of_the_map_of_perception_is_one_clear_error() -> None:
    made = definition(40, [])
    init = (("Ego", TeleportAction(WorldPosition(300.0, -80.0, 0.0))), made.init[1])
    built = Simulation(
        dataclasses.replace(made, init=init),
        PHYSICAL,
        lambda scene: make_strategy("map", PHYSICAL, scene),
        rule=StopRule(1.0),
    )
    with pytest.raises(RouteError, match="no driving lane of the map"):
        built.run()


@pytest.fixture(scope="module")
def lead_runs() -> dict[str, Outcome]:
    """Adapting the speed with the whole perception: a standing and a slower car ahead."""
    others = {"standing": car_at(220.0), "slower": car_at(160.0, speed_mps=20 * KMH)}
    rule = StopRule(time_limit_s=18.0)

    def strategy(scene: MapView):  # type: ignore[no-untyped-def]
        return make_strategy("map", PHYSICAL, scene)

    return {
        name: Simulation(definition(40, [other]), PHYSICAL, strategy, rule=rule).run()
        for name, other in others.items()
    }


def test_adapts_its_speed_to_a_standing_car(lead_runs: dict[str, Outcome]) -> None:
    assert lead_runs["standing"].contact_time_s is None
    assert speeds_kmh(lead_runs["standing"])[-1] < 1.0


def test_adapts_its_speed_to_a_slower_car(lead_runs: dict[str, Outcome]) -> None:
    assert lead_runs["slower"].contact_time_s is None
    assert lead_runs["slower"].flag_time_s is None
    assert speeds_kmh(lead_runs["slower"])[-1] == pytest.approx(20.0, abs=1.5)


def speeds_kmh(outcome: Outcome) -> list[float]:
    table = outcome.log.table()
    return (table["speed_mps"][table["kind"] == "ego"] / KMH).tolist()


# ---- what the scenario does to the ego's speed -------------------------------------------------------------

LEAD = Other("car", 140.0, -LANE_Y_M, speed_mps=5.0)
"""Beside the ego's lane."""
PLACE = WorldPosition(130.0, LANE_Y_M, 0.0)


def vertices(*points: tuple[float, float]) -> Trajectory:
    """Places of the ego along its lane by times."""
    return Trajectory(
        "timed", Polyline(tuple(Vertex(WorldPosition(x_m, LANE_Y_M, 0.0), time_s) for time_s, x_m in points))
    )


ASKED: dict[str, tuple[Action, bool, float | None]] = {
    # 0 to 10 m/s within 2 s, over 10 m; then 40 m
    "initial, linear": (SpeedAction("linear", "time", 2.0, 10.0), True, 2.0 + 4.0),
    # 10 m in the first second, 15 m while it slows to 5 m/s, then 25 m
    "event, slower": (SpeedAction("linear", "time", 2.0, 5.0), False, 1.0 + 2.0 + 5.0),
    # 10 m, 30 m while it accelerates to 20 m/s, then 10 m
    "event, faster": (SpeedAction("linear", "time", 2.0, 20.0), False, 1.0 + 2.0 + 0.5),
    "event, at once": (SpeedAction("step", "time", 0.0, 20.0), False, 1.0 + 2.0),
    # 20 m behind the one at 140 m + 5 m/s, with the front 2.2 m before: 27.8 m to 150 m
    "distance": (LongitudinalDistanceAction("other 1", 20.0, None, False, True, False), True, 27.8 / 5.0),
    "synchronised": (
        SynchronizeAction("other 1", WorldPosition(160.0, -LANE_Y_M, 0.0), PLACE, None, None), True, None,
    ),
    "timed trajectory": (
        FollowTrajectoryAction(
            vertices((0.0, 97.8), (3.0, 110.0), (5.0, 160.0)), 0.0, TimeReference(True, 1.0, 0.0)
        ),
        True, None,
    ),
}  # fmt: skip
"""Action, whether it is an initial one (else after 10 m), and the time at which a car 50 m ahead is met."""


def asking(action: Action, initial: bool) -> ScenarioDefinition:
    """The ego at 10 m/s, a car that stands 50 m before it, one in the next lane, and an action of the ego."""
    made = definition(36.0, [car_at(150.0), LEAD])
    if initial:
        before = dataclasses.replace(made.init[1][1], target=0.0)  # type: ignore[type-var]
        first = made.init[1] if not isinstance(action, SpeedAction) else ("Ego", before)
        return dataclasses.replace(made, init=(made.init[0], first, *made.init[2:], ("Ego", action)))
    near = EntityCondition(("Ego",), False, TraveledDistanceCondition(10.0))
    start = ((Condition("near", 0.0, "none", near),),)
    event = Event("later", "parallel", 1, (NamedAction("later", action, ("Ego",)),), start)
    group = ManeuverGroup("later", 1, (Maneuver("later", (event,)),))
    story = Story("later", (Act("later", (group,), None, None),))
    return dataclasses.replace(made, stories=(*made.stories, story))


@pytest.mark.parametrize("name", ASKED)
def test_until_the_brake_intervenes_the_ego_does_what_the_scenario_asks(name: str) -> None:
    """Unbraked the run is the scenario's; so it is where perception sees nobody."""
    action, initial, contact_s = ASKED[name]
    made = asking(action, initial)
    alone = Engine(made).run(30.0)
    assert alone.contact_entity == "other 0"
    if contact_s is not None:
        assert alone.contact_time_s == pytest.approx(contact_s, abs=1e-6)
    unbraked = Simulation(made, PHYSICAL, None).run()
    blind = decided_by(Simulation(made, PHYSICAL, lambda scene: EverythingArea()), BrakesAt(99.0)).run()
    for outcome in (unbraked, blind):
        assert outcome.contact_time_s == pytest.approx(alone.contact_time_s, abs=1e-6)
        assert outcome.impact_speed_mps / KMH == pytest.approx(alone.ego_speed_at_contact_kmh, abs=1e-6)


class BrakesBetween(BrakesAt):
    """Brakes from one time to another."""

    def __init__(self, time_s: float, until_s: float) -> None:
        super().__init__(time_s)
        self.until_s = until_s

    def step(
        self, state: PipelineState, detections: Detections, ego: EgoState, path: PlannedPath | None = None
    ) -> tuple[PipelineState, FrameResult]:
        state, result = super().step(state, detections, ego)
        brakes = self.time_s - 1e-9 <= ego.stamp_s < self.until_s - 1e-9
        return state, dataclasses.replace(result, command=Command(brakes))


def test_after_braking_the_ego_returns_to_the_speed_that_the_scenario_asks_for_by_then() -> None:
    """From 10 m/s; meanwhile the scenario slows it to 5 m/s, which is reached and not exceeded."""
    made = asking(SpeedAction("linear", "time", 2.0, 5.0), initial=False)
    made = dataclasses.replace(made, entities=made.entities[:1], init=made.init[:2])
    pipeline = BrakesBetween(0.5, 1.5)
    built = Simulation(made, PHYSICAL, lambda scene: EverythingArea(), rule=StopRule(15.0))
    table = decided_by(built, pipeline).run().log.table()
    own = table["kind"] == "ego"
    time_s, speed = table["time_s"][own], table["speed_mps"][own]
    # 0.2 s of delay, 0.4 s of build-up to 8.8 m/s2, then 0.4 s of it
    assert speed[np.searchsorted(time_s, 1.5)] == pytest.approx(10.0 - 8.8 * (0.5 * 0.4 + 0.4), abs=1e-3)
    assert speed[-1] == pytest.approx(5.0, abs=0.02)
    assert speed[time_s > 3.5].max() < 5.0 + 1e-6


def test_speed_adaptation_goes_below_the_speed_that_the_scenario_asks_for_and_not_above() -> None:
    """A car at 5 m/s ahead; the scenario lets the ego accelerate to 20 m/s."""
    made = definition(36.0, [car_at(130.0, 5.0)])
    go = asking(SpeedAction("linear", "time", 5.0, 20.0), initial=False).stories[-1]
    made = dataclasses.replace(made, stories=(go,))
    built = Simulation(made, PHYSICAL, lambda scene: make_strategy("map", PHYSICAL, scene))
    outcome = built.run()
    assert (outcome.contact, outcome.end_reason) == (None, EndReason.FOLLOWED)
    alone = Engine(made).run(10.0)
    table = outcome.log.table()
    own = table["kind"] == "ego"
    asked = np.interp(table["time_s"][own], alone.time_s, alone.speed_mps[:, 0])
    assert (table["speed_mps"][own] <= asked + 1e-3).all()
    assert speeds_kmh(outcome)[-1] == pytest.approx(18.0, abs=1.5)


@pytest.mark.parametrize(
    ("action", "told"),
    [
        (DeleteEntityAction("Ego"), "DeleteEntityAction on 'Ego', the vehicle under test"),
        (SpeedAction("linear", "time", 2.0, -2.0), "SpeedAction of 'Ego' turns its direction"),
    ],
)
def test_what_cannot_be_carried_out_is_refused_by_name_before_the_run(action: Action, told: str) -> None:
    with pytest.raises(ScenarioError, match=told):
        Simulation(asking(action, initial=False), PHYSICAL, None)


def test_a_speed_relative_to_another_must_not_turn_the_ego_either() -> None:
    """The ego is to be 5 m/s slower than a car at 2 m/s: 3 m/s in reverse, where nobody looks."""
    slower = SpeedAction("step", "time", 0.0, RelativeSpeed("other 0", -5.0, False))
    made = definition(36.0, [car_at(130.0, 2.0)])
    made = dataclasses.replace(made, stories=(asking(slower, initial=False).stories[-1],))
    with pytest.raises(ScenarioError, match="'Ego' turns its direction at "):
        Simulation(made, PHYSICAL, None).run()


# ---- determinism -------------------------------------------------------------------------------------------


def run(site: Site, strategy: str, seed: int) -> Outcome:
    return build(CpnaTest(50.0, seed=seed), site, PAPER, make_strategy(strategy, PAPER, site)).run()


def detections(outcome: Outcome, until_s: float) -> np.ndarray:
    table = outcome.log.table()
    rows = (table["kind"] == "detection") & (table["time_s"] < until_s)
    return np.column_stack([table[c][rows] for c in ("time_s", "x_m", "y_m", "yaw_rad")])


def test_same_seed_same_bytes_other_seed_other_noise(site: Site) -> None:
    one, two, other = run(site, "map", 7), run(site, "map", 7), run(site, "map", 8)
    for name, column in one.log.table().items():
        assert column.tobytes() == two.log.table()[name].tobytes()
    assert not np.array_equal(detections(one, 3.0), detections(other, 3.0))
    assert np.abs(detections(one, 3.0) - detections(other, 3.0)).max() < 0.5  # noise only


def test_every_strategy_sees_the_same_noise_until_the_first_flag(site: Site) -> None:
    outcomes = [run(site, name, 0) for name in ("rectangular", "map", "all")]
    first = min(o.flag_time_s for o in outcomes if o.flag_time_s is not None)
    seen = [detections(o, first) for o in outcomes]
    assert len(seen[0]) > 20
    assert all(np.array_equal(seen[0], s) for s in seen[1:])
