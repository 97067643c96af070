"""What bags and node write and read by rosbags, against rosidl and rclpy; fields are compared, never bytes.

Fast CDR leaves padding unset, so that equal messages may differ in bytes.
"""

from __future__ import annotations

import json
import math
from dataclasses import fields as dataclass_fields
from dataclasses import is_dataclass
from importlib import import_module
from random import Random
from typing import Any

import numpy as np
import pytest

from scenarios.ros.definitions import ROS2_DEFINITIONS, ros2_types

TYPES = (
    "bevfusion_msgs/msg/PredictionArray",
    "diagnostic_msgs/msg/DiagnosticArray",
    "nav_msgs/msg/Odometry",
    "std_msgs/msg/Bool",
    "std_msgs/msg/Float64",
    "tf2_msgs/msg/TFMessage",
    "vision_msgs/msg/Detection3DArray",
    "visualization_msgs/msg/MarkerArray",
)
"""Every type that the program reads or writes as ROS 2."""

WORDS = ("", "car", "lidar_top", "Fußgänger", "歩行者", "x" * 300)


def rclpy_class(name: str) -> Any:
    package, _, short = name.split("/")
    return getattr(import_module(f"{package}.msg"), short)


def filled(target: Any, random: Random) -> Any:
    """A message of rclpy with other values than the defaults in all fields; arrays of any length from 0."""
    for field, kind in target.get_fields_and_field_types().items():
        setattr(target, field, value_of(kind, getattr(target, field), random))
    return target


def value_of(kind: str, default: Any, random: Random) -> Any:
    if kind.startswith("sequence<"):
        inner = kind.removeprefix("sequence<").split(",")[0].removesuffix(">")
        return [value_of(inner, None, random) for _ in range(random.choice((0, 1, 3)))]
    if kind.endswith("]"):
        return [value_of(kind.split("[")[0], None, random) for _ in range(len(default))]
    if kind == "string":
        return random.choice(WORDS)
    if kind == "boolean":
        return random.random() < 0.5
    if kind == "octet":
        # rosbags takes a byte for signed; those of our messages are levels of a status, 0 to 3
        return bytes([random.randrange(128)])
    if kind == "float":
        return float(np.float32(random.gauss(0.0, 1e3)))
    if kind == "double":
        return random.choice((random.gauss(0.0, 1e5), math.inf, -0.0, 5e-324))
    if "/" not in kind:
        bits = int(kind.removeprefix("u").removeprefix("int"))
        least = 0 if kind.startswith("u") else -(2 ** (bits - 1))
        return least + random.randrange(2**bits)
    return filled(rclpy_class(kind.replace("/", "/msg/"))(), random)


def fields(message: Any) -> Any:
    """Plain values of all fields, of an object of rclpy or of rosbags."""
    if hasattr(message, "get_fields_and_field_types"):
        return {name: fields(getattr(message, name)) for name in message.get_fields_and_field_types()}
    if is_dataclass(message):
        names = [field.name for field in dataclass_fields(message) if "ClassVar" not in str(field.type)]
        return {name: fields(getattr(message, name)) for name in names}
    if isinstance(message, bytes):  # an octet
        return int.from_bytes(message, "little")
    if isinstance(message, str | bool | int | float):
        return message
    return [fields(value.item() if isinstance(value, np.generic) else value) for value in message]


def of_rosidl(name: str) -> dict[str, str]:
    """Hashes of a type and of those that it holds, from what rosidl has installed."""
    from ament_index_python import get_package_share_path

    package, folder, short = name.split("/")
    installed = json.loads((get_package_share_path(package) / folder / f"{short}.json").read_text())
    return {row["type_name"]: row["hash_string"] for row in installed["type_hashes"]}


@pytest.mark.parametrize("name", TYPES)
def test_hashes_of_a_type_and_of_all_that_it_holds_are_those_of_rosidl(name: str) -> None:
    expected = of_rosidl(name)
    store = ros2_types()
    assert name in expected
    assert {inner: store.hash_rihs01(inner) for inner in expected} == expected


def test_every_definition_is_compared() -> None:
    compared = set().union(*map(of_rosidl, TYPES))
    assert set(ROS2_DEFINITIONS) <= compared


@pytest.mark.parametrize("name", TYPES)
@pytest.mark.parametrize("seed", range(20))
def test_messages_of_rclpy_are_read_and_written_field_for_field(name: str, seed: int) -> None:
    from rclpy.serialization import deserialize_message, serialize_message

    store = ros2_types()
    sent = filled(rclpy_class(name)(), Random(seed))
    read = store.deserialize_cdr(serialize_message(sent), name)
    assert fields(read) == fields(sent)
    received = deserialize_message(bytes(store.serialize_cdr(read, name)), rclpy_class(name))
    assert fields(received) == fields(sent)
