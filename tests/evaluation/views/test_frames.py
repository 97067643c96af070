"""A log arranged by frames."""

import math
from typing import Any

import numpy as np
import pytest

from evaluation.results.files import ResultsError
from evaluation.views.frames import frames_of
from smartmot.area import RectangularArea, RectangularConfig
from smartmot.decision.braking import BrakingDistance


def test_a_frame_per_decision_and_the_end(drive: Any) -> None:
    seen = [{"time_s": t, "kind": "track", "id": 3, "label": "static"} for t in (0.0, 0.1, 0.2)]
    frames = frames_of(drive().log(*seen))
    assert frames.time_s.tolist() == pytest.approx([0.0, 0.1, 0.2, 1.0])
    # what was perceived last still stands at the end, at which nothing was decided
    assert [len(frames.rows("track", frame)) for frame in range(4)] == [1, 1, 1, 1]


def test_without_decisions_every_moment_is_a_frame(drive: Any) -> None:
    assert len(frames_of(drive(frames=7).log())) == 7


@pytest.mark.parametrize(
    ("time", "frame"), [(0.0, 0), (0.049, 0), (0.05, 1), (0.52, 10), (9.0, 20), (-1.0, 0)]
)
def test_the_frame_at_a_time_is_the_last_before_it(drive: Any, time: float, frame: int) -> None:
    assert frames_of(drive().log()).frame_at(time) == frame


def test_yaw_rate_is_that_of_the_circle(drive: Any) -> None:
    """Logs hold no yaw rate; on a circle it is speed over radius, here 10 m/s over 25 m."""
    frames = frames_of(drive(10.0, 0.4).log())
    rates = [frames.ego_state(frame).yaw_rate_radps for frame in range(1, len(frames))]
    assert rates == pytest.approx([0.4] * 20)


def test_yaw_rate_survives_the_turn_of_the_angle(drive: Any) -> None:
    log = drive(10.0, 0.4).log()
    log["yaw_rad"] = (log["yaw_rad"] + math.pi - 0.1 + np.pi) % (2 * np.pi) - np.pi
    frames = frames_of(log)
    assert [frames.ego_state(k).yaw_rate_radps for k in range(1, len(frames))] == pytest.approx([0.4] * 20)


def test_the_rectangle_shrinks_on_the_circle(drive: Any) -> None:
    """On a radius of 10 m, half of that of a straight road, length and width are half of theirs."""
    area = RectangularArea(RectangularConfig(straight_radius_m=20.0), BrakingDistance())
    straight, bent = (frames_of(drive(5.0, rate).log(), area).areas(20)[0][1] for rate in (0.0, 0.5))

    def sides(ring: Any) -> list[float]:
        return [float(np.hypot(*(ring[1] - ring[0]))), float(np.hypot(*(ring[2] - ring[1])))]

    assert sides(bent) == pytest.approx([side / 2 for side in sides(straight)], rel=1e-6)


def test_a_log_without_ego_is_one_clear_error(drive: Any) -> None:
    log = drive().log()
    with pytest.raises(ResultsError, match="without rows of kind 'ego'"):
        frames_of(log[log["kind"] != "ego"])
