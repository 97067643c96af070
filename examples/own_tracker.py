"""A tracker of your own in the closed loop, beside the shipped one: in one run, and over scenes.

    python examples/own_tracker.py

On the command line it would be `--tracker own_tracker:Nearest`.
"""

import numpy as np

import smartmot

GATE_M = 1.5
"""A detection farther than this from every track starts a new track."""
SMOOTHING = 0.7
"""Share of the velocity that was estimated before."""


class Nearest:
    """Each detection continues the nearest track; velocities are smoothed differences."""

    def __init__(self) -> None:
        self.stamp_s, self.tracks, self.next_id = 0.0, {}, 1

    def update(self, detections: smartmot.Detections) -> smartmot.Tracks:
        """Tracks at the time of the detections, map frame."""
        boxes, free, tracks = detections.boxes, dict(self.tracks), {}
        for center_m in boxes.center_m:
            distance_m = {key: np.hypot(*(center_m - place_m)) for key, (place_m, _) in free.items()}
            key = min(distance_m, key=distance_m.__getitem__, default=None)
            velocity_mps = np.zeros(2)
            if key is not None and distance_m[key] < GATE_M:
                place_m, before_mps = free.pop(key)
                measured_mps = (center_m - place_m) / (detections.stamp_s - self.stamp_s)
                velocity_mps = SMOOTHING * before_mps + (1 - SMOOTHING) * measured_mps
            else:
                key, self.next_id = self.next_id, self.next_id + 1
            tracks[key] = center_m, velocity_mps
        self.tracks, self.stamp_s = tracks, detections.stamp_s
        velocities_mps = [velocity for _, velocity in tracks.values()]
        return smartmot.tracks_from_arrays(
            detections.stamp_s, list(tracks), boxes.center_m, boxes.size_m, boxes.yaw_rad,
            detections.category, velocities_mps,
        )  # fmt: skip


def main() -> None:
    """One run with each tracker, then a comparison over scenes in which some ask for no brake."""
    for tracker in (None, Nearest):
        print(smartmot.run("cpna", speed_kmh=50, preset="real", tracker=tracker))
    compared = smartmot.compare(
        "map", vary={"tracker": ("preset", Nearest)}, scenes=("runs across", "people at the kerb"), seeds=1
    )
    print(compared.frame("table")[["settings", "avoided", "false_activations"]].to_string(index=False))


if __name__ == "__main__":
    main()
