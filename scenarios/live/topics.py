"""Topics of perception, and the quality of service of each: what a node reads, what node and bags publish."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenarios.ros.definitions import DETECTION_3D_ARRAY, ODOMETRY, PREDICTION_ARRAY, TRANSFORMS

if TYPE_CHECKING:
    from scenarios.live.detectors import LiveDetector

STATIC_TRANSFORMS = "/tf_static"


@dataclass(frozen=True, slots=True)
class ReadTopic:
    """One topic that is read; its last messages are kept until they are taken.

    Args:
        name: as long as it is not remapped.
        type_name: of its messages.
        depth: so many messages are kept.
        reliable: whether the sender has to send again what was lost; else it may.
        latched: whether what was sent before the node came is asked for (transient local).
    """

    name: str
    type_name: str
    depth: int
    reliable: bool = True
    latched: bool = False


READ = (
    ReadTopic("/bevfusion_detections", PREDICTION_ARRAY, 10),
    ReadTopic("/detections", DETECTION_3D_ARRAY, 10, reliable=False),
    ReadTopic("/localization/pose", ODOMETRY, 10, reliable=False),
    ReadTopic("/tf", TRANSFORMS, 100),
    # every broadcaster keeps one message; a listener keeps those of many, as tf2_ros does
    ReadTopic(STATIC_TRANSFORMS, TRANSFORMS, 100, latched=True),
)


@dataclass(frozen=True, slots=True)
class PublishedTopic:
    """A topic that perception publishes on, reliable and volatile.

    Args:
        name: default name.
        type_name: of its messages.
        depth: messages kept for a slow subscriber.
    """

    name: str
    type_name: str
    depth: int


MARKER_ARRAY = "visualization_msgs/msg/MarkerArray"

MARKERS = PublishedTopic("/tracked_objects", MARKER_ARRAY, 10)
TRACKS = PublishedTopic("/smartmot/tracks", DETECTION_3D_ARRAY, 10)
COLLISION = PublishedTopic("/t4ac/perception/monitors/predicted_collision", "std_msgs/msg/Bool", 20)
NEAREST = PublishedTopic("/t4ac/perception/monitors/nearest_object_distance", "std_msgs/msg/Float64", 20)
AREA = PublishedTopic("/t4ac/perception/monitors/individual_monitorized_area", MARKER_ARRAY, 20)
DIAGNOSTICS = PublishedTopic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", 10)

PUBLISHED = (MARKERS, TRACKS, COLLISION, NEAREST, AREA, DIAGNOSTICS)
"""All of them."""


def read_topics(detectors: Sequence[LiveDetector]) -> tuple[tuple[ReadTopic, str], ...]:
    """Topics that a node reads, and whose boxes are on them; "" where there is one detector, or none.

    Args:
        detectors: several, whose topics are in the place of those of boxes; empty: there is one.
    """
    own = tuple(
        (ReadTopic(each.topic, each.type_name, each.depth, each.reliable), each.name) for each in detectors
    )
    others = [topic for topic in READ if not own or topic.type_name in (ODOMETRY, TRANSFORMS)]
    return (*own, *((topic, "") for topic in others))
