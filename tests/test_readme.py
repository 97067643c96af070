"""The README's Python runs as printed."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.map_builder import shipped_map

README = Path(__file__).parents[1] / "README.md"


def _blocks() -> list[str]:
    return re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_own_conditions_run_as_printed() -> None:
    names: dict[str, Any] = {}
    exec(_blocks()[2], names)
    assert names["outcome"].contact is None
    assert names["outcome"].stop_gap_m > 0


def test_the_tracker_alone_runs_as_printed() -> None:
    """A car at 5 m/s, in frames of uneven times, and a box that no detector should have made."""

    def my_detections() -> Iterator[tuple[Any, ...]]:
        for stamp_s in (0.0, 0.1, 0.23, 0.3):
            place = [[10.0 + 5.0 * stamp_s, 2.0], [np.nan, 0.0]]
            yield stamp_s, place, [[4.5, 1.8], [1.0, 1.0]], [0.0, 0.0], [0.9, 0.9], ["car", "car"]

    names: dict[str, Any] = {"my_detections": my_detections}
    exec(_blocks()[0], names)
    assert names["tracks"].track_id.tolist() == [1]
    np.testing.assert_allclose(names["tracks"].velocity_mps, [[5.0, 0.0]], atol=0.1)
    assert names["tracker"].rejected == 4


def test_own_detections_run_as_printed() -> None:
    """A pedestrian walks towards the lane and is 11 m ahead of an ego at 8 m/s when the frames end."""

    def my_frames() -> Iterator[tuple[Any, ...]]:
        for k in range(40):
            t = 0.05 * k
            place = np.array([[10.0 + 8.0 * 2.0 + 11.0, -5.5 + 1.4 * t]])
            pose = (10.0 + 8.0 * t, -1.75, 0.0, 8.0)
            size, yaw = np.array([[0.5, 0.6]]), np.array([np.pi / 2])
            yield t, place, size, yaw, np.array([0.9]), np.array(["pedestrian"]), pose

    code = _blocks()[1].replace('"town.xodr"', repr(str(shipped_map("urban_street"))))
    names: dict[str, Any] = {"my_frames": my_frames}
    exec(code, names)
    assert names["frame"].tracks.track_id.tolist() == [1]
    assert names["frame"].command.emergency


def test_every_command_of_the_readme_is_understood() -> None:
    from typer.testing import CliRunner

    from evaluation.cli import app

    text = README.read_text(encoding="utf-8")
    lines = [line.split()[1:] for line in text.splitlines() if line.startswith("smartmot-eval ")]
    assert len(lines) >= 4
    for command, *rest in lines:
        shown = CliRunner().invoke(app, [command, "--help"], terminal_width=200)
        assert shown.exit_code == 0
        for option in (word for word in rest if word.startswith("--")):
            assert option in shown.output
