"""Argoverse 2: a scenario of the Motion Forecasting Dataset, its tracks as labels.

Files of a scenario (av2 0.3.6, datasets/motion_forecasting/data_schema.py)::

    scenario_<id>.parquet          track_id, object_type, timestep, position_x, position_y, heading,
                                   velocity_x, velocity_y: ten states a second, in the city's frame
    log_map_archive_<id>.json      (optional) the vector map, see `scenarios.recorded.argoverse.archive`

Track AV is the vehicle that recorded. Places are on the ground, and sizes are not recorded: each type of
object has its usual one.
"""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.archive import ARCHIVES
from scenarios.recorded.argoverse.poses import NS, VehiclePoses
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, categories, read_classes, require_categories
from scenarios.recorded.dataset import LEFT_OUT, Dataset, Objects, Sequence, finished
from scenarios.recorded.tables.columns import numbered
from scenarios.recorded.tables.parquet import read_parquet_table
from scenarios.recorded.textfile import MAX_FRAMES, TextTable, is_given
from smartmot.types import FloatArray

SCENARIOS = "scenario_*.parquet"
EGO_TRACK = "AV"

CATEGORY_OF_TYPE = {
    "vehicle": "car",
    "bus": "truck",
    "pedestrian": "pedestrian",
    "cyclist": "cyclist",
    "motorcyclist": "motorcycle",
    "riderless_bicycle": "cyclist",
    "unknown": "unknown",
    "static": LEFT_OUT,
    "background": LEFT_OUT,
    "construction": LEFT_OUT,
}
"""All ten types of objects (av2 0.3.6, data_schema.py). Left out are those that are no road users."""

SIZE_OF_TYPE = {
    "vehicle": (4.3, 1.9, 1.6),
    "bus": (12.0, 2.55, 3.2),
    "pedestrian": (0.6, 0.7, 1.7),
    "cyclist": (2.0, 0.7, 1.7),
    "motorcyclist": (2.0, 0.7, 1.6),
    "riderless_bicycle": (1.7, 0.5, 1.2),
}
"""Length, width, height. Vehicles, pedestrians and bicycles: medians of the labels of two logs of the Sensor
Dataset (155, 29 and 14 objects). Riders: what av2's pictures show (av2 0.3.6, viz/scenario_visualization.py).
Bus: 12 m, and the greatest width of Directive 96/53/EC. Heights of riders and bus are assumed."""

OTHER_SIZE = (0.5, 0.5, 1.0)
"""Of all other types; assumed."""

_FRAME_NS = 100_000_000
_NUMBERS = ("timestep", "position_x", "position_y", "heading", "velocity_x", "velocity_y")
_TEXTS = ("track_id", "object_type")

SMOOTHED_MPS = 1.0
"""Where the vehicle's places move at a speed that differs by more from its velocity, a note says so."""


def scenario_files(path: Path) -> list[Path]:
    """Scenarios in a folder, or the one that is named; none: it is something else."""
    if path.is_file():
        return [path] if path.match(SCENARIOS) else []
    return sorted(path.glob(SCENARIOS))


def read_scenarios(paths: list[Path]) -> Dataset:
    """Read scenarios: tracks as labels, the vehicle's as poses.

    Args:
        paths: Files `scenario_<id>.parquet`, one recording each.

    Raises:
        DatasetError: A file is wrong; the message names file, row and field.
    """
    classes = read_classes(paths[0].parent, CATEGORY_OF_TYPE)
    left_out: Counter[str] = Counter()
    sequences, off_mps = [], {}
    for path in paths:
        table = _read(path, classes)
        ego, others = (table.rows((table["track_id"] == EGO_TRACK) == own) for own in (True, False))
        left_out.update(kind for kind in others["object_type"].tolist() if classes[kind] == LEFT_OUT)
        sequences.append(_sequence(path, ego, others, classes))
        off_mps[sequences[-1].name] = _off_mps(ego)
    notes = ["sizes are not recorded: the usual one of each type of object is taken", *_doubts(off_mps)]
    if left_out:
        listed = ", ".join(f"{count} {name}" for name, count in sorted(left_out.items()))
        notes.append(f"labels left out, for they are no road users: {listed}")
    return finished("argoverse", sequences, tuple(notes))


def _read(path: Path, classes: ClassMap) -> TextTable:
    """A file, its rows in the order of time."""
    table = read_parquet_table(path, (*_TEXTS, *_NUMBERS), _NUMBERS, _TEXTS)
    if not len(table):
        raise DatasetError(f"{path}: no rows; there is nothing to track")
    rule = f"must be one of Argoverse 2, or stand in {CLASSES_CSV}"
    require_categories(table, "object_type", classes, rule)
    step = table["timestep"]
    table.require((step >= 0.0) & (step < MAX_FRAMES), "timestep", f"must be 0 to {MAX_FRAMES - 1}")
    table.columns["timestep"] = table.whole("timestep")
    return table.rows(np.argsort(table["timestep"], kind="stable"))


def _sequence(path: Path, ego: TextTable, others: TextTable, classes: ClassMap) -> Sequence:
    if not len(ego):
        raise DatasetError(f"{path}: no track {EGO_TRACK!r}, the vehicle that recorded")
    ego.require_finite(*_NUMBERS)
    rises = np.diff(ego["timestep"], prepend=-1) > 0
    ego.require(rises, "timestep", f"must be there once for track {EGO_TRACK}")
    steps = np.union1d(ego["timestep"], others["timestep"])
    poses = VehiclePoses(
        path,
        _FRAME_NS * ego["timestep"],
        Rotation.from_euler("z", ego["heading"][:, None]),
        np.column_stack((ego["position_x"], ego["position_y"], np.zeros(len(ego)))),
    )
    name = path.stem.removeprefix("scenario_")
    own_map = path.with_name(ARCHIVES.replace("*", name))
    kind = others["object_type"]
    size = np.array([SIZE_OF_TYPE.get(each, OTHER_SIZE) for each in kind.tolist()]).reshape(-1, 3)
    labels = Objects.of(
        np.searchsorted(steps, others["timestep"]),
        others.stacked("position_x", "position_y"),
        object_id=numbered(others["track_id"]).astype(np.int64),
        category=categories(kind, classes),
        kind=kind,
        size_m=size[:, :2],
        height_m=size[:, 2],
        yaw_rad=others["heading"],
        velocity_mps=others.stacked("velocity_x", "velocity_y"),
    )
    return Sequence(
        name=name,
        stamp_s=NS * _FRAME_NS * steps,
        frame_name=tuple(map(str, steps.tolist())),
        detections=Objects.empty(),
        labels=labels,
        world_SE3_ego=poses.at(_FRAME_NS * steps),
        map_path=own_map if is_given(own_map) else None,
    )


def _off_mps(ego: TextTable) -> FloatArray:
    """(P - 1,) speeds at which the vehicle's places move beside its recorded velocities."""
    time_s = NS * _FRAME_NS * ego["timestep"]
    place, velocity = ego.stacked("position_x", "position_y"), ego.stacked("velocity_x", "velocity_y")
    with np.errstate(over="ignore", invalid="ignore"):  # of places that are none
        moved_mps = np.diff(place, axis=0) / np.diff(time_s)[:, None]
        off_mps: FloatArray = np.hypot(*(moved_mps - 0.5 * (velocity[1:] + velocity[:-1])).T)
    return off_mps


def _doubts(off_mps: dict[str, FloatArray]) -> list[str]:
    """A line on vehicles whose places do not move as their velocities say, as smoothed ways at their ends."""
    doubtful = {name: float(off.max()) for name, off in off_mps.items() if (off > SMOOTHED_MPS).any()}
    if not doubtful:
        return []
    worst = max(doubtful, key=lambda name: doubtful[name])
    steps = np.flatnonzero(off_mps[worst] > SMOOTHED_MPS)
    return [
        f"in {len(doubtful)} of {len(off_mps)} scenarios the vehicle's places move at other speeds than its "
        f"recorded velocities, up to {doubtful[worst]:.1f} m/s off in {worst} ({len(steps)} of "
        f"{len(off_mps[worst])} steps): its decelerations there are doubtful"
    ]
