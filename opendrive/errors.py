"""Errors and warnings of the package.

Every error derives from `OpenDriveError`, which is a `ValueError`. Its message says what is wrong, where
(file, road, element, line) and what to do about it.
"""

from dataclasses import dataclass
from enum import StrEnum


class OpenDriveError(ValueError):
    """Base of every error raised by this package."""


class MapReadError(OpenDriveError):
    """The file cannot be read as an OpenDRIVE map.

    Attributes:
        rule: name of the rule of the standard that is broken (ASAM's rule UID); empty if there is none.
    """

    rule = ""

    def __init__(self, message: str, rule: str | None = None) -> None:
        """Say what is wrong; `rule` is that of the class when absent."""
        super().__init__(message)
        self.rule = type(self).rule if rule is None else rule


class MapContentError(MapReadError):
    """The file is OpenDRIVE, but a value in it is missing or impossible."""

    rule = "asam.net:xodr:1.0.0:xml.valid_schema"


class RoadNotFoundError(OpenDriveError):
    """The network has no road with the given id."""


class LaneNotFoundError(OpenDriveError):
    """The network has no lane with the given key or index."""


class PositionError(OpenDriveError):
    """A position is not a finite number, lies off the road, or has the wrong shape."""


class RouteNotFoundError(OpenDriveError):
    """No chain of successors leads from one lane to the other."""


class WarningKind(StrEnum):
    """Kinds of what is tolerated; `docs/opendrive.md` says how each is read."""

    BEYOND_ROAD = "beyond the road"
    ARC_WITHOUT_CURVATURE = "arc without curvature"
    CONTRADICTING_LINK = "contradicting link"
    CONSTANT_SPIRAL = "constant spiral"
    CURVE_LENGTH = "curve length"
    DUPLICATE_ID = "duplicate id"
    GAP = "gap"
    GEO_REFERENCE = "geoReference"
    HEADING_GAP = "heading gap"
    IGNORED = "ignored"
    JUNCTION = "junction"
    LANE_IDS = "lane ids"
    LATE_RECORD = "late record"
    LAYER = "lane layer"
    LEFT_OUT = "left out"
    LINK = "link"
    LINK_ANGLE = "angle across a link"
    LINK_GAP = "gap across a link"
    LINK_HEIGHT = "height across a link"
    LINK_WIDTH = "width across a link"
    MISSING = "missing"
    NEGATIVE_WIDTH = "negative width"
    NO_WIDTH = "no width"
    ONE_SIDED_LINK = "one-sided link"
    ORDER = "order"
    REFERENCE = "reference"
    REFUSED = "refused"
    REVISION = "revision"
    ROAD_LENGTH = "road length"
    RULE = "rule"
    SECTION_LENGTH = "section length"
    STEP = "step"
    UNKNOWN_ELEMENT = "unknown element"
    UNKNOWN_LANE_TYPE = "unknown lane type"
    UNKNOWN_VALUE = "unknown value"
    WIDTH_AND_BORDER = "width and border"

    @property
    def is_defect(self) -> bool:
        """Whether what was read may not be what was meant; else only a rule of the standard is broken."""
        return self not in (
            WarningKind.RULE,
            WarningKind.ARC_WITHOUT_CURVATURE,
            WarningKind.CONSTANT_SPIRAL,
        )


@dataclass(frozen=True, slots=True)
class MapWarning:
    """A defect of the map that is tolerated.

    Attributes:
        road_id: road (or junction) where the defect is; empty for the file as a whole.
        element: element of the file, such as ``planView/geometry``.
        message: what is wrong and how it was read.
        kind: what kind of defect it is.
        s_m: where on the road it is; None where that has no meaning.
        lane_id: which lane of the road; None where that has no meaning.
        amount: how far it departs from what is right; None where that has no meaning.
        unit: unit of the amount: ``m`` or ``rad``.
        rule: name of the rule of the standard that it breaks (ASAM's rule UID); empty if there is none.
    """

    road_id: str
    element: str
    message: str
    kind: WarningKind
    s_m: float | None = None
    lane_id: int | None = None
    amount: float | None = None
    unit: str = ""
    rule: str = ""
