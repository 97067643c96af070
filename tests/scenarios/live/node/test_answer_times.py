"""Times from receiving to publishing, on clocks that are set by hand."""

from __future__ import annotations

import time
from dataclasses import replace

import pytest

from scenarios.live.node.answer_times import FRAMES, AnswerTimes
from scenarios.live.outputs import FrameOutput
from scenarios.ros.messages import DetectionMessage
from tests.scenarios.live.streams_made import boxes, frames_of

SYSTEM_NS = 1_700_000_000_000_000_000


class Clocks:
    """The system's clock, and the one that nobody sets."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.now_s = 100.0
        monkeypatch.setattr(time, "perf_counter", lambda: self.now_s)
        monkeypatch.setattr(time, "time_ns", lambda: SYSTEM_NS)


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    return Clocks(monkeypatch)


def frame(number: int) -> tuple[DetectionMessage, FrameOutput]:
    message = boxes(0.05 * number, [])
    ((output,), _) = frames_of([message])
    return message, output


def test_the_time_holds_what_a_frame_waited_in_the_middleware_and_for_a_pose(clocks: Clocks) -> None:
    times = AnswerTimes()
    message, output = frame(1)
    times.receive(message, SYSTEM_NS - 3_000_000)
    clocks.now_s += 0.004
    times.answer(output)
    assert times.percentiles_ms() == pytest.approx((7.0, 7.0))


@pytest.mark.parametrize("middleware_ns", [0, SYSTEM_NS + 5_000_000_000])
def test_a_middleware_that_does_not_say_when_adds_nothing(clocks: Clocks, middleware_ns: int) -> None:
    times = AnswerTimes()
    message, output = frame(1)
    times.receive(message, middleware_ns)
    clocks.now_s += 0.004
    times.answer(output)
    assert times.percentiles_ms() == pytest.approx((4.0, 4.0))


def test_the_last_thousand_count(clocks: Clocks) -> None:
    times = AnswerTimes()
    message, output = frame(1)
    for number in range(FRAMES + 100):
        named = replace(message, received_ns=number)
        times.receive(named, 0)
        clocks.now_s += 1.0 if number < 100 else 0.002 if number % 2 else 0.006
        times.answer(replace(output, received_ns=number))
    assert times.percentiles_ms() == pytest.approx((4.0, 6.0))


def test_frames_that_are_never_answered_are_forgotten(clocks: Clocks) -> None:
    times = AnswerTimes()
    message, output = frame(1)
    for number in range(10_000):
        times.receive(replace(message, received_ns=number), 0)
    assert times.percentiles_ms() is None
    times.answer(replace(output, received_ns=0))
    assert times.percentiles_ms() is None
    times.answer(replace(output, received_ns=9_999))
    assert times.percentiles_ms() == (0.0, 0.0)
