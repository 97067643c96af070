"""The launch file, with stand-ins for the packages of ROS, which no registry has: what it would start."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest
import yaml

from scenarios.live.node.parameters import PARAMETERS
from scenarios.live.topics import PUBLISHED, READ

LAUNCH_FILE = Path(__file__).parents[4] / "ros" / "smartmot_ros" / "launch" / "smartmot.launch.py"


class Recorded(SimpleNamespace):
    """Keeps what it is made with."""

    def __init__(self, *values: object, **named: object) -> None:
        super().__init__(values=values, **named)


@pytest.fixture
def launch(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """Names of the launch file."""
    modules = {
        "launch": {"LaunchDescription": Recorded},
        "launch.actions": {"DeclareLaunchArgument": Recorded, "OpaqueFunction": Recorded},
        "launch_ros": {},
        "launch_ros.actions": {"Node": Recorded},
    }
    for name, names in modules.items():
        module = ModuleType(name)
        vars(module).update(names)
        monkeypatch.setitem(sys.modules, name, module)
    return runpy.run_path(str(LAUNCH_FILE))


def started(launch: dict[str, Any], **given: str) -> Any:
    *arguments, start = launch["generate_launch_description"]().values[0]
    values = {argument.values[0]: argument.default_value for argument in arguments}
    assert given.keys() <= values.keys()
    (node,) = start.function(SimpleNamespace(launch_configurations=values | given))
    return node


def test_every_parameter_of_the_node_is_an_argument(launch: dict[str, Any]) -> None:
    assert set(launch["PARAMETERS"]) == {*PARAMETERS, "use_sim_time"}


def test_topics_have_the_node_s_names_unless_others_are_given(launch: dict[str, Any]) -> None:
    names = {topic.name for topic in (*READ, *PUBLISHED)}
    remappings = started(launch, odometry="/odom").remappings
    assert {source for source, _ in remappings} <= names
    assert [pair for pair in remappings if pair[0] != pair[1]] == [("/localization/pose", "/odom")]


def test_the_node_is_started_with_what_is_given_in_its_types(launch: dict[str, Any]) -> None:
    node = started(
        launch, max_age="3", detection_th="0.25", preset="paper", sensor_pose="[1.0, 0.0, 1.8, 0.0]"
    )
    assert (node.executable, node.name) == ("smartmot-ros", "smartmot")
    assert node.parameters == [
        {"max_age": 3, "detection_th": 0.25, "preset": "paper", "sensor_pose": [1.0, 0.0, 1.8, 0.0]}
    ]
    assert yaml.safe_load(yaml.safe_dump(node.parameters)) == node.parameters


def test_without_arguments_the_node_decides(launch: dict[str, Any]) -> None:
    assert started(launch).parameters == [{}]
