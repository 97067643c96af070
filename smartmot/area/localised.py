"""An area on the map asked for objects in the frame of the odometry, in which they are tracked."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from smartmot.area.monitored import MonitoredArea, Relevance, reaching, within_reach
from smartmot.forecast.uncertain import UncertainMotion
from smartmot.geometry import from_frame, to_frame
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """A rigid motion that lays one pose of the ego on another: `dst_SE2_src`.

    With the ego's pose in the odometry frame as `src` and the one that it is localised at as `dst`, it is
    `map_SE2_odometry`. An error of the localisation thereby moves the map against everything perceived, and
    leaves alone how objects lie to the ego.

    Args:
        src: pose of the ego in the one frame.
        dst: pose of the ego in the other.
    """

    src: EgoState
    dst: EgoState

    @property
    def inverse(self) -> Alignment:
        """From the other frame to the one."""
        return Alignment(self.dst, self.src)

    @property
    def turn_rad(self) -> float:
        """By how much headings turn."""
        return self.dst.yaw_rad - self.src.yaw_rad

    def points(self, points_m: FloatArray) -> FloatArray:
        """(..., 2) points in the other frame."""
        src, dst = self.src, self.dst
        local = to_frame(points_m, src.x_m, src.y_m, src.yaw_rad)
        return from_frame(local, dst.x_m, dst.y_m, dst.yaw_rad)

    def boxes(self, boxes: Boxes) -> Boxes:
        """Boxes in the other frame."""
        return unchecked(Boxes, self.points(boxes.center_m), boxes.size_m, boxes.yaw_rad + self.turn_rad)

    def path(self, path: PlannedPath) -> PlannedPath:
        """A path in the other frame; the lanes of a route stay behind."""
        return PlannedPath(self.points(path.center_m), path.station_m)


@dataclass(frozen=True, slots=True, eq=False)
class LocalisedArea:
    """An area, made around the pose that the ego is localised at, for objects in the odometry frame.

    Args:
        area: on the map.
        map_SE2_odometry: from the frame of the objects to that of the area.
    """

    area: MonitoredArea
    map_SE2_odometry: Alignment  # noqa: N815  # the usual name of a transform

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) which objects are tracked at all."""
        return self.area.kept(self.map_SE2_odometry.boxes(boxes), category)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """How objects relate to the ego's route."""
        return self.area.relevance(self.map_SE2_odometry.boxes(boxes), category)

    def within_reach(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) which objects are near enough in front of the ego to count at all."""
        return within_reach(self.area, self.map_SE2_odometry.boxes(boxes), category)

    def reaching(self, motion: Callable[[], UncertainMotion]) -> BoolArray | None:
        """(M,) which objects reach the path, where the area says so."""

        def on_map() -> UncertainMotion:
            seen, to_map = motion(), self.map_SE2_odometry
            return seen.turned(to_map.turn_rad, to_map.points(seen.center_m))

        return reaching(self.area, on_map)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) which points, (N, 2) odometry frame, lie on the ego's lane ahead."""
        return self.area.on_lane(self.map_SE2_odometry.points(center_m))

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines to draw, where the ego believes them to be: odometry frame."""
        back = self.map_SE2_odometry.inverse
        return [(role, back.points(ring)) for role, ring in self.area.polygons()]
