"""Definitions of messages against rosidl and the maintainers' files."""

import pytest

from scenarios.ros.definitions import (
    PREDICTION_ARRAY,
    ROS1_DEFINITIONS,
    ROS2_DEFINITIONS,
    ros1_types,
    ros2_types,
)

# made by rosidl (ROS 2 Kilted) from the .msg files of the PREMOVE document; without RIHS01_
ROSIDL_HASHES = {
    "bevfusion_msgs/msg/Prediction": "6287b8957900509033169a6745dad9f2c8a04e00aeac05f91f10ded13db822dd",
    PREDICTION_ARRAY: "0819f7a1a94dcb31e9cae5a4d9de072ce5781637ac1349b6726bce4793c64c06",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
}


@pytest.mark.parametrize("name", ROSIDL_HASHES)
def test_type_hashes_are_those_of_rosidl(name: str) -> None:
    assert ros2_types().hash_rihs01(name) == f"RIHS01_{ROSIDL_HASHES[name]}"


def test_stores_hold_every_definition_and_are_new_each_time() -> None:
    first, second = ros2_types(), ros2_types()
    assert first is not second
    assert set(ROS2_DEFINITIONS) <= set(first.fielddefs)
    assert set(ROS1_DEFINITIONS) <= set(ros1_types().fielddefs)


def test_names_of_the_standard_types_are_those_of_rosbags() -> None:
    assert {"nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"} <= set(ros2_types().fielddefs)
    assert {"nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"} <= set(ros1_types().fielddefs)
