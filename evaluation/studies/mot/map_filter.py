"""Detections and labels limited to the lanes that matter to the ego vehicle (`smartmot.area`)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evaluation.studies.mot.lanes import require_cover
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Objects, Sequence
from scenarios.recorded.maps.drive_map import DriveMap
from scenarios.sources.frames import frames
from scenarios.sources.recorded import RecordedSource
from smartmot.area import MapArea, MapAreaConfig, MonitoredLanes
from smartmot.maps.follow import MAX_FROM_LANE_M, routes_from_poses
from smartmot.types import BoolArray, Boxes

_NEW_ROUTE_FACTOR, _NEW_ROUTE_MPS = 2.0, 20.0
"""A new route goes on for twice what is driven within the monitored time at this speed, or at a greater one
of the vehicle: at 72 km/h it is looked for once in 60 m."""


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


def filter_by_map(data: Dataset, network: DriveMap, config: MapAreaConfig | None = None) -> Filtered:
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


def _areas(sequence: Sequence, network: DriveMap, config: MapAreaConfig) -> list[MonitoredLanes | None]:
    """The monitored lanes of each frame; None off the map."""
    egos = [frame.ego for frame in frames(RecordedSource(sequence, network))]
    place = np.array([(ego.x_m, ego.y_m) for ego in egos]).reshape(-1, 2)
    speed = np.array([abs(ego.speed_mps) for ego in egos])
    monitored_m = np.maximum(config.min_front_m, config.front_time_s * speed)
    new_m = config.min_front_m + _NEW_ROUTE_FACTOR * config.front_time_s * np.maximum(speed, _NEW_ROUTE_MPS)
    heights_m = sequence.ego_heights_m()
    routes = routes_from_poses(network, place, monitored_m, new_m, config.vru_margin_m, z_m=heights_m)
    areas: list[MonitoredLanes | None] = []
    strategy: MapArea | None = None
    for ego, route in zip(egos, routes, strict=True):
        if route is None:
            areas.append(None)
            continue
        if strategy is None or strategy.route is not route:
            strategy = MapArea(network, route, config)
        areas.append(strategy.at(ego))
    return areas


def _inside(areas: list[MonitoredLanes | None], objects: Objects) -> BoolArray:
    """(K,) objects in the monitored area of their frame."""
    inside = np.ones(len(objects), dtype=np.bool_)
    for area, rows in zip(areas, objects.frame_rows(len(areas)), strict=True):
        if area is None or rows.start == rows.stop:
            continue
        boxes = Boxes(objects.center_m[rows], objects.size_m[rows], objects.yaw_rad[rows])
        inside[rows] = area.kept(boxes, objects.category[rows])
    return inside
