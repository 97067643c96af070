"""`smartmot-ros` where there is no ROS: help, and mistakes in one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import pytest

from scenarios.live.node.command import split_arguments
from scenarios.live.node.parameters import PARAMETERS
from scenarios.live.topics import PUBLISHED, READ

WITHOUT_ROS = "import sys; sys.modules['rclpy'] = None; from scenarios.live.node.command import main; main()"


def smartmot_ros(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", WITHOUT_ROS, *arguments],
        capture_output=True,
        text=True,
        check=False,
        env={name: value for name, value in os.environ.items() if name != "ROS_DISTRO"} | environment,
    )


@pytest.mark.parametrize("option", ["--help", "-h"])
def test_help_needs_no_ros_and_names_all_parameters_and_topics(option: str) -> None:
    run = smartmot_ros(option)
    assert (run.returncode, run.stderr) == (0, "")
    words = run.stdout.split()
    assert {*PARAMETERS, "use_sim_time"} <= set(words)
    for topic in (*READ, *PUBLISHED):
        assert {topic.name, topic.type_name} <= set(words)
    assert max(map(len, run.stdout.splitlines())) <= 110


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys; sys.argv = ['smartmot-ros', '--help'];"
        "from scenarios.live.node.command import main; main();"
        "print([name for name in ('numpy', 'scipy', 'pandas', 'rosbags') if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.splitlines()[-1] == "[]"


def test_without_ros_one_line_says_what_to_source() -> None:
    run = smartmot_ros()
    assert (run.returncode, run.stdout) == (2, "")
    (line,) = run.stderr.splitlines()
    assert line.startswith("smartmot-ros: ROS 2 is not sourced")
    assert "source /opt/ros/" in line
    assert "install/setup.bash" in line


def test_ros_of_another_python_is_said() -> None:
    run = smartmot_ros(ROS_DISTRO="humble")
    (line,) = run.stderr.splitlines()
    assert run.returncode == 2
    assert "rclpy of ROS 2 humble" in line
    assert f"{sys.version_info[0]}.{sys.version_info[1]}" in line


@pytest.mark.parametrize("arguments", [["--max-age", "3"], ["bag"], ["--help", "more"], ["-p", "max_age:=3"]])
def test_unknown_arguments_are_refused_in_one_line(arguments: list[str]) -> None:
    run = smartmot_ros(*arguments)
    (line,) = run.stderr.splitlines()
    assert run.returncode == 2
    assert arguments[0] in line


def test_arguments_of_ros_end_with_two_dashes() -> None:
    arguments = ["-h", "--ros-args", "-p", "a:=1", "--", "x", "--ros-args", "-r", "a:=b"]
    assert split_arguments(arguments) == (
        ["-h", "x"],
        ["--ros-args", "-p", "a:=1", "--", "--ros-args", "-r", "a:=b"],
    )
    assert split_arguments([]) == ([], [])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_it_starts_ends_it_cleanly(number: int) -> None:
    code = (
        "import sys, types, time\n"
        "from scenarios.live.node.command import Interruption\n"
        "Interruption(); print('waiting', flush=True); time.sleep(60)"
    )
    with subprocess.Popen(
        [sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "waiting\n"
        began = time.monotonic()
        process.send_signal(number)
        assert process.wait(30) == 0
        assert time.monotonic() - began < 30
        assert process.stderr is not None
        assert process.stderr.read() == ""
