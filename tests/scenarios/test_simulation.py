"""The closed loop against closed forms: contact time, impact speed, determinism."""

import dataclasses
import math

import numpy as np
import pytest

from opendrive import load_map
from scenarios.actors import KMH, Actor, Actors
from scenarios.brakes import BrakeConfig
from scenarios.cpna import LEAD_S, CpnaTest, Site, build, find_site, make_strategy
from scenarios.map_builder import shipped_map
from scenarios.presets import PAPER, PHYSICAL, Preset
from scenarios.sensors import Sensor, SensorConfig
from scenarios.simulation import Outcome, Simulation, StopRule
from scenarios.vehicle import EgoVehicle
from smartmot.aeb import BrakeCommand
from smartmot.monitored_area import EverythingArea
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.route import route_ahead
from smartmot.types import Detections, EgoState

FRAME_S = 0.05
WALK_S = 4.0 / (5 * KMH)
HALF_WIDTH_M, HALF_LENGTH_M = 0.25, 2.2  # of the pedestrian across its way, and of the ego


class BrakesAt(Pipeline):
    """Brakes at a given time and knows nothing; keeps what it was given."""

    def __init__(self, time_s: float) -> None:
        super().__init__(EverythingArea(), PipelineConfig())
        self.time_s = time_s
        self.given: list[tuple[float, Detections]] = []
        blind = Pipeline.step(self, self.initial(), Detections.empty(0.0), EgoState(0.0, 0.0, 0.0, 0.0, 0.0))
        self._nothing = dataclasses.replace(blind[1], events=(), lead=None)

    def step(
        self, state: PipelineState, detections: Detections, ego: EgoState
    ) -> tuple[PipelineState, FrameResult]:
        self.given.append((ego.stamp_s, detections))
        command = BrakeCommand(ego.stamp_s >= self.time_s - 1e-9)
        return state, dataclasses.replace(self._nothing, command=command)


@pytest.fixture(scope="module")
def site() -> Site:
    return find_site(load_map(shipped_map("urban_street")), 80.0)


def simulation(
    site: Site,
    speed_kmh: float,
    actors: list[Actor],
    pipeline: Pipeline | None,
    brakes: BrakeConfig = PHYSICAL.brakes,
    *,
    front_m: float = 100.0,
    trigger_m: float = 0.0,
    sensor: SensorConfig = PHYSICAL.sensor,
    rule: StopRule | None = None,
) -> Simulation:
    """The ego's front at a station of the street, and anybody else."""
    ego = EgoVehicle(site.route, front_m - HALF_LENGTH_M, speed_kmh * KMH, 2 * HALF_LENGTH_M, 1.8, brakes)
    return Simulation(
        ego, Actors(actors), site.route, trigger_m, 0, Sensor(sensor, 0), pipeline, rule or StopRule()
    )


def car_at(site: Site, rear_m: float, **motion: float) -> Actor:
    x, y, yaw = site.route.pose(rear_m + 2.2)
    return Actor("car", "target", x, y, yaw, 4.4, 1.8, **motion)


@pytest.mark.parametrize("speed_kmh", [10, 20, 30, 40, 50, 60, 70, 80, 33.3])
def test_contact_without_braking_is_at_the_time_of_the_closed_form(site: Site, speed_kmh: float) -> None:
    outcome = build(CpnaTest(speed_kmh), site, PAPER, None).run()
    expected = LEAD_S + WALK_S - HALF_WIDTH_M / (speed_kmh * KMH)
    assert outcome.contact_time_s == pytest.approx(expected, abs=1e-3)
    assert outcome.contact_time_s == pytest.approx(expected, abs=1e-6)  # what it reaches
    assert outcome.impact_speed_mps == pytest.approx(speed_kmh * KMH, abs=1e-9)
    assert outcome.trigger_time_s == pytest.approx(LEAD_S, abs=1e-6)
    assert outcome.contact_actor == 0
    assert outcome.flag_time_s is outcome.stop_time_s is outcome.stop_gap_m is None


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
    built._pipeline = pipeline
    return built.run()


@pytest.mark.parametrize("brakes", [PAPER.brakes, PHYSICAL.brakes])
@pytest.mark.parametrize("ttc_s", [0.4, 0.7])
def test_real_brake_hits_at_the_speed_of_the_profile(site: Site, brakes: BrakeConfig, ttc_s: float) -> None:
    """Against a standing car, so that only the brakes matter: delay, linear build-up, constant."""
    speed, flag_s = 60 * KMH, 1.0
    rear = 100.0 + speed * (flag_s + ttc_s)
    outcome = simulation(site, 60, [car_at(site, rear)], BrakesAt(flag_s), brakes).run()
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


def test_contact_is_found_although_the_step_is_long(site: Site) -> None:
    """The last row of the log is the instant of contact: the outlines touch."""
    outcome = simulation(site, 80, [car_at(site, 140.0)], None).run()
    assert outcome.contact_time_s == pytest.approx(40.0 / (80 * KMH), abs=1e-6)
    table = outcome.log.table()
    ego = {k: v[table["kind"] == "ego"][-1] for k, v in table.items()}
    assert ego["time_s"] == outcome.contact_time_s
    assert site.route.project(ego["x_m"], ego["y_m"])[0] + HALF_LENGTH_M == pytest.approx(140.0, abs=1e-5)


def test_the_trigger_fires_between_steps(site: Site) -> None:
    speed = 47 * KMH
    outcome = simulation(site, 47, [car_at(site, 300.0)], None, trigger_m=123.456, rule=StopRule(4.0)).run()
    assert outcome.trigger_time_s == pytest.approx(23.456 / speed, abs=1e-6)
    assert outcome.contact_time_s is None


def test_a_pedestrian_who_walks_into_the_standing_ego_is_a_contact_at_speed_zero(site: Site) -> None:
    x, y, yaw = site.route.pose(100.0, 4.0)
    walker = Actor("pedestrian", "target", x, y, yaw - math.pi / 2, 0.6, 0.5, 5 * KMH, 0.0, 8.0)
    brakes = BrakeConfig(0.0, 0.0, 9.0)
    built = simulation(site, 1, [walker], BrakesAt(0.0), brakes, trigger_m=100.0)
    outcome = built.run()
    assert outcome.impact_speed_mps == 0.0
    assert outcome.contact_time_s == pytest.approx((4.0 - 0.3 - 0.9) / (5 * KMH), abs=1e-3)


def test_first_of_several_actors_to_be_hit_is_named(site: Site) -> None:
    actors = [car_at(site, 160.0), car_at(site, 130.0)]
    assert simulation(site, 50, actors, None).run().contact_actor == 1


def test_latency_delivers_older_detections_later(site: Site) -> None:
    blind = BrakesAt(math.inf)
    sensor = dataclasses.replace(PHYSICAL.sensor, latency_s=0.2)
    simulation(site, 50, [car_at(site, 180.0)], blind, sensor=sensor, rule=StopRule(1.5)).run()
    times = np.array([t for t, _ in blind.given])
    stamps = np.array([d.stamp_s for _, d in blind.given])
    assert times[0] == pytest.approx(0.2)
    assert times - stamps == pytest.approx(0.2)
    assert np.diff(stamps) == pytest.approx(FRAME_S)


def test_frames_come_at_the_rate_of_the_sensor(site: Site) -> None:
    for rate in (10.0, 20.0, 50.0):
        blind = BrakesAt(math.inf)
        sensor = dataclasses.replace(PHYSICAL.sensor, rate_hz=rate)
        simulation(site, 50, [car_at(site, 180.0)], blind, sensor=sensor, rule=StopRule(1.0)).run()
        assert np.diff([t for t, _ in blind.given]) == pytest.approx(1 / rate)


@pytest.mark.parametrize("phase_s", [0.01, 0.03, 0.05])
def test_phase_shifts_every_frame(site: Site, phase_s: float) -> None:
    blind = BrakesAt(math.inf)
    sensor = dataclasses.replace(PHYSICAL.sensor, phase_s=phase_s)
    simulation(site, 50, [car_at(site, 180.0)], blind, sensor=sensor, rule=StopRule(1.0)).run()
    times = np.array([t for t, _ in blind.given])
    assert times == pytest.approx(phase_s + FRAME_S * np.arange(len(times)))


def test_time_limit_and_passing_end_a_run(site: Site) -> None:
    x, y, yaw = site.route.pose(130.0, 6.0)
    bystander = Actor("pedestrian", "target", x, y, yaw, 0.6, 0.5)
    limited = simulation(site, 36, [bystander], None, rule=StopRule(time_limit_s=1.0)).run()
    assert limited.log.table()["time_s"].max() == pytest.approx(0.95)
    passed = simulation(site, 36, [bystander], None, rule=StopRule(after_pass_m=10.0)).run()
    # the centre starts at 97.8 and is 10 m beyond the bystander after 42.2 m at 10 m/s
    last = passed.log.table()["time_s"].max()
    assert last == pytest.approx(4.22, abs=0.1)
    assert passed.contact_time_s is None


def test_without_a_pipeline_the_ego_still_follows_its_lane() -> None:
    """Nobody brakes, but the wheel is held: through the bend there is no contact with the car beside it."""
    network = load_map(shipped_map("urban_bend"))
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, ahead_m=1000.0)
    bend = Site(network, route, 0.0, -1)
    x, y, yaw = route.pose(260.0, -3.0)
    parked = Actor("car", "target", x, y, yaw, 4.4, 1.8)
    outcome = simulation(bend, 40, [parked], None, front_m=180.0, rule=StopRule(after_pass_m=30.0)).run()
    table = outcome.log.table()
    ego = np.column_stack((table["x_m"], table["y_m"]))[table["kind"] == "ego"]
    assert outcome.contact_time_s is None
    assert max(abs(route.project(*p)[1]) for p in ego) < 0.3


@pytest.fixture(scope="module")
def lead_runs(site: Site) -> dict[str, Outcome]:
    """Adapting the speed with the whole perception: a standing and a slower car ahead."""
    actors = {
        "standing": car_at(site, 220.0),
        "slower": car_at(site, 160.0, speed_mps=20 * KMH, path_m=400.0),
    }
    rule = StopRule(time_limit_s=18.0)
    return {
        name: simulation(
            site, 40, [actor], Pipeline(make_strategy("map", PHYSICAL, site), PHYSICAL.pipeline), rule=rule
        ).run()
        for name, actor in actors.items()
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
