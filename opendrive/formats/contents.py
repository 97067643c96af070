"""What exports have in common besides lanelets: users of lanes, signals, crosswalks, what is left out."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
import shapely

from opendrive.arrays import FloatArray
from opendrive.formats.lanelets import Lanelets
from opendrive.lanes.travel import ROUTE_LANE_TYPES
from opendrive.model import Signal
from opendrive.network import RoadNetwork
from opendrive.roads.objects import Crosswalk

USERS = {
    **dict.fromkeys((*ROUTE_LANE_TYPES, "HOV", "roadWorks", "shared"), "vehicle"),
    "biking": "bicycle",
    **dict.fromkeys(("sidewalk", "walking"), "pedestrian"),
    **dict.fromkeys(("rail", "tram"), "train"),
    "bus": "bus",
    "taxi": "taxi",
}
"""Who moves along lanes of a type, in CommonRoad's words; lanes of other types are for no traffic."""

LIGHTS = frozenset({"1000001", "1000002", "1000007", "1000008", "1000009", "1000010", "1000011", "1000013"})
"""Traffic lights among the signal types of the OpenDRIVE catalogue; any other dynamic signal counts too."""

_OBLONG = 1.5
"""A crosswalk this much longer than wide is walked along its longer side, else across its road."""


@dataclass(frozen=True, slots=True, eq=False)
class Export:
    """What an export wrote.

    Attributes:
        counts: how many of what was written.
        left_out: what the format cannot hold, or the map does not say, and how often.
        notes: what users of the file have to know.
    """

    counts: dict[str, int]
    left_out: Counter[str] = field(default_factory=Counter)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class PlacedSignal:
    """A signal, its place in the map frame, and the lanelets of traffic lanes that it applies to.

    Attributes:
        signal: the signal.
        xyz_m: where it stands.
        heading_rad: where its face looks from: the direction of the traffic that it is for.
        lanelets: indices, ascending.
    """

    signal: Signal
    xyz_m: tuple[float, float, float]
    heading_rad: float
    lanelets: tuple[int, ...]

    @property
    def is_light(self) -> bool:
        """Whether it is a traffic light."""
        return self.signal.dynamic or self.signal.type in LIGHTS

    @property
    def is_limit(self) -> bool:
        """Whether it is a sign of the speed limit, which lanes carry already."""
        return not self.is_light and self.signal.type in ("274", "274.1", "274.2")


def placed_signals(network: RoadNetwork, pieces: Lanelets, left_out: Counter[str]) -> list[PlacedSignal]:
    """Return all signals that apply to a lanelet with traffic, in the order of roads and s."""
    of_road: dict[str, list[int]] = {}
    for i, lanelet in enumerate(pieces.lanelets):
        if str(network.lanes.lane_type[lanelet.lane]) in USERS:
            of_road.setdefault(network.lanes.key[lanelet.lane].road_id, []).append(i)
    placed: dict[tuple[str, str], tuple[Signal, tuple[float, float, float], float, set[int]]] = {}
    for road_id, road in network.roads.items():
        for item in network.signals_of(road_id):
            s_m = min(max(item.s_m, 0.0), road.length_m)
            reached = {
                i
                for i in of_road.get(road_id, ())
                if pieces.lanelets[i].s_start_m <= s_m <= pieces.lanelets[i].s_end_m
                and item.applies_to(network.lanes.key[pieces.lanelets[i].lane].lane_id)
                and item.orientation in ("none", "+" if pieces.lanelets[i].forward else "-")
            }
            point = road.point(s_m, item.t_m)
            against = np.pi if item.orientation == "-" else 0.0
            xyz_m = (float(point.x_m), float(point.y_m), float(point.z_m) + item.signal.z_offset_m)
            key = (road_id if not item.is_reference else "", item.id)
            if item.is_reference and (known := next((k for k in placed if k[1] == item.id), None)):
                key = known
            entry = placed.setdefault(key, (item.signal, xyz_m, float(point.heading_rad) + against, set()))
            entry[3].update(reached)
    signals = [PlacedSignal(s, xyz, heading, tuple(sorted(of))) for s, xyz, heading, of in placed.values()]
    without = sum(not signal.lanelets for signal in signals)
    if without:
        left_out["signals that apply to no traffic lane"] += without
    return [signal for signal in signals if signal.lanelets]


def crossing_bounds(network: RoadNetwork, crosswalk: Crosswalk) -> tuple[FloatArray, FloatArray]:
    """Return both long sides of a crosswalk, (K, 3) each, in the same direction of walking.

    Its corners are shared out between them, so that their outline is the crosswalk's; where one side has
    fewer, points on it are added.
    """
    ring = crosswalk.polygon
    if not shapely.LinearRing(ring).is_ccw:
        ring = ring[::-1]
    walk = _walking_direction(network, crosswalk)
    along = (ring + np.roll(ring, -1, axis=0)) @ walk
    end, begin = int(np.argmax(along)), int(np.argmin(along))
    count = len(ring)
    # Counter-clockwise, the right side is walked forwards.
    right = ring[[(begin + 1 + k) % count for k in range((end - begin - 1) % count + 1)]]
    left = ring[[(end + 1 + k) % count for k in range((begin - end - 1) % count + 1)]][::-1]
    sides = []
    shares = [_shares(side) for side in (left, right)]
    common = np.unique(np.round(np.concatenate(shares), 9))
    for side, share in zip((left, right), shares, strict=True):
        columns = [np.interp(common, share, side[:, k]) for k in range(2)]
        sides.append(_raised(network, crosswalk, np.stack(columns, axis=1)))
    return sides[0], sides[1]


def _walking_direction(network: RoadNetwork, crosswalk: Crosswalk) -> FloatArray:
    road = network.roads[crosswalk.road_id]
    s_m = min(max(crosswalk.s_m, 0.0), road.length_m)
    heading = float(road.point(s_m, crosswalk.t_m).heading_rad)
    across = np.array([-np.sin(heading), np.cos(heading)])
    box = shapely.get_coordinates(shapely.Polygon(crosswalk.polygon).minimum_rotated_rectangle)
    if len(box) < 4:
        return across
    sides = np.diff(box[:3], axis=0)
    length = np.linalg.norm(sides, axis=1)
    if length.max() >= _OBLONG * length.min():
        longest: FloatArray = sides[int(np.argmax(length))]
        return longest if longest @ across >= 0.0 else -longest
    return across


def _shares(side: FloatArray) -> FloatArray:
    if len(side) == 1:
        return np.array([0.0])
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(side, axis=0), axis=1))])
    shares: FloatArray = lengths / lengths[-1] if lengths[-1] else np.linspace(0.0, 1.0, len(side))
    return np.round(shares, 9)


def _raised(network: RoadNetwork, crosswalk: Crosswalk, xy_m: FloatArray) -> FloatArray:
    """Return points with the height of the road that carries the crosswalk."""
    road = network.roads[crosswalk.road_id]
    s_m, t_m = road.coordinates(xy_m)
    z_m = road.point(np.clip(s_m, 0.0, road.length_m), t_m).z_m
    return np.column_stack([xy_m, z_m])


def folded_note(pieces: Lanelets) -> list[str]:
    """Return what to say of lanelets that cross themselves: nothing, or one note."""
    folded = pieces.folded()
    return [f"{folded} lanelets cross themselves, in bends that are tighter than the lane"] if folded else []


def other_objects(network: RoadNetwork) -> Iterator[str]:
    """Yield the types of all objects that are no crosswalks with an outline."""
    for item in network.objects:
        if item.type != "crosswalk" or len(item.polygon) < 3:
            yield item.type if item.type not in ("", "-1") else "unknown"
