"""Where the lanes and roads of a network lie, and which are at a point."""

from collections.abc import Collection, Mapping
from functools import cached_property
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from opendrive.arrays import (
    FloatArray,
    IntArray,
    concatenated_ranges,
    finite,
    first_rows,
    per_point,
    points_xy,
    positive,
    wrapped,
)
from opendrive.errors import LaneNotFoundError, RoadNotFoundError
from opendrive.lanes.table import LaneKey, LaneTable
from opendrive.model import MapModel
from opendrive.roads.borders import (
    SampledBorders,
    SampledCenters,
    bounds_of,
    lane_polygon,
    lane_polygons,
    sample_borders,
)
from opendrive.roads.geometry import NetworkGeometry, SurfacePoints
from opendrive.roads.lane_index import LaneHits, LaneIndex, NearestLanes
from opendrive.roads.lane_poses import LanePoses
from opendrive.roads.levels import overlapping_roads
from opendrive.roads.road import S_TOLERANCE_M, RoadGeometry, SurfaceAttitudes, within
from opendrive.roads.road_records import RoadRecords


class NetworkLanes:
    """Where lanes and roads lie, and which are at a point: the first group of a `RoadNetwork`'s methods.

    A lane goes in and comes out as its index, a row of `lanes`; `lanes.key` has its road id, the index of its
    lane section and its lane id, and `lane_index_of` is the way back. A road goes in as its id, a text.
    """

    def __init__(self, model: MapModel) -> None:
        self._model = model
        geometry = model.roads.geometry if isinstance(model.roads, RoadRecords) else None
        self._geometry = geometry or NetworkGeometry.collect(tuple(model.roads.values()))
        self._lane_poses = LanePoses(self._geometry)

    @property
    def lanes(self) -> LaneTable:
        """All lanes, as a struct of arrays."""
        return self._geometry.lanes

    def center_line(
        self, lane: ArrayLike, s_m: ArrayLike
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return points of the middle of lanes.

        Args:
            lane: index of a lane, or an array of them.
            s_m: road s, broadcast against `lane`.

        Returns:
            x, y, z and heading in travel direction, all of the broadcast shape.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        pose = self._lane_poses.pose(lane, s_m)
        if pose is not None:
            x_m, y_m, z_m, heading_rad = pose
            return np.array(x_m), np.array(y_m), np.array(z_m), np.array(heading_rad)
        lanes, s = self._on_lanes(lane, s_m)
        many, flat = lanes.ravel(), s.ravel()
        inner, outer, d_inner, d_outer = self.lanes.offsets_and_slopes(many, flat)
        t = 0.5 * (inner + outer)
        points = self._geometry.lane_surface(many, flat, t, 0.5 * (d_inner + d_outer))
        against = np.where(self.lanes.direction[many] > 0, 0.0, np.pi)
        columns = (points.x_m, points.y_m, points.z_m, wrapped(points.heading_rad + against))
        x, y, z, heading = (column.reshape(s.shape) for column in columns)
        return x, y, z, heading

    def lane_offsets(self, lane: ArrayLike, s_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return t of lanes' inner borders (those towards the centre lane) and of their outer borders.

        Lane indices and s are broadcast against each other; so are the results.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        lanes, s = self._on_lanes(lane, s_m)
        inner, outer, _, _ = self.lanes.offsets_and_slopes(lanes.ravel(), s.ravel())
        return inner.reshape(s.shape), outer.reshape(s.shape)

    def lane_knots(self, lane: int) -> FloatArray:
        """Return the s (K,) of a lane's start, of its end and of all records of its shape in between.

        Between two of them reference line and borders are smooth.

        Raises:
            LaneNotFoundError: no such lane.
        """
        _, low_m, high_m = self._geometry.knots(np.array([self._checked(lane)]))
        return np.append(low_m, high_m[-1])

    def lane_width(self, lane: ArrayLike, s_m: ArrayLike) -> FloatArray:
        """Return the widths of lanes along t; lane indices and s are broadcast against each other.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        inner, outer = self.lane_offsets(lane, s_m)
        width: FloatArray = (outer - inner) * self.lanes.side[np.asarray(lane, dtype=np.int64)]
        return width

    def borders(self, lane: ArrayLike, s_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the left and the right border of lanes as seen in travel direction, (N, 2) each.

        Lane indices and s are broadcast against each other and flattened.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane.
        """
        lanes, s = self._on_lanes(lane, s_m)
        inner, outer = self._geometry.border_points(lanes.ravel(), s.ravel())
        outer_is_left = (self.lanes.side == self.lanes.direction)[lanes.ravel(), None]
        return np.where(outer_is_left, outer, inner), np.where(outer_is_left, inner, outer)

    def lane_polygon(
        self,
        lane: int,
        s0_m: float,
        s1_m: float,
        margin_left_m: float = 0.0,
        margin_right_m: float = 0.0,
        tolerance_m: float = 0.05,
    ) -> FloatArray:
        """Return the outline of a stretch of a lane.

        The outline follows the curve of the road and the change of width within `tolerance_m`. Margins that
        reach beyond the centre of a tight bend make it cross itself, as the border moved there does.

        Args:
            lane: index of the lane.
            s0_m: one end of the stretch, road s.
            s1_m: the other end.
            margin_left_m: by how much the left border (in travel direction) is moved outwards, along t.
            margin_right_m: the same for the right border.
            tolerance_m: greatest distance between border and outline.

        Returns:
            (P, 2) corners, map frame, without repetition of the first; along the right border and back along
            the left.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, a margin is not finite, or the tolerance is not
            positive.
        """
        s0, s1 = np.sort(self._on_lane(lane, [s0_m, s1_m])).tolist()
        margins = finite([margin_left_m, margin_right_m], "margin")
        tolerance_m = positive(tolerance_m, "tolerance_m")
        return lane_polygon(self._geometry, lane, s0, s1, margins, tolerance_m)

    def lane_polygons(self, tolerance_m: float = 0.05) -> NDArray[np.object_]:
        """Return the outlines of all lanes as shapely geometries, (L,), counter-clockwise.

        All are valid. Most are polygons; a lane that is nowhere wide in between is a multi-polygon, one that
        is nowhere wide an empty polygon. In a bend that is tighter than a lane is far out, the lane ends at
        the centre of the bend. Where neither is the case, the area is that of the lane within 0.1 %.

        Args:
            tolerance_m: greatest distance between border and outline.

        Raises:
            PositionError: the tolerance is not positive.
        """
        return lane_polygons(self._geometry, positive(tolerance_m, "tolerance_m"))

    def sampled_borders(self, step_m: float = 1.0) -> SampledBorders:
        """Return points of both borders of all lanes, at equal distances of at most `step_m` along the road.

        Raises:
            PositionError: the step is not positive.
        """
        return sample_borders(self._geometry, positive(step_m, "step_m"))

    def center_lines(self, step_m: float = 1.0) -> SampledCenters:
        """Return points of the middles of all lanes, at equal distances of at most `step_m` along the road.

        Raises:
            PositionError: the step is not positive.
        """
        lanes = self.lanes
        count = np.ceil((lanes.s_end_m - lanes.s_start_m) / positive(step_m, "step_m")).astype(np.int64)
        count = np.maximum(count, 1) + 1
        lane = np.repeat(np.arange(len(lanes), dtype=np.int64), count)
        share = concatenated_ranges(np.zeros(len(lanes), dtype=np.int64), count) / (count - 1)[lane]
        share = np.where(lanes.direction[lane] > 0, share, 1.0 - share)
        s_m = lanes.s_start_m[lane] + share * (lanes.s_end_m - lanes.s_start_m)[lane]
        x, y, z, heading = self.center_line(lane, s_m)
        width = self.lane_width(lane, s_m)
        return SampledCenters(first_rows(count), s_m, np.stack([x, y, z], axis=1), heading, width)

    # Roads

    @cached_property
    def roads(self) -> Mapping[str, RoadGeometry]:
        """Roads by id."""
        return MappingProxyType(
            {
                road_id: RoadGeometry(road_id, r, self._geometry, self._model.roads)
                for r, road_id in enumerate(self._geometry.roads.id)
            }
        )

    @cached_property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least and greatest coordinates of all lanes: xmin, ymin, xmax, ymax, metres.

        Exact where the borders are straight, within 5 mm where they bend; 0 without lanes.
        """
        return bounds_of(self._geometry)

    def road_point(self, road_id: str, s_m: ArrayLike, t_m: ArrayLike) -> SurfacePoints:
        """Return x, y, z and heading along s at (s, t) of a road, broadcast against each other.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: s or t is not finite, or s is off the road.
        """
        return self._road(road_id).point(s_m, t_m)

    def road_coordinates(self, road_id: str, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return (s, t) of points (N, 2) relative to a road; see `RoadGeometry.coordinates`.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        return self._road(road_id).coordinates(xy_m)

    def attitude(self, road_id: str, s_m: ArrayLike, t_m: ArrayLike) -> SurfaceAttitudes:
        """Return height, heading, pitch, roll and normal of a road's surface; see `RoadGeometry.attitude`.

        Raises:
            RoadNotFoundError: no such road.
            PositionError: s or t is not finite, or s is off the road.
        """
        return self._road(road_id).attitude(s_m, t_m)

    # Queries

    def lane_index_of(self, key: LaneKey | tuple[str, int, int]) -> int:
        """Return the index of a lane.

        Raises:
            LaneNotFoundError: the network has no such lane.
        """
        road_id, section, lane_id = key
        lane = self.lanes.lane_of_key.get(LaneKey(road_id, section, lane_id))
        if lane is None:
            raise LaneNotFoundError(f"no lane {lane_id} in section {section} of road {road_id!r}")
        return lane

    def locate(self, xy_m: ArrayLike, z_m: ArrayLike | None = None) -> LaneHits:
        """Return every lane that contains each point.

        Without heights, lanes of all levels count, such as those under a bridge; see `overlapping_roads`.

        Args:
            xy_m: (N, 2) points, map frame.
            z_m: (N,) heights of the points, or one for all: only the lanes of the nearest level count, which
                are those within 2 m in height of the lane nearest in height.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        points = points_xy(xy_m)
        return self._index.containing(points, None if z_m is None else per_point(z_m, "z_m", points))

    def nearest_lane(
        self,
        xy_m: ArrayLike,
        lane_types: Collection[str] = ("driving",),
        heading_rad: ArrayLike | None = None,
        z_m: ArrayLike | None = None,
        within_m: float = np.inf,
    ) -> NearestLanes:
        """Return the nearest lane of the given types for each point, however far away it is.

        `distance_m` says how far, and `inside` whether the point lies in it at all.

        Of several lanes that contain a point, the one whose centre line is nearest is taken; if headings are
        given, the one whose travel direction is nearest to the heading.

        Args:
            xy_m: (N, 2) points, map frame.
            lane_types: OpenDRIVE lane types.
            heading_rad: (N,) headings of what stands at the points, or one for all.
            z_m: (N,) heights of the points, or one for all: the nearest lane in space is taken; its distance
                stays that in plan.
            within_m: nothing is found farther away than this.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        types = (lane_types,) if isinstance(lane_types, str) else tuple(lane_types)
        points = points_xy(xy_m)
        height_m = None if z_m is None else per_point(z_m, "z_m", points)
        if heading_rad is None:
            nearest = self._index.nearest(points, types, height_m)
        else:
            headings = per_point(heading_rad, "heading_rad", points)
            nearest = self._index.nearest_along(points, types, headings, height_m)
        return nearest if within_m == np.inf else nearest.within(within_m)

    @cached_property
    def overlapping_roads(self) -> tuple[tuple[str, str], ...]:
        """Pairs of roads above each other, as bridges lie: queries there need a height."""
        return overlapping_roads(self._geometry, self._index)

    @cached_property
    def _index(self) -> LaneIndex:
        return LaneIndex.build(self._geometry)

    # Checks

    def _road(self, road_id: str) -> RoadGeometry:
        road = self.roads.get(road_id)
        if road is None:
            raise RoadNotFoundError(f"no road {road_id!r} in the network; ids are strings")
        return road

    def _checked(self, lane: int) -> int:
        if not 0 <= lane < len(self.lanes):
            raise LaneNotFoundError(f"no lane {lane}: the network has lanes 0 to {len(self.lanes) - 1}")
        return int(lane)

    def _on_lanes(self, lane: ArrayLike, s_m: ArrayLike) -> tuple[IntArray, FloatArray]:
        """Return lane indices and s on the lanes, broadcast against each other."""
        lanes, s = np.broadcast_arrays(np.asarray(lane), finite(s_m, "s_m"))
        if not lanes.size:
            return lanes.astype(np.int64), s
        if lanes.dtype.kind not in "iu":
            raise LaneNotFoundError(f"lane: expected indices, got values of type {lanes.dtype}")
        for extreme in (lanes.min(), lanes.max()):
            self._checked(int(extreme))
        lanes = lanes.astype(np.int64)
        on_lane = np.clip(s, self.lanes.s_start_m[lanes], self.lanes.s_end_m[lanes])
        off = np.flatnonzero(np.abs(s - on_lane) > S_TOLERANCE_M)
        if off.size:
            self._on_lane(int(lanes.flat[off[0]]), s.flat[off[0]])
        return lanes, on_lane

    def _on_lane(self, lane: int, s_m: ArrayLike) -> FloatArray:
        i = self._checked(lane)
        s = finite(s_m, "s_m")
        low, high = float(self.lanes.s_start_m[i]), float(self.lanes.s_end_m[i])
        return within(s, low, high, f"lane {tuple(self.lanes.key[i])}")
