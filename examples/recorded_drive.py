"""A recorded drive in open loop: where would the brake have been requested, and was it a false activation?

    python examples/recorded_drive.py [FOLDER]

The script writes the drive itself, as CSV files that any recording can be brought to
(docs/formats.md): a car at 10 m/s, a pedestrian who steps into its way, and one who stays beside it.
"""

import csv
import sys
import tempfile
from pathlib import Path

import smartmot

COLUMNS = ["sequence", "stamp_s", "x_m", "y_m", "length_m", "width_m", "yaw_rad", "category"]
EGO_COLUMNS = ["sequence", "stamp_s", "x_m", "y_m", "yaw_rad"]
FRAMES, STEP_S, SPEED_MPS = 60, 0.1, 10.0


def write_drive(folder: Path) -> None:
    """Detections, labels and ego poses of 6 s at 10 Hz; map frame, metres and radians."""
    boxes, poses = [], []
    for frame in range(FRAMES):
        stamp_s = round(frame * STEP_S, 1)
        poses.append(["street", stamp_s, SPEED_MPS * stamp_s, 0.0, 0.0])
        walker_y_m = -6.0 + 1.4 * stamp_s
        for x_m, y_m in ((50.0, walker_y_m), (30.0, -6.0)):
            boxes.append(["street", stamp_s, x_m, y_m, 0.5, 0.5, 1.5708, "pedestrian"])
    for name, columns, rows in (
        ("detections", [*COLUMNS, "score"], [[*row, 0.9] for row in boxes]),
        ("labels", [*COLUMNS, "track_id"], [[*row, 1 + k % 2] for k, row in enumerate(boxes)]),
        ("ego", EGO_COLUMNS, poses),
    ):
        with (folder / f"{name}.csv").open("w", newline="") as file:
            csv.writer(file).writerows([columns, *rows])


def main(folder: str | None = None) -> None:
    """Write the drive, see and judge it with two areas and two brake rules, print requests and verdicts."""
    with tempfile.TemporaryDirectory() as place:
        data = Path(folder or place)
        write_drive(data)
        results = smartmot.drive(data, strategy=("rectangular", "path"), rule=("paper", "rss"))
    print(results)
    events = results.frame("events")
    print(events[["strategy", "rule", "time_s", "track", "gap_m", "verdict"]].to_string(index=False))


if __name__ == "__main__":
    main(*sys.argv[1:2])
