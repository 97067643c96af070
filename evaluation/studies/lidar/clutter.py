"""Clutter beside the lanes of drawn streets: foliage, hedges, facades, fences, cabinets, posts and bicycles.

All sizes are assumed; real clutter has more kinds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from opendrive import RoadNetwork
from scenarios.sensors.lidar import Street
from scenarios.sensors.lidar.bodies import unit_body
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, Bodies, Parts
from scenarios.sensors.world import MapSurface, World
from smartmot.types import EgoState

FARTHEST_M = 55.0
"""Of road users and clutter."""


def _parts(rows: Sequence[tuple[int, tuple[float, ...], tuple[float, ...]]], reflectivity: float) -> Parts:
    kind, center, half = zip(*rows, strict=True)
    return Parts(np.array(kind), np.array(center), np.array(half), np.full(len(rows), reflectivity))


def _foliage(rng: np.random.Generator) -> Parts:
    """Leaves: small ellipsoids in a larger one, from a bush to a young tree."""
    half = np.array([rng.uniform(0.2, 1.5), rng.uniform(0.2, 1.2), rng.uniform(0.3, 1.4)])
    bottom = rng.uniform(0.0, 0.4)
    count = int(rng.integers(15, 60))
    inside = rng.normal(0.0, 0.45, (count, 3)).clip(-1.0, 1.0) * half + (0.0, 0.0, half[2] + bottom)
    leaf = rng.uniform(0.05, 0.25, (count, 1)) * rng.uniform(0.6, 1.4, (count, 3))
    inside[:, 2] = np.maximum(inside[:, 2], leaf[:, 2])
    return _parts([(ELLIPSOID, tuple(c), tuple(h)) for c, h in zip(inside, leaf, strict=True)], 0.4)


def _hedge(rng: np.random.Generator) -> Parts:
    length, width, height = rng.uniform(2.0, 10.0), rng.uniform(0.4, 1.0), rng.uniform(0.6, 2.0)
    count = int(length * 4)
    rows = [(BLOCK, (0.0, 0.0, 0.5 * height), (0.5 * length, 0.5 * width, 0.5 * height))]
    for _ in range(count):
        at = (rng.uniform(-0.5, 0.5) * length, rng.uniform(-0.5, 0.5) * width, rng.uniform(0.2, 1.0) * height)
        rows.append((ELLIPSOID, at, tuple(rng.uniform(0.08, 0.35, 3))))
    return _parts(rows, 0.4)


def _facade(rng: np.random.Generator) -> Parts:
    """A wall with pilasters, steps, sills and bins in front of it."""
    length, height = rng.uniform(6.0, 18.0), rng.uniform(3.0, 9.0)
    rows = [(BLOCK, (0.0, 0.0, 0.5 * height), (0.5 * length, 0.2, 0.5 * height))]
    for _ in range(int(rng.integers(2, 9))):
        half = rng.uniform((0.1, 0.05, 0.15), (0.8, 0.4, 1.2))
        bottom = 0.0 if rng.random() < 0.6 else rng.uniform(0.3, 1.5)
        side = rng.choice((-1.0, 1.0))
        at = (
            rng.uniform(-0.5, 0.5) * length,
            side * (0.2 + half[1] * rng.uniform(0.6, 2.0)),
            bottom + half[2],
        )
        rows.append((BLOCK, at, tuple(half)))
    return _parts(rows, 0.25)


def _fence(rng: np.random.Generator) -> Parts:
    count, step, height = int(rng.integers(3, 12)), rng.uniform(0.3, 2.5), rng.uniform(0.8, 1.8)
    radius = rng.uniform(0.02, 0.06)
    along = step * (np.arange(count) - 0.5 * (count - 1))
    rows = [(COLUMN, (float(x), 0.0, 0.5 * height), (radius, radius, 0.5 * height)) for x in along]
    rows += [
        (BLOCK, (0.0, 0.0, level * height), (0.5 * step * count, 0.02, rng.uniform(0.02, 0.1)))
        for level in rng.uniform(0.3, 1.0, int(rng.integers(0, 4))).tolist()
    ]
    return _parts(rows, 0.3)


def _cabinet(rng: np.random.Generator) -> Parts:
    half = rng.uniform((0.15, 0.1, 0.35), (0.9, 0.4, 1.0))
    return _parts([(BLOCK, (0.0, 0.0, half[2]), tuple(half))], 0.4)


def _thick_post(rng: np.random.Generator) -> Parts:
    """Advertising columns, gate posts, trunks with shoots."""
    radius, height = rng.uniform(0.06, 0.5), rng.uniform(0.7, 5.0)
    rows = [(COLUMN, (0.0, 0.0, 0.5 * height), (radius, radius * rng.uniform(0.7, 1.0), 0.5 * height))]
    for _ in range(int(rng.integers(0, 6))):
        at = (*rng.normal(0.0, radius + 0.1, 2), rng.uniform(0.2, 1.0) * height)
        rows.append((ELLIPSOID, tuple(at), tuple(rng.uniform(0.05, 0.3, 3))))
    return _parts(rows, 0.25)


def _bollards(rng: np.random.Generator) -> Parts:
    """A row of them."""
    count, step = int(rng.integers(1, 7)), rng.uniform(1.0, 2.5)
    radius, height = rng.uniform(0.04, 0.12), rng.uniform(0.6, 1.2)
    along = step * (np.arange(count) - 0.5 * (count - 1))
    half = (radius, radius, 0.5 * height)
    return _parts([(COLUMN, (float(x), 0.0, 0.5 * height), half) for x in along], 0.35)


def _bicycles(rng: np.random.Generator) -> Parts:
    """Parked bicycles without riders, side by side."""
    body = unit_body("cyclist")
    frame = Parts(body.kind[:3], body.center_m[:3], body.half_m[:3], body.reflectivity[:3])
    frame = frame.scaled(np.array([1.75, 0.6, 1.8]))
    count = int(rng.integers(1, 5))
    shift = rng.uniform(0.4, 0.8) * np.arange(count)
    groups = [replace(frame, center_m=frame.center_m + np.array([0.0, t, 0.0])) for t in shift]
    columns = (np.concatenate([getattr(group, name) for group in groups]) for name in Parts.__slots__)
    return Parts(*columns)


def _foliage_wall(rng: np.random.Generator) -> Parts:
    """Bushes that have grown together, and the lower branches of trees."""
    half = rng.uniform((1.5, 0.5, 0.8), (4.0, 1.2, 2.0))
    count = int(rng.integers(60, 140))
    inside = rng.uniform(-1.0, 1.0, (count, 3)) * half + (0.0, 0.0, half[2])
    leaf = rng.uniform(0.08, 0.4, (count, 1)) * rng.uniform(0.6, 1.4, (count, 3))
    inside[:, 2] = np.maximum(inside[:, 2], leaf[:, 2])
    return _parts([(ELLIPSOID, tuple(c), tuple(h)) for c, h in zip(inside, leaf, strict=True)], 0.4)


def _tall_grass(rng: np.random.Generator) -> Parts:
    """Grass and shrubs up to the knee or the hip."""
    count = int(rng.integers(10, 50))
    half = rng.uniform(0.04, 0.3, (count, 1)) * rng.uniform(0.5, 1.2, (count, 3))
    place = np.column_stack((rng.normal(0.0, 1.2, (count, 2)), half[:, 2] * rng.uniform(0.3, 1.5, count)))
    return _parts([(ELLIPSOID, tuple(c), tuple(h)) for c, h in zip(place, half, strict=True)], 0.4)


def _waste_bins(rng: np.random.Generator) -> Parts:
    """Bins on wheels in a row: EN 840-1, 120 to 360 l, are 0.93 to 1.1 m high and 0.48 to 0.6 m wide."""
    rows = []
    for number in range(int(rng.integers(1, 5))):
        half = rng.uniform((0.24, 0.25, 0.45), (0.31, 0.45, 0.56))
        at = (rng.normal(0.0, 0.05), 0.7 * number, half[2])
        rows += [
            (BLOCK, at, tuple(0.92 * half)),
            (BLOCK, (at[0], at[1], 2.0 * half[2] - 0.03), (half[0] * 1.05, half[1], 0.04)),
        ]
    return _parts(rows, 0.3)


def _board(rng: np.random.Generator) -> Parts:
    """A board that stands on the ground, or one on a post with others under it."""
    wide = rng.uniform(0.25, 0.6)
    if rng.random() < 0.5:
        tall = rng.uniform(0.4, 0.9)
        rows = [(BLOCK, (x, 0.0, tall), (0.02, wide, tall)) for x in (-0.12, 0.12)]
        return _parts(rows, 0.4)
    rows = [(COLUMN, (0.0, 0.0, 1.2), (0.035, 0.035, 1.2))]
    for _ in range(int(rng.integers(1, 4))):
        half = (0.02, wide * rng.uniform(0.5, 1.0), rng.uniform(0.1, 0.4))
        rows.append((BLOCK, (0.05, rng.uniform(-0.1, 0.1), rng.uniform(0.6, 2.0)), half))
    return _parts(rows, 0.5)


def _post_with_bin(rng: np.random.Generator) -> Parts:
    """A post or lamp with what hangs on it: bins, boxes, parking meters."""
    radius, height = rng.uniform(0.03, 0.1), rng.uniform(1.2, 6.0)
    rows = [(COLUMN, (0.0, 0.0, 0.5 * height), (radius, radius, 0.5 * height))]
    for _ in range(int(rng.integers(1, 3))):
        half = rng.uniform((0.1, 0.1, 0.15), (0.25, 0.25, 0.4))
        rows.append(
            (BLOCK, (radius + half[0], 0.0, rng.uniform(0.4, 1.6)), tuple(half))
            if rng.random() < 0.5
            else (COLUMN, (radius + half[0], 0.0, rng.uniform(0.4, 1.1)), tuple(half))
        )
    return _parts(rows, 0.3)


def _terrace(rng: np.random.Generator) -> Parts:
    """Tables with chairs, and benches."""
    rows: list[tuple[int, tuple[float, ...], tuple[float, ...]]] = []
    for number in range(int(rng.integers(1, 4))):
        x = 1.8 * number
        rows += [
            (COLUMN, (x, 0.0, 0.72), (0.35, 0.35, 0.02)),
            (COLUMN, (x, 0.0, 0.36), (0.04, 0.04, 0.36)),
        ]
        for _ in range(int(rng.integers(0, 4))):
            turn, out = rng.uniform(-math.pi, math.pi), rng.uniform(0.5, 0.8)
            at = x + out * math.cos(turn), out * math.sin(turn)
            rows += [
                (BLOCK, (*at, 0.45), (0.2, 0.2, 0.03)),
                (
                    BLOCK,
                    (at[0] + 0.2 * math.cos(turn), at[1] + 0.2 * math.sin(turn), 0.65),
                    (0.03, 0.2, 0.25),
                ),
                (BLOCK, (*at, 0.22), (0.17, 0.17, 0.2)),
            ]
    return _parts(rows, 0.35)


def _street_front(rng: np.random.Generator) -> Parts:
    """Houses in a row: fronts that spring back and forth, with recesses of doors and windows, and steps."""
    rows, x = [], 0.0
    for _ in range(int(rng.integers(2, 5))):
        length, back, height = rng.uniform(4.0, 9.0), rng.uniform(-0.6, 0.6), rng.uniform(3.0, 10.0)
        rows.append((BLOCK, (x + 0.5 * length, back, 0.5 * height), (0.5 * length, 0.2, 0.5 * height)))
        for _ in range(int(rng.integers(2, 8))):
            half = rng.uniform((0.08, 0.03, 0.1), (0.7, 0.3, 1.2))
            bottom = 0.0 if rng.random() < 0.5 else rng.uniform(0.3, 1.6)
            side = float(rng.choice((-1.0, 1.0)))
            at = (x + rng.uniform(0.0, length), back + side * (0.2 + half[1]), bottom + half[2])
            rows.append((BLOCK, at, tuple(half)))
        x += length + (rng.uniform(1.0, 4.0) if rng.random() < 0.2 else 0.0)
    middle = 0.5 * x
    return _parts([(kind, (at[0] - middle, *at[1:]), half) for kind, at, half in rows], 0.25)


def _parked_truck(rng: np.random.Generator) -> Parts:
    """A lorry or a bus, which has no label here."""
    size = rng.uniform((6.0, 2.2, 2.5), (11.0, 2.55, 3.8))
    return unit_body("truck").scaled(size)


def _motorcycle(rng: np.random.Generator) -> Parts:
    """Without a rider."""
    body = unit_body("motorcycle")
    frame = Parts(body.kind[:3], body.center_m[:3], body.half_m[:3], body.reflectivity[:3])
    return frame.scaled(rng.uniform((1.8, 0.6, 1.7), (2.2, 0.9, 2.0)))


_CLUTTER: tuple[tuple[Callable[[np.random.Generator], Parts], float, float], ...] = (
    (_foliage, 0.28, 1.5), (_hedge, 0.12, 5.0), (_facade, 0.14, 9.0), (_fence, 0.10, 5.0),
    (_cabinet, 0.12, 0.9), (_thick_post, 0.08, 0.6), (_bicycles, 0.06, 1.5), (_bollards, 0.10, 5.0),
)  # fmt: skip
"""What makes it, its share, and how far it may reach from its place along its heading."""

_ROUGH = (
    *((make, 0.5 * share, reach) for make, share, reach in _CLUTTER),
    (_foliage_wall, 0.08, 4.0), (_tall_grass, 0.06, 2.0), (_waste_bins, 0.05, 1.0), (_board, 0.06, 0.6),
    (_post_with_bin, 0.08, 0.6), (_terrace, 0.04, 3.0), (_street_front, 0.07, 16.0),
    (_parked_truck, 0.03, 6.0), (_motorcycle, 0.03, 1.2),
)  # fmt: skip
"""The same for streets that are crowded with more kinds."""

COUNT, ROUGH_COUNT = (20, 90), (40, 160)
"""Least number of pieces, and from where on there are none, in `FARTHEST_M` ahead."""


def clutter_beside(
    network: RoadNetwork,
    surface: MapSurface,
    street: Street,
    ego: EgoState,
    world: World,
    rng: np.random.Generator,
    *,
    rough: bool = False,
) -> Bodies:
    """Pieces off the lanes for traffic, along the ego's heading or across, apart from road users.

    `rough`: more of them and of more kinds.
    """
    kinds, numbers = (_ROUGH, ROUGH_COUNT) if rough else (_CLUTTER, COUNT)
    count = int(rng.integers(*numbers))
    kind = rng.choice(len(kinds), count, p=[share for _, share, _ in kinds])
    distance, angle = FARTHEST_M * np.sqrt(rng.uniform(0.0, 1.0, count)), rng.uniform(-1.2, 1.2, count)
    heading = ego.yaw_rad + angle
    place = np.column_stack((np.cos(heading), np.sin(heading))) * distance[:, None] + (ego.x_m, ego.y_m)
    yaw = ego.yaw_rad + rng.normal(0.0, 0.15, count) + 0.5 * math.pi * (rng.random(count) < 0.25)
    reach = np.array([kinds[k][2] for k in kind.tolist()])
    along = np.column_stack((np.cos(yaw), np.sin(yaw)))
    probes = place[:, None] + along[:, None] * (reach[:, None] * np.linspace(-1.0, 1.0, 7))[..., None]
    hits = network.locate(probes.reshape(-1, 2))
    on_road = ~np.isin(network.lanes.lane_type[hits.lane], ("sidewalk", "none", "border"))
    free = np.ones(count, dtype=np.bool_)
    free[hits.point[on_road] // probes.shape[1]] = False
    gap = np.hypot(*np.moveaxis(probes[:, :, None] - world.boxes.center_m, -1, 0))
    free &= (gap > 0.8 + 0.5 * np.hypot(*world.boxes.size_m.T)).all(axis=(1, 2)) if len(world) else True
    rows = np.flatnonzero(free)
    at = place[rows]
    bottom = surface.elevation_m(at, yaw[rows]) + street.raised_m(at)
    parts = [kinds[k][0](rng) for k in kind[rows].tolist()]
    return Bodies.of(parts, np.column_stack((at, bottom)), yaw[rows])
