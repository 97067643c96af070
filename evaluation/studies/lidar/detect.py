"""Road users detected in recorded clouds, written for scores, trackers and drives."""

from __future__ import annotations

import platform
import statistics
import time
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.results.files import write_bytes
from evaluation.results.tables import Table, csv_bytes, fixed
from scenarios.errors import DatasetError
from scenarios.recorded.camera import image_boxes
from scenarios.recorded.clouds.arrays import AXES_KEPT
from scenarios.recorded.clouds.axes import boxes_ahead, boxes_of_sensor, cloud_ahead
from scenarios.recorded.clouds.fields import NamedCloud
from scenarios.recorded.clouds.files import cloud_files, read_clouds
from scenarios.recorded.csv_files import DETECTIONS, LABELS
from scenarios.recorded.kitti import (
    CATEGORY_OF_TYPE,
    MAX_OCCLUSION,
    MAX_TRUNCATION,
    NEIGHBOURS,
    TRACKING_COLUMNS,
    TYPE_OF_CATEGORY,
)
from scenarios.recorded.kitti_objects.calibration import Calibration, read_calibration
from scenarios.recorded.kitti_objects.labels import object_text
from scenarios.recorded.textfile import read_table
from scenarios.ros.bags.bag import is_bag
from smartmot.lidar import BoxDetections, DetectorConfig, detect
from smartmot.lidar.detections import Stage
from smartmot.pointcloud import Boxes3D, PointCloud

KITTI_FOLDER, STAGES_FOLDER = "kitti", "stages"

_BOX_COLUMNS = ("ahead_m", "left_m", "length_m", "width_m", "yaw_rad", "z_m", "height_m")


@dataclass(frozen=True, slots=True, eq=False)
class DetectedCloud:
    """A cloud and what was detected in it.

    Args:
        name: of the cloud.
        cloud: its points.
        detections: boxes in its frame.
        spent_s: processor time of the detector.
        ahead: axis of the sensor that points ahead: cloud and boxes are turned so that it is x.
    """

    name: str
    cloud: PointCloud
    detections: BoxDetections
    spent_s: float
    ahead: str = "x"


@dataclass(slots=True)
class Account:
    """What has been read and detected, and what is to be said of it.

    Args:
        clouds: how many.
        points: in all of them.
        boxes: by class.
        stages: of every cloud.
        spent_s: processor time of every cloud.
        notes: each once, with the number of clouds.
    """

    clouds: int = 0
    points: int = 0
    boxes: Counter[str] = field(default_factory=Counter)
    stages: list[tuple[Stage, ...]] = field(default_factory=list)
    spent_s: list[float] = field(default_factory=list)
    notes: Counter[str] = field(default_factory=Counter)

    @property
    def median_ms(self) -> float:
        """Processor time of a cloud."""
        return 1e3 * statistics.median(self.spent_s)

    def add(self, detected: DetectedCloud) -> None:
        """Count a cloud."""
        self.clouds += 1
        self.points += len(detected.cloud)
        self.boxes.update(detected.detections.category.tolist())
        self.stages.append(detected.detections.stages)
        self.spent_s.append(detected.spent_s)


def clouds_of(paths: Sequence[Path], topic: str | None, ahead: str | None = None) -> Iterator[NamedCloud]:
    """Clouds of files, folders and bags, one at a time, turned so that x is ahead and y left.

    Args:
        paths: what to read.
        topic: of bags.
        ahead: axis of the sensor that points ahead; None: as the format says it, x where it does not.

    Raises:
        DatasetError: there is no cloud, none has a point, or a file is damaged.
    """
    points = 0
    for path in paths:
        for named in read_clouds(path, topic):
            points += len(named.cloud)
            yield _turned(named, ahead or named.ahead)
    if not points:
        raise DatasetError(f"{', '.join(map(str, paths))}: no cloud has a point")


FAR_AWAY_M = 500.0
"""Farther than half of the echoes of any LiDAR on a road are."""


def _turned(named: NamedCloud, ahead: str) -> NamedCloud:
    notes = tuple(note for note in named.notes if note != AXES_KEPT)
    if named.dropped:
        notes = (*notes, "points with a value that is not finite dropped")
    if not len(named.cloud):
        notes = (*notes, "clouds without points")
    elif np.median(np.hypot(*named.cloud.xyz_m[:, :2].T)) > FAR_AWAY_M:
        notes = (
            *notes,
            f"half of the points are over {FAR_AWAY_M:g} m away: expected metres in the sensor's frame",
        )
    if ahead != "x":
        notes = (*notes, f"the sensor's {ahead} points ahead: clouds and boxes turned, x ahead and y left")
    return replace(named, cloud=cloud_ahead(named.cloud, ahead), notes=notes, ahead=ahead)


def cloud_count(paths: Iterable[Path]) -> int | None:
    """How many clouds files and folders have; None: there is a bag, of which it is not known."""
    count = 0
    for path in paths:
        if is_bag(path):
            return None
        count += len(cloud_files(path)) if path.is_dir() else 1
    return count


def detected_clouds(
    paths: Sequence[Path],
    topic: str | None,
    config: DetectorConfig,
    account: Account,
    ahead: str | None = None,
) -> Iterator[DetectedCloud]:
    """Detections of files, folders and bags, one cloud at a time; see `clouds_of`.

    Raises:
        DatasetError: there is no cloud, two have one name, or a file is damaged.
    """
    names: set[str] = set()
    for named in clouds_of(paths, topic, ahead):
        if named.name in names:
            raise DatasetError(
                f"two clouds are named {named.name}: name files of one format, or folders one by one"
            )
        names.add(named.name)
        account.notes.update(named.notes)
        detected = detected_cloud(named, config)
        account.add(detected)
        yield detected


def detected_cloud(named: NamedCloud, config: DetectorConfig) -> DetectedCloud:
    """The detections of one cloud, without the vehicle that carries the sensor."""
    start_s = time.thread_time()
    detections = detect(named.cloud, config)
    # a box with the sensor in it is the vehicle that carries it, of which real sensors see parts
    others = detections.distance_m > 0.0
    if not others.all():
        detections = replace(
            detections,
            boxes=detections.boxes[others],
            score=detections.score[others],
            category=detections.category[others],
            box_cluster=detections.box_cluster[others],
        )
    spent_s = time.thread_time() - start_s
    return DetectedCloud(named.name, named.cloud, detections, spent_s, named.ahead)


def times_line(account: Account) -> str:
    """Medians of the processor time of a cloud and of its stages, in words."""
    stages = ", ".join(
        f"{column[0].name} {1e3 * statistics.median(stage.elapsed_s for stage in column):.1f}"
        for column in zip(*account.stages, strict=True)
    )
    return f"{account.median_ms:.1f} ms of processor time a cloud: {stages}"


def stage_table(account: Account) -> Table:
    """Medians of the stages over the clouds."""
    rows = []
    for column in zip(*account.stages, strict=True):
        first = column[0]
        count = statistics.median(stage.count for stage in column)
        milliseconds = statistics.median(1e3 * stage.elapsed_s for stage in column)
        rows.append((first.name, f"{count:g}", first.unit, fixed(milliseconds, 2)))
    total = fixed(account.median_ms, 2)
    boxes = ", ".join(f"{name} {count}" for name, count in sorted(account.boxes.items())) or "none"
    caption = f"Medians over {account.clouds} clouds; boxes of all: {boxes}. Host: {host_name()}."
    return Table(("stage", "count", "unit", "ms"), tuple(rows), (("processor time", "", "", total),), caption)


def host_name() -> str:
    """The model of the processor, as the system says it."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    models = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return models[0] if models else platform.processor() or platform.machine()


class DetectionWriter:
    """Writes the detections of clouds into a folder: KITTI's result lines, and a table for all.

    Args:
        folder: where.
        calibrations: where the camera is; None: result lines have the sensor's axes and no image box.
        account: is given notes.
    """

    def __init__(self, folder: Path, calibrations: Calibrations | None, account: Account) -> None:
        self.folder, self.calibrations, self.account = folder, calibrations, account
        self.rows: list[tuple[int, tuple[object, ...]]] = []
        self.names: list[str] = []
        self.stamps: list[float | None] = []
        self.ahead: list[str] = []

    def add(self, detected: DetectedCloud) -> None:
        """Write one cloud's result lines and keep its rows of the table."""
        detections = detected.detections
        self.names.append(detected.name)
        self.stamps.append(detected.cloud.stamp_s)
        self.ahead.append(detected.ahead)
        text = self._kitti_text(detected)
        write_bytes(self.folder / KITTI_FOLDER / f"{detected.name}.txt", text.encode())
        cloud = len(self.names) - 1
        columns = (
            *_columns(detections.boxes),
            detections.score.tolist(),
            detections.category.tolist(),
            detections.distance_m.tolist(),
        )
        self.rows += [(cloud, row) for row in zip(*columns, strict=True)]

    def finish(self) -> None:
        """Write the table of all clouds."""
        name, times = self.times()
        rows = ((times[cloud], *row) for cloud, row in self.rows)
        header = (name, *_BOX_COLUMNS, "score", "category", "distance_m")
        write_bytes(self.folder / DETECTIONS, csv_bytes(header, rows))

    def times(self) -> tuple[str, list[float] | list[int]]:
        """Column and value that say when each cloud was measured."""
        stamps = [stamp for stamp in self.stamps if stamp is not None]
        if len(stamps) == len(self.stamps) and len(set(stamps)) == len(stamps):
            return "stamp_s", stamps
        if all(name.isdecimal() for name in self.names):
            return "frame", [int(name) for name in self.names]
        self.account.notes["clouds have neither times nor numbers: frames are counted from 0"] += 1
        return "frame", list(range(len(self.names)))

    def _kitti_text(self, detected: DetectedCloud) -> str:
        detections = detected.detections
        types = [TYPE_OF_CATEGORY[category] for category in detections.category.tolist()]
        if self.calibrations is None:
            return object_text(detections.boxes, types, SENSOR_AXES, detections.score, image=False)
        calibration = self.calibrations.of(detected.name)
        # a calibration is of the sensor as it is mounted
        boxes = boxes_of_sensor(detections.boxes, detected.ahead)
        ahead = calibration.to_camera(boxes.center_m)[:, 2] > 0.0
        pixels = image_boxes(calibration.boxes_to_camera(boxes), calibration.projection[2])
        seen = ahead & (pixels[:, 2] > pixels[:, 0]) & (pixels[:, 3] > pixels[:, 1])
        if not seen.all():
            self.account.notes["boxes outside the image are not in KITTI's result lines"] += 1
        kept = np.flatnonzero(seen)
        return object_text(
            boxes[kept], [types[k] for k in kept.tolist()], calibration, detections.score[kept]
        )


def _columns(boxes: Boxes3D) -> tuple[list[float], ...]:
    """The fields of `_BOX_COLUMNS`."""
    x, y, z = boxes.center_m.T.tolist()
    length, width, height = boxes.size_m.T.tolist()
    return x, y, length, width, boxes.yaw_rad.tolist(), z, height


class Calibrations:
    """KITTI's calibration of all clouds, or of each.

    Args:
        path: a file, or a folder with one file per cloud.

    Raises:
        DatasetError: the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._shared = None if path.is_dir() else read_calibration(path)

    def of(self, name: str) -> Calibration:
        """That of a cloud."""
        return self._shared or read_calibration(self._path / f"{name}.txt")


SENSOR_AXES = Calibration(
    np.broadcast_to(np.eye(3, 4), (4, 3, 4)).copy(),
    np.eye(3),
    np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]]),
)
"""A camera in the sensor's place that looks along its x: for result lines without a calibration."""


def write_labels(path: Path, calibrations: Calibrations, writer: DetectionWriter) -> None:
    """Labels of KITTI's tracking data beside the table of detections, in the sensor's frame.

    Raises:
        ArgumentError: the clouds have no numbers, or no label is in any of them.
        DatasetError: the file is wrong.
    """
    name, times = writer.times()
    if not all(cloud.isdecimal() for cloud in writer.names):
        raise ArgumentError("--labels: clouds need the numbers of their frames as names, such as 000100.bin")
    table = read_table(path, TRACKING_COLUMNS, ("type",), optional=1)
    time_of = dict(zip((int(cloud) for cloud in writer.names), times, strict=True))
    ahead_of = dict(zip((int(cloud) for cloud in writer.names), writer.ahead, strict=True))
    known = np.array([category in CATEGORY_OF_TYPE for category in table["type"].tolist()])
    inside = np.isin(table.whole("frame"), list(time_of))
    if not inside.any():
        raise ArgumentError(f"--labels: {path} has no label in frames {min(time_of)} to {max(time_of)}")
    rows: list[tuple[object, ...]] = []
    for number in sorted(time_of):
        chosen = table.rows(known & (table.whole("frame") == number))
        camera_boxes = chosen.stacked("h", "w", "l", "x", "y", "z", "ry")
        boxes = boxes_ahead(calibrations.of(f"{number:06d}").boxes_to_lidar(camera_boxes), ahead_of[number])
        # as `mot` reads KITTI's own folders
        ignored = np.isin(chosen["type"], NEIGHBOURS)
        ignored |= (chosen["truncated"] > MAX_TRUNCATION) | (chosen["occluded"] > MAX_OCCLUSION)
        columns = (chosen.whole("id").tolist(), chosen["type"].tolist(), ignored.astype(np.int64).tolist())
        rows += [
            (time_of[number], *row, identity, CATEGORY_OF_TYPE[kind], hidden)
            for *row, identity, kind, hidden in zip(*_columns(boxes), *columns, strict=True)
        ]
    header = (name, *_BOX_COLUMNS, "track_id", "category", "ignored")
    write_bytes(writer.folder / LABELS, csv_bytes(header, rows))
