"""Errors of localisation and odometry: their size, their memory, and what they leave alone."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario.reading.reader import load
from scenarios.presets import PHYSICAL, Preset
from scenarios.settings import preset_with
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.sources import Frame, StepResult, frames
from scenarios.sources.pose_errors import LocalisationErrors, OdometryErrors, PoseErrors, WithPoseErrors
from scenarios.strategies import NamedStrategy
from smartmot import Boxes, Detections, EgoState, PlannedPath
from smartmot.errors import ConfigError
from smartmot.geometry import to_frame

WRONG = (
    ("localisation_lateral_m", 0.3),
    ("localisation_heading_deg", 1.0),
    ("localisation_drift_m", 0.2),
    ("localisation_noise_m", 0.1),
    ("odometry_speed", 0.02),
    ("odometry_yaw_rate_deg_s", 0.3),
)


def ego(
    time_s: float, x_m: float = 0.0, y_m: float = 0.0, yaw_rad: float = 0.0, speed: float = 10.0
) -> EgoState:
    return EgoState(time_s, x_m, y_m, yaw_rad, speed)


def left_of_truth(errors: PoseErrors, at: EgoState) -> float:
    believed = errors.localised(at)
    return float(to_frame(np.array([believed.x_m, believed.y_m]), at.x_m, at.y_m, at.yaw_rad)[1])


# --- localisation -------------------------------------------------------------------------------------------


@given(st.floats(-3, 3), st.floats(-3, 3), st.floats(-0.5, 0.5), st.floats(-3, 3))
def test_a_bias_is_one_of_the_ego_s_own_axes(left: float, ahead: float, turn: float, yaw: float) -> None:
    at = ego(0.0, 7.0, -4.0, yaw)
    believed = PoseErrors(LocalisationErrors(left, ahead, turn)).localised(at)
    local = to_frame(np.array([believed.x_m, believed.y_m]), 7.0, -4.0, yaw)
    assert local == pytest.approx([ahead, left], abs=1e-9)
    assert math.cos(believed.yaw_rad - yaw - turn) == pytest.approx(1.0)
    assert (believed.speed_mps, believed.stamp_s) == (10.0, 0.0)


def test_the_drift_has_its_deviation_and_its_memory() -> None:
    """A stationary Gauss-Markov process: the same variance at all times, correlation exp(-t / time)."""
    errors = [
        PoseErrors(LocalisationErrors(drift_sigma_m=0.3, drift_time_s=4.0), seed=k) for k in range(2000)
    ]
    at = {t: np.array([left_of_truth(e, ego(t)) for e in errors]) for t in (0.0, 4.0, 12.0)}
    for values in at.values():  # the standard error of a deviation of 2000 values is 1.6 %
        assert np.std(values) == pytest.approx(0.3, rel=0.07)
        assert np.mean(values) == pytest.approx(0.0, abs=0.03)
    for first, second in ((0.0, 4.0), (4.0, 12.0)):
        correlation = np.corrcoef(at[first], at[second])[0, 1]
        assert correlation == pytest.approx(math.exp(-(second - first) / 4.0), abs=0.09)


def test_the_noise_of_a_frame_has_its_deviation_and_no_memory() -> None:
    errors = PoseErrors(LocalisationErrors(noise_sigma_m=0.3, noise_heading_rad=0.02), seed=5)
    poses = [errors.localised(ego(0.05 * k)) for k in range(3000)]
    left, turn = np.array([p.y_m for p in poses]), np.array([p.yaw_rad for p in poses])
    assert np.std(left) == pytest.approx(0.3, rel=0.06)
    assert np.std(turn) == pytest.approx(0.02, rel=0.06)
    for values in (left, turn):
        assert np.corrcoef(values[1:], values[:-1])[0, 1] == pytest.approx(0.0, abs=0.08)
    assert np.corrcoef(left, turn)[0, 1] == pytest.approx(0.0, abs=0.08)


def test_what_is_drawn_depends_on_seed_and_time_alone() -> None:
    config = LocalisationErrors(drift_sigma_m=0.3, noise_sigma_m=0.1)
    times = [0.0, 0.37, 9.99, 10.0, 25.0]
    forward, backward = PoseErrors(config, seed=2), PoseErrors(config, seed=2)
    values = [left_of_truth(forward, ego(t)) for t in times]
    assert [left_of_truth(backward, ego(t, 50.0)) for t in times[::-1]] == pytest.approx(values[::-1])
    other = PoseErrors(config, seed=3)
    assert all(left_of_truth(other, ego(t)) != value for t, value in zip(times, values, strict=True))


@pytest.mark.parametrize(
    "wrong",
    [{"lateral_m": math.nan}, {"drift_sigma_m": -0.1}, {"noise_sigma_m": math.inf}, {"drift_time_s": 0.0},
     {"heading_rad": 4.0}],
)  # fmt: skip
def test_impossible_errors_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="localisation"):
        LocalisationErrors(**wrong)
    with pytest.raises(ConfigError, match="odometry"):
        OdometryErrors(speed=-1.0)


# --- odometry -----------------------------------------------------------------------------------------------


def test_a_speed_of_two_percent_more_is_two_percent_of_the_way() -> None:
    errors = PoseErrors(odometry=OdometryErrors(speed=0.02))
    for k in range(101):
        believed = errors.drive(ego(0.1 * k, 5.0 + k))
    assert (believed.x_m, believed.y_m) == pytest.approx((5.0 + 102.0, 0.0))
    assert believed.speed_mps == pytest.approx(10.2)


def test_a_bias_of_the_turn_rate_bends_a_straight_way_into_an_arc() -> None:
    """Radius v / w: after t seconds at v / w (sin wt, 1 - cos wt)."""
    rate, speed = 0.05, 10.0
    errors = PoseErrors(odometry=OdometryErrors(yaw_rate_radps=rate))
    for k in range(201):
        believed = errors.drive(ego(0.05 * k, 0.5 * k))
    arc = speed / rate * np.array([math.sin(rate * 10.0), 1.0 - math.cos(rate * 10.0)])
    assert (believed.x_m, believed.y_m) == pytest.approx(tuple(arc), rel=1e-6)
    assert believed.yaw_rad == pytest.approx(rate * 10.0)
    assert believed.yaw_rate_radps == pytest.approx(rate)


def test_detections_and_path_lie_to_the_ego_as_in_truth() -> None:
    """Detections as the odometry was when they were measured, the path as it is now."""
    errors = PoseErrors(LocalisationErrors(), OdometryErrors(0.1, 0.2))
    believed_then: dict[int, EgoState] = {}
    path = PlannedPath.through([[0.0, 0.0], [100.0, 0.0]])
    truth = [ego(0.05 * k, 0.5 * k, 0.0, 0.0) for k in range(41)]
    for k, at in enumerate(truth):
        errors.drive(at)
        if k < 2:
            continue
        then = truth[k - 2]  # 0.1 s of latency
        boxes = Boxes(np.array([[30.0, 2.0]]), np.array([[0.5, 0.5]]), np.zeros(1))
        velocity = np.array([[1.0, 0.0]])
        seen = Detections(then.stamp_s, boxes, np.ones(1), np.array(["car"]), velocity)
        frame = errors.perceived(Frame(at.stamp_s, at, seen, path=path))
        old = believed_then[k - 2] if k > 3 else None
        if old is not None:
            local = to_frame(frame.detections.boxes.center_m, old.x_m, old.y_m, old.yaw_rad)
            assert local == pytest.approx(np.array([[30.0 - then.x_m, 2.0]]))
            assert frame.detections.boxes.yaw_rad - old.yaw_rad == pytest.approx(0.0, abs=1e-9)
            assert frame.detections.velocity_mps == pytest.approx(
                np.array([[math.cos(old.yaw_rad), math.sin(old.yaw_rad)]])
            )
        assert frame.path is not None
        assert frame.path.project(frame.ego.x_m, frame.ego.y_m) == pytest.approx((at.x_m, 0.0), abs=1e-9)
        assert frame.mission is path
        assert frame.localised is not None
        assert (frame.localised.x_m, frame.localised.y_m) == pytest.approx((at.x_m, 0.0))
        believed_then[k] = frame.ego


# --- runs ---------------------------------------------------------------------------------------------------


def made(preset: Preset, strategy: str = "map") -> Simulation:
    definition = load(shipped_scenario("crossing"), {"Ego_speed_kmh": 50.0})
    return Simulation(definition, preset, NamedStrategy(strategy, preset), seed=3)


def values(outcome: Outcome) -> tuple[object, ...]:
    return (outcome.flag_time_s, outcome.contact, outcome.end_time_s, outcome.log.table()["x_m"].tobytes())


def test_copies_of_a_run_with_errors_go_on_with_the_same_bytes() -> None:
    preset = preset_with(PHYSICAL, WRONG)
    simulation = made(preset)
    perception, step = simulation.perception(), simulation.start()
    for _ in range(30):
        assert step.frame is not None
        result = perception.step(step.frame)
        simulation.record(result)
        step = simulation.step(result.command)
    parts = (simulation, perception, step)
    copies = [copy.deepcopy(parts), pickle.loads(pickle.dumps(parts))]
    outcomes = []
    for go_on, eyes, at in [parts, *copies]:
        while at.frame is not None:
            result = eyes.step(at.frame)
            go_on.record(result)
            at = go_on.step(result.command)
        outcomes.append(values(go_on.outcome()))
    assert outcomes[0] == outcomes[1] == outcomes[2] == values(made(preset).run())


@pytest.mark.parametrize("strategy", ["rectangular", "all", "path"])
def test_localisation_changes_nothing_for_who_takes_nothing_from_the_map(strategy: str) -> None:
    wrong = preset_with(PHYSICAL, (("localisation_lateral_m", 1.0), ("localisation_drift_m", 0.5)))
    true, off = made(PHYSICAL, strategy).run(), made(wrong, strategy).run()
    assert (true.flag_time_s, true.stop_time_s) == (off.flag_time_s, off.stop_time_s)


def test_frames_of_any_source_take_the_errors() -> None:
    bare = made(PHYSICAL)
    errors = LocalisationErrors(lateral_m=0.4, drift_sigma_m=0.1)
    first = list(frames(WithPoseErrors(made(PHYSICAL), errors, seed=3)))
    for seen, truth in zip(first, frames(bare), strict=True):
        assert truth.localised is None
        assert seen.localised is not None
        assert seen.ego == truth.ego
        assert np.array_equal(seen.detections.boxes.center_m, truth.detections.boxes.center_m)
        believed = to_frame(
            np.array([seen.localised.x_m, seen.localised.y_m]),
            truth.ego.x_m,
            truth.ego.y_m,
            truth.ego.yaw_rad,
        )
        assert 0.0 < float(believed[1]) < 0.8
    own = preset_with(PHYSICAL, (("localisation_lateral_m", 0.4), ("localisation_drift_m", 0.1)))
    assert [f.localised for f in frames(made(own))] == [f.localised for f in first]


def test_the_end_of_a_source_is_passed_on() -> None:
    class Ended:
        def start(self) -> StepResult:
            return StepResult(None, "over")

        def step(self, command: object) -> StepResult:
            raise AssertionError(command)

    assert WithPoseErrors(Ended()).start().end_reason == "over"
