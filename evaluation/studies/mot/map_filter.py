"""Detections and labels limited to the lanes that matter to the ego vehicle (`smartmot.area`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evaluation.studies.mot.lanes import require_cover
from opendrive import RoadNetwork
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Objects, Sequence
from smartmot.area.monitored_area import MapArea, MapAreaConfig, MonitoredLanes
from smartmot.maps.route import route_ahead
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray

MAX_FROM_LANE_M = 3.0
"""A vehicle farther from every driving lane than a lane's width is off the map."""

_BEHIND_M = 100.0


@dataclass(frozen=True, slots=True)
class Filtered:
    """A filtered data set.

    Args:
        data: Detections in the monitored area only; labels outside it are ignored.
        dropped: Detections left out.
        off_map: Frames whose vehicle is beside all lanes; everything is kept in them.
    """

    data: Dataset
    dropped: int
    off_map: int


def filter_by_map(data: Dataset, network: RoadNetwork, config: MapAreaConfig | None = None) -> Filtered:
    """Keep what lies on lanes that matter, as the tracker's map strategy does while driving.

    The route is not known; it is taken to go straight on from the vehicle's lane, and is looked for again
    where the vehicle leaves it.

    Args:
        data: Recordings with ego poses, in the map's frame.
        network: The map.
        config: Lengths and margins of the monitored area.

    Raises:
        DatasetError: There are no ego poses, or the map does not cover them.
    """
    kept, dropped, off_map = [], 0, 0
    for sequence in data.sequences:
        if sequence.world_SE3_ego is None:
            raise DatasetError(
                f"--filter map: sequence {sequence.name} has no ego poses, which the filter needs"
            )
        require_cover(network, sequence.ego_xy_yaw()[:, :2], "ego poses of sequence " + sequence.name)
        areas = _areas(sequence, network, config or MapAreaConfig())
        inside = _inside(areas, sequence.detections)
        labels = sequence.labels
        if labels is not None:
            labels = replace(labels, ignored=labels.ignored | ~_inside(areas, labels))
        kept.append(replace(sequence, detections=sequence.detections[inside], labels=labels))
        dropped += int((~inside).sum())
        off_map += sum(area is None for area in areas)
    if off_map == data.frame_count:
        raise DatasetError(
            "--map: does not cover the data: "
            f"the vehicle is never within {MAX_FROM_LANE_M:g} m of a driving lane"
        )
    return Filtered(replace(data, sequences=tuple(kept)), dropped, off_map)


def _areas(sequence: Sequence, network: RoadNetwork, config: MapAreaConfig) -> list[MonitoredLanes | None]:
    """The monitored lanes of each frame; None off the map."""
    pose = sequence.ego_xy_yaw()
    nearest = network.nearest_lane(pose[:, :2])
    on_map = nearest.found & (nearest.distance_m <= MAX_FROM_LANE_M)
    speed = _speeds_mps(sequence.stamp_s, pose)
    areas: list[MonitoredLanes | None] = []
    strategy: MapArea | None = None
    for k, (x, y, yaw) in enumerate(pose.tolist()):
        if not on_map[k]:
            areas.append(None)
            continue
        lane = int(nearest.lane[k])
        if strategy is None or lane not in strategy.route.lanes or _ends(strategy, x, y, float(speed[k])):
            ahead = config.min_front_m + 2.0 * config.front_time_s * max(float(speed[k]), 20.0)
            route = route_ahead(
                network, lane, float(nearest.s_m[k]), ahead, _BEHIND_M, vru_margin_m=config.vru_margin_m
            )
            strategy = MapArea(network, route, config)
        areas.append(strategy.at(EgoState(float(sequence.stamp_s[k]), x, y, yaw, float(speed[k]))))
    return areas


def _ends(strategy: MapArea, x_m: float, y_m: float, speed_mps: float) -> bool:
    """Whether the route ends within the monitored length and may go on."""
    station, _ = strategy.route.project(x_m, y_m)
    short = strategy.route.length_m - station < strategy.front_m(speed_mps)
    return short and bool(strategy.network.successors(strategy.route.lanes[-1]))


def _speeds_mps(stamp_s: FloatArray, pose: FloatArray) -> FloatArray:
    """(F,) speeds since the frame before; the first frame has the second's."""
    if len(stamp_s) < 2:
        return np.zeros(len(stamp_s))
    elapsed = np.maximum(np.diff(stamp_s), 1e-3)
    speed = np.linalg.norm(np.diff(pose[:, :2], axis=0), axis=1) / elapsed
    return np.concatenate((speed[:1], speed))


def _inside(areas: list[MonitoredLanes | None], objects: Objects) -> BoolArray:
    """(K,) objects in the monitored area of their frame."""
    inside = np.ones(len(objects), dtype=np.bool_)
    start = objects.frame_starts(len(areas))
    for k, area in enumerate(areas):
        rows = slice(start[k], start[k + 1])
        if area is None or rows.start == rows.stop:
            continue
        boxes = Boxes(objects.center_m[rows], objects.size_m[rows], objects.yaw_rad[rows])
        inside[rows] = area.kept(boxes, objects.category[rows])
    return inside
