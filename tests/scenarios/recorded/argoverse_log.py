"""A log of Argoverse 2 made by hand: a straight street, a car that drives along it, and what it meets."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from pyarrow import feather

START_NS = 315_966_253_660_357_000
FRAME_NS = 100_000_000
SPEED_MPS = 10.0

Columns = dict[str, list[Any]]


def poses(duration_s: float = 1.0, rate_hz: float = 170.0) -> Columns:
    """Along x at constant speed, from x = 20 m, in the middle of the lane at y = -1.75 m."""
    time_s = np.arange(0.0, duration_s + 1.0 / rate_hz, 1.0 / rate_hz)
    count = len(time_s)
    return {
        "timestamp_ns": [START_NS + round(1e9 * t) for t in time_s.tolist()],
        "qw": [1.0] * count,
        "qx": [0.0] * count,
        "qy": [0.0] * count,
        "qz": [0.0] * count,
        "tx_m": (20.0 + SPEED_MPS * time_s).tolist(),
        "ty_m": [-1.75] * count,
        "tz_m": [0.0] * count,
    }


def box(frame: int, name: str, x_m: float, y_m: float, category: str, **rest: Any) -> dict[str, Any]:
    """A box in the vehicle's frame, heading ahead, on the ground."""
    size = {"length_m": 4.0, "width_m": 2.0, "height_m": 1.6}
    turn = {"qw": 1.0, "qx": 0.0, "qy": 0.0, "qz": 0.0}
    place = {"tx_m": x_m, "ty_m": y_m, "tz_m": 0.8}
    row = {"timestamp_ns": START_NS + frame * FRAME_NS, "track_uuid": name, "category": category}
    return {**row, **size, **turn, **place, "num_interior_pts": 10, **rest}


def columns_of(rows: Sequence[Mapping[str, Any]]) -> Columns:
    return {name: [row[name] for row in rows] for name in rows[0]}


def boxes(frames: int = 10) -> list[dict[str, Any]]:
    """A car ahead in the lane, and a pedestrian at the kerb, 10 m ahead of where the vehicle begins."""
    rows = []
    for k in range(frames):
        driven_m = SPEED_MPS * k * FRAME_NS * 1e-9
        rows.append(box(k, "car", 20.0, 0.0, "REGULAR_VEHICLE"))
        small = {"length_m": 0.5, "width_m": 0.5}
        rows.append(box(k, "person", 10.0 - driven_m, -4.0, "PEDESTRIAN", **small))
    return rows


def write(path: Path, columns: Mapping[str, Sequence[Any]]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    feather.write_feather(pa.table(dict(columns)), path)
    return path


def log(folder: Path, rows: Sequence[Mapping[str, Any]] | None = None, name: str = "annotations") -> Path:
    """Poses, annotations and a map."""
    write(folder / "city_SE3_egovehicle.feather", poses())
    write(folder / f"{name}.feather", columns_of(boxes() if rows is None else rows))
    write_map(folder / "map" / "log_map_archive_street.json", street())
    return folder


# --- the map ------------------------------------------------------------------------------------------


def points(*places: tuple[float, float]) -> list[dict[str, float]]:
    return [{"x": x, "y": y, "z": 0.0} for x, y in places]


def lane(
    number: int, left: Sequence[tuple[float, float]], right: Sequence[tuple[float, float]], **fields: Any
) -> dict[str, Any]:
    return {
        "id": number,
        "is_intersection": False,
        "lane_type": "VEHICLE",
        "left_lane_boundary": points(*left),
        "right_lane_boundary": points(*right),
        "left_lane_mark_type": "NONE",
        "right_lane_mark_type": "NONE",
        "successors": [],
        "predecessors": [],
        "left_neighbor_id": None,
        "right_neighbor_id": None,
        **fields,
    }


def straight(
    number: int, from_m: float, to_m: float, left_m: float, right_m: float, **fields: Any
) -> dict[str, Any]:
    """A lane along x, or against it where `to_m` is less."""
    return lane(
        number, [(from_m, left_m), (to_m, left_m)], [(from_m, right_m), (to_m, right_m)], **fields
    )  # fmt: skip


def street() -> dict[str, Any]:
    """A street along x in two parts, each with two lanes one way, a cycle lane and an oncoming lane.

    Middle line at y = 3.5 m; lanes 10 and 20 at -1.75 m, 11 and 21 to their left, 12 and 22 oncoming. On the
    first part cycle lane 13 is at the right, and the drivable area ends 0.5 m beyond it, at y = -5.5 m; on
    the second it ends 2 m beside the lane. The oncoming lane is 3 m from the edge on its side.
    """
    lanes = [
        straight(10, 0, 60, 0.0, -3.5, left_neighbor_id=11, right_neighbor_id=13, successors=[20, 99],
                 left_lane_mark_type="DASHED_WHITE", right_lane_mark_type="SOLID_WHITE"),
        straight(11, 0, 60, 3.5, 0.0, left_neighbor_id=12, right_neighbor_id=10, successors=[21],
                 left_lane_mark_type="DOUBLE_SOLID_YELLOW", right_lane_mark_type="SOLID_DASH_WHITE"),
        straight(12, 60, 0, 3.5, 7.0, left_neighbor_id=11, left_lane_mark_type="DOUBLE_SOLID_YELLOW"),
        straight(13, 0, 60, -3.5, -5.0, left_neighbor_id=10, lane_type="BIKE"),
        straight(20, 60, 100, 0.0, -3.5, left_neighbor_id=21),
        straight(21, 60, 100, 3.5, 0.0, left_neighbor_id=22, right_neighbor_id=20, predecessors=[11]),
        straight(22, 100, 60, 3.5, 7.0, left_neighbor_id=21, successors=[12]),
    ]  # fmt: skip
    area = points((0, -5.5), (60, -5.5), (60, -5.5), (100, -5.5), (100, 10.0), (0, 10.0))
    crossing = {"edge1": points((30, -6), (30, 8)), "edge2": points((33, -6), (33, 8)), "id": 5}
    return {
        "lane_segments": {str(each["id"]): each for each in lanes},
        "drivable_areas": {"1": {"area_boundary": area, "id": 1}},
        "pedestrian_crossings": {"5": crossing},
    }


def write_map(path: Path, content: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))
    return path
