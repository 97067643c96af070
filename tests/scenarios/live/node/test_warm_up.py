"""What is loaded before the first frame of a live node."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

CODE = """
import json, sys
import numpy as np
from scenarios.live.node.parameters import live_settings
from scenarios.live.perception import LivePerception
from scenarios.live.published import published
from scenarios.live.node.warm_up import warm_up
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.ros.messages import DetectionMessage, OdometryMessage

settings, map_file = live_settings(json.loads(sys.argv[1]))
lane_map = None if map_file is None else load_drive_map(map_file)
perception = LivePerception(settings, lane_map)
warm_up(settings, lane_map)
loaded = set(sys.modules)
messages = 0
for k in range(1, 30):
    stamp, x = k * 100_000_000, k * 0.8
    base = np.array((20.0 + x, -1.75, 0.0))
    upright = np.array((1.0, 0.0, 0.0, 0.0))
    ahead = np.array((8.0, 0.0, 0.0))
    perception.take(OdometryMessage(stamp, "map", "base", stamp, base, upright, ahead, np.zeros(3)))
    boxes = np.array(((40.0 - x, 0.0, 0.8), (30.0 - x, 3.0 - 0.1 * k, 0.9), (12.0, 3.5, 0.8)))
    outputs = perception.take(
        DetectionMessage(
            stamp, "base", stamp, np.zeros(3, int), np.array(["car", "pedestrian", "truck"]), boxes,
            np.array(((4.5, 1.8, 1.6), (0.6, 0.6, 1.8), (8.0, 2.5, 3.0))), np.tile(upright, (3, 1)),
            np.full((3, 3), 1.0), np.array((0.9, 0.8, 0.7)),
        )
    )
    for output in outputs:
        messages += len(published(output))
print(json.dumps([messages, perception.counts.decided, sorted(set(sys.modules) - loaded)]))
"""


@pytest.mark.parametrize(
    "parameters",
    [
        {},
        {"strategy": "rectangular", "rule": "rss", "velocity_frame": "sensor"},
        {"map": "scenarios/maps/urban_street.xodr", "preset": "paper", "rule": "cascade"},
    ],
)
def test_frames_import_nothing(parameters: dict[str, str]) -> None:
    run = subprocess.run(
        [sys.executable, "-c", CODE, json.dumps(parameters)], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stderr
    published, decided, imported = json.loads(run.stdout)
    assert published > 100
    assert decided >= 28
    assert imported == []
