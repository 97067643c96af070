"""Rauch-Tung-Striebel smoothing of a track: every state by all detections, those after it as well.

Source: Rauch, Tung, Striebel, "Maximum likelihood estimates of linear dynamic systems", AIAA Journal 3 (8),
1965. The filter's states are carried back from the last one; between two detections the states are predicted
ones, so that gaps are filled by what both ends say.
"""

from __future__ import annotations

import numpy as np

from smartmot.filters.kalman import heading_innovation
from smartmot.filters.motion_models import (
    AREA,
    CHANNELS,
    YAW,
    DecayingAcceleration,
    LinearMotion,
    X,
    Y,
    process_noise,
)
from smartmot.types import FloatArray

_PLACES = {X: 0, Y: 1, AREA: 2, YAW: 4}
"""Entries of a mean that have rates, by channel: x, y, area, ratio and yaw come first, then the rates."""


class Smoother:
    """Smooths tracks of one category.

    Args:
        motion: The motion model of the filter that made the states.
        code: The category's position in CATEGORIES.
    """

    def __init__(self, motion: LinearMotion, code: int) -> None:
        self._motion, self._code, order = motion, code, motion.order
        rated = list(_PLACES.items())
        # where value, rate and acceleration of each channel stand in the mean
        self._chains = [[place, len(CHANNELS) + k] for k, (_, place) in enumerate(rated)]
        if order == 3:
            for k in (X, Y):
                self._chains[k].append(len(CHANNELS) + len(rated) + k)
        self._channels = [channel for channel, _ in rated]
        self.size = len(CHANNELS) + len(rated) + (2 if order == 3 else 0)
        self._steps: dict[float, tuple[FloatArray, FloatArray]] = {}

    def step(self, dt_s: float) -> tuple[FloatArray, FloatArray]:
        """(D, D) transition and (D, D) noise of the motion over a time."""
        if dt_s not in self._steps:
            motion = self._motion
            if isinstance(motion, DecayingAcceleration):
                noise = motion.process_noise(dt_s)[self._code]
            else:
                noise = process_noise(motion.densities(), dt_s)[self._code]
            change, spread = np.eye(self.size), np.zeros((self.size, self.size))
            f = motion.transition(dt_s)
            for channel, chain in zip(self._channels, self._chains, strict=True):
                n = len(chain)
                change[np.ix_(chain, chain)] = f[:n, :n]
                spread[np.ix_(chain, chain)] = noise[channel, :n, :n]
            ratio = len(CHANNELS) - 2  # it has no rate
            spread[ratio, ratio] = noise[ratio, 0, 0]
            self._steps[dt_s] = change, spread
        return self._steps[dt_s]

    def smoothed(
        self, stamp_s: FloatArray, mean: FloatArray, covariance: FloatArray, at_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Means and covariances at some times, by all detections of the track.

        Args:
            stamp_s: (K,) times of the detections, ascending.
            mean: (K, D) what the filter knew after each, in the order of `ChannelFilter.names`.
            covariance: (K, D, D) its covariances.
            at_s: (T,) times, ascending, that of every detection among them and none outside.

        Returns:
            (T, D) means, whose headings go on without steps of half turns, and (T, D, D) covariances.
        """
        measured = np.searchsorted(at_s, stamp_s)
        means = np.empty((len(at_s), self.size))
        spreads = np.empty((len(at_s), self.size, self.size))
        means[measured], spreads[measured] = mean, covariance
        for k in np.setdiff1d(np.arange(len(at_s)), measured).tolist():
            change, noise = self.step(float(at_s[k] - at_s[k - 1]))
            means[k] = change @ means[k - 1]
            spreads[k] = change @ spreads[k - 1] @ change.T + noise
        for k in range(len(at_s) - 2, -1, -1):
            change, noise = self.step(float(at_s[k + 1] - at_s[k]))
            predicted = change @ spreads[k] @ change.T + noise
            # by its pseudo-inverse, since a filter may know an entry exactly: a rate of 0 at first sight
            gain = spreads[k] @ change.T @ np.linalg.pinv(predicted, hermitian=True)
            beyond = means[k + 1] - change @ means[k]
            # detectors confuse front and rear: the last heading has seen most evidence
            turn = heading_innovation(means[k + 1, YAW : YAW + 1], (change @ means[k])[YAW : YAW + 1])[0]
            half_turns = beyond[YAW] - turn
            beyond[YAW] = turn
            means[k] += gain @ beyond
            means[k, YAW] += half_turns
            spreads[k] += gain @ (spreads[k + 1] - predicted) @ gain.T
        return means, 0.5 * (spreads + np.swapaxes(spreads, 1, 2))
