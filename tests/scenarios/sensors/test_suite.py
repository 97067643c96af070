"""Several sensors by the clock: who measures when, and in which order detections are handed over."""

import dataclasses

import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.sensors import BoxDetector, BoxSensor, Sensor, SensorChain, SensorConfig, Timing, World
from scenarios.sensors.sensor import box_chain, observing_chain
from scenarios.sensors.suite import Measurements, SensorSuite, joined_detections
from smartmot.types import Boxes, Detections, Dropped, EgoState

STEP_S = 0.01


@dataclasses.dataclass(frozen=True)
class Echo:
    """A measurement of nothing but its time and its sensor."""

    stamp_s: float
    sensor: str
    is_truth: bool = False


class EchoSensor:
    def __init__(self, name: str, timing: Timing, is_truth: bool = False) -> None:
        self.name, self.timing, self.is_truth = name, timing, is_truth

    def measure(self, world: World, ego: EgoState) -> Echo:
        return Echo(world.time_s, self.name, self.is_truth)


class EchoDetector:
    def __init__(self, latency_s: float = 0.0, rate_hz: float | None = None) -> None:
        self.latency_s, self.rate_hz = latency_s, rate_hz

    def detect(self, measurement: Echo) -> Detections:
        return Detections.empty(measurement.stamp_s)


def chain(
    rate_hz: float,
    phase_s: float = 0.0,
    latency_s: float = 0.0,
    detector: EchoDetector | None = None,
    name: str = "echo",
    is_truth: bool = False,
) -> SensorChain[Echo]:
    timing = Timing(rate_hz, phase_s, latency_s)
    return SensorChain(EchoSensor(name, timing, is_truth), detector or EchoDetector(), name)


def people(count: int) -> World:
    boxes = Boxes(np.column_stack((5.0 + 3.0 * np.arange(count), np.zeros(count))), np.full((count, 2), 0.5),
                  np.zeros(count))  # fmt: skip
    some, there = np.ones(count), np.full(count, True)
    return World(0.0, boxes, some, some, np.arange(count), np.full(count, "pedestrian"), there, there)


def handed_over(chains: list[SensorChain[Echo]], until_s: float) -> list[tuple[float, float, object]]:
    """Times of arrival and of measurement, and the measurement, of all that arrives."""
    suite, rows = SensorSuite(chains, STEP_S), []
    for step in range(round(until_s / STEP_S)):
        now = step * STEP_S
        world, ego = dataclasses.replace(people(0), time_s=now), EgoState(now, 0.0, 0.0, 0.0, 0.0)
        if step == suite.next_step(step - 1):
            suite.measure(step, now, world, ego)
        while (arrival := suite.arrived(now)) is not None:
            rows.append((now, arrival.detections.stamp_s, arrival.measurement))
    return rows


def test_latencies_of_sensor_and_detector_add_up() -> None:
    rows = handed_over([chain(10.0, 0.03, 0.02, EchoDetector(0.05))], 0.5)
    assert [stamp for _, stamp, _ in rows] == pytest.approx([0.03, 0.13, 0.23, 0.33])
    assert [now - stamp for now, stamp, _ in rows] == pytest.approx([0.07] * 4)


def test_a_slow_detector_leaves_measurements_out() -> None:
    rows = handed_over([chain(20.0, detector=EchoDetector(rate_hz=1 / 0.12))], 0.7)
    with pytest.raises(ScenarioError, match="detector's interval must be a multiple"):
        SensorSuite([chain(20.0, detector=EchoDetector(rate_hz=7.0))], STEP_S)
    # 120 ms are no multiple of 50 ms: the next measurement after them is taken
    assert [stamp for _, stamp, _ in rows] == pytest.approx([0.0, 0.15, 0.3, 0.45, 0.6])


def test_older_measurements_come_first_however_late_they_arrive() -> None:
    chains = [chain(10.0, name="fast"), chain(5.0, 0.05, 0.12, name="slow")]
    rows = handed_over(chains, 0.5)
    stamps = [stamp for _, stamp, _ in rows]
    assert stamps == sorted(stamps) == pytest.approx([0.0, 0.05, 0.1, 0.2, 0.25, 0.3, 0.4])
    arrivals = [now for now, _, _ in rows]
    assert arrivals == pytest.approx([0.0, 0.17, 0.17, 0.2, 0.37, 0.37, 0.4])
    assert [echo.sensor for *_, echo in rows][:3] == ["fast", "slow", "fast"]  # type: ignore[attr-defined]


def test_what_is_measured_at_one_instant_is_one_frame() -> None:
    rows = handed_over([chain(10.0, name="a"), chain(5.0, 0.0, 0.03, name="b")], 0.25)
    assert [now for now, _, _ in rows] == pytest.approx([0.03, 0.1, 0.23])
    assert [stamp for _, stamp, _ in rows] == pytest.approx([0.0, 0.1, 0.2])
    both, alone, _ = (measurement for *_, measurement in rows)
    assert isinstance(both, Measurements)
    assert [echo.sensor for echo in both.parts] == ["a", "b"]  # type: ignore[attr-defined]
    assert not both.is_truth
    assert alone == Echo(pytest.approx(0.1), "a")  # type: ignore[arg-type]


def test_ground_truth_is_kept_from_perception() -> None:
    rows = handed_over([chain(10.0, is_truth=True), chain(10.0, name="points")], 0.05)
    assert [measurement for *_, measurement in rows] == [Echo(0.0, "points")]
    rows = handed_over([chain(10.0, is_truth=True)], 0.05)
    assert [measurement for *_, measurement in rows] == [None]


def test_detections_of_several_sensors_are_joined_row_by_row() -> None:
    one = Detections(
        1.0,
        Boxes([[1, 2]], [[3, 4]], [0.5]),
        [0.9],
        ["car"],
        None,
        Dropped(score=1, box=2),  # type: ignore[arg-type]
    )
    other = Detections(
        1.0,
        Boxes([[5, 6]], [[1, 1]], [0.1]),
        [0.5],
        ["pedestrian"],
        [[1.0, 2.0]],
        Dropped(box=1),  # type: ignore[arg-type]
    )
    joined = joined_detections([one, other])
    assert joined.boxes.center_m.tolist() == [[1, 2], [5, 6]]
    assert joined.score.tolist() == [0.9, 0.5]
    assert joined.category.tolist() == ["car", "pedestrian"]
    assert joined.velocity_mps is not None
    assert np.isnan(joined.velocity_mps[0]).all()
    assert joined.velocity_mps[1].tolist() == [1.0, 2.0]
    assert joined.dropped == Dropped(score=1, box=3)
    assert joined_detections([one, one]).velocity_mps is None


@pytest.mark.parametrize("count", [0, 1, 4])
@pytest.mark.parametrize("number", [0, 7])
def test_the_shipped_pair_gives_the_bytes_of_the_sensor_that_observes(count: int, number: int) -> None:
    config = SensorConfig(detection_probability=0.8, yaw_sigma_rad=0.1, range_m=12.0, phase_s=0.02)
    now = 0.02 + number * 0.05
    world = dataclasses.replace(people(count), time_s=now, seen=np.arange(count) != 1)
    ego = EgoState(now, 0.0, 0.0, 0.0, 10.0)
    observed = Sensor(config, 5).observe(number, ego, world.boxes, world.category, world.seen)
    pair = BoxDetector(config, 5).detect(BoxSensor(config).measure(world, ego))
    chained = box_chain(config, 5)
    behind = observing_chain(config, Sensor(config, 5), "own")
    for seen in (pair, *(c.detector.detect(c.sensor.measure(world, ego)) for c in (chained, behind))):
        assert seen.stamp_s == observed.stamp_s
        assert seen.boxes.center_m.tobytes() == observed.boxes.center_m.tobytes()
        assert seen.boxes.yaw_rad.tobytes() == observed.boxes.yaw_rad.tobytes()
        assert seen.score.tobytes() == observed.score.tobytes()
        assert seen.category.tolist() == observed.category.tolist()


def test_a_detector_of_one_s_own_may_change_what_it_is_given() -> None:
    class Renames(Sensor):
        def observe(self, frame, ego, boxes, category, there=None):  # type: ignore[no-untyped-def]
            category[:], there[0] = "cyclist", False
            return super().observe(frame, ego, boxes, category, there)

    config, world = SensorConfig(), people(3)
    own = observing_chain(config, Renames(config, 0), "own")
    seen = own.detector.detect(own.sensor.measure(world, EgoState(0.0, 0.0, 0.0, 0.0, 10.0)))
    assert set(seen.category.tolist()) == {"cyclist"}
    assert world.category.tolist() == ["pedestrian"] * 3
    assert world.seen.all()


@pytest.mark.parametrize(
    "wrong", [{"rate_hz": 0.0}, {"phase_s": -0.1}, {"latency_s": -0.1}, {"rate_hz": float("nan")}]
)
def test_impossible_times_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ScenarioError, match="sensor: the rate must be positive"):
        Timing(**({"rate_hz": 20.0} | wrong))


@pytest.mark.parametrize("rate_hz", [30.0, 200.0, 1e12])
def test_rates_that_are_no_whole_number_of_steps_are_refused(rate_hz: float) -> None:
    with pytest.raises(ScenarioError, match=r"frame interval .* must be a multiple of the step of 10 ms"):
        SensorSuite([chain(rate_hz)], STEP_S)
