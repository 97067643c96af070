"""A run stepped from outside: any decision, any number of sensors, copies at any frame."""

import copy
import dataclasses
import functools
import math
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from scenarios.catalogue.library import shipped_scenario
from scenarios.errors import ScenarioError, StepOrderError
from scenarios.openscenario.model import ScenarioDefinition, SpeedAction
from scenarios.openscenario.reading.reader import load
from scenarios.presets import PHYSICAL, Preset
from scenarios.sensors import BoxDetector, BoxSensor, SensorChain, SensorConfig, Timing, World
from scenarios.simulation.ends import EndReason, StopRule
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import NO_COMMAND, Simulation
from scenarios.sources import Frame, StepResult, frames
from scenarios.sources.perception import Perception
from scenarios.spec import NO_AEB, RunSpec, simulation_of
from scenarios.strategies import NamedStrategy
from smartmot.area import EverythingArea
from smartmot.decision.rules import Command, LeadObject
from smartmot.errors import PluginError
from smartmot.path import PlannedPath
from smartmot.pipeline import FrameResult, Pipeline, PipelineConfig, PipelineState
from smartmot.types import Boxes, Detections, EgoState

KMH = 1 / 3.6
BRAKE = Command(emergency=True)


@functools.cache
def crossing(speed_kmh: float = 60.0) -> ScenarioDefinition:
    return load(shipped_scenario("crossing"), {"Ego_speed_kmh": speed_kmh})


def made(
    strategy: str | None = "map", preset: Preset = PHYSICAL, definition: ScenarioDefinition | None = None
) -> Simulation:
    maker = None if strategy is None else NamedStrategy(strategy, preset)
    return Simulation(definition or crossing(), preset, maker, seed=3)


def values(outcome: Outcome) -> tuple[object, ...]:
    """Everything of an outcome that can be compared, with the bytes of its log."""
    fields = [field.name for field in dataclasses.fields(outcome)]
    log = {name: column.tobytes() for name, column in outcome.log.table().items()}
    return (*(getattr(outcome, name) for name in fields if name not in ("log", "frame_time_ms")), log)


def finished(
    simulation: Simulation, step: StepResult, perception: Perception, frames_left: int = 10_000
) -> StepResult:
    """Go on with a perception, for so many frames at most."""
    while step.frame is not None and frames_left:
        result = perception.step(step.frame)
        simulation.record(result)
        step = simulation.step(result.command)
        frames_left -= 1
    return step


def commanded(simulation: Simulation, decide: Callable[[Frame], Command | None]) -> Outcome:
    """A run with a decision of one's own."""
    step = simulation.start()
    while step.frame is not None:
        step = simulation.step(decide(step.frame))
    return simulation.outcome()


def with_latency(latency_s: float) -> Preset:
    return dataclasses.replace(PHYSICAL, sensor=dataclasses.replace(PHYSICAL.sensor, latency_s=latency_s))


def reversing() -> ScenarioDefinition:
    definition = load(shipped_scenario("ahead"), {})
    init = tuple(
        (name, dataclasses.replace(action, target=-3.0))
        if name == "Ego" and isinstance(action, SpeedAction)
        else (name, action)
        for name, action in definition.init
    )
    return dataclasses.replace(definition, init=init)


# ---- the same as run() -------------------------------------------------------------------------------------


@pytest.mark.parametrize("strategy", ["map", "rectangular", "all"])
@pytest.mark.parametrize("latency_s", [0.0, 0.05, 0.13])
def test_stepping_with_the_preset_s_perception_is_running(strategy: str, latency_s: float) -> None:
    preset = with_latency(latency_s)
    stepped = made(strategy, preset)
    step = finished(stepped, stepped.start(), stepped.perception())
    outcome = stepped.outcome()
    assert step.end_reason == outcome.end_reason
    assert values(outcome) == values(made(strategy, preset).run())


def test_in_reverse_stepping_is_running() -> None:
    stepped, run = made("map", definition=reversing()), made("map", definition=reversing())
    step = stepped.start()
    assert step.frame is not None
    assert step.frame.ego.speed_mps == -3.0
    assert step.frame.path is None
    finished(stepped, step, stepped.perception())
    assert values(stepped.outcome()) == values(run.run())


class BrakesBefore(Pipeline):
    """Brakes while a detection is in front of the ego and nearer than a distance; knows no tracks."""

    def __init__(self, distance_m: float) -> None:
        super().__init__(EverythingArea(), PipelineConfig())
        self.distance_m = distance_m

    def step(
        self,
        state: PipelineState,
        detections: Detections,
        ego: EgoState,
        path: PlannedPath | None = None,
    ) -> tuple[PipelineState, FrameResult]:
        state, result = super().step(state, detections, ego, path)
        command = brakes_before(detections, ego, self.distance_m)
        return state, dataclasses.replace(result, command=command)


def brakes_before(detections: Detections, ego: EgoState, distance_m: float) -> Command:
    """A rule of one's own: whether anybody is in front, within 3 m aside and nearer than a distance."""
    dx, dy = (detections.boxes.center_m - np.array([ego.x_m, ego.y_m])).T
    ahead = math.cos(ego.yaw_rad) * dx + math.sin(ego.yaw_rad) * dy
    aside = math.cos(ego.yaw_rad) * dy - math.sin(ego.yaw_rad) * dx
    return Command(bool(((ahead > 0.0) & (ahead < distance_m) & (np.abs(aside) < 3.0)).any()))


@pytest.mark.parametrize("distance_m", [15.0, 40.0, 80.0])
def test_a_rule_of_one_s_own_comes_to_the_same_stepped_and_run(distance_m: float) -> None:
    stepped = commanded(made(None), lambda frame: brakes_before(frame.detections, frame.ego, distance_m))
    pipeline = BrakesBefore(distance_m)
    simulation = made("all")
    finished(simulation, simulation.start(), Perception(lambda frame: pipeline))
    run = simulation.outcome()
    names = [f.name for f in dataclasses.fields(Outcome) if f.name not in ("log", "frame_time_ms", "dropped")]
    assert [getattr(stepped, name) for name in names] == [getattr(run, name) for name in names]
    assert stepped.flag_time_s is not None
    tables = [outcome.log.table() for outcome in (stepped, run)]
    truth = [np.isin(table["kind"], ("ego", "actor")) for table in tables]
    for name in tables[0]:
        assert tables[0][name][truth[0]].tobytes() == tables[1][name][truth[1]].tobytes()


def test_an_ego_that_is_always_told_to_brake_stops_from_its_first_frame_on() -> None:
    simulation = Simulation(crossing(), PHYSICAL, None, rule=StopRule(at_standstill=True))
    outcome = commanded(simulation, lambda frame: BRAKE)
    assert (outcome.end_reason, outcome.flag_time_s) == (EndReason.STOPPED, 0.0)
    # 0.2 s of delay, 0.4 s of build-up to 8.8 m/s2, then all of it
    speed = 60 * KMH - 0.5 * 0.4 * 8.8
    assert outcome.stop_time_s == pytest.approx(0.6 + speed / 8.8, abs=0.011)


@pytest.mark.parametrize("command", [None, NO_COMMAND])
def test_an_ego_that_is_never_told_to_brake_meets_the_target_as_without_aeb(command: Command | None) -> None:
    spec = RunSpec("crossing", "crossing", (("Ego_speed_kmh", 60.0),), "map", "physical", "dry", 60.0)
    unbraked = simulation_of(dataclasses.replace(spec, strategy=NO_AEB)).run()
    stepped = commanded(simulation_of(spec), lambda frame: command)
    assert stepped.contact is not None
    assert stepped.contact == unbraked.contact
    assert (stepped.end_time_s, stepped.end_reason) == (unbraked.end_time_s, unbraked.end_reason)
    assert stepped.detections > 0 == unbraked.detections


def test_speed_is_adapted_to_the_lead_that_a_command_names() -> None:
    """Somebody 30 m ahead at 5 m/s, whom only the decision knows."""
    simulation = Simulation(crossing(), PHYSICAL, None, rule=StopRule(time_limit_s=3.0))
    start = simulation.start()
    assert start.frame is not None
    x_m = start.frame.ego.x_m

    def follow(frame: Frame) -> Command:
        gap = 30.0 + 5.0 * frame.stamp_s - (frame.ego.x_m - x_m)
        return Command(emergency=False, lead=LeadObject(1, gap, 5.0))

    step = start
    while step.frame is not None:
        last = step.frame
        step = simulation.step(follow(step.frame))
    assert last.ego.speed_mps < 10.0
    assert simulation.outcome().flag_time_s is None


# ---- frames ------------------------------------------------------------------------------------------------


def test_frames_say_what_perception_may_know() -> None:
    simulation = made("map", with_latency(0.1))
    at_frames = list(frames(simulation))
    assert [frame.stamp_s for frame in at_frames[:3]] == pytest.approx([0.1, 0.15, 0.2])
    for frame in at_frames:
        assert frame.ego.stamp_s == frame.stamp_s == pytest.approx(frame.detections.stamp_s + 0.1)
        assert frame.lane_map is simulation.network
        assert frame.measurement is None
        assert frame.path is at_frames[0].path
    path = at_frames[0].path
    assert path is not None
    station, offset = path.project(at_frames[-1].ego.x_m, at_frames[-1].ego.y_m)
    assert offset == pytest.approx(0.0, abs=0.02)
    assert station > 50.0


def test_without_a_strategy_frames_come_all_the_same() -> None:
    assert len(list(frames(made(None)))) > 50


def test_a_run_without_a_strategy_asks_no_detector() -> None:
    class Fails:
        latency_s, rate_hz = 0.0, None

        def detect(self, measurement: object) -> Detections:
            raise RuntimeError("asked")

    sensor = BoxSensor(PHYSICAL.sensor)
    chain: SensorChain[object] = SensorChain(sensor, Fails())  # type: ignore[arg-type]
    outcome = Simulation(crossing(), PHYSICAL, None, sensors=[chain]).run()
    assert outcome.end_reason is EndReason.CONTACT
    with pytest.raises(
        PluginError, match=r"sensor, frame at 0 s: RuntimeError: asked \(.*test_stepping\.py, line"
    ):
        Simulation(crossing(), PHYSICAL, None, sensors=[chain]).start()


# ---- mistakes ----------------------------------------------------------------------------------------------


def test_what_is_no_command_is_refused_and_the_frame_stays() -> None:
    simulation = made()
    simulation.start()
    for given in (True, (True, None), Command, 0):
        with pytest.raises(ScenarioError, match=r"step\(\) takes a Command"):
            simulation.step(given)  # type: ignore[arg-type]
    with pytest.raises(ScenarioError, match=r"record\(\) takes a FrameResult, got None"):
        simulation.record(None)  # type: ignore[arg-type]
    step = simulation.step(BRAKE)
    assert step.frame is not None
    assert step.frame.stamp_s == 0.05


def test_steps_out_of_order_are_refused_by_name() -> None:
    simulation = made()
    for call in (lambda: simulation.step(BRAKE), lambda: simulation.step(None)):
        with pytest.raises(StepOrderError, match=r"step\(\) before start\(\)"):
            call()
    with pytest.raises(StepOrderError, match=r"outcome\(\) before the end"):
        simulation.outcome()
    step = simulation.start()
    with pytest.raises(StepOrderError, match=r"start\(\) a second time"):
        simulation.start()
    with pytest.raises(StepOrderError, match=r"start\(\) a second time"):
        simulation.run()
    with pytest.raises(StepOrderError, match=r"outcome\(\) before the end"):
        simulation.outcome()
    assert step.frame is not None
    result = simulation.perception().step(step.frame)
    simulation.record(result)
    with pytest.raises(StepOrderError, match=r"record\(\) a second time for the frame of 0 s"):
        simulation.record(result)
    while step.frame is not None:
        step = simulation.step(BRAKE)
    for call in (lambda: simulation.step(BRAKE), lambda: simulation.step(None)):
        with pytest.raises(StepOrderError, match=r"step\(\) after the end \(time_limit\)"):
            call()
    assert simulation.outcome().end_reason == step.end_reason


def test_a_simulation_without_strategy_has_no_perception() -> None:
    with pytest.raises(ScenarioError, match="without a strategy"):
        made(None).perception()


# ---- copies ------------------------------------------------------------------------------------------------


def pickled(pair: tuple[Simulation, StepResult, Perception]) -> tuple[Simulation, StepResult, Perception]:
    copied: tuple[Simulation, StepResult, Perception] = pickle.loads(pickle.dumps(pair))
    return copied


@pytest.mark.parametrize(
    ("duplicate", "frame"),
    [(copy.deepcopy, 0), (pickled, 1), (copy.deepcopy, 40), (pickled, 75), (copy.deepcopy, 90)],
)
@pytest.mark.parametrize(("scenario", "strategy"), [("crossing", "map"), ("ahead", "rectangular")])
def test_a_copy_goes_on_as_the_original(
    duplicate: Callable[[object], tuple[Simulation, StepResult, Perception]],
    frame: int,
    scenario: str,
    strategy: str,
) -> None:
    """Also if another copy has been driven to its end meanwhile, with other commands."""
    spec = RunSpec(scenario, scenario, (), strategy, "physical", "dry", 0.0, seed=4, phase_s=0.02)
    expected = values(simulation_of(spec).run())
    original = simulation_of(spec)
    perception = original.perception()
    step = finished(original, original.start(), perception, frame)
    assert step.frame is not None
    ours = duplicate((original, step, perception))
    others, other_step, _ = duplicate((original, step, perception))
    while other_step.frame is not None:
        other_step = others.step(BRAKE)
    assert values(others.outcome()) != expected
    for simulation, at, sees in (ours, (original, step, perception)):
        finished(simulation, at, sees)
        assert values(simulation.outcome()) == expected


def test_a_copy_made_before_the_start_is_a_run_of_its_own() -> None:
    original = made()
    copied = copy.deepcopy(original)
    assert values(original.run()) == values(copied.run())


def test_a_copy_shares_what_never_changes() -> None:
    original = made()
    step = original.start()
    copied = copy.deepcopy(original)
    assert copied.network is original.network
    assert copied.engine is not original.engine
    assert step.frame is not None
    after = copied.step(None)
    assert after.frame is not None
    assert after.frame.path is step.frame.path


# ---- several sensors ---------------------------------------------------------------------------------------


def chain(config: SensorConfig, seed: int) -> SensorChain[object]:
    return SensorChain(BoxSensor(config), BoxDetector(config, seed))  # type: ignore[arg-type]


def two_sensors() -> list[SensorChain[object]]:
    """A fast one with a long range, and a slow one with a short range and more latency."""
    return [
        chain(SensorConfig(range_m=70.0, rate_hz=20.0), 1),
        chain(SensorConfig(range_m=30.0, rate_hz=5.0, phase_s=0.02, latency_s=0.1), 2),
    ]


def test_detections_of_two_sensors_arrive_as_frames_in_the_order_of_their_measurement() -> None:
    simulation = Simulation(crossing(), PHYSICAL, None, sensors=two_sensors())
    at_frames = list(frames(simulation))
    stamps = np.array([frame.detections.stamp_s for frame in at_frames])
    times = np.array([frame.stamp_s for frame in at_frames])
    assert (np.diff(stamps) > 0.0).all()
    assert (np.diff(times) >= 0.0).all()
    slow = np.isclose((stamps - 0.02) % 0.2, 0.0, atol=1e-6) | np.isclose((stamps - 0.02) % 0.2, 0.2)
    assert set(np.round(np.diff(stamps[~slow]), 9)) == {0.05}
    assert set(np.round(np.diff(stamps[slow]), 9)) == {0.2}
    assert times[slow] - stamps[slow] == pytest.approx(0.1)
    # those of the fast one at 0.05 and 0.1 s wait for that of the slow one of 0.02 s, which comes at 0.12 s
    assert times[:5] == pytest.approx([0.0, 0.12, 0.12, 0.12, 0.15])
    assert stamps[:5] == pytest.approx([0.0, 0.02, 0.05, 0.1, 0.15])
    assert simulation.outcome().detections == sum(len(frame.detections) for frame in at_frames)


def test_several_frames_at_one_instant_are_decided_one_by_one_and_the_last_command_holds() -> None:
    def at_the_second(frame: Frame) -> Command:
        return Command(frame.detections.stamp_s == pytest.approx(0.05))

    outcome = commanded(Simulation(crossing(), PHYSICAL, None, sensors=two_sensors()), at_the_second)
    assert outcome.flag_time_s == pytest.approx(0.12)
    assert outcome.stop_time_s is None
    assert outcome.contact is not None
    assert outcome.impact_speed_mps == pytest.approx(60 * KMH)


def test_perception_tracks_with_two_sensors() -> None:
    """Whoever has but the short one brakes later."""
    flags = []
    for sensors in (two_sensors(), two_sensors()[1:]):
        outcome = Simulation(crossing(), PHYSICAL, NamedStrategy("map", PHYSICAL), sensors=sensors).run()
        assert outcome.flag_time_s is not None
        flags.append(outcome.flag_time_s)
    assert flags[0] < flags[1]


@dataclasses.dataclass(frozen=True)
class Cloud:
    """Points measured at one instant: fit for perception."""

    stamp_s: float
    points: int
    is_truth: bool = False


class PointSensor:
    timing = Timing(10.0)

    def measure(self, world: World, ego: EgoState) -> Cloud:
        assert len(world) == len(world.bottom_m) == len(world.velocity_mps)
        return Cloud(world.time_s, len(world))


class PointDetector:
    latency_s, rate_hz = 0.05, 5.0

    def detect(self, measurement: Cloud) -> Detections:
        return Detections.empty(measurement.stamp_s)


def test_a_measurement_that_is_no_truth_comes_with_its_frame() -> None:
    points: SensorChain[Cloud] = SensorChain(PointSensor(), PointDetector(), "points")
    simulation = Simulation(crossing(), PHYSICAL, None, sensors=[points, *two_sensors()[:1]])
    seen = [frame for frame in frames(simulation) if frame.measurement is not None]
    # the detector takes every second measurement
    assert [frame.detections.stamp_s for frame in seen[:3]] == pytest.approx([0.0, 0.2, 0.4])
    assert seen[0].stamp_s == pytest.approx(0.05)
    assert seen[0].measurement == Cloud(0.0, 1)


def test_what_a_detector_must_not_return_is_refused_by_name() -> None:
    class Late(PointDetector):
        def detect(self, measurement: Cloud) -> Detections:
            return Detections.empty(measurement.stamp_s + 1.0)

    class Boxy(PointDetector):
        def detect(self, measurement: Cloud) -> Detections:
            return Boxes.empty()  # type: ignore[return-value]

    for detector, told in (
        (Late(), "points: detections of 1 s at 0 s"),
        (Boxy(), "points: detect" r"\(\) ret"),
    ):
        points: SensorChain[Cloud] = SensorChain(PointSensor(), detector, "points")
        with pytest.raises(ValueError, match=told):
            Simulation(crossing(), PHYSICAL, None, sensors=[points]).start()


def test_an_ego_without_sensors_is_refused() -> None:
    with pytest.raises(ScenarioError, match="sensors: expected one or more"):
        Simulation(crossing(), PHYSICAL, None, sensors=[]).start()
