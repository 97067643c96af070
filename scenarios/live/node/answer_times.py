"""How long a live node takes from receiving a frame to having published its answer."""

from __future__ import annotations

import time
from collections import deque

import numpy as np

from scenarios.live.outputs import FrameOutput
from scenarios.live.perception import MOST_WAITING
from scenarios.ros.messages import DetectionMessage

FRAMES = 1000
"""The last so many answers count: 50 s at 20 Hz."""

_NS = 1e-9


class AnswerTimes:
    """Times of the last answers, waiting for a pose and in the middleware's queue included."""

    def __init__(self) -> None:
        self._received_s: dict[tuple[int, int], float] = {}
        self._answered_s: deque[float] = deque(maxlen=FRAMES)

    def receive(self, message: DetectionMessage, middleware_ns: int) -> None:
        """Note when a frame came.

        Args:
            message: the frame.
            middleware_ns: when the middleware received it, on the system's clock; 0: it does not say.
        """
        # a stamp of the future is that of a clock that was set
        queued_s = max(time.time_ns() - middleware_ns, 0) * _NS if middleware_ns > 0 else 0.0
        self._received_s[message.time_ns, message.received_ns] = time.perf_counter() - queued_s
        if len(self._received_s) > 2 * MOST_WAITING:  # late frames are never answered
            del self._received_s[next(iter(self._received_s))]

    def answer(self, output: FrameOutput) -> None:
        """Note that an answer was published."""
        received_s = self._received_s.pop((output.stamp_ns, output.received_ns), None)
        if received_s is not None:
            self._answered_s.append(time.perf_counter() - received_s)

    def percentiles_ms(self) -> tuple[float, float] | None:
        """Median and 99th percentile of the last answers; None: there are none."""
        if not self._answered_s:
            return None
        median, high = np.percentile(np.array(self._answered_s), (50.0, 99.0)).tolist()
        return 1e3 * median, 1e3 * high
