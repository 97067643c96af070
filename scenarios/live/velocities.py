"""In which axes a detector's velocities are: compared with how far its boxes move."""

from __future__ import annotations

from collections import deque

import numpy as np

from scenarios.live.placing import PlacedFrame
from smartmot.types import FloatArray, Tracks

WINDOW_S = 0.5
"""Displacements are taken over so long: boxes that are off by 0.1 m make 0.3 m/s then."""
LEAST_MPS = 1.0
"""Slower objects say nothing of axes."""
LEAST_SAMPLES = 20
AGREES = 0.3
"""Velocities agree where the sum of their errors is under this share of the displacements. Axes that are
turned by 17 degrees make as much."""

_NS = 1e-9


class VelocityCheck:
    """Sums up, for both axes in question, how far velocities are from displacements."""

    def __init__(self) -> None:
        self._centers: dict[int, deque[tuple[int, FloatArray]]] = {}
        self._moved_mps = 0.0
        self._errors_mps = {"sensor": 0.0, "world": 0.0}
        self._samples = 0

    def see(self, stamp_ns: int, tracks: Tracks, frame: PlacedFrame, map_SE3_sensor: FloatArray) -> None:
        """Take a frame.

        Args:
            stamp_ns: of the detections.
            tracks: M tracks.
            frame: the boxes.
            map_SE3_sensor: (4, 4) pose of the sensor.
        """
        before, self._centers = self._centers, {}
        if not len(frame.center_m) or not np.isfinite(frame.sent_mps).any():
            return
        for k in (tracks.coasted_s <= 0.0).nonzero()[0].tolist():
            offset = frame.center_m - tracks.boxes.center_m[k]
            nearest = int((offset * offset).sum(axis=1).argmin())
            track_id, center = int(tracks.track_id[k]), frame.center_m[nearest]
            centers = self._centers[track_id] = before.get(track_id, deque())
            centers.append((stamp_ns, center))
            while len(centers) > 2 and (stamp_ns - centers[1][0]) * _NS >= WINDOW_S:
                centers.popleft()
            elapsed_s = (stamp_ns - centers[0][0]) * _NS
            if elapsed_s >= WINDOW_S:
                moved = (center - centers[0][1]) / elapsed_s
                self._compare(moved, frame.sent_mps[nearest], map_SE3_sensor)

    def _compare(self, moved_mps: FloatArray, sent_mps: FloatArray, map_SE3_sensor: FloatArray) -> None:
        speed = float(np.hypot(*moved_mps))
        if speed < LEAST_MPS or not np.isfinite(sent_mps).all():
            return
        turned = map_SE3_sensor[:3, :3] @ sent_mps
        self._samples += 1
        self._moved_mps += speed
        self._errors_mps["sensor"] += float(np.hypot(*(moved_mps - turned[:2])))
        self._errors_mps["world"] += float(np.hypot(*(moved_mps - sent_mps[:2])))

    def agreeing(self) -> tuple[str, ...]:
        """Axes in which velocities agree with displacements; none as long as too little has moved."""
        if self._samples < LEAST_SAMPLES:
            return ()
        return tuple(name for name, error in self._errors_mps.items() if error <= AGREES * self._moved_mps)

    def note(self, velocity_frame: str) -> str | None:
        """What a user should know about the axes that were chosen; None: nothing."""
        if self._samples < LEAST_SAMPLES:
            return None
        agreeing = self.agreeing()
        if velocity_frame in agreeing:
            return None
        if not agreeing:
            if velocity_frame == "ignore":
                return None
            return (
                f"the detector's velocities agree with the displacement of tracks in no axes, also not in "
                f"those of velocity_frame {velocity_frame}: use ignore"
            )
        axes = " and ".join(agreeing)
        where = f"the detector's velocities agree with the displacement of tracks in the axes of: {axes}"
        if velocity_frame == "ignore":
            return f"{where}; they are not used (velocity_frame ignore)"
        return f"{where}; velocity_frame is {velocity_frame}"
