"""What stands along the lanes of a map: kerbs of its sidewalks, and street furniture drawn at random.

Sizes of furniture are assumed, as usual in German towns; the least height of a sign is that of VwV-StVO.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from opendrive import RoadNetwork
from opendrive.lanes.travel import ROUTE_LANE_TYPES
from scenarios.errors import ScenarioError
from scenarios.sensors.lidar.bodies import unit_body
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, Bodies, Parts, joined
from scenarios.sensors.world import MapSurface
from smartmot.arrays import BoolArray, FloatArray, IntArray
from smartmot.types import Boxes

KERB_M = 0.12
"""Height of a sidewalk over the road where the map says none: FGSV, RASt 06, usual kerb."""

FLATNESS_M = 0.02
"""How far the border of a sidewalk may be from the blocks it is made of."""

STEEPNESS_M = 0.03
"""How far the height of a sidewalk on a slope may be from that of its blocks, if these are over 1 m long."""

FOOT_M = 0.3
"""How far blocks of the sidewalk reach under the road."""

JOINT_M = 0.05
"""Overlap of blocks, so that bends leave no gaps."""

CONCRETE, METAL, SIGN, BARK, LEAVES, PLASTIC, BRICK = 0.25, 0.35, 0.9, 0.2, 0.4, 0.3, 0.25
"""Reflectivities at right angles, near infrared: assumed."""

TRAFFIC = ROUTE_LANE_TYPES | {"biking", "bus", "taxi", "HOV", "tram", "rail", "stop", "shoulder", "parking"}
"""Lanes on which no furniture stands."""

CAR_M = (4.4, 1.8, 1.5)
"""Length, width and height of a parked car."""

NO_BOXES = Boxes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))

PARKING_PITCH_M = 6.0
"""Length of a place in a parked row (EAR 05, 5.7 to 6.2 m)."""


def _row(kind: int, half: tuple[float, float, float], z: float, share: float) -> tuple[object, ...]:
    return kind, (0.0, 0.0, z), half, share


def _parts(*rows: tuple[object, ...]) -> Parts:
    kind, center, half, share = zip(*rows, strict=True)
    return Parts(np.array(kind), np.array(center), np.array(half), np.array(share))


def _post(rng: np.random.Generator) -> Parts:
    height, radius = rng.uniform(0.9, 1.1), rng.uniform(0.04, 0.08)
    if rng.random() < 0.4:  # a lamp, not a bollard
        height, radius = rng.uniform(4.0, 8.0), rng.uniform(0.06, 0.1)
    return _parts(_row(COLUMN, (radius, radius, 0.5 * height), 0.5 * height, METAL))


def _sign(rng: np.random.Generator) -> Parts:
    size, under = rng.uniform(0.42, 0.75), rng.uniform(2.0, 2.25)
    top = under + size
    return _parts(
        _row(COLUMN, (0.035, 0.035, 0.5 * top), 0.5 * top, METAL),
        _row(BLOCK, (0.01, 0.5 * size, 0.5 * size), top - 0.5 * size, SIGN),
    )


def _tree(rng: np.random.Generator) -> Parts:
    trunk, radius, crown = rng.uniform(2.2, 3.5), rng.uniform(0.1, 0.25), rng.uniform(1.2, 2.5)
    return _parts(
        _row(COLUMN, (radius, radius, 0.5 * trunk + 0.25), 0.5 * trunk + 0.25, BARK),
        _row(ELLIPSOID, (crown, crown, 1.2 * crown), trunk + 1.2 * crown, LEAVES),
    )


def _bin(rng: np.random.Generator) -> Parts:
    radius, height = rng.uniform(0.2, 0.35), rng.uniform(0.7, 1.2)
    return _parts(_row(COLUMN, (radius, radius, 0.5 * height), 0.5 * height, PLASTIC))


def _wall(rng: np.random.Generator) -> Parts:
    length, height, thick = rng.uniform(3.0, 12.0), rng.uniform(0.6, 2.2), rng.uniform(0.15, 0.4)
    return _parts(_row(BLOCK, (0.5 * length, 0.5 * thick, 0.5 * height), 0.5 * height, BRICK))


@dataclass(frozen=True, slots=True)
class Furnishing:
    """How a kind of furniture is placed.

    Args:
        make: its parts.
        share: of all pieces.
        from_kerb: stands this far behind the kerb, m; None: behind the sidewalk.
    """

    make: Callable[[np.random.Generator], Parts]
    share: float
    from_kerb: tuple[float, float] | None


GREATEST_DENSITY = 100.0
"""Pieces per 100 m of each side: more would be a fence."""

FURNITURE = {
    "post": Furnishing(_post, 0.3, (0.3, 0.6)),
    "sign": Furnishing(_sign, 0.15, (0.5, 0.8)),
    "tree": Furnishing(_tree, 0.2, (0.6, 1.0)),
    "bin": Furnishing(_bin, 0.15, (0.4, 0.8)),
    "wall": Furnishing(_wall, 0.2, None),
}
"""Kinds of furniture; shares and distances are assumed."""


@dataclass(frozen=True)
class Street:
    """What stands along the roads of a map, map frame.

    Args:
        bodies: B bodies that stand: first the blocks of sidewalks, then furniture.
        sidewalk_blocks: how many the first are.
        kind: (B - sidewalk_blocks) kinds of furniture, out of `FURNITURE`, and "parked".
        footprint: their outlines from above, of what is less than 2 m up.
        dropped: pieces of furniture that would have stood on a lane for traffic or where it is kept clear.
    """

    bodies: Bodies
    sidewalk_blocks: int = 0
    kind: tuple[str, ...] = ()
    footprint: Boxes = NO_BOXES
    dropped: int = 0

    def without(self, removed: BoolArray) -> Street:
        """The street without some of its F pieces of furniture, by (F,) flags; they count as dropped."""
        kept = np.flatnonzero(~removed)
        if len(kept) == len(self.kind):
            return self
        bodies = self.bodies.take(
            np.concatenate((np.arange(self.sidewalk_blocks), self.sidewalk_blocks + kept))
        )
        kind = tuple(self.kind[k] for k in kept.tolist())
        lost = self.dropped + len(self.kind) - len(kept)
        return Street(bodies, self.sidewalk_blocks, kind, self.footprint[kept], lost)

    def rows_of(self, kind: str) -> IntArray:
        """Rows in `bodies` of the furniture of a kind."""
        return self.sidewalk_blocks + np.flatnonzero(np.array(self.kind, dtype=np.str_) == kind)

    @cached_property
    def digest(self) -> bytes:
        """Hash of all that stands, the same for equal streets."""
        bodies, hashed = self.bodies, hashlib.sha256()
        parts = (bodies.parts.kind, bodies.parts.center_m, bodies.parts.half_m, bodies.parts.reflectivity)
        for column in (bodies.position_m, bodies.yaw_rad, bodies.first, *parts):
            hashed.update(column.tobytes())
        return hashed.digest()

    @cached_property
    def _radius_m(self) -> FloatArray:
        return self.bodies.radius_m

    def near(self, x_m: float, y_m: float, range_m: float) -> Bodies:
        """The bodies that reach into a circle."""
        if not len(self.bodies):
            return self.bodies
        rel = self.bodies.position_m[:, :2] - (x_m, y_m)
        return self.bodies.take(np.flatnonzero(np.hypot(*rel.T) - self._radius_m <= range_m))

    def raised_m(self, points_m: FloatArray) -> FloatArray:
        """(N,) how far sidewalks lie over the road at (N, 2) points; 0 elsewhere."""
        raised = np.zeros(len(points_m))
        blocks, parts = self.sidewalk_blocks, self.bodies.parts
        if not blocks or not len(points_m):
            return raised
        rel = points_m[:, None] - self.bodies.position_m[:blocks, :2]
        c, s = np.cos(self.bodies.yaw_rad[:blocks]), np.sin(self.bodies.yaw_rad[:blocks])
        half = parts.half_m[:blocks]
        on = (np.abs(c * rel[..., 0] + s * rel[..., 1]) <= half[:, 0]) & (
            np.abs(c * rel[..., 1] - s * rel[..., 0]) <= half[:, 1]
        )
        top = 2.0 * half[:, 2] - FOOT_M
        highest: FloatArray = np.where(on, top, 0.0).max(axis=1)
        return highest


@dataclass(frozen=True, slots=True)
class Furnished:
    """How a street is furnished; see `furnished_street`.

    Args:
        density_per_100_m: pieces of furniture per 100 m of each side of a road, on average.
        seed: of what stands where.

    Raises:
        ScenarioError: the density is negative or infinite, or the seed no whole number from 0 on.
    """

    density_per_100_m: float = 8.0
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0.0 <= self.density_per_100_m <= GREATEST_DENSITY:
            raise ScenarioError(
                f"street: the density must lie in [0, {GREATEST_DENSITY:g}] pieces per 100 m, got "
                f"{self.density_per_100_m:g}"
            )
        if self.seed < 0:
            raise ScenarioError(f"street: the seed must be a whole number from 0 on, got {self.seed}")


BARE = Street(Bodies.empty())
"""No kerbs and no furniture."""


def furnished_street(
    network: RoadNetwork,
    density_per_100_m: float = 8.0,
    seed: int = 0,
    *,
    parked_share: float = 0.5,
    clear_m: FloatArray | None = None,
    kerbs: bool = True,
    surface: MapSurface | None = None,
) -> Street:
    """Kerbs, furniture and parked cars along the lanes of a map.

    Furniture stands along sidewalks; on roads without any, beside the outermost lane. Parked cars stand on
    lanes for parking. Nothing else stands on a lane for traffic.

    Args:
        network: the map.
        density_per_100_m: pieces of furniture per 100 m of each side of a road, on average.
        seed: of what stands where.
        parked_share: share of parking places that are taken.
        clear_m: (K, 3) x, y and radius of circles without furniture and parked cars.
        kerbs: whether sidewalks are raised.
        surface: the ground on which all stand; None: that of the map.

    Raises:
        ScenarioError: the density is negative, or the share of places not in [0, 1].
    """
    if not 0.0 <= density_per_100_m < math.inf or not 0.0 <= parked_share <= 1.0:
        raise ScenarioError(
            "street: the density must be finite and not negative, the share of parked cars in [0, 1]; got "
            f"{density_per_100_m:g} and {parked_share:g}"
        )
    surface = surface or MapSurface(network)
    clear = np.zeros((0, 3)) if clear_m is None else np.asarray(clear_m, dtype=np.float64).reshape(-1, 3)
    blocks = _sidewalks(network, surface) if kerbs else Bodies.empty()
    raised = Street(blocks, len(blocks))
    rng = np.random.default_rng(seed)
    pieces = [*_furniture(network, density_per_100_m, rng), *_parked(network, parked_share, rng)]
    free = _free(network, pieces, clear)
    kept = [piece for piece, keep in zip(pieces, free, strict=True) if keep]
    place = np.array([piece.place for piece in kept]).reshape(-1, 2)
    yaw = np.array([piece.yaw_rad for piece in kept])
    bottom = surface.elevation_m(place, yaw) + raised.raised_m(place)
    furniture = Bodies.of([piece.parts for piece in kept], np.column_stack((place, bottom)), yaw)
    kinds = tuple(piece.kind for piece in kept)
    footprint = _footprint(kept)
    return Street(joined([blocks, furniture]), len(blocks), kinds, footprint, len(pieces) - len(kept))


@dataclass(frozen=True, slots=True, eq=False)
class _Piece:
    kind: str
    parts: Parts
    place: FloatArray
    yaw_rad: float


def _sidewalks(network: RoadNetwork, surface: MapSurface) -> Bodies:
    """The blocks of all sidewalks, level each."""
    lanes = network.lanes
    parts, place, yaw = [], [], []
    for lane in np.flatnonzero(lanes.lane_type == "sidewalk").tolist():
        for s0, s1, inner, outer in _cells(network, lane, surface):
            middle, width = 0.5 * (inner + outer), np.hypot(*(outer - inner).T)
            along = middle[1] - middle[0]
            length = math.hypot(*along)
            if length < 0.01 or width.mean() < 0.05:
                continue
            stated = float(lanes.inner_height.value(np.array([lane]), np.array([0.5 * (s0 + s1)]))[0])
            top = stated if stated > 0.0 else KERB_M
            half = (0.5 * length + JOINT_M, 0.5 * float(width.mean()), 0.5 * (top + FOOT_M))
            parts.append(_parts(_row(BLOCK, half, half[2], CONCRETE)))
            place.append(middle.mean(axis=0))
            yaw.append(math.atan2(along[1], along[0]))
    if not parts:
        return Bodies.empty()
    at, heading = np.array(place), np.array(yaw)
    bottom = surface.elevation_m(at, heading) - FOOT_M
    return Bodies.of(parts, np.column_stack((at, bottom)), heading)


def _cells(
    network: RoadNetwork, lane: int, surface: MapSurface
) -> list[tuple[float, float, FloatArray, FloatArray]]:
    """Stretches of a lane that are level rectangles within `FLATNESS_M` and `STEEPNESS_M`, or 1 m long.

    Each with s from and to, and (2, 2) ends of the inner and of the outer border.
    """
    low, high = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
    s = np.linspace(low, high, max(math.ceil(high - low), 1) + 1)
    inner, outer = _inner_outer(network, lane, s)
    height = np.zeros(len(s))
    if not surface.is_level:
        heading = network.center_line(np.full(len(s), lane), s)[3]
        height = surface.elevation_m(0.5 * (inner + outer), heading)
    cells, open_spans = [], [(0, len(s) - 1)]
    while open_spans:
        a, b = open_spans.pop()
        part = slice(a, b + 1)
        uneven = _bend(inner[part], outer[part]) > FLATNESS_M or np.ptp(height[part]) > 2.0 * STEEPNESS_M
        if b - a > 1 and uneven:
            middle = (a + b) // 2
            open_spans += [(middle, b), (a, middle)]
        else:
            cells.append((float(s[a]), float(s[b]), inner[[a, b]], outer[[a, b]]))
    return cells


def _bend(inner: FloatArray, outer: FloatArray) -> float:
    """How far two borders are from the long sides of a rectangle."""
    deviation = 0.0
    for border in (inner, outer):
        chord = border[-1] - border[0]
        rel = border - border[0]
        length = max(math.hypot(*chord), 1e-9)
        deviation = max(deviation, float(np.abs(chord[0] * rel[:, 1] - chord[1] * rel[:, 0]).max()) / length)
    width = np.hypot(*(outer - inner).T)
    return max(deviation, 0.5 * float(np.ptp(width)))


def _inner_outer(network: RoadNetwork, lane: int, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(N, 2) points of the border towards the road's middle, and of the other."""
    left, right = network.borders(np.full(len(s_m), lane), s_m)
    outer_is_left = network.lanes.side[lane] == network.lanes.direction[lane]
    return (right, left) if outer_is_left else (left, right)


def _verges(network: RoadNetwork) -> list[tuple[int, bool]]:
    """Lanes along which furniture stands, and whether on them: sidewalks, or beside the outermost lane."""
    lanes = network.lanes
    side_of = list(zip(lanes.section.tolist(), lanes.side.tolist(), strict=True))
    walked = {side_of[lane] for lane in np.flatnonzero(lanes.lane_type == "sidewalk").tolist()}
    outermost: dict[tuple[int, int], int] = {}
    for lane, side in enumerate(side_of):
        if side not in outermost or lanes.rank[lane] > lanes.rank[outermost[side]]:
            outermost[side] = lane
    return [
        *((lane, True) for lane in np.flatnonzero(lanes.lane_type == "sidewalk").tolist()),
        *((lane, False) for side, lane in outermost.items() if side not in walked),
    ]


def _furniture(network: RoadNetwork, density_per_100_m: float, rng: np.random.Generator) -> list[_Piece]:
    """Pieces at random places along the verges: their numbers are Poisson's."""
    names = list(FURNITURE)
    shares = np.array([FURNITURE[name].share for name in names])
    pieces = []
    for lane, on_lane in _verges(network):
        low, high = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
        count = int(rng.poisson(0.01 * density_per_100_m * (high - low)))
        s = np.sort(rng.uniform(low, high, count))
        if not count:
            continue
        inner, outer = _inner_outer(network, lane, s)
        heading = network.center_line(np.full(count, lane), s)[3]
        width = np.hypot(*(outer - inner).T)
        for k, name in enumerate(rng.choice(names, count, p=shares / shares.sum()).tolist()):
            furnishing = FURNITURE[name]
            parts = furnishing.make(rng)
            low_m, high_m = furnishing.from_kerb or (0.3, 0.8)
            behind = float(rng.uniform(low_m, high_m))
            if width[k] < 0.3:
                continue
            outward = (outer[k] - inner[k]) / width[k]
            from_lane = furnishing.from_kerb is not None and on_lane
            start = inner[k] if from_lane else outer[k]
            pieces.append(_Piece(name, parts, start + behind * outward, float(heading[k])))
    return pieces


def _parked(network: RoadNetwork, share: float, rng: np.random.Generator) -> list[_Piece]:
    """Cars on lanes for parking, along them."""
    pieces = []
    for lane in np.flatnonzero(network.lanes.lane_type == "parking").tolist():
        low, high = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
        s = np.arange(low + 0.5 * PARKING_PITCH_M, high - 0.5 * PARKING_PITCH_M + 1e-9, PARKING_PITCH_M)
        s = s[rng.random(len(s)) < share]
        if not len(s):
            continue
        x, y, _, heading = network.center_line(np.full(len(s), lane), s)
        width = network.lane_width(np.full(len(s), lane), s)
        for k in np.flatnonzero(width >= CAR_M[1]).tolist():
            parts = unit_body("car").scaled(np.array(CAR_M))
            pieces.append(_Piece("parked", parts, np.array([x[k], y[k]]), float(heading[k])))
    return pieces


def _free(network: RoadNetwork, pieces: list[_Piece], clear: FloatArray) -> BoolArray:
    """(N,) whether nothing of a piece near the ground is on a lane for traffic, or within a clear circle.

    Tested on 16 points of the outline and the middle; the crown of a tree may reach over the road.
    """
    free = np.ones(len(pieces), dtype=np.bool_)
    if not pieces:
        return free
    outline = np.stack([_outline(piece) for piece in pieces])
    if len(clear):
        gap = np.hypot(*np.moveaxis(outline[:, :, None] - clear[:, :2], -1, 0)) - clear[:, 2]
        free &= (gap > 0.0).all(axis=(1, 2))
    hits = network.locate(outline.reshape(-1, 2))
    banned = np.isin(network.lanes.lane_type[hits.lane], sorted(TRAFFIC))
    parked = np.array([piece.kind == "parked" for piece in pieces])
    owner = hits.point // outline.shape[1]
    banned &= ~(parked[owner] & (network.lanes.lane_type[hits.lane] == "parking"))
    free[owner[banned]] = False
    return free


def _footprint(pieces: list[_Piece]) -> Boxes:
    """Outlines of pieces from above."""
    if not pieces:
        return NO_BOXES
    near, far = np.array([_low_extent(piece) for piece in pieces]).transpose(1, 0, 2)
    yaw = np.array([piece.yaw_rad for piece in pieces])
    c, s = np.cos(yaw)[:, None], np.sin(yaw)[:, None]
    x, y = np.split(0.5 * (near + far), 2, axis=1)
    place = np.array([piece.place for piece in pieces])
    return Boxes(place + np.column_stack((c * x - s * y, s * x + c * y)), far - near, yaw)


def _low_extent(piece: _Piece) -> tuple[FloatArray, FloatArray]:
    """(2,) and (2,) corners, in the piece's frame, around the parts that are less than 2 m up."""
    parts = piece.parts
    low = parts.center_m[:, 2] - parts.half_m[:, 2] < 2.0
    near: FloatArray = np.where(low[:, None], parts.center_m[:, :2] - parts.half_m[:, :2], np.inf).min(axis=0)
    far: FloatArray = np.where(low[:, None], parts.center_m[:, :2] + parts.half_m[:, :2], -np.inf).max(axis=0)
    return near, far


def _outline(piece: _Piece) -> FloatArray:
    """(17, 2) middle and outline of the parts that are less than 2 m up."""
    near, far = _low_extent(piece)
    t = np.linspace(-1.0, 1.0, 5)[:4]
    ring = np.concatenate(
        [np.column_stack(side) for side in ((t, t * 0 - 1), (t * 0 + 1, t), (-t, t * 0 + 1), (t * 0 - 1, -t))]
    )
    local = 0.5 * (near + far) + 0.5 * (far - near) * np.concatenate(([[0.0, 0.0]], ring))
    c, s = math.cos(piece.yaw_rad), math.sin(piece.yaw_rad)
    outline: FloatArray = piece.place + local @ np.array([[c, s], [-s, c]])
    return outline
