"""How long the live node takes to answer a frame, among real ROS 2 on this machine.

    .ci/ros python -m benchmarks.ros [--frames N] [--boxes N] [--rate HZ] [--map FILE]

A peer publishes odometry and boxes, and takes the time until the tracks of the frame arrive. That bounds the
node's own time from receiving to publishing from above: it holds the way through DDS, twice, and the peer's
work. The goal is 20 ms for 99 of 100 frames. `.ci/ros` makes the environment; in a sourced workspace with
bevfusion_msgs `python -m benchmarks.ros` is enough.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from importlib import import_module
from pathlib import Path

import numpy as np

GOAL_MS = 20.0
BEGIN_NS = 1_700_000_000_000_000_000
NEEDED = ("rclpy", "bevfusion_msgs.msg", "vision_msgs.msg", "tf2_msgs.msg", "rosbags.typesys")


def main() -> None:
    """Measure and print; status 1 where there is no ROS 2."""
    parser = argparse.ArgumentParser(prog="benchmarks.ros", description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--frames", type=int, default=400)
    parser.add_argument("--boxes", type=int, default=20)
    parser.add_argument("--rate", type=float, default=20.0, metavar="HZ")
    parser.add_argument("--map", metavar="FILE", help="the node's map; the vehicle drives along its x axis")
    options = parser.parse_args()
    try:
        for name in NEEDED:
            import_module(name)
    except ImportError as error:
        sys.exit(f"benchmarks.ros: needs real ROS 2 ({error}); run: .ci/ros python -m benchmarks.ros")
    parameters = ["-p", "sensor_pose:=[0.0, 0.0, 0.0, 0.0]"]
    if options.map is not None:
        parameters += ["-p", f"map:={Path(options.map).resolve()}"]
    answered_ms, longest_ms, lost = measure(options.frames, options.boxes, options.rate, parameters)
    middle, high = np.percentile(answered_ms, (50.0, 99.0))
    print(f"{options.frames} frames of {options.boxes} boxes at {options.rate:g} Hz, {lost} not answered")
    times = f"median {middle:.1f} ms, p99 {high:.1f} ms, max {answered_ms.max():.1f} ms"
    print(f"from publishing to the tracks: {times}")
    print(f"longest step of the node: {longest_ms:.1f} ms")
    load, processors = os.getloadavg()[0], os.cpu_count()
    print(f"load of the machine {load:.1f} on {processors} processors; only a quiet one tells the time")
    print(f"goal {GOAL_MS:g} ms for 99 of 100 frames: {'met' if high <= GOAL_MS and not lost else 'missed'}")


def measure(frames: int, boxes: int, rate_hz: float, parameters: list[str]) -> tuple[np.ndarray, float, int]:
    """(N,) times of answered frames (ms), the node's longest step (ms), and how many were not answered."""
    from tests.ros.messages_made import SPEED_MPS, odometry, predictions
    from tests.ros.peer import LiveProcess, Peer

    period_s = 1.0 / rate_hz
    sent_at = {}
    with (
        tempfile.TemporaryDirectory() as folder,
        LiveProcess(Path(folder), "--ros-args", *parameters) as process,
        Peer("benchmark") as peer,
    ):
        process.wait_until_ready()
        peer.advertise("/localization/pose", "nav_msgs/msg/Odometry")
        peer.advertise("/bevfusion_detections", "bevfusion_msgs/msg/PredictionArray")
        tracks = peer.listen("/smartmot/tracks", "vision_msgs/msg/Detection3DArray")
        status = peer.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        peer.wait_until_matched()
        begin = time.perf_counter()
        for frame in range(frames):
            stamp_ns = BEGIN_NS + round(frame * period_s * 1e9)
            driven_m = SPEED_MPS * frame * period_s
            pose, message = odometry(stamp_ns, driven_m), predictions(stamp_ns, boxes, driven_m)
            peer.send("/localization/pose", pose)
            sent_at[stamp_ns] = time.perf_counter()
            peer.send("/bevfusion_detections", message)
            peer.spin_for(begin + (frame + 1) * period_s - time.perf_counter())
        peer.spin_for(2.0)
        received = zip(tracks, peer.received_at["/smartmot/tracks"], strict=True)
        answered_ms = [
            1e3 * (at - sent_at[message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec])
            for message, at in received
        ]
        longest_ms = max(
            float(pair.value)
            for message in status
            for pair in message.status[0].values
            if pair.key.startswith("longest step")
        )
    return np.array(answered_ms), longest_ms, frames - len(answered_ms)


if __name__ == "__main__":
    main()
