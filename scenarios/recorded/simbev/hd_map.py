"""SimBEV's `HD_MAP` lines: on which lane CARLA placed the ego, compared with a lane map of the same town.

A line has road, lane and station of the waypoint nearest to the ego, and where that waypoint is, in the
right-handed axes of the data set (CARLA's y negated), which are those of the town's OpenDRIVE file.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from opendrive import RoadNetwork
from scenarios.errors import DatasetError
from scenarios.reading import shown
from scenarios.recorded.simbev.reader import HD_MAPS, file_of, infos_of, scene_frames, simbev_root
from scenarios.recorded.textfile import read_json

STATION_TOLERANCE_M = 0.1
"""Stations within this are the same: CARLA keeps them as single floats, and samples its curves."""


@dataclass(frozen=True, slots=True)
class LaneComparison:
    """What a lane map says of the waypoints of a data set.

    Args:
        compared: lines read; frames without a file have none.
        differing: a text for each that the map places elsewhere.
    """

    compared: int
    differing: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Waypoint:
    """A line: its file, the lane as road, number and station, and the place as x, y and heading."""

    path: Path
    road: str
    lane: int
    s_m: float
    x_m: float
    y_m: float
    yaw_rad: float


def compare_lanes(folder: Path, network: RoadNetwork) -> LaneComparison:
    """Compare `nearest_lane` of a map with the `HD_MAP` lines of a SimBEV folder.

    Args:
        folder: as `read_simbev` takes it.
        network: the town's OpenDRIVE map.

    Raises:
        DatasetError: a file is wrong; the message names file and field.
    """
    root = simbev_root(folder)
    points = [
        _waypoint(file)
        for path in infos_of(folder)
        for name, frames in scene_frames(path).items()
        for info in frames
        if "HD_MAP" in info
        and (file := file_of(root, HD_MAPS, info, "HD_MAP", f"{path}: scene {name}")).is_file()
    ]
    if not points:
        return LaneComparison(0, ())
    # in a junction lanes lie over each other: the heading tells them apart
    nearest = network.nearest_lane(
        np.array([(point.x_m, point.y_m) for point in points]),
        heading_rad=np.array([point.yaw_rad for point in points]),
    )
    differing = []
    for k, point in enumerate(points):
        if not nearest.found[k]:
            differing.append(f"{point.path}: no driving lane")
            continue
        road, _, lane = network.lanes.key[int(nearest.lane[k])]
        s_m = float(nearest.s_m[k])
        if (road, lane) != (point.road, point.lane) or abs(s_m - point.s_m) > STATION_TOLERANCE_M:
            differing.append(
                f"{point.path}: road {point.road}, lane {point.lane}, s {point.s_m:.3f} m; "
                f"the map has road {road}, lane {lane}, s {s_m:.3f} m"
            )
    return LaneComparison(len(points), tuple(differing))


def _waypoint(path: Path) -> _Waypoint:
    content = read_json(path)
    if not isinstance(content, dict) or not isinstance(content.get("transform"), dict):
        raise DatasetError(f"{path}: expected an object with an object 'transform'")
    road = content.get("road_id")
    if not isinstance(road, (int, str)) or isinstance(road, bool):
        raise DatasetError(f"{path}: field 'road_id' must be a number or text, got {shown(road)}")
    lane = content.get("lane_id")
    if type(lane) is not int:
        raise DatasetError(f"{path}: field 'lane_id' must be a whole number, got {shown(lane)}")
    place = content["transform"]
    return _Waypoint(
        path,
        str(road),
        lane,
        _number(content, "s", path),
        _number(place, "x", path),
        _number(place, "y", path),
        math.radians(_number(place, "yaw", path)),
    )


def _number(values: dict[str, Any], name: str, path: Path) -> float:
    value = values.get(name)
    if not isinstance(value, (int, float)) or isinstance(value, bool) or not math.isfinite(value):
        raise DatasetError(f"{path}: field {name!r} must be a number, got {shown(value)}")
    return float(value)
