"""The scenes of the comparison: which file, where, with which values, and what must happen.

A scene in which nothing should happen (`nothing`) ends without contact when the ego does not brake; every
emergency request in it is a false activation. A scene in which the ego must brake (`brake`) ends with a
contact when it does not. The tests check both for every variant.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.motion.roads import load_roads
from scenarios.places import Place, kerb_m, lane_at, near_side
from scenarios.scenes.scene_maps import STRAIGHT_M, bend_length_m
from smartmot.maps.route import route_ahead, route_from_lanes

SCENES = Path(__file__).parent
OUTER_MAPS = SCENES.parents[2] / "shared" / "opendrive" / "maps"
"""Maps of real and simulated towns beside a checkout; their scenes exist where they do."""

Must = Literal["brake", "nothing"]
Values = tuple[tuple[str, Value], ...]


@dataclass(frozen=True, slots=True)
class SceneRun:
    """One variant of a scene.

    Args:
        scene: what it is about; variants of one scene share it.
        variant: where and how.
        must: what the ego must do.
        file: scenario file, or name of a shipped scenario.
        parameters: values in place of the declared ones.
        speed_kmh: of the ego.
        default: whether it belongs to the short comparison.
    """

    scene: str
    variant: str
    must: Must
    file: str
    parameters: Values
    speed_kmh: float
    default: bool = True

    @property
    def name(self) -> str:
        """Name in tables, unique."""
        return f"{self.scene}, {self.variant}"


@dataclass(frozen=True, slots=True)
class Street:
    """A place on a road of a map.

    Args:
        name: in tables.
        map_file: from the folder of the scenes, or absolute.
        place: road, driving lane of the ego, and s of the line across the road.
        come_from: where the ego comes from, if not straight: from there the road leads nowhere else.
    """

    name: str
    map_file: str
    place: Place
    come_from: Place | None = None


STRAIGHT = Street("straight", "../maps/urban_street.xodr", Place("1", -1, 400.0))
PARKING = Street("straight", "../maps/urban_street_parking.xodr", Place("1", -1, 400.0))
TWO_LANES = Street("two lanes", "maps/street_two_lanes.xodr", Place("1", -1, 300.0))
CYCLE = Street("straight", "maps/street_cycle.xodr", Place("1", -1, 300.0))


def bend(radius_m: float, turn: str, into_m: float = 20.0, kind: str = "") -> Street:
    """A place in a bend of 90 degrees.

    Args:
        radius_m: 30, 60 or 120.
        turn: left or right, as the ego drives.
        into_m: from the beginning of the bend to the line, along the road's middle.
        kind: "", "_parking" or "_cycle": what lies beside the driving lanes.
    """
    lane, s_m = -1, STRAIGHT_M + into_m
    if turn == "right":
        lane, s_m = 1, STRAIGHT_M + bend_length_m(radius_m) - into_m
    name = f"{radius_m:g} m bend {turn}"
    return Street(name, f"maps/bend_{radius_m:g}{kind}.xodr", Place("1", lane, s_m))


_TO_LINE_M = 150.0
"""Greatest way from where the ego comes from to the end of the road with the line."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of an outer map.

    Args:
        street: where.
        speeds_kmh: of the ego.
        opposite: nearest lane that leads the other way; None: there is none, or none that is long enough.
        parking: whether there is room for parked cars beside the ego's lane.
        between: whether cars may stand on both sides of the ego's lane without being in an oncoming one.
        beside: whether there is a sidewalk that leads on beyond the line.
    """

    street: Street
    speeds_kmh: tuple[float, ...]
    opposite: int | None = None
    parking: bool = False
    beside: bool = True
    between: bool = False


def _outer(name: str, file: str, place: Place, come_from: Place | None = None) -> Street:
    return Street(name, str((OUTER_MAPS / file).resolve()), place, come_from)


TOWN_STRAIGHT = Stretch(_outer("Town01 straight", "Town01.xodr", Place("8", -1, 200.0)), (30.0, 50.0), 1)
# 80 m straight, then a right angle with a radius of about 50 m; the lane runs against s
TOWN_BEND = Stretch(
    _outer("Town03 bend", "Town03.xodr", Place("21", 1, 60.0)), (30.0, 40.0), -1, parking=True
)
# 58 m straight, then a right angle with a radius of about 40 m
TOWN_SHARP_BEND = Stretch(_outer("Town10 bend", "c0910_Town10HD.xodr", Place("10", 2, 45.0)), (30.0,), -1)
# lanes one way, and a road that ends 15 m behind the line
CAMPUS = Stretch(
    _outer("campus straight", "CampusUAH_v1_7.xodr", Place("7", -2, 125.0)), (30.0, 50.0),
    parking=True, beside=False, between=True,
)  # fmt: skip
STRETCHES = (TOWN_STRAIGHT, TOWN_BEND, TOWN_SHARP_BEND, CAMPUS)
"""Of outer maps."""

# T-junctions: the line is 12 m behind a turn of 90 degrees
TOWN_TURNS = (
    _outer("Town01 turn left", "Town01.xodr", Place("6", -1, 12.0), Place("24", -1, 50.0)),
    _outer("Town01 turn right", "Town01.xodr", Place("6", 1, 212.0), Place("19", -1, 49.0)),
    _outer("Town03 turn left", "Town03.xodr", Place("90", -1, 12.0), Place("33", -1, 15.0)),
)


@dataclass(frozen=True, slots=True)
class Arm:
    """A road that leads away from a junction, with one lane each way.

    Args:
        road_id: id of the road.
        lane_id: the lane away from the junction; the one towards it has the other sign.
    """

    road_id: str
    lane_id: int


@dataclass(frozen=True, slots=True)
class Junction:
    """A turn at a junction of an outer map.

    Args:
        town: in tables.
        map_file: absolute.
        turn: left or right.
        enter: by which somebody comes.
        across: the arm straight on, or, at the end of a road, the one opposite to `exit`.
        exit: by which the one leaves who turns.
    """

    town: str
    map_file: str
    turn: Literal["left", "right"]
    enter: Arm
    across: Arm
    exit: Arm

    @property
    def name(self) -> str:
        """In tables."""
        return f"{self.town} turn {self.turn}"


_TOWN01 = str((OUTER_MAPS / "Town01.xodr").resolve())
# T-junctions: from the road that ends there, and off the one that leads on
ENDS = (
    Junction("Town01", _TOWN01, "left", Arm("24", 1), Arm("5", 1), Arm("6", -1)),
    Junction("Town01", _TOWN01, "right", Arm("19", 1), Arm("7", -1), Arm("6", 1)),
)
LEADS_ON = (
    Junction("Town01", _TOWN01, "left", Arm("6", 1), Arm("7", -1), Arm("19", 1)),
    Junction("Town01", _TOWN01, "right", Arm("6", -1), Arm("5", 1), Arm("24", 1)),
)


@dataclass(frozen=True, slots=True)
class RoadWorks:
    """Road works on a straight road of an outer map whose road marks let the ego change lanes before them.

    Args:
        name: in tables.
        map_file: absolute.
        closed: lane and s of the first barrier.
        beside: the lane that the ego changes to.
        approach_m: from the ego's start to the first barrier.
        run_out_m: from there to the end of the straight road, or less.
    """

    name: str
    map_file: str
    closed: Place
    beside: int
    approach_m: float
    run_out_m: float


ROAD_WORKS = (
    RoadWorks("campus straight", CAMPUS.street.map_file, Place("7", -2, 85.0), -1, 80.0, 50.0),
    RoadWorks("Town03 straight", TOWN_BEND.street.map_file, Place("3", -2, 68.0), -1, 65.0, 50.0),
)


OUTER_TRAFFIC = (
    ("Town01 straight", "Town01.xodr", "traffic_town", 40.0),
    ("campus two lanes", "CampusUAH_v1_7.xodr", "traffic_campus", 50.0),
)
"""Name in tables, outer map, recordings and speed of the ego in km/h."""


@cache
def _network(map_file: str) -> RoadNetwork:
    return load_roads(SCENES / map_file).network


def place_values(street: Street, side: str, way_m: float) -> dict[str, Value]:
    """Values of a scene's place parameters.

    Args:
        street: where.
        side: near or far, of the road as the ego drives.
        way_m: from the ego's start to the line.

    Raises:
        ScenarioError: there is no such place, its road begins too late, or the ego does not come there.
        scenarios.openscenario.errors.RunError: the map cannot be read.
    """
    network, place = _network(street.map_file), street.place
    lane = lane_at(network, place)
    along = int(network.lanes.direction[lane])
    left = near_side(network, lane) * (1 if side == "near" else -1)
    if street.come_from is None:
        route = route_ahead(network, lane, place.s_m, ahead_m=100.0, behind_m=way_m + 5.0)
    else:
        start = street.come_from
        route = route_ahead(network, lane_at(network, start), start.s_m, ahead_m=_TO_LINE_M)
        if lane not in route.lanes:
            raise ScenarioError(f"{street.name}: from road {start.road_id} the ego comes to other roads")
    index = route.lanes.index(lane)
    line = float(route.entry_m[index]) + route.strips[index].station_at(place.s_m)
    if line < way_m:
        raise ScenarioError(
            f"{street.name}: the road begins {line:.0f} m before the line; the scene needs {way_m:.0f}"
        )
    x_m, y_m, yaw_rad = route.pose(line - way_m)
    inner, outer = network.lane_offsets(lane, place.s_m)
    to_kerb, _ = kerb_m(network, lane, place.s_m, left)
    return {
        "Map": street.map_file,
        "Road": place.road_id,
        "Line_s": place.s_m,
        "Along": float(along),
        "Kerb": float(inner + outer) / 2 + left * along * to_kerb,
        "Out": float(left * along),
        "Lane_to_kerb": to_kerb,
        "Start_x": x_m,
        "Start_y": y_m,
        "Start_yaw": yaw_rad,
        "Way": way_m,
    }


def _at(
    scene: str,
    must: Must,
    file: str,
    street: Street,
    side: str,
    speed_kmh: float,
    lead_s: float,
    default: bool = True,
    detail: str = "",
    **values: Value,
) -> SceneRun:
    """A variant at a place of a street; the ego starts so long before the line."""
    place = place_values(street, side, round(speed_kmh / 3.6 * lead_s, 3))
    variant = ", ".join(text for text in (street.name, f"{side} side", detail, f"{speed_kmh:g} km/h") if text)
    parameters = place | {"Ego_speed_kmh": speed_kmh} | values
    return SceneRun(
        scene,
        variant,
        must,
        str(SCENES / f"{file}.xosc"),
        tuple(sorted(parameters.items())),
        speed_kmh,
        default,
    )


def _standing() -> Iterator[SceneRun]:
    places: list[tuple[Street, str, float, float, bool]] = []
    for speed in (30.0, 50.0):
        for side in ("near", "far"):
            short = (side, speed) == ("near", 50.0)
            places += [(STRAIGHT, side, speed, beyond, short) for beyond in (0.4, 1.2)]
    for radius, speed in ((30.0, 30.0), (60.0, 30.0), (60.0, 50.0), (120.0, 50.0)):
        # the outside of a left bend is the near side, that of a right bend the far side
        for turn, side in (("left", "near"), ("right", "far")):
            for beyond in (0.4, 1.2):
                # outside right bends only in the one of 60 m: there the other lane lies between
                short = beyond == 0.4 and (turn == "left" or (radius, speed) == (60.0, 50.0))
                places.append((bend(radius, turn), side, speed, beyond, short))
        for turn, side in (("left", "far"), ("right", "near")):
            places.append((bend(radius, turn), side, speed, 0.8, False))
    for street, side, speed, beyond, short in places:
        what = "people at the kerb" if beyond < 0.5 else "people on the sidewalk"
        yield _at(
            what, "nothing", "standing", street, side, speed, 5.0, short, f"{beyond:g} m", Beyond=beyond
        )


def _walking() -> Iterator[SceneRun]:
    for street, side, speed in (
        (STRAIGHT, "near", 50.0),
        (STRAIGHT, "far", 50.0),
        (bend(30.0, "left"), "near", 30.0),
        (bend(60.0, "left"), "near", 50.0),
        (bend(60.0, "right"), "far", 50.0),
        (bend(60.0, "right"), "near", 50.0),
        (bend(120.0, "left"), "near", 50.0),
    ):
        for walk, how in ((1.0, "same way"), (-1.0, "towards the ego")):
            for kmh in (5.0, 10.0):
                short = (
                    kmh == 5.0
                    and walk < 0
                    and (street.name, side)
                    in {("straight", "near"), ("60 m bend left", "near"), ("60 m bend right", "far")}
                )
                detail = f"{how}, {kmh:g} km/h"
                yield _at(
                    "walking along", "nothing", "walking", street, side, speed, 5.0, short, detail,
                    Walk=walk, Target_speed_kmh=kmh, Beyond=0.8,
                )  # fmt: skip


def _stopping() -> Iterator[SceneRun]:
    for street, side, speed in (
        (STRAIGHT, "near", 30.0),
        (STRAIGHT, "near", 50.0),
        (STRAIGHT, "far", 50.0),
        (bend(60.0, "left"), "near", 50.0),
    ):  # fmt: skip
        for gap in (0.3, 0.8, 1.5, 2.5):
            for kmh in (5.0, 8.0):
                short = street is STRAIGHT and side == "near" and speed == 50.0 and (kmh == 5.0 or gap != 1.5)
                yield _at(
                    "stops before the road", "nothing", "stopping", street, side, speed, 9.0, short,
                    f"{gap:g} m before the kerb, {kmh:g} km/h",
                    Stop_gap=gap, Target_speed_kmh=kmh, Stop_distance=0.5 if kmh < 6 else 1.0,
                )  # fmt: skip


def _traffic() -> Iterator[SceneRun]:
    for turn, side in (("left", "near"), ("right", "far")):
        street = bend(60.0, turn, 20.0, "_parking")
        for speed in (30.0, 50.0):
            short = (turn, speed) == ("left", 50.0)
            yield _at("parked cars outside a bend", "nothing", "parked", street, side, speed, 5.0, short)
    for radius, speed in ((30.0, 30.0), (60.0, 50.0), (120.0, 50.0)):
        for turn in ("left", "right"):
            street = bend(radius, turn, bend_length_m(radius) / 2)
            yield _at(
                "oncoming car in a bend", "nothing", "oncoming", street, "near", speed, 6.0,
                (radius, turn) == (60.0, "right"),
                Opposite_lane=float(-street.place.lane_id), Other_speed_kmh=speed,
            )  # fmt: skip
    for speed in (30.0, 50.0):
        yield _at("cyclist on a cycle lane", "nothing", "cycle_lane", CYCLE, "near", speed, 7.0, speed > 40)
    for speed in (30.0, 50.0):
        yield _at(
            "between two standing cars", "nothing", "between_cars", TWO_LANES, "near", speed, 5.0, speed > 40,
            Lane_t=-1.75,
        )  # fmt: skip
    for scene, file, kmh in (
        ("moving traffic", "two_lanes", 50.0),
        ("moving traffic in a bend", "bend", 40.0),
    ):
        for number in (1, 2, 3):
            path = str(SCENES / f"traffic_{file}_{number}.xosc")
            yield SceneRun(scene, f"traffic {number}, {kmh:g} km/h", "nothing", path, (), kmh, number == 1)
    street = bend(60.0, "left", 30.0, "_cycle")
    yield _at("cyclist on a cycle lane", "nothing", "cycle_lane", street, "near", 40.0, 7.0)


_EXITS: dict[str, dict[str, Value]] = {
    "left": {"Turn": 1.0, "Exit_road": "4", "Exit_lane": -1.0, "Exit_along": 1.0, "Exit_zero": 0.0},
    "right": {"Turn": -1.0, "Exit_road": "2", "Exit_lane": 1.0, "Exit_along": -1.0, "Exit_zero": 200.0},
}


def _junction(
    scene: str, must: Must, file: str, turn: str, speed_kmh: float, default: bool = True, **values: Value
) -> SceneRun:
    parameters = _EXITS[turn] | {"Ego_speed_kmh": speed_kmh} | values
    variant = f"turn {turn}, {speed_kmh:g} km/h"
    path = str(SCENES / f"{file}.xosc")
    return SceneRun(scene, variant, must, path, tuple(sorted(parameters.items())), speed_kmh, default)


def _junctions() -> Iterator[SceneRun]:
    for turn in ("left", "right"):
        for speed in (15.0, 20.0):
            short = speed == 20.0
            yield _junction("people around a turn", "nothing", "turn_people", turn, speed, short)
            left = short and turn == "left"
            yield _junction("turn past waiting cars", "nothing", "turn_waiting_car", turn, speed, left)
        yield _junction("car ahead turns off", "nothing", "turning_off", turn, 50.0, turn == "right")
    speed = 50.0
    values: Values = (("Ego_speed_kmh", speed),)
    path = str(SCENES / "road_works.xosc")
    yield SceneRun("lane change at road works", "straight, 50 km/h", "nothing", path, values, speed)


def _must_brake() -> Iterator[SceneRun]:
    for speed in (20.0, 30.0, 40.0, 50.0, 60.0):
        yield SceneRun(
            "CPNA of the paper", f"{speed:g} km/h", "brake", "cpna_paper", (("Ego_speed_kmh", speed),), speed,
            speed in (50.0, 60.0),
        )  # fmt: skip
    bicycle: Values = (
        ("Acceleration_distance", 2.0), ("Target_catalog", "Vehicles"), ("Target_entry", "bicyclist"),
        ("Target_offset", 10.0), ("Target_reference", 0.62), ("Target_speed_kmh", 15.0),
    )  # fmt: skip
    for speed in (30.0, 50.0, 60.0):
        ego: Values = (("Ego_speed_kmh", speed),)
        for kmh, offset in ((8.0, 4.5), (12.0, 6.0)):
            runner: Values = (("Target_offset", offset), ("Target_speed_kmh", kmh))
            variant = f"{kmh:g} km/h, {speed:g} km/h"
            yield SceneRun("runs across", variant, "brake", "crossing", ego + runner, speed)
        variant, short = f"straight, {speed:g} km/h", speed < 60.0
        yield SceneRun("cyclist crosses", variant, "brake", "crossing", ego + bicycle, speed, short)
        yield SceneRun("from behind parked cars", variant, "brake", "crossing_obstructed", ego, speed, short)
    for speed in (30.0, 50.0):
        yield _at("hesitates and goes on", "brake", "hesitating", STRAIGHT, "near", speed, 10.0)
        yield _at(
            "two at once", "brake", "two_at_once", STRAIGHT, "near", speed, 9.0, speed > 40,
            Other_kerb=3.5, Other_to_kerb=5.25,
        )  # fmt: skip
    for radius, turn, speed, short in (
        (30.0, "left", 30.0, True),
        (30.0, "right", 30.0, False),
        (60.0, "left", 40.0, True),
        (60.0, "right", 40.0, True),
        (120.0, "left", 50.0, False),
    ):
        street = bend(radius, turn, bend_length_m(radius) / 2)
        yield _at("crosses in a bend", "brake", "crossing", street, "near", speed, 8.0, short)
        behind = bend(radius, turn, bend_length_m(radius) - 10.0)
        lane = float(street.place.lane_id)
        yield _at(
            "car stands in a bend", "brake", "stopped_car", behind, "near", speed, 8.0, short, Lane=lane
        )
    for turn, speed, short in (("right", 30.0, True), ("right", 40.0, False), ("left", 40.0, True)):
        yield _at(
            "from behind parked cars in a bend", "brake", "crossing_parked",
            bend(60.0, turn, bend_length_m(60.0) / 2, "_parking"), "near", speed, 8.0, short,
        )  # fmt: skip
    for turn, side in (("left", -1.0), ("left", 1.0), ("right", -1.0)):
        run = _junction("crosses after a turn", "brake", "turn_crossing", turn, 20.0, Side=side)
        yield SceneRun(
            run.scene, f"{run.variant}, from the {'right' if side < 0 else 'left'}", run.must, run.file,
            run.parameters, run.speed_kmh,
        )  # fmt: skip


def _towns() -> Iterator[SceneRun]:
    for stretch in STRETCHES:
        if Path(stretch.street.map_file).is_file():
            for speed in stretch.speeds_kmh:
                yield from _nothing_in_towns(stretch, speed)
                yield from _brake_in_towns(stretch, speed)
    yield from _traffic_in_towns()
    for street in TOWN_TURNS:
        if Path(street.map_file).is_file():
            for side in ("near", "far"):
                yield _at(
                    "people around a turn", "nothing", "standing", street, side, 20.0, 10.0, False,
                    Beyond=0.8,
                )  # fmt: skip
            yield _at("crosses after a turn", "brake", "crossing", street, "near", 20.0, 10.0, False)


def _arm_values(network: RoadNetwork, role: str, arm: Arm) -> dict[str, Value]:
    """Values of the parameters of an arm: s at the junction is 0 or the road's length."""
    lane = lane_at(network, Place(arm.road_id, arm.lane_id, 0.0))
    along = int(network.lanes.direction[lane])
    return {
        f"{role}_road": arm.road_id,
        f"{role}_lane": float(arm.lane_id),
        f"{role}_along": float(along),
        f"{role}_zero": 0.0 if along > 0 else float(network.lanes.s_end_m[lane]),
    }


def junction_values(junction: Junction) -> dict[str, Value]:
    """Values of the place parameters of scenes at a junction.

    Raises:
        ScenarioError: there is no such arm.
        scenarios.openscenario.errors.RunError: the map cannot be read.
    """
    network = _network(junction.map_file)
    return {
        "Map": junction.map_file,
        "Turn": 1.0 if junction.turn == "left" else -1.0,
        **_arm_values(network, "Enter", junction.enter),
        **_arm_values(network, "Across", junction.across),
        **_arm_values(network, "Exit", junction.exit),
    }


def _turn_length_m(junction: Junction) -> float:
    """Length of the lanes in a junction from the arm that the ego comes by to the one that it leaves by."""
    network = _network(junction.map_file)
    values = junction_values(junction)
    ends = (
        lane_at(network, Place(arm.road_id, lane_id, float(values[f"{role}_zero"])))
        for role, arm, lane_id in (
            ("Enter", junction.enter, -junction.enter.lane_id),
            ("Exit", junction.exit, junction.exit.lane_id),
        )
    )
    route = route_from_lanes(network, network.shortest_route(*ends))
    return float(route.entry_m[-1] - route.entry_m[1])


def _town_run(
    scene: str, file: str, name: str, speed_kmh: float, parameters: dict[str, Value], **values: Value
) -> SceneRun:
    """A variant at a junction or at road works of an outer map, in which nothing should happen."""
    return SceneRun(
        scene,
        f"{name}, {speed_kmh:g} km/h",
        "nothing",
        str(SCENES / f"{file}.xosc"),
        tuple(sorted((parameters | {"Ego_speed_kmh": speed_kmh} | values).items())),
        speed_kmh,
        default=False,
    )


def _town_traffic() -> Iterator[SceneRun]:
    for junction in ENDS:
        if Path(junction.map_file).is_file():
            place = junction_values(junction)
            for speed in (15.0, 20.0):
                yield _town_run(
                    "turn past waiting cars", "turn_waiting_car", junction.name, speed, place,
                    Turn_length=_turn_length_m(junction),
                )  # fmt: skip
    for junction in LEADS_ON:
        if Path(junction.map_file).is_file():
            place = junction_values(junction)
            yield _town_run(
                "car ahead turns off", "turning_off", junction.name, 50.0, place,
                Across_way=30.0, Exit_way=100.0,
            )  # fmt: skip
    for works in ROAD_WORKS:
        if Path(works.map_file).is_file():
            network, closed = _network(works.map_file), works.closed
            lane = lane_at(network, closed)
            beside = lane_at(network, Place(closed.road_id, works.beside, closed.s_m))
            place = {
                "Map": works.map_file,
                "Road": closed.road_id,
                "Line_s": closed.s_m,
                "Along": float(network.lanes.direction[lane]),
                "From_t": float(sum(network.lane_offsets(lane, closed.s_m))) / 2,
                "To_t": float(sum(network.lane_offsets(beside, closed.s_m))) / 2,
                "Approach": works.approach_m,
                "Run_out": works.run_out_m,
            }
            yield _town_run("lane change at road works", "road_works", works.name, 50.0, place)


def _traffic_in_towns() -> Iterator[SceneRun]:
    for name, map_name, file, kmh in OUTER_TRAFFIC:
        map_file = (OUTER_MAPS / map_name).resolve()
        if map_file.is_file():
            for number in (1, 2):
                yield SceneRun(
                    "moving traffic", f"{name}, traffic {number}, {kmh:g} km/h", "nothing",
                    str(SCENES / f"{file}_{number}.xosc"), (("Map", str(map_file)),), kmh, False,
                )  # fmt: skip


def _nothing_in_towns(stretch: Stretch, speed: float) -> Iterator[SceneRun]:
    """Scenes of a stretch in which nothing should happen."""
    street = stretch.street
    for side in ("near", "far"):
        yield _at("people at the kerb", "nothing", "standing", street, side, speed, 5.0, False, Beyond=0.4)
        if stretch.beside:
            yield _at(
                "walking along", "nothing", "walking", street, side, speed, 5.0, False,
                "towards the ego, 5 km/h", Walk=-1.0, Target_speed_kmh=5.0, Beyond=0.8,
            )  # fmt: skip
    yield _at(
        "stops before the road", "nothing", "stopping", street, "near", speed, 7.0, False,
        Stop_gap=0.8, Walk_distance=1.0,
    )  # fmt: skip
    if stretch.parking:
        yield _at("parked cars", "nothing", "parked", street, "near", speed, 5.0, False)
    if stretch.between:
        lane = lane_at(_network(street.map_file), street.place)
        inner, outer = _network(street.map_file).lane_offsets(lane, street.place.s_m)
        yield _at(
            "between two standing cars", "nothing", "between_cars", street, "near", speed, 5.0, False,
            Lane_t=float(inner + outer) / 2,
        )  # fmt: skip
    if stretch.opposite is not None:
        yield _at(
            "oncoming car", "nothing", "oncoming", street, "near", speed, 5.0, False,
            Opposite_lane=float(stretch.opposite), Other_speed_kmh=speed,
        )  # fmt: skip


def _brake_in_towns(stretch: Stretch, speed: float) -> Iterator[SceneRun]:
    """Scenes of a stretch in which the ego must brake."""
    street = stretch.street
    yield _at("crosses", "brake", "crossing", street, "near", speed, 7.0, False)
    yield _at(
        "cyclist crosses", "brake", "crossing", street, "near", speed, 7.0, False,
        Target_catalog="Vehicles", Target_entry="bicyclist", Target_center=0.605, Target_speed_kmh=15.0,
        Beyond=4.0, Acceleration_distance=2.0,
    )  # fmt: skip
    yield _at("hesitates and goes on", "brake", "hesitating", street, "near", speed, 10.0, False)
    far = place_values(street, "far", 0.0)
    yield _at(
        "two at once", "brake", "two_at_once", street, "near", speed, 14.0, False,
        Other_kerb=far["Kerb"], Other_to_kerb=far["Lane_to_kerb"],
    )  # fmt: skip
    yield _at(
        "car stands", "brake", "stopped_car", street, "near", speed, 7.0, False,
        Lane=float(street.place.lane_id),
    )  # fmt: skip
    if stretch.parking:
        yield _at("from behind parked cars", "brake", "crossing_parked", street, "near", speed, 7.0, False)


@cache
def all_scenes() -> tuple[SceneRun, ...]:
    """Every variant that can be run here: those of outer maps only where the maps are."""
    makers = (_standing, _walking, _stopping, _traffic, _junctions, _must_brake, _towns, _town_traffic)
    return tuple(run for maker in makers for run in maker())


def scene_names() -> tuple[str, ...]:
    """Names of the scenes, each once."""
    return tuple(dict.fromkeys(run.scene for run in all_scenes()))


def choose_scenes(names: Sequence[str] = (), *, full: bool = False) -> tuple[SceneRun, ...]:
    """Variants to run.

    Args:
        names: scenes; none: all.
        full: every variant, not just those of the short comparison.

    Raises:
        ScenarioError: an unknown name, or one that only the full comparison has.
    """
    known = scene_names()
    for name in names:
        if name not in known:
            raise ScenarioError(f"no scene {name!r}; there are: {'; '.join(known)}")
    wanted = set(names or known)
    chosen = tuple(run for run in all_scenes() if run.scene in wanted and (full or run.default))
    if absent := [name for name in names if name not in {run.scene for run in chosen}]:
        raise ScenarioError(f"only the full comparison has {'; '.join(absent)}: add --full")
    return chosen
