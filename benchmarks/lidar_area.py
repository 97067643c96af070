"""What a monitored area saves a LiDAR detector: processor time, and false objects.

    python -m benchmarks.lidar_area [--frames N] [--seed N]

Streets are drawn at random on the shipped maps, furnished and with clutter, and seen by each sensor. Points
off an area are dropped before they are grouped. `map` is the area of that strategy around an ego at 40 km/h
on its route. `path` and `rectangular` keep every road user, so that they drop nothing: their rows are for
what counts in a decision, a corridor of 3 m to each side of the path and the rectangle of the paper, which a
system that tracks who comes from aside cannot use. Calls with and without are interleaved, cloud by cloud,
and the time that the area is asked for is in that of the cut.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from benchmarks.fit_lidar import CHECKED_ON, LEAST_OVERLAP, sensors
from evaluation.studies.lidar.detect import host_name
from evaluation.studies.lidar.drawn import CLASSES, DrawnFrame, drawn_frames
from opendrive import RoadNetwork
from scenarios.places import MapView
from scenarios.presets import PHYSICAL
from scenarios.sensors.lidar import LidarMeasurement, Mount
from scenarios.strategies import make_strategy
from smartmot.area import MonitoredArea, PathArea, PathAreaConfig
from smartmot.arrays import BoolArray, FloatArray, StrArray
from smartmot.lidar import BoxDetections, ClassicalConfig, detect
from smartmot.lidar.monitored import points_on
from smartmot.maps.follow import route_along
from smartmot.maps.route import Route
from smartmot.pointcloud import Boxes3D
from smartmot.pointcloud.boxes import overlaps
from smartmot.types import Boxes

SPEED_MPS = 40.0 / 3.6
AHEAD_M, STEP_M = 60.0, 2.0
CORRIDOR_M = 3.0
LEAST_POINTS, FARTHEST_M = 5, 40.0
"""Of road users that count, as in `fit_lidar`."""


@dataclass(frozen=True, slots=True)
class Counting:
    """An area that keeps only what counts in a decision."""

    area: MonitoredArea

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) which boxes are in the route."""
        return self.area.relevance(boxes, category).in_route


@dataclass(slots=True)
class Tally:
    """What is measured of one area."""

    all_ms: list[float] = field(default_factory=list)
    cut_ms: list[float] = field(default_factory=list)
    share: list[float] = field(default_factory=list)
    false_all: int = 0
    false_kept: int = 0
    false_cut: int = 0
    labels: int = 0
    found_kept: int = 0
    found_cut: int = 0


def route_of(network: RoadNetwork, frame: DrawnFrame) -> Route:
    """The route from the ego on, straight on or whatever comes first."""
    lane = int(network.locate(np.array([[frame.ego.x_m, frame.ego.y_m]])).lane[0])
    lanes = network.lanes
    points: list[FloatArray] = []
    left_m = AHEAD_M
    while left_m > 0.0:
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        s = np.linspace(low, high, max(2, int((high - low) / STEP_M) + 1))
        x, y, _, yaw = network.center_line(np.full(len(s), lane), s)
        along = np.column_stack((x, y))
        first = along[0] - along[-1]
        if np.cos(yaw[0]) * first[0] + np.sin(yaw[0]) * first[1] > 0.0:  # driven against s
            along = along[::-1]
        if not points:
            along = along[int(np.hypot(*(along - (frame.ego.x_m, frame.ego.y_m)).T).argmin()) :]
        points.append(along)
        left_m -= float(np.hypot(*np.diff(along, axis=0).T).sum()) if len(along) > 1 else 0.0
        after = network.successors(lane)
        if not len(after):
            break
        lane = int(after[0])
    return route_along(network, np.concatenate(points), 100.0, 50.0)


def areas(frame: DrawnFrame) -> dict[str, MonitoredArea | Counting]:
    """Areas around the ego of a frame, map frame."""
    route = route_of(frame.network, frame)
    ego = replace(frame.ego, speed_mps=SPEED_MPS)
    view = MapView(frame.network, route)
    corridor = PathArea(PathAreaConfig(CORRIDOR_M))
    return {
        "map": make_strategy("map", PHYSICAL, view).at(ego),
        "path, corridor": Counting(corridor.at(ego, route)),
        "rectangular": Counting(make_strategy("rectangular", PHYSICAL, view).at(ego)),
    }


def spent_ms(call: Callable[[], object]) -> float:
    """Processor time: the least of three."""
    times = []
    for _ in range(3):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return 1e3 * min(times)


def false_and_found(
    frame: DrawnFrame, detections: BoxDetections, kept: BoolArray, own: BoolArray
) -> tuple[int, int]:
    """How many of the boxes that are kept overlap no road user of their class, and road users found."""
    false = found = 0
    for name in CLASSES:
        truth: Boxes3D = frame.boxes[frame.category == name]
        rows = np.flatnonzero(kept & (detections.category == name))
        overlap = overlaps(truth, detections.boxes[rows])[0]
        false += int((overlap.max(axis=0, initial=0.0) <= LEAST_OVERLAP[name]).sum())
        right = overlap.max(axis=1, initial=0.0) > LEAST_OVERLAP[name]
        found += int((right & own[frame.category == name]).sum())
    return false, found


def measure(frame: DrawnFrame, tallies: dict[str, Tally]) -> None:
    """Detect in one cloud, with and without each area."""
    cloud, config = frame.cloud, ClassicalConfig()
    measurement = LidarMeasurement(0.0, 0, cloud, frame.ego, Mount(frame.ground_m, 0.0, 0.0))
    whole = detect(cloud, config)
    for name, area in areas(frame).items():
        tally = tallies[name]

        def on(xyz_m: FloatArray, area: MonitoredArea | Counting = area) -> BoolArray:
            return points_on(area.kept, measurement.places(xyz_m, frame.ego))

        def on_area(boxes: Boxes3D, category: StrArray, area: MonitoredArea | Counting = area) -> BoolArray:
            made = measurement.detections(boxes, np.ones(len(boxes)), category)
            return area.kept(made.boxes, made.category)

        cut = detect(cloud, config, monitored=on)
        tally.all_ms.append(spent_ms(partial(detect, cloud, config)))
        tally.cut_ms.append(spent_ms(partial(detect, cloud, config, monitored=on)))
        obstacles = next(stage.count for stage in cut.stages if stage.name == "ground")
        left = next(stage.count for stage in cut.stages if stage.name == "monitored area")
        tally.share.append(left / max(obstacles, 1))
        own = on_area(frame.boxes, frame.category) & (frame.points >= LEAST_POINTS)
        own &= np.hypot(*frame.boxes.center_m[:, :2].T) <= FARTHEST_M
        tally.labels += int(own.sum())
        everything = np.ones(len(whole), dtype=np.bool_)
        tally.false_all += false_and_found(frame, whole, everything, own)[0]
        false, found = false_and_found(frame, whole, on_area(whole.boxes, whole.category), own)
        tally.false_kept, tally.found_kept = tally.false_kept + false, tally.found_kept + found
        false, found = false_and_found(frame, cut, on_area(cut.boxes, cut.category), own)
        tally.false_cut, tally.found_cut = tally.false_cut + false, tally.found_cut + found


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--frames", type=int, default=40, help="of each sensor")
    parser.add_argument("--seed", type=int, default=2001)
    options = parser.parse_args()
    print(f"{host_name()}, one thread; {options.frames} frames of each sensor; medians in ms, false a frame")
    print(
        f"{'sensor':7} {'area':15} {'points':>7} {'ms all':>7} {'cut':>7} {'false all':>10} "
        f"{'kept':>6} {'cut':>6} {'found kept':>11} {'cut':>6} {'labels':>7}"
    )
    for number, (sensor, config) in enumerate(sensors()):
        tallies: dict[str, Tally] = defaultdict(Tally)
        for frame in drawn_frames(CHECKED_ON, config, options.frames, options.seed + number):
            measure(frame, tallies)
        for name, t in tallies.items():
            median = statistics.median
            false = [count / options.frames for count in (t.false_all, t.false_kept, t.false_cut)]
            print(
                f"{sensor:7} {name:15} {median(t.share):7.0%} {median(t.all_ms):7.2f} "
                f"{median(t.cut_ms):7.2f} {false[0]:10.2f} {false[1]:6.2f} {false[2]:6.2f} "
                f"{t.found_kept:11} {t.found_cut:6} {t.labels:7}"
            )


if __name__ == "__main__":
    main()
