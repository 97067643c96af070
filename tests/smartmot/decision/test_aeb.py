import math

import pytest

from smartmot.decision.aeb import AebConfig, AebState, Event, Situation, decide
from smartmot.errors import ConfigError

CONFIG = AebConfig()
RUNNING = AebState(started=True)
WATCHING = AebState(started=True, unexpected=True)
BRAKING = AebState(started=True, unexpected=True, emergency=True)


def _now(
    stamp_s: float = 1.0,
    *,
    collision: bool = False,
    nearest_m: float = math.inf,
    braking_m: float = 20.0,
    entering: bool = False,
    occupied: bool = False,
    standing: bool = True,
) -> Situation:
    return Situation(stamp_s, collision, nearest_m, braking_m, entering, occupied, standing)


def _names(events: tuple[Event, ...]) -> list[tuple[str, str]]:
    return [(e.layer, e.name) for e in events]


START = [("start", "run_start"), ("selector", "follow_path")]
OPEN = [("unexpected", "forecasted_pedestrian"), ("selector", "unexpected")]
FLAG = [("monitors", "collision"), ("unexpected", "predicted_collision")]
CLOSE = [("monitors", "free_lane"), ("unexpected", "end_unexpected"), ("selector", "follow_path")]
DANGER = {"collision": True, "nearest_m": 15.0}


@pytest.mark.parametrize(
    ("state", "situation", "after", "events"),
    [
        # before the first frame
        (AebState(), _now(), RUNNING, START),
        (AebState(), _now(entering=True), WATCHING, START + OPEN),
        (AebState(), _now(**DANGER), BRAKING, [*START, ("selector", "unexpected"), *FLAG]),
        (AebState(), _now(entering=True, **DANGER), BRAKING, START + OPEN + FLAG),
        # following the path
        (RUNNING, _now(), RUNNING, []),
        (RUNNING, _now(occupied=True), RUNNING, []),
        (RUNNING, _now(nearest_m=3.0), RUNNING, []),
        (RUNNING, _now(collision=True, nearest_m=20.0), RUNNING, []),
        (RUNNING, _now(entering=True), WATCHING, OPEN),
        (RUNNING, _now(**DANGER), BRAKING, [("selector", "unexpected"), *FLAG]),
        (RUNNING, _now(entering=True, **DANGER), BRAKING, OPEN + FLAG),
        # somebody is about to enter
        (WATCHING, _now(entering=True), WATCHING, []),
        (WATCHING, _now(occupied=True), WATCHING, []),
        (WATCHING, _now(entering=True, **DANGER), BRAKING, FLAG),
        (WATCHING, _now(**DANGER), BRAKING, FLAG),
        (WATCHING, _now(), AebState(True, True, False, 1.0), []),
        # stopping, then holding
        (BRAKING, _now(**DANGER), BRAKING, []),
        (BRAKING, _now(entering=True), BRAKING, []),
        (BRAKING, _now(occupied=True), BRAKING, []),
        (BRAKING, _now(), AebState(True, True, True, 1.0), []),
        # while it still moves the brake stays on, whatever can be seen; without one speed is no matter
        (BRAKING, _now(standing=False), BRAKING, []),
        (AebState(True, True, True, 0.5), _now(standing=False), BRAKING, []),
        (WATCHING, _now(standing=False), AebState(True, True, False, 1.0), []),
        (AebState(True, True, False, 0.85), _now(standing=False), RUNNING, CLOSE),
        # the way is clear, but not for long enough; then for long enough
        (AebState(True, True, True, 0.9), _now(), AebState(True, True, True, 0.9), []),
        (AebState(True, True, True, 0.9), _now(occupied=True), BRAKING, []),
        (AebState(True, True, True, 0.85), _now(), RUNNING, CLOSE),
        (AebState(True, True, False, 0.85), _now(), RUNNING, CLOSE),
        (AebState(True, True, False, 0.8), _now(entering=True), WATCHING, []),
        (AebState(True, True, False, 0.8), _now(**DANGER), BRAKING, FLAG),
    ],
)
def test_transitions(
    state: AebState, situation: Situation, after: AebState, events: list[tuple[str, str]]
) -> None:
    found, emergency, reported = decide(state, situation, CONFIG)
    assert found == after
    assert emergency == after.emergency
    assert _names(reported) == events
    assert all(e.stamp_s == situation.stamp_s for e in reported)


@pytest.mark.parametrize(
    ("nearest", "braking", "flagged"),
    [
        (11.99, 0.04, True),  # near at any speed
        (12.0, 0.04, False),
        (35.6, 35.65, True),  # 60 km/h
        (35.65, 35.65, False),
        (math.inf, 500.0, False),
    ],
)
def test_near_means_braking_distance_or_twelve_metres(nearest: float, braking: float, flagged: bool) -> None:
    situation = _now(collision=True, nearest_m=nearest, braking_m=braking)
    assert decide(RUNNING, situation, CONFIG)[1] is flagged


def _drive(
    *spans: tuple[int, dict[str, float | bool]], rate_hz: float = 20.0
) -> list[tuple[bool, list[str]]]:
    """Command and event names of each frame: so many frames in each situation."""
    state, out, k = AebState(), [], 0
    for frames, settings in spans:
        for _ in range(frames):
            state, emergency, events = decide(state, _now(k / rate_hz, **settings), CONFIG)
            out.append((emergency, [e.name for e in events]))
            k += 1
    return out


def test_order_of_figure_4() -> None:
    """A pedestrian is seen coming, is about to be hit, crosses before the standing ego, has left the lane."""
    frames = _drive(
        (20, {}),
        (20, {"entering": True}),
        (20, {"entering": True, "collision": True, "nearest_m": 15.0}),
        (40, {"occupied": True, "nearest_m": 4.0, "braking_m": 0.04}),
        (20, {}),
    )
    named = [(k, name) for k, (_, names) in enumerate(frames) for name in names]
    assert named == [
        (0, "run_start"),
        (0, "follow_path"),
        (20, "forecasted_pedestrian"),
        (20, "unexpected"),
        (40, "collision"),
        (40, "predicted_collision"),
        (103, "free_lane"),  # first clear at frame 100, 0.15 s later at 20 Hz
        (103, "end_unexpected"),
        (103, "follow_path"),
    ]
    assert [k for k, (emergency, _) in enumerate(frames) if emergency] == list(range(40, 103))


@pytest.mark.parametrize("rate_hz", [10.0, 20.0, 100.0])
def test_clear_time_is_measured_not_counted(rate_hz: float) -> None:
    frames = _drive((1, DANGER), (60, {}), rate_hz=rate_hz)
    freed = [k for k, (_, names) in enumerate(frames) if "free_lane" in names]
    assert freed == [1 + math.ceil(0.15 * rate_hz - 1e-9)]


def test_braked_to_standstill_even_if_the_cause_is_out_of_sight() -> None:
    """The ego is still rolling for 30 frames after the last sight of the pedestrian."""
    frames = _drive((1, DANGER), (30, {"standing": False}), (10, {}))
    assert [k for k, (emergency, _) in enumerate(frames) if emergency] == list(range(34))
    assert "free_lane" in frames[34][1]


def test_held_at_standstill_as_long_as_somebody_is_on_the_way() -> None:
    frames = _drive((5, DANGER), (2000, {"occupied": True, "braking_m": 0.04}), (3, {}))
    assert all(emergency for emergency, _ in frames)
    assert sum(len(names) for _, names in frames[1:]) == 0


def test_no_chatter_when_the_way_flickers() -> None:
    """Two frames clear, one not, over and over: the brake stays on and nothing is reported twice."""
    frames = _drive((2, DANGER), *[(2, {}), (1, {"occupied": True})] * 50, (4, {}))
    assert all(emergency for emergency, _ in frames[:-1])
    assert not frames[-1][0]
    names = [name for _, found in frames for name in found]
    opened = ["run_start", "follow_path", "unexpected", "collision", "predicted_collision"]
    assert names == [*opened, "free_lane", "end_unexpected", "follow_path"]


def test_flicker_of_the_forecast_opens_and_closes_once() -> None:
    frames = _drive((1, {}), *[(1, {"entering": True}), (2, {})] * 30, (4, {}))
    names = [name for _, found in frames for name in found]
    assert names.count("forecasted_pedestrian") == names.count("end_unexpected") == 1
    assert not any(emergency for emergency, _ in frames)


def test_a_second_pedestrian_starts_a_second_behaviour() -> None:
    frames = _drive((3, DANGER), (10, {}), (3, {"entering": True}), (10, {}))
    names = [name for _, found in frames for name in found]
    assert names.count("run_start") == 1
    assert names.count("unexpected") == names.count("end_unexpected") == 2


def test_without_clear_time_the_brake_is_released_at_once() -> None:
    state, emergency, events = decide(BRAKING, _now(), AebConfig(clear_s=0.0))
    assert (state, emergency) == (RUNNING, False)
    assert _names(events) == CLOSE


@pytest.mark.parametrize("settings", [{"near_m": -1.0}, {"clear_s": -0.1}])
def test_impossible_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        AebConfig(**settings)
