"""A recorded drive whose labels stand in for detections, with the errors of a sensor."""

from __future__ import annotations

from collections.abc import Sequence as Many
from dataclasses import replace
from typing import Any

import numpy as np

from scenarios.errors import DatasetError, ScenarioError
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.motion import LabelMotion
from scenarios.sensors.interfaces import SensorChain, check_detections
from scenarios.sensors.suite import joined_detections
from scenarios.sensors.world import World
from scenarios.sources.frames import Frame, StepResult
from scenarios.sources.recorded import END_OF_RECORDING, RecordedSource
from smartmot.decision.rules import Command
from smartmot.plugins import failure
from smartmot.types import Boxes, Detections, EgoState


class LabelledSource:
    """Frames of one sequence, made of its labels: measured at their time, they arrive after the latency.

    The vehicle's state at the arrival lies between the recorded ones. What would arrive after the end of the
    recording is left out.

    Args:
        sequence: the recording, with labels.
        chains: sensors and their detectors; they measure at each frame of the recording, whatever their rate.
        source: the same recording as a source of frames: of the vehicle, the map and the path.

    Raises:
        DatasetError: there are no labels.
    """

    def __init__(self, sequence: Sequence, chains: Many[SensorChain[Any]], source: RecordedSource) -> None:
        if sequence.labels is None:
            raise DatasetError(f"sequence {sequence.name} has no labels to stand in for detections")
        self._source, self._chains = source, tuple(chains)
        self._motion = LabelMotion(sequence.labels, sequence.stamp_s)
        self._speed_mps, self._category = self._motion.speed_mps, self._motion.category
        self._latency_s = max(chain.latency_s for chain in chains)
        self._stamp_s = sequence.stamp_s
        self._frames: list[Frame] = []
        self._next: int | None = None

    def start(self) -> StepResult:
        """Go to the first frame; see `FrameSource`."""
        if self._next is not None:
            raise ScenarioError("labelled source: already started; make a new one")
        result = self._source.start()
        while result.frame is not None:
            self._frames.append(result.frame)
            result = self._source.step(None)
        self._next = 0
        return self.step(None)

    def step(self, command: Command | None) -> StepResult:
        """Go on to the next frame; the command changes nothing. See `FrameSource`."""
        k = self._next
        if k is None or k > len(self._frames):
            raise ScenarioError(f"labelled source: {'not started' if k is None else 'at its end'}")
        self._next = k + 1
        if k == len(self._frames):
            return StepResult(None, END_OF_RECORDING)
        frame = self._frames[k]
        ego = self._state_at(frame.stamp_s + self._latency_s)
        if ego is None:
            self._next = len(self._frames) + 1
            return StepResult(None, END_OF_RECORDING)
        return StepResult(
            replace(frame, stamp_s=ego.stamp_s, ego=ego, detections=self._detections(k, frame.ego))
        )

    def _state_at(self, time_s: float) -> EgoState | None:
        """The vehicle's state between two frames; None after the last."""
        after = int(np.searchsorted(self._stamp_s, time_s - _SAME_S))
        if after == len(self._frames):
            return None
        last = self._frames[after].ego
        if abs(last.stamp_s - time_s) <= _SAME_S:
            return last
        first = self._frames[after - 1].ego
        share = (time_s - first.stamp_s) / (last.stamp_s - first.stamp_s)
        turn = float(np.remainder(last.yaw_rad - first.yaw_rad + np.pi, 2.0 * np.pi) - np.pi)
        return replace(
            last,
            stamp_s=time_s,
            x_m=first.x_m + share * (last.x_m - first.x_m),
            y_m=first.y_m + share * (last.y_m - first.y_m),
            yaw_rad=first.yaw_rad + share * turn,
        )

    def _detections(self, k: int, ego: EgoState) -> Detections:
        """What the sensors make of the labels of a frame."""
        world = self._world(k, ego.stamp_s)
        parts = []
        for chain in self._chains:
            try:
                detections = chain.detector.detect(chain.sensor.measure(world, ego))
            except (Exception, SystemExit) as error:  # whatever a user's code may raise
                raise failure(f"{chain.name}, frame at {ego.stamp_s:g} s", error) from error
            check_detections(chain.name, "detect", detections, ego.stamp_s)
            parts.append(detections)
        return parts[0] if len(parts) == 1 else joined_detections(parts)

    def _world(self, k: int, time_s: float) -> World:
        """All objects of the recording, those there that are labelled in a frame."""
        motion, rows, count = self._motion, self._motion.rows[k], len(self._motion.objects)
        labels, index = motion.labels, motion.index[rows]
        center, size, yaw = np.zeros((count, 2)), np.ones((count, 2)), np.zeros(count)
        height, speed, there = np.ones(count), np.zeros(count), np.zeros(count, dtype=np.bool_)
        center[index], size[index], yaw[index] = (
            labels.center_m[rows],
            labels.size_m[rows],
            labels.yaw_rad[rows],
        )
        height[index], speed[index], there[index] = labels.height_m[rows], self._speed_mps[rows], True
        boxes, identity = Boxes(center, size, yaw), np.arange(count)
        return World(time_s, boxes, speed, height, identity, self._category, there, there)


def without_detections(sequence: Sequence) -> Sequence:
    """The recording without what a detector reported."""
    return replace(sequence, detections=Objects.empty())


_SAME_S = 1e-6
"""Times this near are one frame's."""
