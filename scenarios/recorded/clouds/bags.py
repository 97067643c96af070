"""Clouds in bags of ROS: sensor_msgs/PointCloud2."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.clouds.fields import NamedCloud, cloud_from_rows, require_rings, rows_from_cloud
from scenarios.ros.bags.bag import Bag, open_bag
from scenarios.ros.bags.decoding import decoded
from scenarios.ros.bags.writer import MessageWriter
from scenarios.ros.definitions import POINT_CLOUD, ros2_types
from scenarios.ros.point_rows import DATATYPES, CloudMessage

TOPIC = "/points"
"""Where clouds are written without a name."""

FRAME = "lidar"
"""Frame of clouds that do not name theirs."""

FRAME_S = 0.1
"""Between clouds that have no stamps: LiDARs turn at 10 Hz."""


@dataclass(frozen=True, slots=True)
class CloudTopic:
    """A topic with clouds.

    Args:
        name: its name.
        type_name: type of its messages.
        depth: messages kept for a slow subscriber, as sensors publish.
    """

    name: str = TOPIC
    type_name: str = POINT_CLOUD
    depth: int = 5


def read_bag_clouds(path: Path, topic: str | None = None) -> Iterator[NamedCloud]:
    """Clouds of a bag in their order, named by their number from 000000 on; one at a time in memory.

    Args:
        path: folder or file of a bag.
        topic: which topic; None: the only one with clouds.

    Raises:
        DatasetError: the bag cannot be read, or has no such topic, or several and none is named.
    """
    with open_bag(path) as bag:
        name = _topic_name(bag, topic)
        for number, raw in enumerate(bag.raw((name,))):
            try:
                message = decoded(raw)
                if not isinstance(message, CloudMessage):
                    raise DatasetError(f"topic {name} holds no {POINT_CLOUD}")
                named = cloud_from_rows(
                    message.rows, f"{number:06d}", message.frame_id, message.time_ns * 1e-9
                )
            except ValueError as error:
                raise DatasetError(f"{path}: cloud {number} of {name}: {error}") from None
            notes = list(named.notes)
            if message.stamp_ns is None:
                notes.append("no stamp: the time of receipt counts")
            yield replace(named, notes=tuple(notes))


def _topic_name(bag: Bag, topic: str | None) -> str:
    names = sorted({each.name for each in bag.of_type(POINT_CLOUD)})
    listed = ", ".join(names) or "none"
    if topic is not None:
        if topic not in names:
            raise DatasetError(f"{bag.path}: no topic {topic} with clouds; there are {listed}")
        return topic
    if len(names) != 1:
        raise DatasetError(f"{bag.path}: topics with clouds: {listed}; one is needed (--topic)")
    return names[0]


def write_bag_clouds(path: Path, clouds: Iterable[NamedCloud], topic: str | None = None) -> int:
    """Write clouds as a bag of ROS 2; those without stamps are 0.1 s apart from 0 s on.

    Args:
        path: folder to be made, or a file .mcap or .db3.
        clouds: what to write, in the order of time.
        topic: name of the topic; None: `TOPIC`.

    Returns:
        How many.

    Raises:
        DatasetError: the path is there already or cannot be written.
    """
    target = CloudTopic(topic or TOPIC)
    with MessageWriter(path, (target,)) as bag:
        for number, named in enumerate(clouds):
            stamp_s = named.cloud.stamp_s
            time_ns = round(1e9 * (number * FRAME_S if stamp_s is None else stamp_s))
            if time_ns < 0:
                raise DatasetError(f"{named.name}: ROS has no time before 1970, the stamp is {stamp_s} s")
            bag.put(target, time_ns, _message(named, time_ns))
        return bag.count


def _message(named: NamedCloud, time_ns: int) -> Any:
    """A PointCloud2 of rosbags' classes."""
    types = ros2_types().types
    require_rings(named.cloud)
    rows = rows_from_cloud(named.cloud)
    codes = {kind: code for code, kind in DATATYPES.items()}
    layout: Any = rows.dtype.fields
    fields = [
        types["sensor_msgs/msg/PointField"](
            name=name, offset=int(layout[name][1]), datatype=codes[layout[name][0].str[1:]], count=1
        )
        for name in rows.dtype.names or ()
    ]
    seconds, nanoseconds = divmod(time_ns, 1_000_000_000)
    header = types["std_msgs/msg/Header"](
        stamp=types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds),
        frame_id=named.cloud.frame or FRAME,
    )
    step = rows.dtype.itemsize
    return types[POINT_CLOUD](
        header=header,
        height=1,
        width=len(rows),
        fields=fields,
        is_bigendian=False,
        point_step=step,
        row_step=step * len(rows),
        data=np.frombuffer(rows.tobytes(), dtype=np.uint8),
        is_dense=True,
    )
