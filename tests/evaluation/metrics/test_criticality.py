"""Criticality against closed forms and against stepping the boxes."""

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from evaluation.metrics.criticality import (
    Moving,
    criticality,
    criticality_csv,
    required_decel_mps2,
    time_to_collision_s,
)
from smartmot.geometry import signed_gap_scalar


def moving(x: float, y: float, yaw: float, speed: float, length: float = 4.0, width: float = 2.0) -> Moving:
    return Moving(np.array([x, y]), np.array([length, width]), np.array(yaw), np.array(speed))


def test_following_a_slower_car() -> None:
    ego, other = moving(0, 0, 0, 20.0), moving(44.0, 0, 0, 10.0)
    ttc = time_to_collision_s(ego, other)
    assert ttc == pytest.approx(4.0)  # 40 m free, closing at 10 m/s
    assert required_decel_mps2(ego, other, ttc) == pytest.approx(10.0**2 / (2 * 40.0))


def test_pedestrian_from_the_side() -> None:
    # its front edge is 4 m from the ego's side; the ego's front is at its line after 2 s
    ego = moving(0, 0, 0, 10.0)
    walker = moving(22.25, -5.3, math.pi / 2, 2.0, 0.6, 0.5)
    # along x the boxes meet at 20 m / 10 m/s = 2 s, across at 4 m / 2 m/s = 2 s
    assert time_to_collision_s(ego, walker) == pytest.approx(2.0)
    late = moving(22.25, -15.3, math.pi / 2, 2.0, 0.6, 0.5)
    assert time_to_collision_s(ego, late) == np.inf
    assert required_decel_mps2(ego, late, np.array(np.inf)) == 0.0


def test_in_contact() -> None:
    ego, other = moving(0, 0, 0, 5.0), moving(3.0, 0, 0.3, 0.0)
    assert time_to_collision_s(ego, other) == 0.0
    assert required_decel_mps2(ego, other, np.array(0.0)) == np.inf


coordinate = st.floats(-30, 30)
angle = st.floats(-math.pi, math.pi)
speed = st.floats(0.5, 20)


@given(coordinate, coordinate, angle, angle, speed, speed)
def test_time_to_collision_is_when_the_gap_closes(
    x: float, y: float, yaw: float, other_yaw: float, v: float, other_v: float
) -> None:
    ego, other = moving(0, 0, yaw, v), moving(x, y, other_yaw, other_v, 1.0, 0.6)

    def gap(t: float) -> float:
        boxes = [
            (*(m.center_m + m.velocity_mps * t).tolist(), *m.size_m.tolist(), float(m.yaw_rad))
            for m in (ego, other)
        ]
        return signed_gap_scalar(boxes[0], boxes[1])

    ttc = float(time_to_collision_s(ego, other))
    assume(gap(0.0) > 1e-6)
    times = np.linspace(0.0, 20.0, 400)
    if math.isinf(ttc):
        assert min(gap(t) for t in times) > -1e-6
    else:
        assert gap(ttc) == pytest.approx(0.0, abs=1e-6)
        assert min((gap(t) for t in times if t < ttc - 1e-9), default=1.0) > -1e-6


def test_arrays_broadcast() -> None:
    ego = moving(0, 0, 0, 10.0)
    x = np.array([24.0, 44.0, 64.0])
    others = Moving(np.column_stack((x, np.zeros(3))), np.tile([4.0, 2.0], (3, 1)), np.zeros(3), np.zeros(3))
    assert time_to_collision_s(ego, others).tolist() == pytest.approx([2.0, 4.0, 6.0])


def test_a_log_gives_the_worst_of_all_at_every_time() -> None:
    log = {
        # the last two actors are there when there is no ego, and say nothing
        "kind": np.array(["ego", "actor", "actor", "ego", "actor", "event", "actor", "actor"]),
        "time_s": np.array([0.0, 0.0, 0.0, 0.1, 0.1, 0.1, 0.05, 0.2]),
        "x_m": np.array([0.0, 24.0, 44.0, 1.0, 24.0, np.nan, 6.0, 6.0]),
        "y_m": np.zeros(8),
        "yaw_rad": np.zeros(8),
        "length_m": np.full(8, 4.0),
        "width_m": np.full(8, 2.0),
        "speed_mps": np.array([10.0, 0.0, 0.0, 10.0, 10.0, np.nan, 0.0, 0.0]),
    }
    found = criticality(log, 5.0)
    assert found.time_s.tolist() == [0.0, 0.1]
    assert found.time_to_collision_s.tolist() == pytest.approx([2.0, np.inf])
    assert found.required_decel_mps2.tolist() == pytest.approx([10.0**2 / 40.0, 0.0])
    assert found.brake_threat_number.tolist() == pytest.approx([0.5, 0.0])


def test_criticality_over_time_as_a_table_follows_the_closed_forms() -> None:
    """Ego at 10 m/s, its front 48 m before a standing box: TTC gap / v, a = v^2 / (2 gap), BTN a / 8."""
    time = np.array([0.0, 1.0, 2.0])
    ego = {"kind": "ego", "length_m": 4.0, "width_m": 2.0, "yaw_rad": 0.0, "speed_mps": 10.0, "y_m": 0.0}
    wall = {"kind": "actor", "length_m": 1.0, "width_m": 2.0, "yaw_rad": 0.0, "speed_mps": 0.0, "y_m": 0.0}
    rows = [{**ego, "time_s": t, "x_m": 10.0 * t} for t in time]
    rows += [{**wall, "time_s": t, "x_m": 50.5} for t in time]
    log = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    lines = criticality_csv(criticality(log, 8.0)).decode().splitlines()
    assert lines[0] == "time_s,time_to_collision_s,required_decel_mps2,brake_threat_number"
    for line, t in zip(lines[1:], time, strict=True):
        gap = 48.0 - 10.0 * t
        needed = 100.0 / (2 * gap)
        assert [float(cell) for cell in line.split(",")] == pytest.approx(
            [t, gap / 10.0, needed, needed / 8.0], abs=1e-6
        )
    away = dict(log, yaw_rad=np.where(log["kind"] == "ego", np.pi, 0.0))
    (first, *_) = criticality_csv(criticality(away, 8.0)).decode().splitlines()[1:]
    assert first == "0.0,,0.0,0.0"
