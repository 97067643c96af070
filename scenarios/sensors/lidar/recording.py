"""A LiDAR that is cast along a recording: the world is what the labels say, on the ground of a map."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.poses import rigid, turned_about
from scenarios.sensors.lidar.config import LidarConfig, Mount
from scenarios.sensors.lidar.sensor import LidarSensor
from scenarios.sensors.lidar.street import BARE, CAR_M, Street
from scenarios.sensors.world import FlatGround, RoadSurface, World
from smartmot.arrays import FloatArray, IntArray
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import PointCloud
from smartmot.types import Boxes, EgoState

TICK_S = 0.01
"""Frames of a simulation are at multiples of it; the instant of a contact is not, and has no cloud."""
_SAME_S = 1e-6


class RecordedSweeps:
    """Clouds along a recording, made when they are asked for.

    Its frames are those at which a turn of the LiDAR can end: the first, and every next that is a turn or
    more later, evenly. Ego and others stand on the ground. Parked cars of the street are labels too, within
    the LiDAR's range.

    Args:
        sequence: with labels and ego poses of a vehicle whose middle is given.
        ego_speed_mps: (F,) its speeds, negative in reverse.
        config: the LiDAR.
        seed: of its noise.
        street: what stands along the road.
        surface: the ground.
    """

    def __init__(
        self,
        sequence: Sequence,
        ego_speed_mps: FloatArray,
        config: LidarConfig,
        seed: int = 0,
        street: Street = BARE,
        surface: RoadSurface | None = None,
    ) -> None:
        self._surface = surface or FlatGround()
        kept = turn_ends(sequence.stamp_s, config.pattern.rate_hz)
        self.left_out = len(sequence) - len(kept)
        self.config, self.street = config, street
        phase_s = float(sequence.stamp_s[kept[0]]) if len(kept) else 0.0
        self._sensor = LidarSensor(replace(config, phase_s=phase_s), seed, street)
        egos = _egos(sequence, ego_speed_mps)
        self._egos = [egos[k] for k in kept.tolist()]
        self._labels = _on_ground(_of_frames(sequence.labels, kept), self._surface, street)
        self.sequence = self._with_heights(_cut(sequence, kept))

    def __len__(self) -> int:
        return len(self._egos)

    def __iter__(self) -> Iterator[PointCloud]:
        """The clouds, one per frame."""
        return map(self.cloud, range(len(self)))

    def cloud(self, frame: int) -> PointCloud:
        """The cloud of a frame."""
        ego, labels = self._egos[frame], self._labels
        rows = slice(*np.searchsorted(labels.frame, [frame, frame + 1]).tolist())
        return self._sensor.measure(_world(labels[rows], ego.stamp_s, self._surface), ego).cloud

    def scan(self, frame: int) -> int:
        """Number of the cloud of a frame."""
        return self._sensor.timing.number_at(self._egos[frame].stamp_s)

    @property
    def ego_SE3_lidar(self) -> FloatArray:  # noqa: N802 - dst_SE3_src is the field's notation
        """(4, 4) pose of the sensor in the vehicle's frame."""
        return mounted(self.config.mount)

    def _with_heights(self, sequence: Sequence) -> Sequence:
        """The recording on the ground, with the parked cars."""
        assert sequence.world_SE3_ego is not None
        yaw = np.array([ego.yaw_rad for ego in self._egos])
        place = np.array([(ego.x_m, ego.y_m) for ego in self._egos]).reshape(-1, 2)
        pose = sequence.world_SE3_ego.copy()
        pose[:, 2, 3] = self._surface.elevation_m(place, yaw)
        first = int(self._labels.object_id.max(initial=-1)) + 1
        parked = parked_cars(self.street, place, self.config.range_m, first)
        return replace(sequence, labels=_merged(self._labels, parked), world_SE3_ego=pose)


def mounted(mount: Mount) -> FloatArray:
    """(4, 4) pose of a sensor in the frame of its vehicle, whose origin is on the ground under its middle."""
    place = np.array([[mount.forward_m, 0.0, mount.height_m]])
    pose: FloatArray = rigid(turned_about(1, np.array([mount.pitch_rad])), place)[0]
    return pose


def turn_ends(stamp_s: FloatArray, rate_hz: float) -> IntArray:
    """Frames of a recording at which clouds can end: evenly from the first on, no faster than the LiDAR."""
    ticks = np.rint((stamp_s - stamp_s[:1]) / TICK_S)
    on_grid = np.abs(ticks * TICK_S - (stamp_s - stamp_s[:1])) < _SAME_S
    ticks = ticks.astype(np.int64)
    step = math.gcd(*ticks[on_grid].tolist()) or 1
    stride = step * max(math.ceil(1.0 / (rate_hz * step * TICK_S) - 1e-9), 1)
    return np.flatnonzero(on_grid & (ticks % stride == 0))


def parked_cars(street: Street, place_m: FloatArray, range_m: float, first_id: int) -> Objects:
    """Labels of the street's parked cars in every frame from which they are within range.

    Args:
        street: what stands along the road.
        place_m: (F, 2) places of the sensor.
        range_m: of the sensor.
        first_id: identity of the first of them.
    """
    cars = street.rows_of("parked")
    position, yaw = street.bodies.position_m[cars], street.bodies.yaw_rad[cars]
    near = np.hypot(*np.moveaxis(place_m[:, None] - position[:, :2], -1, 0)) <= range_m
    frame, car = np.nonzero(near)
    length, width, height = CAR_M
    count = len(frame)
    return Objects.of(
        frame,
        position[car, :2],
        object_id=first_id + car,
        category=np.full(count, "car"),
        size_m=np.tile((length, width), (count, 1)),
        yaw_rad=wrap_angle(yaw[car]),
        bottom_m=position[car, 2],
        height_m=np.full(count, height),
        velocity_mps=np.zeros((count, 2)),
    )


def _egos(sequence: Sequence, speed_mps: FloatArray) -> list[EgoState]:
    """The ego at every frame; its turn rate is that since the frame before, as odometry has it."""
    xy_yaw, stamp_s = sequence.ego_xy_yaw(), sequence.stamp_s
    turn = wrap_angle(np.diff(xy_yaw[:, 2]))
    rate = np.concatenate((np.zeros(min(len(stamp_s), 1)), turn / np.diff(stamp_s)))
    columns = (stamp_s, *xy_yaw.T, speed_mps, np.zeros(len(stamp_s)), rate)
    return [EgoState(*row) for row in np.column_stack(columns).tolist()]


def _cut(sequence: Sequence, frames: IntArray) -> Sequence:
    """A recording's times and poses at some of its frames."""
    assert sequence.world_SE3_ego is not None
    return replace(
        sequence,
        stamp_s=sequence.stamp_s[frames],
        frame_name=tuple(sequence.frame_name[k] for k in frames.tolist()),
        detections=Objects.empty(),
        world_SE3_ego=sequence.world_SE3_ego[frames],
        stamp_ns=None if sequence.stamp_ns is None else sequence.stamp_ns[frames],
    )


def _of_frames(labels: Objects | None, frames: IntArray) -> Objects:
    """The labels of some frames, which are numbered anew."""
    assert labels is not None
    kept = labels[np.isin(labels.frame, frames)]
    return replace(kept, frame=np.searchsorted(frames, kept.frame))


def _on_ground(labels: Objects, surface: RoadSurface, street: Street) -> Objects:
    """The labels on the ground, or on the sidewalk."""
    ground = surface.elevation_m(labels.center_m, labels.yaw_rad)
    # every point is compared with every block of the sidewalks: not all at once
    parts = np.array_split(labels.center_m, len(labels) // 256 + 1)
    return replace(labels, bottom_m=ground + np.concatenate([street.raised_m(part) for part in parts]))


def _merged(labels: Objects, others: Objects) -> Objects:
    """Both, in the order of the frames."""
    names = Objects.__slots__
    columns = {name: np.concatenate((getattr(labels, name), getattr(others, name))) for name in names}
    return Objects.of(columns.pop("frame"), columns.pop("center_m"), **columns)


def _world(labels: Objects, time_s: float, surface: RoadSurface) -> World:
    """The labels of a frame as the world that a sensor measures."""
    along = np.column_stack((np.cos(labels.yaw_rad), np.sin(labels.yaw_rad)))
    everyone = np.ones(len(labels), dtype=np.bool_)
    return World(
        time_s,
        Boxes(labels.center_m, labels.size_m, labels.yaw_rad),
        np.einsum("kj,kj->k", along, labels.velocity_mps),
        labels.height_m,
        labels.object_id,
        labels.category,
        everyone,
        everyone,
        surface,
    )
