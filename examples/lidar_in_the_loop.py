"""A LiDAR in the closed loop: clouds of points are simulated, boxes detected in them, and braked for.

    python examples/lidar_in_the_loop.py

Beside it the same test with boxes of the ground truth, which shows what the sensor costs.
"""

import smartmot


def main() -> None:
    """The pedestrian test with a perfect sensor, and with two detectors of a LiDAR's clouds."""
    sides = {
        "ground truth": {},
        "LiDAR, clusters of points": {"sensor": "mid70", "perception": "classical"},
        "LiDAR, points cut out by the truth": {"sensor": "mid70", "perception": "cutout"},
    }
    for name, perception in sides.items():
        run = smartmot.run("cpna", speed_kmh=40, strategy="map", preset="physical", **perception)
        log = run.frame()
        seen = log[(log["kind"] == "detection") & (log["category"] == "pedestrian")]
        nearest = "never" if seen.empty else f"first at {seen['time_s'].min():.2f} s"
        print(f"{name}: {len(seen)} detections of pedestrians, {nearest}")
        print(f"    {run.outcome.text}")


if __name__ == "__main__":
    main()
