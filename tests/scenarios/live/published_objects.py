"""What perception publishes as objects of rosbags' classes, by the names of all fields."""

from __future__ import annotations

import math
from typing import Any

from scenarios.live.counts import Diagnostics
from scenarios.live.outputs import Marker, TrackedBoxes
from scenarios.live.perception import Output
from scenarios.live.published import DIAGNOSTIC_NAME, HARDWARE_ID, NO_OBJECT_M
from scenarios.live.topics import (
    AREA,
    COLLISION,
    DIAGNOSTICS,
    MARKER_ARRAY,
    MARKERS,
    NEAREST,
    TRACKS,
    PublishedTopic,
)
from scenarios.ros.definitions import DETECTION_3D_ARRAY
from scenarios.ros.making import Make

_NS_PER_S = 1_000_000_000


class MessageObjects:
    """Makes messages of what perception puts out.

    Args:
        make: makes one message, as `make("std_msgs/msg/Bool", data=True)`.
    """

    def __init__(self, make: Make) -> None:
        self._make = make

    def messages(self, output: Output) -> list[tuple[PublishedTopic, Any]]:
        """Topics and messages of one output; without a decision there is no message of one."""
        if isinstance(output, Diagnostics):
            return [(DIAGNOSTICS, self._diagnostics(output))]
        header = self._header(output.stamp_ns, output.frame_id)
        made = [
            (MARKERS, self._markers(output.markers, header)),
            (TRACKS, self._tracks(output.tracks, header)),
        ]
        decision = output.decision
        if decision is not None:
            nearest_m = NO_OBJECT_M if decision.nearest_m is None else decision.nearest_m
            made += [
                (COLLISION, self._make(COLLISION.type_name, data=bool(decision.predicted_collision))),
                (NEAREST, self._make(NEAREST.type_name, data=float(nearest_m))),
                (AREA, self._markers(output.area_markers, header)),
            ]
        return made

    def _header(self, stamp_ns: int, frame_id: str) -> Any:
        sec, nanosec = divmod(stamp_ns, _NS_PER_S)
        stamp = self._make("builtin_interfaces/msg/Time", sec=sec, nanosec=nanosec)
        return self._make("std_msgs/msg/Header", stamp=stamp, frame_id=frame_id)

    def _point(self, xyz: tuple[float, ...], name: str = "geometry_msgs/msg/Point") -> Any:
        x, y, z = xyz
        return self._make(name, x=x, y=y, z=z)

    def _pose(self, position_m: tuple[float, ...], yaw_rad: float) -> Any:
        turn = self._make(
            "geometry_msgs/msg/Quaternion",
            x=0.0,
            y=0.0,
            z=math.sin(0.5 * yaw_rad),
            w=math.cos(0.5 * yaw_rad),
        )
        return self._make("geometry_msgs/msg/Pose", position=self._point(position_m), orientation=turn)

    def _markers(self, markers: tuple[Marker, ...], header: Any) -> Any:
        return self._make(MARKER_ARRAY, markers=[self._marker(marker, header) for marker in markers])

    def _marker(self, marker: Marker, header: Any) -> Any:
        red, green, blue, opacity = marker.colour
        sec = int(marker.lifetime_s)
        return self._make(
            "visualization_msgs/msg/Marker",
            header=header,
            ns=marker.ns,
            id=marker.marker_id % 2**31,
            type=marker.kind,
            action=marker.action,
            pose=self._pose(marker.position_m, marker.yaw_rad),
            scale=self._point(marker.scale_m, "geometry_msgs/msg/Vector3"),
            color=self._make("std_msgs/msg/ColorRGBA", r=red, g=green, b=blue, a=opacity),
            lifetime=self._make(
                "builtin_interfaces/msg/Duration",
                sec=sec,
                nanosec=min(round((marker.lifetime_s - sec) * _NS_PER_S), _NS_PER_S - 1),
            ),
            points=[self._point(point) for point in marker.points_m],
            text=marker.text,
        )

    def _tracks(self, tracks: TrackedBoxes, header: Any) -> Any:
        rows = zip(
            tracks.track_id.tolist(),
            tracks.category.tolist(),
            tracks.score.tolist(),
            tracks.center_m.tolist(),
            tracks.size_m.tolist(),
            tracks.yaw_rad.tolist(),
            strict=True,
        )
        detections = []
        for number, name, score, center, size, yaw in rows:
            pose = self._pose(center, yaw)
            result = self._make(
                "vision_msgs/msg/ObjectHypothesisWithPose",
                hypothesis=self._make("vision_msgs/msg/ObjectHypothesis", class_id=name, score=score),
                pose=self._make("geometry_msgs/msg/PoseWithCovariance", pose=pose),
            )
            box = self._make(
                "vision_msgs/msg/BoundingBox3D",
                center=pose,
                size=self._point(size, "geometry_msgs/msg/Vector3"),
            )
            detections.append(
                self._make(
                    "vision_msgs/msg/Detection3D", header=header, results=[result], bbox=box, id=str(number)
                )
            )
        return self._make(DETECTION_3D_ARRAY, header=header, detections=detections)

    def _diagnostics(self, status: Diagnostics) -> Any:
        values = [
            self._make("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in status.values
        ]
        made = self._make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=status.level,
            name=DIAGNOSTIC_NAME,
            message=status.message,
            hardware_id=HARDWARE_ID,
            values=values,
        )
        header = self._header(status.stamp_ns, "")
        return self._make(DIAGNOSTICS.type_name, header=header, status=[made])
