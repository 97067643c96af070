"""Tests with real ROS 2 around the program; `.ci/ros` makes an environment for them and runs them there."""

import os
import warnings
from collections.abc import Iterator

import pytest

from tests.ros.peer import Peer

REQUIRED = os.environ.get("SMARTMOT_ROS") == "required"

collect_ignore_glob = [] if REQUIRED else ["test_[!e]*.py"]
"""Elsewhere all but test_environment.py, which says so in one line."""


@pytest.fixture(scope="session", autouse=True)
def ros2() -> None:
    if not REQUIRED:
        return
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of rosidl's parser about a module of Python
        import rosidl_generator_py
    assert rosidl_generator_py.__name__


@pytest.fixture
def peer() -> Iterator[Peer]:
    with Peer() as made:
        yield made
