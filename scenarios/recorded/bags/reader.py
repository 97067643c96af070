"""Bags as recordings: boxes in the frame of the odometry, poses of the vehicle, one sequence.

Topics are known by their types. A frame whose header is empty has the time at which it was received, and the
pose that was the newest then; what else the messages leave out is dealt with in `scenarios.ros.messages`.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.bags.placing import Places, objects_on_map
from scenarios.recorded.classes import ClassMap, read_classes
from scenarios.recorded.dataset import Dataset, Sequence, finished
from scenarios.recorded.nuscenes import CATEGORY_OF_CLASS as NUSCENES_CLASSES
from scenarios.recorded.simbev.reader import CATEGORY_OF_CLASS as SIMBEV_CLASSES
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.bags.chosen import chosen_topics
from scenarios.ros.definitions import MONITORED_LANES
from scenarios.ros.messages import (
    VELOCITY_FRAMES,
    DetectionMessage,
)
from smartmot.types import CATEGORIES, FloatArray

CLASSES: ClassMap = {**{name: name for name in CATEGORIES}, **NUSCENES_CLASSES, **SIMBEV_CLASSES}
"""Category of each class, in small letters: those of the data sets that detectors are trained on."""

MAX_BACK_S = 1.0
"""Stamps that go back by more begin another drive; by less, messages have overtaken one another."""

_NS = 1e-9


@dataclass(frozen=True, slots=True)
class BagReading:
    """What of a bag is read, and how.

    Args:
        topic: of the boxes; None: the only one of their types.
        odometry: topic of the poses; None: the only one of its type, else transforms.
        velocity_frame: one of VELOCITY_FRAMES.

    Raises:
        DatasetError: the axes are unknown.
    """

    topic: str | None = None
    odometry: str | None = None
    velocity_frame: str = "ignore"

    def __post_init__(self) -> None:
        if self.velocity_frame not in VELOCITY_FRAMES:
            raise DatasetError(
                f"--velocity-frame: unknown {self.velocity_frame!r}; use one of: {', '.join(VELOCITY_FRAMES)}"
            )


def read_bag(path: Path, reading: BagReading | None = None) -> Dataset:
    """Read a bag of ROS 2 or ROS 1: boxes, the vehicle's poses, transforms.

    Args:
        path: folder or file.
        reading: which topics; None: those that are known by their types.

    Raises:
        DatasetError: the bag cannot be read, or it is not clear which topics hold boxes and poses; the
            message names bag, topic and reason.
    """
    reading = reading or BagReading()
    with open_bag(path) as bag:
        topics = chosen_topics(bag, reading.topic, reading.odometry)
        received = bag.messages(*topics.names)
        notes = list(bag.notes)
        lanes = [topic.name for topic in bag.of_type(MONITORED_LANES)]
    if lanes:
        notes.append(f"monitored lanes of {', '.join(lanes)} are not used: areas are made from a map")
    frames = _sorted(path, [m for _, m in received if isinstance(m, DetectionMessage)], notes)
    if not frames:
        raise DatasetError(f"{path}: topic {topics.boxes[0]} has no messages")
    classes = bag_classes(path, CLASSES)
    name = path.resolve().name if path.is_dir() else path.name.partition(".")[0]
    sequence = _sequence(name, frames, Places(received), classes, reading.velocity_frame, notes)
    return finished("bag", [sequence], tuple(notes))


def bag_classes(path: Path, own: ClassMap) -> ClassMap:
    """Classes with those of the user's file beside a bag, in small letters.

    Args:
        path: folder or file of the bag.
        own: the classes that count otherwise.

    Raises:
        DatasetError: the file is wrong.
    """
    classes = read_classes(path if path.is_dir() else path.parent, own)
    return {name.lower(): category for name, category in classes.items()}


def _sorted(path: Path, frames: list[DetectionMessage], notes: list[str]) -> list[DetectionMessage]:
    """Frames in the order of their times, each time once.

    Raises:
        DatasetError: time goes back so far that another drive begins.
    """
    newest_ns, overtaken = None, 0
    for frame in frames:
        if newest_ns is not None and frame.time_ns < newest_ns:
            overtaken += 1
            back_s = _NS * (newest_ns - frame.time_ns)
            if back_s > MAX_BACK_S:
                raise DatasetError(
                    f"{path}: time goes back by {back_s:g} s with the boxes received at "
                    f"{frame.received_ns} ns: the bag holds several drives, or a stamp is wrong"
                )
        newest_ns = frame.time_ns if newest_ns is None else max(newest_ns, frame.time_ns)
    by_time: dict[int, DetectionMessage] = {}
    for frame in frames:
        by_time.setdefault(frame.time_ns, frame)
    unstamped = sum(frame.stamp_ns is None for frame in frames)
    if unstamped:
        notes.append(f"{unstamped} frames with an empty header: the time at which they were received counts")
    if overtaken:
        notes.append(f"{overtaken} frames received after later ones: sorted by their stamps")
    if len(by_time) < len(frames):
        notes.append(f"{len(frames) - len(by_time)} frames left out, for their stamps are there already")
    return [by_time[time_ns] for time_ns in sorted(by_time)]


def _sequence(
    name: str,
    frames: list[DetectionMessage],
    places: Places,
    classes: ClassMap,
    velocity_frame: str,
    notes: list[str],
) -> Sequence:
    """The recording; notes are added."""
    # a frame without a name has the sensor of those with one
    sensors = Counter(frame.frame_id for frame in frames if frame.frame_id)
    usual = sensors.most_common(1)[0][0] if sensors else ""
    found_places = [places.at(frame, frame.frame_id or usual) for frame in frames]
    seen = [(frame, place) for frame, place in zip(frames, found_places, strict=True) if place is not None]
    missing = len(frames) - len(seen)
    notes += places.notes()
    poses: FloatArray | None
    if places.any and seen:
        if missing:
            notes.append(f"{missing} frames left out, for no pose of the vehicle is near enough")
        kept = [frame for frame, _ in seen]
        poses, sensor_poses = (np.array([place[k] for _, place in seen if place]) for k in (0, 1))
    else:
        notes.append(f"no poses of the vehicle: boxes stay in the frame {usual or 'of the sensor'}")
        kept, poses = frames, None
        sensor_poses = np.tile(np.eye(4), (len(kept), 1, 1))
    objects = objects_on_map(kept, sensor_poses, classes, velocity_frame, notes)
    stamps = np.array([frame.time_ns for frame in kept], dtype=np.int64)
    stamp_s = np.asarray(stamps * _NS, dtype=np.float64)
    frame_name = tuple(map(str, stamps.tolist()))
    return Sequence(name, stamp_s, frame_name, objects, world_SE3_ego=poses, stamp_ns=stamps)
