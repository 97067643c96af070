"""The ground as rays meet it: a plane, or a grid of heights on maps with hills."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarios.sensors.world import FlatGround, MapSurface, RoadSurface
from smartmot.arrays import FloatArray, IntArray
from smartmot.types import EgoState

STEP_M = 1.0
"""Distance of the heights that are taken from the map; between them the ground is bilinear."""

TILE = 32
"""Heights on a side of a tile, which is sampled when it is first near."""

WIDEST_M = 100.0
"""Half of the side of the square in which the ground has a relief; beyond it goes on as at the edge."""

MARCH = 1.08
"""Ratio of the ranges at which it is looked whether a ray has gone under the ground."""

REFINEMENTS = 12
"""Steps of the false position method; f is smooth, so that each gains a digit or more."""


class Terrain:
    """Heights of a road surface, sampled where a sensor comes by.

    Args:
        surface: the ground of the world.
    """

    def __init__(self, surface: RoadSurface) -> None:
        self.surface = surface
        self._tiles: dict[tuple[int, int, int], FloatArray] = {}

    @property
    def is_flat(self) -> bool:
        """Whether it is a plane."""
        if isinstance(self.surface, FlatGround):
            return True
        return isinstance(self.surface, MapSurface) and self.surface.is_level

    def around(self, ego: EgoState, forward_m: float, range_m: float) -> Relief:
        """The ground around a sensor, in the frame of the stamp.

        Where roads lie above one another, that counts along which the ego heads.
        """
        half = min(range_m, WIDEST_M)
        x, y = ego.x_m + forward_m * math.cos(ego.yaw_rad), ego.y_m + forward_m * math.sin(ego.yaw_rad)
        side = TILE * STEP_M
        columns = range(math.floor((x - half) / side), math.floor((x + half) / side) + 1)
        rows = range(math.floor((y - half) / side), math.floor((y + half) / side) + 1)
        quadrant = round(ego.yaw_rad / (0.5 * math.pi)) % 4
        grid = np.block([[self._tile(column, row, quadrant) for row in rows] for column in columns])
        return Relief(grid, (columns[0] * side, rows[0] * side), (x, y), ego.yaw_rad, range_m)

    def _tile(self, column: int, row: int, quadrant: int) -> FloatArray:
        key = column, row, quadrant
        if key not in self._tiles:
            along = STEP_M * np.arange(TILE)
            x, y = np.meshgrid(column * TILE * STEP_M + along, row * TILE * STEP_M + along, indexing="ij")
            points = np.column_stack((x.ravel(), y.ravel()))
            heading = np.full(len(points), 0.5 * math.pi * quadrant)
            self._tiles[key] = self.surface.elevation_m(points, heading).reshape(TILE, TILE)
        return self._tiles[key]


@dataclass(frozen=True, slots=True, eq=False)
class Relief:
    """A grid of heights as the rays of a cloud meet it.

    Args:
        grid: (X, Y) heights over the map's x and y, `STEP_M` apart.
        corner_m: x and y of the first.
        place_m: x and y of the sensor at the stamp.
        yaw_rad: heading of the ego at the stamp.
        range_m: how far rays are followed.
    """

    grid: FloatArray
    corner_m: tuple[float, float]
    place_m: tuple[float, float]
    yaw_rad: float
    range_m: float

    def height_m(self, x_m: FloatArray, y_m: FloatArray) -> FloatArray:
        """Height at points of the frame of the stamp."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        u = (self.place_m[0] + c * x_m - s * y_m - self.corner_m[0]) / STEP_M
        v = (self.place_m[1] + s * x_m + c * y_m - self.corner_m[1]) / STEP_M
        u, v = np.clip(u, 0.0, self.grid.shape[0] - 1.001), np.clip(v, 0.0, self.grid.shape[1] - 1.001)
        i, j = u.astype(np.int64), v.astype(np.int64)
        u, v = u - i, v - j
        low = (1.0 - u) * self.grid[i, j] + u * self.grid[i + 1, j]
        high = (1.0 - u) * self.grid[i, j + 1] + u * self.grid[i + 1, j + 1]
        height: FloatArray = (1.0 - v) * low + v * high
        return height

    def meet(
        self, start: FloatArray, height_m: float, direction: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(N,) ranges at which rays meet the ground, infinite for none, and cosines of incidence.

        Args:
            start: (N, 2) horizontal places where rays start.
            height_m: of all these.
            direction: (N, 3) unit vectors.
        """
        met_m, cosine = np.full(len(direction), np.inf), np.zeros(len(direction))
        ray, near, far = self._brackets(start, height_m, direction)
        if not len(ray):
            return met_m, cosine
        begin, ahead = start[ray], direction[ray]

        def over(s: FloatArray) -> FloatArray:
            ground = self.height_m(begin[:, 0] + s * ahead[:, 0], begin[:, 1] + s * ahead[:, 1])
            return height_m + s * ahead[:, 2] - ground

        at_near, at_far = over(near), over(far)
        moved = np.zeros(len(ray))
        for _ in range(REFINEMENTS):
            share = at_near / np.maximum(at_near - at_far, 1e-12)
            s = near + (far - near) * np.clip(share, 0.0, 1.0)
            value = over(s)
            above = value > 0.0
            # an end that stays twice counts half: the method of Illinois
            at_far = np.where(above, np.where(moved > 0.0, 0.5, 1.0) * at_far, value)
            at_near = np.where(above, value, np.where(moved < 0.0, 0.5, 1.0) * at_near)
            near, far = np.where(above, s, near), np.where(above, far, s)
            moved = np.where(above, 1.0, -1.0)
        met_m[ray] = s
        x, y = begin[:, 0] + s * ahead[:, 0], begin[:, 1] + s * ahead[:, 1]
        step = 0.5 * STEP_M
        slope_x = (self.height_m(x + step, y) - self.height_m(x - step, y)) / (2.0 * step)
        slope_y = (self.height_m(x, y + step) - self.height_m(x, y - step)) / (2.0 * step)
        dot = ahead[:, 2] - slope_x * ahead[:, 0] - slope_y * ahead[:, 1]
        cosine[ray] = np.abs(dot) / np.sqrt(1.0 + slope_x**2 + slope_y**2)
        return met_m, cosine

    def _brackets(
        self, start: FloatArray, height_m: float, direction: FloatArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Which rays go under the ground, and the ranges between which each does so first."""
        top = float(self.grid.max())
        ray = np.arange(len(direction))
        rays, nears, fars = [], [], []
        before, now = 0.0, 0.5
        while before < self.range_m and len(ray):
            x, y = start[ray, 0] + now * direction[ray, 0], start[ray, 1] + now * direction[ray, 1]
            z = height_m + now * direction[ray, 2]
            under = z <= self.height_m(x, y)
            rays.append(ray[under])
            nears.append(np.full(len(rays[-1]), before))
            fars.append(np.full(len(rays[-1]), now))
            ray = ray[~under & ((z <= top) | (direction[ray, 2] < 0.0))]
            before, now = now, now * MARCH
        return np.concatenate(rays), np.concatenate(nears), np.concatenate(fars)
