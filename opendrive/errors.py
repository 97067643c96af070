"""Errors and warnings of the package.

Every error derives from `OpenDriveError`, which is a `ValueError`. Its message says what is wrong, where
(file, road, element, line) and what to do about it.
"""

from dataclasses import dataclass


class OpenDriveError(ValueError):
    """Base of every error raised by this package."""


class MapReadError(OpenDriveError):
    """The file cannot be read as an OpenDRIVE map."""


class MapContentError(MapReadError):
    """The file is OpenDRIVE, but a value in it is missing or impossible."""


class RoadNotFoundError(OpenDriveError):
    """The network has no road with the given id."""


class LaneNotFoundError(OpenDriveError):
    """The network has no lane with the given key or index."""


class PositionError(OpenDriveError):
    """A position is not a finite number, lies off the road, or has the wrong shape."""


class RouteNotFoundError(OpenDriveError):
    """No chain of successors leads from one lane to the other."""


@dataclass(frozen=True, slots=True)
class MapWarning:
    """A defect of the map that is tolerated.

    Attributes:
        road_id: road (or junction) where the defect is; empty for the file as a whole.
        element: element of the file, such as ``planView/geometry``.
        message: what is wrong and how it was read.
    """

    road_id: str
    element: str
    message: str
