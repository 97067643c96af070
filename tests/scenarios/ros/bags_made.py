"""Bags of the shared messages, written by rosbags and by hand."""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterable
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer
from rosbags.rosbag1 import Writer as Ros1Writer

from scenarios.ros.bags.bag import open_bag
from scenarios.ros.definitions import BEV_DETECTIONS, MONITORED_LANES, ros1_types, ros2_types

DATA = Path(__file__).parents[2] / "data" / "ros2" / "bevfusion"
SQLITE = DATA / "tracker_input_sqlite3"
MCAP = DATA / "tracker_input_mcap"
DETECTIONS, POSE = "/bevfusion_detections", "/localization/pose"


@dataclass(frozen=True)
class Stored:
    """A message to be written."""

    topic: str
    type_name: str
    received_ns: int
    data: bytes
    definition: str = ""
    encoding: str = "cdr"


def stored(path: Path = MCAP) -> list[Stored]:
    """The messages of the shared bag."""
    with open_bag(path) as bag:
        return [
            Stored(m.topic.name, m.topic.type_name, m.received_ns, bytes(m.data), m.topic.definition)
            for m in bag.raw()
        ]


def write_mcap(
    path: Path,
    rows: Iterable[Stored],
    compression: CompressionType = CompressionType.NONE,
    **options: Any,
) -> Path:
    """An MCAP file by the library of its authors."""
    writer = Writer(str(path), compression=compression, **options)
    writer.start(profile="ros2", library="test")
    channels: dict[tuple[str, str], int] = {}
    for row in rows:
        key = (row.topic, row.type_name)
        if key not in channels:
            schema = writer.register_schema(row.type_name, "ros2msg", row.definition.encode())
            channels[key] = writer.register_channel(row.topic, row.encoding, schema)
        writer.add_message(channels[key], row.received_ns, row.data, row.received_ns)
    writer.finish()
    return path


def write_sqlite(path: Path, rows: Iterable[Stored]) -> Path:
    """A SQLite file as ROS 2 Foxy wrote it: without schema version, hashes and definitions."""
    with closing(sqlite3.connect(path)) as database:
        database.execute(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
            "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
        )
        database.execute(
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, "
            "timestamp INTEGER NOT NULL, data BLOB NOT NULL)"
        )
        numbers: dict[str, int] = {}
        for row in rows:
            if row.topic not in numbers:
                numbers[row.topic] = len(numbers) + 1
                database.execute(
                    "INSERT INTO topics VALUES (?, ?, ?, ?, '')",
                    (numbers[row.topic], row.topic, row.type_name, row.encoding),
                )
            database.execute(
                "INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                (numbers[row.topic], row.received_ns, row.data),
            )
        database.commit()
    return path


def write_metadata(folder: Path, files: Iterable[str], counts: dict[str, int], **changes: object) -> None:
    """metadata.yaml of version 4 with the fields that are read."""
    content: dict[str, object] = {
        "version": 4,
        "storage_identifier": "sqlite3",
        "message_count": sum(counts.values()),
        "relative_file_paths": list(files),
        "topics_with_message_count": [
            {
                "topic_metadata": {"name": name, "type": "a/msg/B", "serialization_format": "cdr"},
                "message_count": count,
            }
            for name, count in counts.items()
        ],
        "compression_format": "",
        "compression_mode": "",
    }
    from ruamel.yaml import YAML

    with (folder / "metadata.yaml").open("w") as stream:
        YAML(typ="safe").dump({"rosbag2_bagfile_information": content | changes}, stream)


def ros2_message(type_name: str, fill: Callable[[Any], object]) -> bytes:
    """A serialised message; `fill` makes it from the store's types by their names."""
    store = ros2_types()
    return bytes(store.serialize_cdr(fill(store.types), type_name))


def write_ros1(path: Path, rows: Iterable[tuple[str, str, int, object]], compression: Any = None) -> Path:
    """A bag of ROS 1 with messages of `ros1_types`."""
    store = ros1_types()
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections: dict[str, Any] = {}
        for topic, type_name, received_ns, message in rows:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, type_name, typestore=store)
            writer.write(connections[topic], received_ns, store.serialize_ros1(message, type_name))
    return path


def ros1_rows() -> list[tuple[str, str, int, object]]:
    """Five frames of the SmartMOT authors: k boxes in frame k, and a lane."""
    t = ros1_types().types

    def header(time_ns: int) -> object:
        time = t["builtin_interfaces/msg/Time"](time_ns // 10**9, time_ns % 10**9)
        return t["std_msgs/msg/Header"](0, time, "lidar")

    detection = t["t4ac_msgs/msg/BEV_detection"](
        "Car", 0.75, 3, -3.0, -20.0, 0.0, 0.0, np.zeros(4), np.zeros(4), np.zeros(4), 4.0, 2.0,
        -np.pi / 2, False,
    )  # fmt: skip
    way, node = t["t4ac_msgs/msg/Way"], t["t4ac_msgs/msg/Node"]
    lane = t["t4ac_msgs/msg/Lane"](
        way([node(0.0, -2.0, 0.0), node(30.0, -2.0, 0.0)]), way([node(0.0, 1.5, 0.0)]), "current"
    )
    rows: list[tuple[str, str, int, object]] = []
    for k in range(5):
        time_ns = 1_600_000_000_000_000_000 + k * 50_000_000
        boxes = t[BEV_DETECTIONS](header(time_ns), 30.0, -30.0, -10.0, 10.0, [detection] * k)
        rows.append(("/merged", BEV_DETECTIONS, time_ns + 1000, boxes))
        lanes = t[MONITORED_LANES](header(time_ns), [lane])
        rows.append(("/lanes", MONITORED_LANES, time_ns + 2000, lanes))
    return rows


__all__ = [
    "DATA", "DETECTIONS", "MCAP", "POSE", "SQLITE",
    "CompressionType", "IndexType", "Stored", "ros1_rows", "ros2_message", "stored",
    "write_mcap", "write_metadata", "write_ros1", "write_sqlite",
]  # fmt: skip
