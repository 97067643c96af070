"""Where the tests of this folder can run."""

import os
from importlib import import_module

import pytest

PACKAGES = ("rclpy", "bevfusion_msgs.msg", "vision_msgs.msg", "tf2_msgs.msg", "rosless")


def test_real_ros_2_is_sourced() -> None:
    if os.environ.get("SMARTMOT_ROS") != "required":
        pytest.skip("tests with real ROS 2: `.ci/ros` makes an environment for them and runs them")
    assert [name for name in PACKAGES if import_module(name) is None] == []
