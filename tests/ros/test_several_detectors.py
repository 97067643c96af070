"""Two detectors of different types and quality of service into one tracker, among peers of rclpy."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ros.drive_made import (
    BEGIN_NS,
    DETECTION_3D_ARRAY,
    ODOMETRY,
    PERIOD_NS,
    PREDICTION_ARRAY,
    TRACKS,
    stamps,
)
from tests.ros.messages_made import SPEED_MPS, detections_3d, odometry, predictions
from tests.ros.peer import LiveProcess, Peer, run_node

FRAMES = 20
FILE = """
[lidar]
topic = "/lidar/boxes"
rate_hz = 20
sensor_pose = [0, 0, 0, 0]

[camera]
topic = "/camera/boxes"
type = "bevfusion_msgs/msg/PredictionArray"
rate_hz = 10
delay_s = 0.1
sensor_pose = [-20, 0, 0, 0]
reliable = true
depth = 3
"""


def test_both_are_tracked_and_late_frames_lead_to_answers_at_the_newest_time(
    tmp_path: Path, peer: Peer
) -> None:
    file = tmp_path / "detectors.toml"
    file.write_text(FILE)
    with LiveProcess(tmp_path, "--ros-args", "-p", f"detectors:={file}") as process:
        process.wait_until_ready()
        peer.advertise(ODOMETRY, "nav_msgs/msg/Odometry")
        peer.advertise("/lidar/boxes", DETECTION_3D_ARRAY, reliable=False)
        peer.advertise("/camera/boxes", PREDICTION_ARRAY)
        tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
        peer.wait_until_matched()
        for k in range(FRAMES):
            driven_m = SPEED_MPS * k * PERIOD_NS * 1e-9
            peer.send(ODOMETRY, odometry(BEGIN_NS + k * PERIOD_NS, driven_m))
            peer.spin_for(0.02)
            peer.send("/lidar/boxes", detections_3d(BEGIN_NS + k * PERIOD_NS, 2, driven_m))
            peer.spin_for(0.05)
            if k % 2 == 0 and k > 1:  # of the frame before the last one; its sensor is 20 m behind
                made_m = SPEED_MPS * (k - 2) * PERIOD_NS * 1e-9
                peer.send("/camera/boxes", predictions(BEGIN_NS + (k - 2) * PERIOD_NS, 1, made_m))
                peer.spin_for(0.05)
        late = len(range(2, FRAMES, 2))
        peer.spin_until(lambda: len(tracks) >= FRAMES + late)
        assert process.stop() == 0
    assert stamps(tracks) == sorted(stamps(tracks))
    places = sorted((d.bbox.center.position.x, d.bbox.center.position.y) for d in tracks[-1].detections)
    assert places == [pytest.approx(each, abs=0.1) for each in ((40.0, -10.0), (60.0, -10.0), (60.0, -5.0))]
    assert f"lidar: {FRAMES} frames, 0 behind a newer one, 0 left out" in process.output
    assert f"camera: {late} frames, {late} behind a newer one, 0 left out" in process.output


def test_a_wrong_file_is_one_line_and_status_2(tmp_path: Path) -> None:
    file = tmp_path / "detectors.toml"
    file.write_text(FILE + "speed = 3\n")
    run = run_node("--ros-args", "-p", f"detectors:={file}")
    assert (run.returncode, run.stdout) == (2, "")
    (line,) = run.stderr.splitlines()
    assert "[camera]: unknown key 'speed'" in line
