"""`smartmot-ros`: arguments, signals and mistakes of the live node; runs without ROS as far as its help."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

COMMAND = "smartmot-ros"
FAILED = 2
"""Status of exit after a mistake, as of `smartmot-eval`."""

_HELP = """\
usage: {command} [--ros-args -p NAME:=VALUE -r TOPIC:=TOPIC ...]

Perception as a live node of ROS 2: detections and odometry in; tracks, markers and emergency requests out.
Source ROS 2 and the workspace with bevfusion_msgs first: docs/ros.md, "Live node".

parameters, -p NAME:=VALUE
{parameters}

topics read, -r TOPIC:=TOPIC
{read}

topics published
{published}
"""


class NodeError(Exception):
    """The node cannot start as it was asked to, or cannot go on; the message is for the user."""


class Interruption:
    """Ctrl-C and SIGTERM: they end the process with status 0, or the executor as long as one spins.

    Attributes:
        spinning: whether rclpy, which is told as well, ends an executor.
    """

    def __init__(self) -> None:
        self.spinning = False
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._stop)

    def _stop(self, number: int, frame: object) -> None:
        if not self.spinning:
            sys.exit(0)


def main() -> None:
    """Entry point: runs the node until Ctrl-C or SIGTERM; a mistake is one line on the error output."""
    interruption = Interruption()
    try:
        own, for_ros = split_arguments(sys.argv[1:])
        if own in (["--help"], ["-h"]):
            sys.stdout.write(help_text())
            return
        if own:
            raise NodeError(f"unknown argument {own[0]!r}; see {COMMAND} --help")
        rclpy = import_rclpy()
        from scenarios.live.node.node import run

        run(rclpy, for_ros, interruption)
    except NodeError as error:
        sys.stderr.write(f"{COMMAND}: {' '.join(str(error).split())}\n")
        sys.exit(FAILED)


def split_arguments(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """Arguments of our own, and those for ROS: from each `--ros-args` to `--` or the end."""
    own: list[str] = []
    for_ros: list[str] = []
    into = own
    for argument in arguments:
        if argument == "--ros-args":
            into = for_ros
        into.append(argument)
        if argument == "--" and into is for_ros:
            into = own
    return own, for_ros


def import_rclpy() -> Any:
    """The package rclpy of the sourced workspace.

    Raises:
        NodeError: there is none for this Python.
    """
    try:
        rclpy = import_module("rclpy")
        import_module("rclpy.executors")
    except ImportError as error:
        if os.environ.get("ROS_DISTRO"):
            raise NodeError(
                f"rclpy of ROS 2 {os.environ['ROS_DISTRO']} cannot be imported by this Python "
                f"{sys.version_info[0]}.{sys.version_info[1]} ({error}); install smartmot for its Python"
            ) from None
        raise NodeError(
            f"ROS 2 is not sourced ({error}); run: source /opt/ros/DISTRO/setup.bash, and install/setup.bash "
            "of the workspace with bevfusion_msgs"
        ) from None
    return rclpy


def help_text() -> str:
    """What `--help` prints."""
    from scenarios.live.node.parameters import PARAMETERS
    from scenarios.live.topics import PUBLISHED, READ

    def lines(rows: dict[str, str]) -> str:
        width = max(map(len, rows)) + 2
        return "\n".join(f"  {name:<{width}}{text}" for name, text in rows.items())

    return _HELP.format(
        command=COMMAND,
        parameters=lines(
            {name: p.text for name, p in PARAMETERS.items()} | {"use_sim_time": "follow /clock"}
        ),
        read=lines({topic.name: topic.type_name for topic in READ}),
        published=lines({topic.name: topic.type_name for topic in PUBLISHED}),
    )
