"""Clouds of streets drawn at random, with their road users as truth: for fitting, calibration and tests.

Streets are those of `furnished_street` with clutter beside the lanes that it does not have: foliage, hedges,
facades, fences, cabinets and bicycles without riders. All sizes are assumed; real clutter has more kinds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evaluation.studies.lidar.cars import drawn_car
from evaluation.studies.lidar.clutter import FARTHEST_M, clutter_beside
from evaluation.studies.lidar.echoes import Echoes, miscalibrated, on_waves, smeared, too_weak
from evaluation.studies.lidar.people import drawn_person, drawn_rider
from opendrive import RoadNetwork, load_map
from scenarios.sensors.lidar import LidarConfig, LidarSensor, Mount, Street, furnished_street
from scenarios.sensors.lidar.shapes import Bodies, joined
from scenarios.sensors.lidar.street import CAR_M, PARKING_PITCH_M
from scenarios.sensors.world import MapSurface, World
from smartmot.arrays import FloatArray, IntArray, StrArray
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import Boxes, EgoState

CLASSES = ("pedestrian", "cyclist", "car")
"""Those of which there is truth."""

FRAMES_PER_STREET = 4
"""The same street is seen from so many places, with other road users."""


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
    varied: bool = False,
    rough: bool = False,
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
        varied: whether cars have many shapes (`cars`), people many sizes, and parked cars stand at sidewalks
            too; else they are those of the sensor in the closed loop.
        rough: whether streets, varied ones, are as crowded and sensors as poor as they can be: people and
            riders of many shapes, more clutter, road users farther away, ground that is not flat, and lines
            and echoes with errors of their own.
    """
    for number in range(first, first + count):
        rng = np.random.default_rng((seed, number))
        if number % FRAMES_PER_STREET == 0:
            network = load_map(maps[(number // FRAMES_PER_STREET) % len(maps)])
            surface = MapSurface(network)
            street = furnished_street(
                network, rng.uniform(3.0, 14.0), int(rng.integers(2**31)), parked_share=rng.uniform(0.0, 0.8)
            )
            parked = _Parked.of(street)
            if varied:
                parked, street = _varied_parked(network, surface, street, rng)
        drawn_mount = mount or Mount(rng.uniform(1.4, 2.1), 0.0, math.radians(rng.uniform(-1.5, 1.5)))
        sensor_config = replace(config, mount=drawn_mount)
        ego = _ego(network, rng)
        sizes = _VARIED if varied else _USUAL
        world = _world(network, surface, street, ego, in_the_way, rng, sizes, spread=rough)
        if in_turn:
            world = replace(world, time_s=number / config.pattern.rate_hz)
        extra = [street.bodies]
        if clutter:
            extra.append(clutter_beside(network, surface, street, ego, world, rng, rough=rough))
        cast_world = world
        if varied:
            drawn = SHAPED if rough else SHAPED[:1]
            rows = np.flatnonzero(np.isin(world.category, drawn))
            extra.append(_shaped(world, rows, street, rng))
            cast_world = replace(world, seen=~np.isin(world.category, drawn))
        own_street = replace(street, bodies=joined(extra))
        sensor = LidarSensor(sensor_config, int(rng.integers(2**31)), own_street)
        cloud = smeared(sensor.measure(cast_world, ego).cloud, rng)
        boxes, category = _labels(world, street, parked, ego, drawn_mount)
        echoes = Echoes(cloud, boxes)
        lost = echoes.through_bicycles(category, rng)
        if varied:
            lost |= echoes.of_dark_cars(category, rng)
        if rough:
            lost |= too_weak(cloud, rng)
        cloud = cloud[~lost]
        if rough:
            cloud, boxes = on_waves(miscalibrated(cloud, rng), boxes, rng)
        points = boxes.point_counts(cloud.xyz_m, 0.05).astype(np.float64)
        yield DrawnFrame(cloud, boxes, category, points, drawn_mount.height_m, network, ego)


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


_USUAL = (_ADULT, _CHILD, _CYCLIST, _CAR, _VAN)
_VARIED = (
    _Kind("pedestrian", (0.35, 0.4, 1.45), (1.05, 0.8, 2.0), 2.0),
    _Kind("pedestrian", (0.3, 0.3, 0.95), (0.6, 0.5, 1.35), 2.0),
    _Kind("cyclist", (1.5, 0.45, 1.55), (2.05, 0.8, 1.95), 7.0),
    _Kind("car", (3.3, 1.5, 1.3), (5.0, 1.95, 1.75), 14.0),
    _Kind("car", (4.0, 1.65, 1.7), (6.0, 2.1, 2.2), 14.0),
)
"""Adults, children, cyclists, cars, and vans or off-road cars. Their sizes span the mean sizes of labels in
two published data sets with room on both sides: cars 3.88 x 1.63 x 1.53 m and pedestrians 0.84 x 0.66 x 1.76
m (KITTI; annotators' boxes hold arms and stride), cars 4.63 x 1.97 x 1.74 m (nuScenes)."""


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
    sizes: tuple[_Kind, ...],
    *,
    spread: bool = False,
) -> World:
    """People anywhere on and beside the road, riders and cars along lanes; none touches another.

    `spread`: twice as many people, and riders and cars ahead at any distance, not most of them near.
    """
    adult, child, cyclist, car, van = sizes
    place: list[FloatArray] = []
    yaw: list[float] = []
    kinds: list[_Kind] = []
    people = int(rng.integers(2, 10)) * (2 if spread else 1)
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
            kinds.append(child if rng.random() < 0.2 else adult)
            beside = np.array([c * ahead - s * aside, s * ahead + c * aside])
            place.append(near + beside + np.array([ego.x_m, ego.y_m]))
            yaw.append(facing + rng.normal(0.0, 0.3) if number else facing)
    usable = np.flatnonzero(np.isin(network.lanes.lane_type, ("driving", "biking")))
    for kind, many in (
        (cyclist, rng.integers(2, 12)),
        (car, rng.integers(2, 10)),
        (van, rng.integers(0, 3)),
    ):
        for _ in range(int(many)):
            aim = rng.uniform(5.0, 48.0) if spread else None
            x, y, heading = _on_lane_near(network, usable, ego, rng, aim)
            aside = rng.uniform(-4.0, 4.0) if kind is cyclist else rng.normal(0.0, 0.2)
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


AHEAD_RAD = math.radians(60.0)
"""Bearing up to which a road user is ahead."""


def _on_lane_near(
    network: RoadNetwork,
    usable: IntArray,
    ego: EgoState,
    rng: np.random.Generator,
    aim_m: float | None = None,
) -> tuple[float, float, float]:
    """Place and heading on the middle of a lane, the nearest of some that is at least 5 m away.

    `aim_m`: of more of them the one ahead whose distance is nearest to it.
    """
    lane = rng.choice(usable, 8 if aim_m is None else 64)
    s = rng.uniform(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane])
    x, y, _, heading = network.center_line(lane, s)
    distance = np.hypot(x - ego.x_m, y - ego.y_m)
    off = distance
    if aim_m is not None:
        aside = wrap_angle(np.arctan2(y - ego.y_m, x - ego.x_m) - ego.yaw_rad)
        off = np.abs(distance - aim_m) + np.where(np.abs(aside) > AHEAD_RAD, FARTHEST_M, 0.0)
    row = int(np.where(distance < 5.0, np.inf, off).argmin())
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


ON_SIDEWALKS = 0.5
"""Share of the sidewalks, of roads without places for parking, on which cars stand in a row: assumed."""


def _varied_parked(
    network: RoadNetwork, surface: MapSurface, street: Street, rng: np.random.Generator
) -> tuple[_Parked, Street]:
    """Parked cars of many shapes and sizes in place of those of a street, and on sidewalks."""
    old = street.rows_of("parked")
    place, heading = [street.bodies.position_m[old, :2]], [street.bodies.yaw_rad[old]]
    lanes = network.lanes
    for lane in np.flatnonzero(lanes.lane_type == "sidewalk").tolist():
        s = np.arange(float(lanes.s_start_m[lane]) + 4.0, float(lanes.s_end_m[lane]) - 4.0, PARKING_PITCH_M)
        s = s[rng.random(len(s)) < rng.uniform(0.1, 0.8)]
        if len(old) or not len(s) or rng.random() >= ON_SIDEWALKS:
            continue
        x, y, _, yaw = network.center_line(np.full(len(s), lane), s)
        place.append(np.column_stack((x, y)))
        heading.append(yaw)
    at, yaw = np.concatenate(place), np.concatenate(heading)
    # a third of them face the other way
    yaw = yaw + rng.normal(0.0, 0.05, len(yaw)) + np.where(rng.random(len(yaw)) < 0.3, math.pi, 0.0)
    kind = rng.choice(2, len(yaw), p=(0.8, 0.2))
    low, high = (np.array([getattr(k, end) for k in _VARIED[3:]])[kind] for end in ("low_m", "high_m"))
    size = rng.uniform(low, high)
    size[:, 0] = np.minimum(size[:, 0], PARKING_PITCH_M - 0.6)
    piece = street.bodies.position_m[street.sidewalk_blocks :, :2]
    gap = np.hypot(*np.moveaxis(piece[:, None] - at, -1, 0)).min(axis=1, initial=np.inf)
    bare = street.without((gap < 0.5 * PARKING_PITCH_M) | (np.array(street.kind, dtype=np.str_) == "parked"))
    position = np.column_stack((at, surface.elevation_m(at, yaw) + bare.raised_m(at)))
    bodies = Bodies.of([drawn_car(each, rng) for each in size], position, yaw)
    outline = Boxes(
        np.concatenate((bare.footprint.center_m, at)),
        np.concatenate((bare.footprint.size_m, size[:, :2])),
        np.concatenate((bare.footprint.yaw_rad, yaw)),
    )
    varied = replace(
        bare,
        bodies=joined([bare.bodies, bodies]),
        kind=bare.kind + ("parked",) * len(yaw),
        footprint=outline,
    )
    return _Parked(position, yaw, size), varied


SHAPED = ("car", "pedestrian", "cyclist")
_MAKES = {"car": drawn_car, "pedestrian": drawn_person, "cyclist": drawn_rider}


def _shaped(world: World, rows: IntArray, street: Street, rng: np.random.Generator) -> Bodies:
    """Bodies of many shapes for road users of a world."""
    boxes = world.boxes[rows]
    size = np.column_stack((boxes.size_m, world.height_m[rows]))
    bottom = world.bottom_m[rows] + street.raised_m(boxes.center_m)
    category = world.category[rows].tolist()
    parts = [_MAKES[name](each, rng) for name, each in zip(category, size, strict=True)]
    position = np.column_stack((boxes.center_m, bottom))
    return Bodies.of(parts, position, boxes.yaw_rad, world.velocity_mps[rows])


@dataclass(frozen=True, slots=True, eq=False)
class _Parked:
    """Parked cars: (N, 3) middles of their undersides, (N,) headings and (N, 3) sizes."""

    position_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray

    @classmethod
    def of(cls, street: Street) -> _Parked:
        """Those of a street, which are all alike."""
        rows = street.rows_of("parked")
        size = np.broadcast_to(CAR_M, (len(rows), 3))
        return cls(street.bodies.position_m[rows], street.bodies.yaw_rad[rows], size)


def _labels(
    world: World, street: Street, parked: _Parked, ego: EgoState, mount: Mount
) -> tuple[Boxes3D, StrArray]:
    """Boxes of road users and parked cars, sensor's frame, and their categories."""
    bottom = world.bottom_m + street.raised_m(world.boxes.center_m)
    size = np.column_stack((world.boxes.size_m, world.height_m))
    size = np.concatenate((size, parked.size_m))
    place = np.concatenate((np.column_stack((world.boxes.center_m, bottom)), parked.position_m))
    place[:, 2] += 0.5 * size[:, 2]
    yaw = np.concatenate((world.boxes.yaw_rad, parked.yaw_rad))
    ground = float(world.surface.elevation_m(np.array([[ego.x_m, ego.y_m]]), np.array([ego.yaw_rad]))[0])
    rel = place - (ego.x_m, ego.y_m, ground + mount.height_m)
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    x, y, z = c * rel[:, 0] + s * rel[:, 1] - mount.forward_m, c * rel[:, 1] - s * rel[:, 0], rel[:, 2]
    p, q = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    center = np.column_stack((p * x - q * z, y, q * x + p * z))
    category = np.concatenate((world.category, np.full(len(parked.yaw_rad), "car")))
    near = np.hypot(x, y) < FARTHEST_M
    return Boxes3D(center, size, wrap_angle(yaw - ego.yaw_rad))[near], category[near]
