"""A recorded drive as a source of frames: it goes on as it was driven, whatever is commanded."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from scenarios.errors import DatasetError, ScenarioError
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.motion import LEAST_STEP_S, center_poses
from scenarios.sources.frames import Frame, StepResult
from smartmot.decision.rules import Command
from smartmot.geometry import wrap_angle
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.types import Detections, EgoState, FloatArray, IntArray

END_OF_RECORDING = "end_of_recording"
"""Why a recorded source ends."""

PATH_STEP_M = 0.5
"""Points of the recorded path are so far apart: positions of a standing vehicle would give any direction."""


class RecordedSource:
    """Frames of one sequence.

    The ego's speed and turn rate are those since the frame before, by differences of the recorded poses; the
    first frame has the second's. The speed is negative where the vehicle moves against its heading.
    Accelerations are not derived: they are 0. A brake rule that holds its request until standstill holds it
    as long as the recorded vehicle goes on: what counts is when it began.

    Args:
        sequence: The recording.
        lane_map: The map that perception uses, in the frame of the recorded poses; None: there is none.
        hindsight_s: How far ahead the planned path is known: it is the way that the vehicle then drove, which
            no planner could know for sure. The path reaches at least so far and at most twice as far, but not
            beyond the recording, and is renewed as often. Of a vehicle that stands all the while it is the
            way straight ahead. None: frames have no path.
        length_m: The vehicle's outline along its heading.
        width_m: The vehicle's outline across it.
        center_ahead_m: How far the middle of the outline is ahead of the point whose poses are recorded
            (nuScenes: the rear axle; KITTI: the camera).
        needs_odometry: Whether to refuse a recording without poses. Otherwise its ego stands at the origin of
            its own frame, where all velocities are relative to it. That is enough for tracking; decisions
            would be those of a standing vehicle.

    Raises:
        DatasetError: There are no poses although they are needed, or they are impossible.
        ScenarioError: The hindsight is not positive.
    """

    def __init__(
        self,
        sequence: Sequence,
        lane_map: LaneMap | None = None,
        *,
        hindsight_s: float | None = None,
        length_m: float = 4.4,
        width_m: float = 1.8,
        center_ahead_m: float = 0.0,
        needs_odometry: bool = True,
    ) -> None:
        if needs_odometry and sequence.world_SE3_ego is None:
            raise DatasetError(f"sequence {sequence.name} has no ego poses, which decisions need")
        if hindsight_s is not None and not 0.0 < hindsight_s < math.inf:
            raise ScenarioError(f"recorded source: hindsight_s must be positive, got {hindsight_s}")
        pose = center_poses(sequence, center_ahead_m)
        self._ego = np.column_stack((pose, *pose_rates(sequence.stamp_s, pose)))
        self._height_m = sequence.ego_heights_m()
        self._outline = (length_m, width_m)
        self._sequence, self._lane_map = sequence, lane_map
        self._hindsight_s = hindsight_s
        self._window: int | None = None
        self._path: PlannedPath | None = None
        self._next: int | None = None
        self._detections: Iterator[Detections] | None = None

    def __getstate__(self) -> dict[str, object]:
        """All but the iterator, so that a source can be copied and pickled at any frame."""
        return self.__dict__ | {"_detections": None}

    def start(self) -> StepResult:
        """Go to the first frame; see `FrameSource`."""
        if self._next is not None:
            raise ScenarioError("recorded source: already started; make a new one")
        self._next = 0
        return self.step(None)

    def step(self, command: Command | None) -> StepResult:
        """Go on to the next frame; the command changes nothing. See `FrameSource`."""
        k, count = self._next, len(self._sequence)
        if k is None or k > count:
            raise ScenarioError(f"recorded source: {'not started' if k is None else 'at its end'}")
        self._next = k + 1
        if k == count:
            return StepResult(None, END_OF_RECORDING)
        if self._detections is None:
            self._detections = self._sequence.frames(k)
        # the detections come first: they refuse a stamp that is none
        return StepResult(self._frame(k, next(self._detections)))

    def _frame(self, k: int, detections: Detections) -> Frame:
        x_m, y_m, yaw_rad, speed_mps, yaw_rate_radps = self._ego[k].tolist()
        length_m, width_m = self._outline
        ego = EgoState(
            *(detections.stamp_s, x_m, y_m, yaw_rad, speed_mps),
            yaw_rate_radps=yaw_rate_radps,
            length_m=length_m,
            width_m=width_m,
        )
        return Frame(ego.stamp_s, ego, detections, lane_map=self._lane_map, path=self._path_at(k))

    def _path_at(self, k: int) -> PlannedPath | None:
        """The recorded path around a frame, the same object until it is renewed."""
        if self._hindsight_s is None:
            return None
        elapsed_s = self._sequence.stamp_s - self._sequence.stamp_s[0]
        window = int(elapsed_s[k] // self._hindsight_s)
        if window != self._window:
            first, last = (np.searchsorted(elapsed_s, (window + n) * self._hindsight_s) for n in (0, 2))
            rows = first + spaced(self._ego[first:last, :2], PATH_STEP_M)
            points = self._ego[rows, :2]
            if len(points) < 2:
                x_m, y_m, yaw_rad = self._ego[k, :3].tolist()
                ahead = (x_m + PATH_STEP_M * math.cos(yaw_rad), y_m + PATH_STEP_M * math.sin(yaw_rad))
                rows, points = np.array([k, k]), np.array([(x_m, y_m), ahead])
            heights_m = None if self._height_m is None else self._height_m[rows]
            self._window, self._path = window, PlannedPath.through(points, heights_m)
        return self._path


def pose_rates(stamp_s: FloatArray, pose: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Speeds and turn rates since the frame before; the first frame has the second's.

    Args:
        stamp_s: (F,) times.
        pose: (F, 3) x, y and yaw.

    Returns:
        (F,) speeds along the heading, m/s, negative against it, and (F,) turn rates, rad/s.
    """
    if len(stamp_s) < 2:
        return np.zeros(len(stamp_s)), np.zeros(len(stamp_s))
    with np.errstate(over="ignore"):  # stamps that are none are refused with their frame
        elapsed = np.maximum(np.diff(stamp_s), LEAST_STEP_S)
    step = np.diff(pose, axis=0)
    ahead = step[:, 0] * np.cos(pose[1:, 2]) + step[:, 1] * np.sin(pose[1:, 2])
    speed = np.copysign(np.linalg.norm(step[:, :2], axis=1), ahead) / elapsed
    yaw_rate = wrap_angle(step[:, 2]) / elapsed
    return np.concatenate((speed[:1], speed)), np.concatenate((yaw_rate[:1], yaw_rate))


def spaced(points_m: FloatArray, least_m: float) -> IntArray:
    """The first row of (P, 2) points, and that of each at least so far from the one kept before."""
    points = points_m.tolist()
    kept: list[int] = []
    for row, point in enumerate(points):
        if not kept or math.dist(point, points[kept[-1]]) >= least_m:
            kept.append(row)
    return np.array(kept, dtype=np.int64)
