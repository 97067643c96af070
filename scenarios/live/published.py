"""What perception publishes, as serialised ROS messages by topic.

Sources: visualization_msgs, vision_msgs 4.x, std_msgs and diagnostic_msgs of ROS 2; topics of the PREMOVE
document and of the SmartMOT authors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from struct import Struct

from scenarios.live.counts import Diagnostics
from scenarios.live.outputs import FrameOutput, Marker, TrackedBoxes
from scenarios.live.perception import Output
from scenarios.live.topics import AREA, COLLISION, DIAGNOSTICS, MARKERS, NEAREST, TRACKS, PublishedTopic
from scenarios.ros.cdr import HEAD, CdrWriter

NO_OBJECT_M = 50_000.0
"""Distance of the nearest object on the wire where there is none (SmartMOT authors)."""

DIAGNOSTIC_NAME = "smartmot: perception"
HARDWARE_ID = "smartmot"

_NS_PER_S = 1_000_000_000
_MAX_ID = 2**31
"""Numbers of markers are int32."""

_EMPTY_TEXT = b"\x01\x00\x00\x00\x00"
"""A string without characters: the length counts the zero at its end."""
_NONE = b"\x00\x00\x00\x00"
"""A sequence without elements."""

_BOOL, _BYTE, _DOUBLE = Struct("<?"), Struct("<B"), Struct("<d")
_STAMP = Struct("<iI")
_NUMBERS = Struct("<iii")
"""id, type and action of a Marker."""
_POSE_SCALE = Struct("<10d")
"""pose and scale of a Marker."""
_COLOUR_LIFETIME = Struct("<4fiI?")
"""color, lifetime and frame_locked of a Marker."""
_POINT = Struct("<3d")
_RESULT_BOX = Struct("<d7d36d7d3d")
"""score, pose and covariance of the result, bbox of a Detection3D: all float64."""

_UNSET_BEFORE_TEXT = (
    _NONE  # colors
    + _EMPTY_TEXT + bytes(3)  # texture_resource
    + bytes(8) + _EMPTY_TEXT + bytes(3)  # header of texture
    + _EMPTY_TEXT + bytes(3) + _NONE  # format and data of texture
    + _NONE  # uv_coordinates
)  # fmt: skip
"""Fields of a Marker between points and text that are never set."""
_UNSET_AFTER_TEXT = (
    _EMPTY_TEXT + bytes(3)  # mesh_resource
    + _EMPTY_TEXT + bytes(3) + _NONE  # mesh_file: filename, data
    + b"\x00"  # mesh_use_embedded_materials
)  # fmt: skip
"""Fields of a Marker after its text, none of which is set."""
_NO_COVARIANCE = (0.0,) * 36


def published(output: Output) -> list[tuple[PublishedTopic, bytes]]:
    """Topics and messages of one output; without a decision there is no message of one."""
    if isinstance(output, Diagnostics):
        return [(DIAGNOSTICS, _diagnostics(output))]
    header = _header(output.stamp_ns, output.frame_id)
    messages = [(MARKERS, _markers(output.markers, header)), (TRACKS, _tracks(output.tracks, header))]
    decision = output.decision
    if decision is not None:
        nearest_m = NO_OBJECT_M if decision.nearest_m is None else decision.nearest_m
        messages += [
            (COLLISION, HEAD + _BOOL.pack(decision.predicted_collision)),
            (NEAREST, HEAD + _DOUBLE.pack(nearest_m)),
            (AREA, _markers(output.area_markers, header)),
        ]
    return messages


def published_time_ns(output: Output) -> int:
    """When an output counts as published in a bag: when its detections were received."""
    return output.received_ns if isinstance(output, FrameOutput) else output.stamp_ns


def _header(stamp_ns: int, frame_id: str) -> bytes:
    """A std_msgs/Header, which may stand wherever something is aligned to 4."""
    writer = CdrWriter()
    writer.values(_STAMP, 4, *divmod(stamp_ns, _NS_PER_S))
    writer.text(frame_id)
    return bytes(writer.data[len(HEAD) :])


def _pose(position_m: Sequence[float], yaw_rad: float) -> tuple[float, ...]:
    """Position, and x, y, z and w of a turn about z."""
    return (*position_m, 0.0, 0.0, math.sin(0.5 * yaw_rad), math.cos(0.5 * yaw_rad))


def _markers(markers: Sequence[Marker], header: bytes) -> bytes:
    """A visualization_msgs/MarkerArray."""
    writer = CdrWriter()
    writer.count(len(markers))
    for marker in markers:
        writer.copied(header)
        writer.text(marker.ns)
        writer.values(_NUMBERS, 4, marker.marker_id % _MAX_ID, marker.kind, marker.action)
        writer.values(_POSE_SCALE, 8, *_pose(marker.position_m, marker.yaw_rad), *marker.scale_m)
        sec = int(marker.lifetime_s)
        nanosec = min(round((marker.lifetime_s - sec) * _NS_PER_S), _NS_PER_S - 1)
        writer.values(_COLOUR_LIFETIME, 4, *marker.colour, sec, nanosec, False)
        writer.count(len(marker.points_m))
        for point_m in marker.points_m:
            writer.values(_POINT, 8, *point_m)
        writer.copied(_UNSET_BEFORE_TEXT)
        writer.text(marker.text)
        writer.copied(_UNSET_AFTER_TEXT)
    return bytes(writer.data)


def _tracks(tracks: TrackedBoxes, header: bytes) -> bytes:
    """A vision_msgs/Detection3DArray: one result and the identifier of the track in each."""
    rows: Iterable[tuple[int, str, float, list[float], list[float], float]] = zip(
        tracks.track_id.tolist(),
        tracks.category.tolist(),
        tracks.score.tolist(),
        tracks.center_m.tolist(),
        tracks.size_m.tolist(),
        tracks.yaw_rad.tolist(),
        strict=True,
    )
    writer = CdrWriter()
    writer.copied(header)
    writer.count(len(tracks))
    for number, name, score, center_m, size_m, yaw_rad in rows:
        pose = _pose(center_m, yaw_rad)
        writer.copied(header)
        writer.count(1)
        writer.text(name)
        writer.values(_RESULT_BOX, 8, score, *pose, *_NO_COVARIANCE, *pose, *size_m)
        writer.text(str(number))
    return bytes(writer.data)


def _diagnostics(status: Diagnostics) -> bytes:
    """A diagnostic_msgs/DiagnosticArray with one status."""
    writer = CdrWriter()
    writer.copied(_header(status.stamp_ns, ""))
    writer.count(1)
    writer.values(_BYTE, 1, status.level)
    for text in (DIAGNOSTIC_NAME, status.message, HARDWARE_ID):
        writer.text(text)
    writer.count(len(status.values))
    for key, value in status.values:
        writer.text(key)
        writer.text(value)
    return bytes(writer.data)
