"""Places of the scenes: what `scenes.toml` says of one, as values of a scenario file's place parameters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, Protocol

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.motion.roads import load_roads
from scenarios.places import Place, kerb_m, lane_at, near_side
from scenarios.scenes.scene_maps import STRAIGHT_M, bend_length_m
from smartmot.maps.route import route_ahead, route_from_lanes

SCENES = Path(__file__).parent

TO_LINE_M = 150.0
"""Greatest way from where the ego comes from to the end of the road with the line."""


class ScenePlace(Protocol):
    """Where a scene is run."""

    @property
    def name(self) -> str:
        """In names of variants."""

    def values(self, side: str, way_m: float) -> dict[str, Value]:
        """Values of the place parameters.

        Args:
            side: near or far, of the road as the ego drives.
            way_m: from the ego's start to the line.
        """

    def computed(self, side: str) -> dict[str, Value]:
        """What parameters of a scene may be computed from: see `scenes.toml`."""


def _network(map_file: str) -> RoadNetwork:
    return load_roads(SCENES / map_file).network


def _middle_t(network: RoadNetwork, place: Place) -> float:
    """Road coordinate t of the middle of a lane, metres."""
    return float(sum(network.lane_offsets(lane_at(network, place), place.s_m))) / 2


@dataclass(frozen=True, slots=True)
class Fixed:
    """A place that a scenario file has of its own, or a map without a place on it.

    Args:
        name: in names of variants.
        parameters: what else the scenario file asks for.
    """

    name: str
    parameters: Mapping[str, Value]

    def values(self, side: str, way_m: float) -> dict[str, Value]:
        """The same for every side and way."""
        return dict(self.parameters)

    def computed(self, side: str) -> dict[str, Value]:
        """Nothing."""
        return {}


@dataclass(frozen=True, slots=True)
class Street:
    """A place on a road of a map.

    Args:
        name: in names of variants.
        map_file: from the folder of the scenes, or absolute.
        place: road, driving lane of the ego, and s of the line across the road.
        come_from: where the ego comes from, if not straight: from there the road leads nowhere else.
    """

    name: str
    map_file: str
    place: Place
    come_from: Place | None = None

    def values(self, side: str, way_m: float) -> dict[str, Value]:
        """See `ScenePlace`.

        Raises:
            ScenarioError: there is no such place, its road begins too late, or the ego does not come there.
            scenarios.openscenario.errors.RunError: the map cannot be read.
        """
        network, place = _network(self.map_file), self.place
        lane = lane_at(network, place)
        if self.come_from is None:
            route = route_ahead(network, lane, place.s_m, ahead_m=100.0, behind_m=way_m + 5.0)
        else:
            start = self.come_from
            route = route_ahead(network, lane_at(network, start), start.s_m, ahead_m=TO_LINE_M)
            if lane not in route.lanes:
                raise ScenarioError(f"{self.name}: from road {start.road_id} the ego comes to other roads")
        line = route.station_of(lane, place.s_m)
        if line < way_m:
            raise ScenarioError(
                f"{self.name}: the road begins {line:.0f} m before the line; the scene needs {way_m:.0f}"
            )
        x_m, y_m, yaw_rad = route.pose(line - way_m)
        return {
            "Map": self.map_file,
            "Road": place.road_id,
            "Line_s": place.s_m,
            "Along": float(network.lanes.direction[lane]),
            **self._kerb(network, side),
            "Start_x": x_m,
            "Start_y": y_m,
            "Start_yaw": yaw_rad,
            "Way": way_m,
        }

    def computed(self, side: str) -> dict[str, Value]:
        """Middle of the ego's lane, and the kerb of the other side."""
        network = _network(self.map_file)
        kerb = self._kerb(network, "far" if side == "near" else "near")
        return {
            "lane_t": _middle_t(network, self.place),
            "other_kerb": kerb["Kerb"],
            "other_to_kerb": kerb["Lane_to_kerb"],
        }

    def _kerb(self, network: RoadNetwork, side: str) -> dict[str, Value]:
        """Road coordinate t of the kerb, the sign of t beyond it, and the way to it from the ego's lane."""
        lane = lane_at(network, self.place)
        left = near_side(network, lane) * (1 if side == "near" else -1)
        out = left * int(network.lanes.direction[lane])
        to_kerb, _ = kerb_m(network, lane, self.place.s_m, left)
        return {
            "Kerb": _middle_t(network, self.place) + out * to_kerb,
            "Out": float(out),
            "Lane_to_kerb": to_kerb,
        }


def bend(name: str, radius_m: float, turn: str, into_m: float | str, kind: str) -> Street:
    """A place in a bend of 90 degrees of the scenes' own maps.

    Args:
        name: in names of variants; empty: the radius and the turn.
        radius_m: 30, 60 or 120.
        turn: left or right, as the ego drives.
        into_m: from the beginning of the bend to the line, along the road's middle; middle; negative from
            its end.
        kind: parking, cycle, or empty: what lies beside the driving lanes.
    """
    length_m = bend_length_m(radius_m)
    into = length_m / 2 if isinstance(into_m, str) else into_m if into_m >= 0 else length_m + into_m
    lane, s_m = (-1, STRAIGHT_M + into) if turn == "left" else (1, STRAIGHT_M + length_m - into)
    map_file = f"maps/bend_{radius_m:g}{'_' if kind else ''}{kind}.xodr"
    return Street(name or f"{radius_m:g} m bend {turn}", map_file, Place("1", lane, s_m))


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
    """A turn at a junction.

    Args:
        name: in names of variants.
        map_file: absolute.
        turn: left or right.
        enter: by which somebody comes.
        across: the arm straight on, or, at the end of a road, the one opposite to `exit`.
        exit: by which the one leaves who turns.
    """

    name: str
    map_file: str
    turn: Literal["left", "right"]
    enter: Arm
    across: Arm
    exit: Arm

    def values(self, side: str, way_m: float) -> dict[str, Value]:
        """The same for every side and way; s at the junction is 0 or the road's length.

        Raises:
            ScenarioError: there is no such arm.
            scenarios.openscenario.errors.RunError: the map cannot be read.
        """
        network = _network(self.map_file)
        values: dict[str, Value] = {"Map": self.map_file, "Turn": 1.0 if self.turn == "left" else -1.0}
        for role, arm in (("Enter", self.enter), ("Across", self.across), ("Exit", self.exit)):
            lane = lane_at(network, Place(arm.road_id, arm.lane_id, 0.0))
            along = int(network.lanes.direction[lane])
            values |= {
                f"{role}_road": arm.road_id,
                f"{role}_lane": float(arm.lane_id),
                f"{role}_along": float(along),
                f"{role}_zero": 0.0 if along > 0 else float(network.lanes.s_end_m[lane]),
            }
        return values

    def computed(self, side: str) -> dict[str, Value]:
        """Length of the lanes in the junction from the arm that the ego comes by to the one it leaves by."""
        network, values = _network(self.map_file), self.values(side, 0.0)
        start, end = (
            lane_at(network, Place(arm.road_id, lane_id, float(values[f"{role}_zero"])))
            for role, arm, lane_id in (
                ("Enter", self.enter, -self.enter.lane_id),
                ("Exit", self.exit, self.exit.lane_id),
            )
        )
        route = route_from_lanes(network, network.shortest_route(start, end))
        return {"turn_m": float(route.entry_m[-1] - route.entry_m[1])}


@dataclass(frozen=True, slots=True)
class RoadWorks:
    """Road works on a straight road whose road marks let the ego change lanes before them.

    Args:
        name: in names of variants.
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

    def values(self, side: str, way_m: float) -> dict[str, Value]:
        """The same for every side and way.

        Raises:
            ScenarioError: there is no such lane.
            scenarios.openscenario.errors.RunError: the map cannot be read.
        """
        network, closed = _network(self.map_file), self.closed
        return {
            "Map": self.map_file,
            "Road": closed.road_id,
            "Line_s": closed.s_m,
            "Along": float(network.lanes.direction[lane_at(network, closed)]),
            "From_t": _middle_t(network, closed),
            "To_t": _middle_t(network, Place(closed.road_id, self.beside, closed.s_m)),
            "Approach": self.approach_m,
            "Run_out": self.run_out_m,
        }

    def computed(self, side: str) -> dict[str, Value]:
        """Nothing."""
        return {}


def read_place(key: str, entry: Mapping[str, Any], map_file: str) -> ScenePlace:
    """A place of the data file.

    Args:
        key: its key.
        entry: what the file says of it; see there.
        map_file: its map, empty where the scenario file has its own.

    Raises:
        ScenarioError: a key is missing, unknown or has a value of another kind.
    """
    fields = {name: value for name, value in entry.items() if name not in ("name", "map", "outer")}
    name = str(entry.get("name", key))
    unknown: dict[str, Any] = {}
    try:
        match fields:
            case {"values": values, **unknown}:
                place: ScenePlace = Fixed(name, parameter_values(values))
            case {"bend_m": radius, "turn": turn, "into_m": into, **unknown}:
                kind = unknown.pop("kind", "")
                place = bend(entry.get("name", ""), radius, turn, into, kind)
            case {"enter": enter, "across": across, "exit": leave, "turn": turn, **unknown}:
                place = Junction(name, map_file, turn, Arm(*enter), Arm(*across), Arm(*leave))
            case {"at": at, "beside": beside, "approach_m": approach, "run_out_m": run_out, **unknown}:
                place = RoadWorks(name, map_file, _place(at), beside, float(approach), float(run_out))
            case {"at": at, **unknown}:
                come_from = unknown.pop("come_from", None)
                place = Street(name, map_file, _place(at), _place(come_from) if come_from else None)
            case _:
                place, unknown = Fixed(name, {"Map": map_file}), fields
    except (TypeError, ValueError, KeyError) as error:
        raise ScenarioError(f"place {key!r}: {error}") from None
    if unknown:
        raise ScenarioError(f"place {key!r}: {', '.join(unknown)} is not understood")
    return place


def _place(values: tuple[str, int, float]) -> Place:
    road_id, lane_id, s_m = values
    return Place(road_id, lane_id, float(s_m))


def parameter_values(values: Mapping[str, Any]) -> dict[str, Value]:
    """Values of parameters: numbers as floats, texts as they are.

    Raises:
        TypeError: another kind of value.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, (int, float, str)):
            raise TypeError(f"{name}: expected a number or a text, got {value!r}")
    return {name: value if isinstance(value, str) else float(value) for name, value in values.items()}
