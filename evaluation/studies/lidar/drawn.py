"""Clouds of streets drawn at random, with their road users as truth: for fitting, calibration and tests.

Streets are those of `furnished_street` with clutter beside the lanes that it does not have: foliage, hedges,
facades, fences, cabinets and bicycles without riders. All sizes are assumed; real clutter has more kinds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from opendrive import RoadNetwork, load_map
from scenarios.sensors.lidar import LidarConfig, LidarSensor, Mount, Street, furnished_street
from scenarios.sensors.lidar.bodies import unit_body
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, Bodies, Parts, joined
from scenarios.sensors.lidar.street import CAR_M
from scenarios.sensors.world import MapSurface, World
from smartmot.arrays import FloatArray, IntArray, StrArray
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import Boxes, EgoState

CLASSES = ("pedestrian", "cyclist", "car")
"""Those of which there is truth."""

FRAMES_PER_STREET = 4
"""The same street is seen from so many places, with other road users."""

FARTHEST_M = 55.0
"""Of road users and clutter."""


@dataclass(frozen=True, slots=True, eq=False)
class DrawnFrame:
    """A cloud and what is in it.

    Args:
        cloud: sensor's frame.
        boxes: T boxes of road users, parked cars too, in that frame.
        category: (T,) out of `CLASSES`.
        points: (T,) points in each box.
        ground_m: height of the sensor over the ground.
        network: the map.
        ego: where the sensor is on it.
    """

    cloud: PointCloud
    boxes: Boxes3D
    category: StrArray
    points: FloatArray
    ground_m: float
    network: RoadNetwork
    ego: EgoState


def drawn_frames(
    maps: Sequence[Path],
    config: LidarConfig,
    count: int,
    seed: int,
    *,
    clutter: bool = True,
    in_the_way: float = 0.0,
    first: int = 0,
    mount: Mount | None = None,
    in_turn: bool = False,
) -> Iterator[DrawnFrame]:
    """Frames on maps by turns.

    Args:
        maps: OpenDRIVE files.
        config: the LiDAR.
        count: frames.
        seed: of all that is drawn.
        clutter: whether there is more than `furnished_street` has.
        in_the_way: share of people, or groups, who are no farther aside than a vehicle is wide, as a rule.
        first: number of the first frame, a multiple of `FRAMES_PER_STREET`.
        mount: of the LiDAR; None: it is drawn for every frame, 1.4 to 2.1 m high, pitched up to 1.5 degrees.
        in_turn: whether each frame is a scan of its own number; else all are scan 0, whose rays a rosette
            repeats.
    """
    for number in range(first, first + count):
        rng = np.random.default_rng((seed, number))
        if number % FRAMES_PER_STREET == 0:
            network = load_map(maps[(number // FRAMES_PER_STREET) % len(maps)])
            surface = MapSurface(network)
            street = furnished_street(
                network, rng.uniform(3.0, 14.0), int(rng.integers(2**31)), parked_share=rng.uniform(0.0, 0.8)
            )
        drawn_mount = mount or Mount(rng.uniform(1.4, 2.1), 0.0, math.radians(rng.uniform(-1.5, 1.5)))
        sensor_config = replace(config, mount=drawn_mount)
        ego = _ego(network, rng)
        world = _world(network, surface, street, ego, in_the_way, rng)
        if in_turn:
            world = replace(world, time_s=number / config.pattern.rate_hz)
        own_street = street
        if clutter:
            extra = _clutter(network, surface, street, ego, world, rng)
            own_street = replace(street, bodies=joined([street.bodies, extra]))
        sensor = LidarSensor(sensor_config, int(rng.integers(2**31)), own_street)
        cloud = _smeared(sensor.measure(world, ego).cloud, rng)
        frame = _frame(cloud, world, street, network, ego, drawn_mount)
        yield _spoked(frame, rng)


def _ego(network: RoadNetwork, rng: np.random.Generator) -> EgoState:
    lanes = network.lanes
    driving = np.flatnonzero((lanes.lane_type == "driving") & (lanes.s_end_m - lanes.s_start_m > 5.0))
    lane = int(rng.choice(driving))
    s = rng.uniform(float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane]))
    x, y, _, yaw = (float(column[0]) for column in network.center_line(np.array([lane]), np.array([s])))
    return EgoState(0.0, x, y, yaw, 0.0)


@dataclass(frozen=True, slots=True)
class _Kind:
    """Sizes of a class: least and greatest length, width and height, and greatest speed."""

    category: str
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    speed_mps: float


# legs of bodies are upright up to the hip: a longer stride would make them deeper than people are
_ADULT = _Kind("pedestrian", (0.35, 0.45, 1.5), (0.7, 0.65, 1.95), 2.0)
_CHILD = _Kind("pedestrian", (0.3, 0.3, 0.95), (0.5, 0.45, 1.35), 2.0)
_CYCLIST = _Kind("cyclist", (1.6, 0.5, 1.6), (1.95, 0.75, 1.9), 7.0)
_CAR = _Kind("car", (3.5, 1.6, 1.38), (5.0, 1.95, 1.75), 14.0)
_VAN = _Kind("car", (4.8, 1.85, 1.9), (6.0, 2.05, 2.1), 14.0)


def drawn_size(category: str, rng: np.random.Generator) -> FloatArray:
    """(3,) length, width and height of one of `CLASSES`; a fifth of the pedestrians are children."""
    people = _CHILD if rng.random() < 0.2 else _ADULT
    kind = {"pedestrian": people, "cyclist": _CYCLIST, "car": _CAR}[category]
    size: FloatArray = rng.uniform(kind.low_m, kind.high_m)
    return size


GROUPS = (0.6, 0.28, 0.08, 0.04)
"""Shares of one, two, three and four people who walk together: half of all people in streets and more do,
most of them in pairs (Moussaid, Perozo, Garnier, Helbing, Theraulaz, "The walking behaviour of pedestrian
social groups and its impact on crowd dynamics", PLoS ONE 5, 2010)."""

VEHICLE_M = 1.8
"""Width of a vehicle, assumed."""

APART_M = (0.6, 1.0)
"""Between the middles of two who walk side by side: about 0.8 m in the same observations."""


def _world(
    network: RoadNetwork,
    surface: MapSurface,
    street: Street,
    ego: EgoState,
    in_the_way: float,
    rng: np.random.Generator,
) -> World:
    """People anywhere on and beside the road, riders and cars along lanes; none touches another."""
    place: list[FloatArray] = []
    yaw: list[float] = []
    kinds: list[_Kind] = []
    people = int(rng.integers(2, 10))
    while len(kinds) < people:
        # most of them where a vehicle looks: ahead
        distance, angle = rng.uniform(4.0, 45.0), float(np.clip(rng.normal(0.0, 0.4), -0.9, 0.9))
        if in_the_way and rng.random() < in_the_way:
            angle = math.atan2(rng.normal(0.0, 0.5 * VEHICLE_M), distance)
        near = np.array([math.cos(ego.yaw_rad + angle), math.sin(ego.yaw_rad + angle)]) * distance
        facing = rng.uniform(-math.pi, math.pi)
        # the first of a group, the others beside one another, a little before or behind
        for number in range(min(int(rng.choice(len(GROUPS), p=GROUPS)) + 1, people - len(kinds))):
            ahead, aside = rng.normal(0.0, 0.2), number * rng.uniform(*APART_M)
            c, s = math.cos(facing), math.sin(facing)
            kinds.append(_CHILD if rng.random() < 0.2 else _ADULT)
            beside = np.array([c * ahead - s * aside, s * ahead + c * aside])
            place.append(near + beside + np.array([ego.x_m, ego.y_m]))
            yaw.append(facing + rng.normal(0.0, 0.3) if number else facing)
    usable = np.flatnonzero(np.isin(network.lanes.lane_type, ("driving", "biking")))
    for kind, many in (
        (_CYCLIST, rng.integers(2, 12)),
        (_CAR, rng.integers(2, 10)),
        (_VAN, rng.integers(0, 3)),
    ):
        for _ in range(int(many)):
            x, y, heading = _on_lane_near(network, usable, ego, rng)
            aside = rng.uniform(-4.0, 4.0) if kind is _CYCLIST else rng.normal(0.0, 0.2)
            turn = rng.normal(0.0, 0.1) if rng.random() < 0.8 else rng.uniform(-math.pi, math.pi)
            kinds.append(kind)
            place.append(np.array([x - aside * math.sin(heading), y + aside * math.cos(heading)]))
            yaw.append(heading + turn)
    at = np.array(place)
    size = np.array([rng.uniform(kind.low_m, kind.high_m) for kind in kinds])
    radius = 0.5 * np.hypot(size[:, 0], size[:, 1])
    walks = np.array([kind.category == "pedestrian" for kind in kinds])
    radius[walks] = np.minimum(radius[walks], 0.5 * size[walks, 1])
    distance = np.hypot(*(at - (ego.x_m, ego.y_m)).T)
    taken = [(np.array([ego.x_m, ego.y_m]), 2.6), *_standing(street, ego)]
    kept = []
    for row in np.flatnonzero(distance < FARTHEST_M).tolist():
        if all(np.hypot(*(at[row] - other)) > radius[row] + around for other, around in taken):
            kept.append(row)
            taken.append((at[row], float(radius[row])))
    count = len(kept)
    speed = np.array([rng.uniform(0.0, kinds[row].speed_mps) * (rng.random() < 0.6) for row in kept])
    everyone = np.ones(count, dtype=np.bool_)
    boxes = Boxes(at[kept].reshape(-1, 2), size[kept, :2].reshape(-1, 2), np.array(yaw)[kept])
    category = np.array([kinds[row].category for row in kept], dtype=np.str_)
    return World(0.0, boxes, speed, size[kept, 2], np.arange(count), category, everyone, everyone, surface)


def _on_lane_near(
    network: RoadNetwork, usable: IntArray, ego: EgoState, rng: np.random.Generator
) -> tuple[float, float, float]:
    """Place and heading on the middle of a lane, the nearest of some that is at least 5 m away."""
    lane = rng.choice(usable, 8)
    s = rng.uniform(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane])
    x, y, _, heading = network.center_line(lane, s)
    distance = np.hypot(x - ego.x_m, y - ego.y_m)
    row = int(np.where(distance < 5.0, np.inf, distance).argmin())
    return float(x[row]), float(y[row]), float(heading[row])


def _standing(street: Street, ego: EgoState) -> list[tuple[FloatArray, float]]:
    """Places and radii near the ground of what stands along the street."""
    rows = np.arange(street.sidewalk_blocks, len(street.bodies))
    radius = np.minimum(street.bodies.radius_m[rows], 3.0)
    place = street.bodies.position_m[rows, :2]
    near = np.hypot(*(place - (ego.x_m, ego.y_m)).T) < FARTHEST_M + 5.0
    # the crown of a tree is overhead
    return [
        (place[k], min(float(radius[k]), 0.4) if kind == "tree" else float(radius[k]))
        for k, kind in enumerate(street.kind)
        if near[k]
    ]


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


_CLUTTER: tuple[tuple[Callable[[np.random.Generator], Parts], float, float], ...] = (
    (_foliage, 0.28, 1.5), (_hedge, 0.12, 5.0), (_facade, 0.14, 9.0), (_fence, 0.10, 5.0),
    (_cabinet, 0.12, 0.9), (_thick_post, 0.08, 0.6), (_bicycles, 0.06, 1.5), (_bollards, 0.10, 5.0),
)  # fmt: skip
"""What makes it, its share, and how far it may reach from its place along its heading."""


def _clutter(
    network: RoadNetwork,
    surface: MapSurface,
    street: Street,
    ego: EgoState,
    world: World,
    rng: np.random.Generator,
) -> Bodies:
    """Pieces off the lanes for traffic, along the ego's heading or across, apart from road users."""
    count = int(rng.integers(20, 90))
    kind = rng.choice(len(_CLUTTER), count, p=[share for _, share, _ in _CLUTTER])
    distance, angle = FARTHEST_M * np.sqrt(rng.uniform(0.0, 1.0, count)), rng.uniform(-1.2, 1.2, count)
    heading = ego.yaw_rad + angle
    place = np.column_stack((np.cos(heading), np.sin(heading))) * distance[:, None] + (ego.x_m, ego.y_m)
    yaw = ego.yaw_rad + rng.normal(0.0, 0.15, count) + 0.5 * math.pi * (rng.random(count) < 0.25)
    reach = np.array([_CLUTTER[k][2] for k in kind.tolist()])
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
    parts = [_CLUTTER[k][0](rng) for k in kind[rows].tolist()]
    return Bodies.of(parts, np.column_stack((at, bottom)), yaw[rows])


SADDLE, THIN_M = 0.5, 0.06
"""A bicycle is what is lower than this share of its rider's box, and so near to its middle plane: the rider's
legs are beside it."""

OPEN_BICYCLE = (0.3, 1.0)
"""Share of the rays that pass through a bicycle: tyre and rim are a quarter of a wheel's disc, spokes and
tubes little; assumed, because beams that are wider than a spoke have an echo of it now and then."""


def _spoked(frame: DrawnFrame, rng: np.random.Generator) -> DrawnFrame:
    """The frame without most echoes of bicycles, which the sensor takes for discs and blocks."""
    xyz = frame.cloud.xyz_m
    kept = np.ones(len(xyz), dtype=np.bool_)
    for row in np.flatnonzero(frame.category == "cyclist").tolist():
        yaw, size = float(frame.boxes.yaw_rad[row]), frame.boxes.size_m[row]
        rel = xyz - frame.boxes.center_m[row]
        along = np.abs(math.cos(yaw) * rel[:, 0] + math.sin(yaw) * rel[:, 1])
        across = np.abs(math.cos(yaw) * rel[:, 1] - math.sin(yaw) * rel[:, 0])
        low = rel[:, 2] < (SADDLE - 0.5) * size[2]
        thin = np.flatnonzero(low & (across < THIN_M) & (along < 0.55 * size[0]))
        kept[thin[rng.random(len(thin)) < rng.uniform(*OPEN_BICYCLE)]] = False
    cloud = frame.cloud[kept]
    return replace(frame, cloud=cloud, points=frame.boxes.point_counts(cloud.xyz_m, 0.05).astype(np.float64))


SMEAR_M = 0.5
"""How far behind an edge an echo may lie that comes from both sides of it: the length of a pulse of 5 ns is
0.75 m there and back, and two echoes are apart when they are as far from each other."""

SMEARED = 0.5
"""Share of the echoes at an edge that come from both sides: a beam of 3 mrad (HDL-64E manual) is as wide as
the step between two shots, so that an edge is in every other one."""


def _smeared(cloud: PointCloud, rng: np.random.Generator) -> PointCloud:
    """The cloud as beams with a width would measure it: echoes at edges are drawn out to behind."""
    xyz = cloud.xyz_m.astype(np.float64)
    distance = np.linalg.norm(xyz, axis=1)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    if cloud.ring is None or not len(xyz):
        return cloud
    # a rosette has one ring, and its shots follow one another along it
    order = np.lexsort((azimuth, cloud.ring)) if cloud.ring.max() else np.arange(len(xyz))
    ordered, ring = distance[order], cloud.ring[order]
    behind = (np.diff(ordered) > SMEAR_M) & (np.diff(ring) == 0)
    before = (np.diff(ordered) < -SMEAR_M) & (np.diff(ring) == 0)
    edge = np.zeros(len(xyz), dtype=np.bool_)
    edge[:-1] |= behind
    edge[1:] |= before
    moved = order[edge & (rng.random(len(xyz)) < SMEARED)]
    xyz[moved] *= (1.0 + SMEAR_M * rng.random(len(moved)) ** 2 / distance[moved])[:, None]
    return replace(cloud, xyz_m=xyz.astype(np.float32))


def _frame(
    cloud: PointCloud, world: World, street: Street, network: RoadNetwork, ego: EgoState, mount: Mount
) -> DrawnFrame:
    """The cloud with the boxes of road users and parked cars."""
    parked = street.rows_of("parked")
    position, heading = street.bodies.position_m[parked], street.bodies.yaw_rad[parked]
    bottom = world.bottom_m + street.raised_m(world.boxes.center_m)
    size = np.column_stack((world.boxes.size_m, world.height_m))
    size = np.concatenate((size, np.broadcast_to(CAR_M, (len(parked), 3))))
    place = np.concatenate((np.column_stack((world.boxes.center_m, bottom)), position))
    place[:, 2] += 0.5 * size[:, 2]
    yaw = np.concatenate((world.boxes.yaw_rad, heading))
    ground = float(world.surface.elevation_m(np.array([[ego.x_m, ego.y_m]]), np.array([ego.yaw_rad]))[0])
    rel = place - (ego.x_m, ego.y_m, ground + mount.height_m)
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    x, y, z = c * rel[:, 0] + s * rel[:, 1] - mount.forward_m, c * rel[:, 1] - s * rel[:, 0], rel[:, 2]
    p, q = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    center = np.column_stack((p * x - q * z, y, q * x + p * z))
    category = np.concatenate((world.category, np.full(len(parked), "car")))
    near = np.hypot(x, y) < FARTHEST_M
    boxes = Boxes3D(center, size, wrap_angle(yaw - ego.yaw_rad))[near]
    counts = boxes.point_counts(cloud.xyz_m, 0.05).astype(np.float64)
    return DrawnFrame(cloud, boxes, category[near], counts, mount.height_m, network, ego)
