"""The LiDAR as a sensor of the closed loop: the world in, a cloud of points out."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenarios.sensors.interfaces import Timing
from scenarios.sensors.lidar.bodies import road_users
from scenarios.sensors.lidar.casting import Hits, Motion, RayTable, cast, moved
from scenarios.sensors.lidar.config import LidarConfig
from scenarios.sensors.lidar.measurement import LidarMeasurement, pitched
from scenarios.sensors.lidar.patterns import Rays
from scenarios.sensors.lidar.shapes import Bodies, joined
from scenarios.sensors.lidar.street import BARE, Street
from scenarios.sensors.lidar.terrain import Terrain
from scenarios.sensors.world import World
from smartmot.arrays import FloatArray, IntArray
from smartmot.pointcloud import PointCloud
from smartmot.types import EgoState

GROUND_REFLECTIVITY = 0.15
"""Of asphalt, near infrared: assumed."""


class LidarSensor:
    """Casts the rays of a LiDAR against road users, the ground, kerbs and street furniture.

    Errors of cloud k are the same whatever is in the scene. The ego is level and has no body of its own.

    Args:
        config: the LiDAR.
        seed: of noise and dropout.
        street: what stands along the road; `BARE`: nothing, and the road has no kerbs.
        compiled: see `casting.cast`.
    """

    def __init__(
        self, config: LidarConfig, seed: int = 0, street: Street = BARE, *, compiled: bool | None = None
    ) -> None:
        self.config, self.seed, self.street, self.compiled = config, seed, street, compiled
        self._terrain: Terrain | None = None
        self.timing = Timing(config.pattern.rate_hz, config.phase_s, config.latency_s)

    def measure(self, world: World, ego: EgoState) -> LidarMeasurement:
        """The cloud that ends with the world's time."""
        return self.label(world, ego)[0]

    def label(self, world: World, ego: EgoState) -> tuple[LidarMeasurement, IntArray]:
        """The cloud, and (N,) the row in the world of the road user on which each point is, or -1.

        The second is ground truth: it is for labels and tests, and no detector gets it.
        """
        number = self.timing.number_at(world.time_s)
        rays = self.config.pattern.rays(number)
        table, row_of = ray_table(rays, self.config.mount.pitch_rad)
        ground = world.ego_ground_m
        if ground is None:
            at = np.array([[ego.x_m, ego.y_m]])
            ground = float(world.surface.elevation_m(at, np.array([ego.yaw_rad]))[0])
        rows = np.flatnonzero(world.seen & world.exists)
        bodies = self._bodies(world, rows, ego)
        mount = self.config.mount
        motion = Motion(ground + mount.height_m, ego.speed_mps, ego.yaw_rate_radps, mount.forward_m)
        terrain = self._terrain_of(world)
        relief = None if terrain.is_flat else terrain.around(ego, mount.forward_m, self.config.range_m)
        hits = cast(table, motion, bodies, ground if relief is None else relief, compiled=self.compiled)
        ray, range_m = self._echoes(hits, row_of, number)
        row = row_of[ray]
        cloud = self._cloud(rays, table, motion, hits, (ray, row, range_m), bodies, world.time_s)
        body = hits.body[row]
        user = (body >= 0) & (body < len(rows))
        labels = np.full(len(body), -1, dtype=np.int64)
        labels[user] = rows[body[user]]
        return LidarMeasurement(world.time_s, number, cloud, ego, mount), labels

    def _terrain_of(self, world: World) -> Terrain:
        """The ground of the world; heights that have been sampled are kept while it is the same."""
        if self._terrain is None or self._terrain.surface is not world.surface:
            self._terrain = Terrain(world.surface)
        return self._terrain

    def _bodies(self, world: World, rows: IntArray, ego: EgoState) -> Bodies:
        """Road users, then the street around the ego, in the frame of the stamp."""
        boxes = world.boxes[rows]
        if world.ground_m is None:
            bottom = world.surface.elevation_m(boxes.center_m, boxes.yaw_rad)
        else:
            bottom = world.ground_m[rows]
        bottom = bottom + self.street.raised_m(boxes.center_m)
        users = road_users(
            world.category[rows],
            np.column_stack((boxes.size_m, world.height_m[rows])),
            np.column_stack((boxes.center_m, bottom)),
            boxes.yaw_rad,
            world.velocity_mps[rows],
        )
        near = self.street.near(ego.x_m, ego.y_m, self.config.range_m)
        c, s = np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)
        sensor = np.array(
            [ego.x_m + self.config.mount.forward_m * c, ego.y_m + self.config.mount.forward_m * s]
        )
        return joined([users, near]).seen_from(sensor, ego.yaw_rad)

    def _echoes(self, hits: Hits, row: IntArray, number: int) -> tuple[IntArray, FloatArray]:
        """(M,) rays of the pattern that have an echo, and (M,) their ranges with noise.

        Args:
            hits: of the table of rays.
            row: (N,) the row of each ray of the pattern in that table.
            number: of the cloud.
        """
        config, count = self.config, len(row)
        rng = np.random.default_rng((self.seed, number))
        echo = ((hits.range_m >= config.blind_m) & (hits.range_m <= config.range_m)).take(row)
        # drawn for all rays, so that what one meets changes no other's error
        noise = rng.standard_normal(count, dtype=np.float32) if config.range_sigma_m > 0.0 else None
        if config.dropout > 0.0:
            echo &= rng.random(count) >= config.dropout
        ray = np.flatnonzero(echo)
        range_m = hits.range_m.take(row.take(ray))
        return ray, range_m if noise is None else range_m + config.range_sigma_m * noise.take(ray)

    def _cloud(
        self,
        rays: Rays,
        table: RayTable,
        motion: Motion,
        hits: Hits,
        echo: tuple[IntArray, IntArray, FloatArray],
        bodies: Bodies,
        stamp_s: float,
    ) -> PointCloud:
        """The points of the echoes: their rays in the pattern and in the table, and their ranges."""
        ray, row, range_m = echo
        if self.config.motion_compensated and not motion.stands:
            place, direction = moved(table, motion)
            level = direction.take(row, axis=0)
            level *= range_m[:, None]
            level[:, :2] += place.take(row, axis=0)
            points = pitched(level, -self.config.mount.pitch_rad)
        else:
            points = rays.direction.take(ray, axis=0) * range_m[:, None]
        part = hits.part.take(row)
        # -1 takes the last: what is no part is the ground
        reflectivity = np.append(bodies.parts.reflectivity, GROUND_REFLECTIVITY).take(part)
        return PointCloud(
            points.astype(np.float32),
            (reflectivity * hits.cosine.take(row)).astype(np.float32),
            rays.ring.take(ray),
            rays.time_offset_s.take(ray).astype(np.float32),
            "lidar",
            stamp_s,
        )


@lru_cache(maxsize=64)
def ray_table(rays: Rays, pitch_rad: float) -> tuple[RayTable, IntArray]:
    """The rays in the level frame, and (N,) the row of each in the table; tabulated once."""
    table, order = RayTable.of(pitched(rays.direction, pitch_rad), rays.time_offset_s)
    row = np.empty(len(order), dtype=np.int64)
    row[order] = np.arange(len(order))
    return table, row
