"""The peer's half of `benchmarks.opendrive`: runs in an environment with carla, prints one JSON object.

    PEER_PYTHON opendrive_peer.py REQUEST.json

The request names the map, the points and the places on lanes; everything is timed in processor time.
"""

from __future__ import annotations

import json
import statistics
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any


def seconds(work: Callable[[], Any], rounds: int) -> float:
    """Median processor time of `work`."""
    spent = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return statistics.median(spent)


def main() -> None:
    """Answer the request."""
    import carla

    request = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    text = Path(request["map"]).read_text(encoding="utf-8")
    rounds = request["rounds"]
    town = carla.Map("map", text)
    # CARLA's frame is left-handed: y is mirrored.
    points = [carla.Location(x, -y, 0.0) for x, y in request["points"]]
    driving = carla.LaneType.Driving
    places = request["places"]

    def pose(road: int, lane: int, s: float) -> Any:
        waypoint = town.get_waypoint_xodr(road, lane, s)
        return None if waypoint is None else waypoint.transform

    def borders() -> list[Any]:
        corners = []
        for road, lane, s in places:
            waypoint = town.get_waypoint_xodr(road, lane, s)
            if waypoint is None:
                continue
            transform, half = waypoint.transform, 0.5 * waypoint.lane_width
            right = transform.get_right_vector()
            at = transform.location
            corners.append(
                (at.x + half * right.x, at.y + half * right.y, at.x - half * right.x, at.y - half * right.y)
            )
        return corners

    print(
        json.dumps(
            {
                "load_s": seconds(lambda: carla.Map("map", text), rounds),
                "nearest_s": seconds(
                    lambda: [town.get_waypoint(p, lane_type=driving) for p in points], rounds
                ),
                "inside_s": seconds(
                    lambda: [
                        town.get_waypoint(p, project_to_road=False, lane_type=carla.LaneType.Any)
                        for p in points
                    ],
                    rounds,
                ),
                "borders_s": seconds(borders, rounds),
                "pose_s": seconds(lambda: [pose(*place) for place in places], rounds) / len(places),
            }
        )
    )


if __name__ == "__main__":
    main()
