"""How often frames come, of each detector."""

from __future__ import annotations

from collections import deque

_INTERVALS = 9
"""The median of so many intervals counts: a late frame, or a missing one, does not change it."""
_NS = 1e-9


class FrameRates:
    """Measures the intervals between frames.

    Args:
        usual_s: the interval as long as none is known.
    """

    def __init__(self, usual_s: float) -> None:
        self._usual_s = usual_s
        self._last_ns: dict[str, int] = {}
        self._intervals: dict[str, deque[int]] = {}

    def see(self, stamp_ns: int, detector: str) -> int:
        """Take the time of a frame; how many intervals of its detector are known, 9 at most.

        A frame that is not newer than the last one of its detector counts for nothing.
        """
        intervals = self._intervals.setdefault(detector, deque(maxlen=_INTERVALS))
        last_ns = self._last_ns.get(detector)
        if last_ns is None or stamp_ns > last_ns:
            self._last_ns[detector] = stamp_ns
            if last_ns is not None:
                intervals.append(stamp_ns - last_ns)
        return len(intervals)

    @property
    def interval_s(self) -> float:
        """Median of the last intervals, of the detector that comes most often."""
        medians = [sorted(each)[len(each) // 2] for each in self._intervals.values() if each]
        return min(medians) * _NS if medians else self._usual_s
