"""Lane sections, lanes and what they have (chapter "Lanes")."""

from dataclasses import dataclass, field

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.model.deferred import Deferred, Detail

NO_HEIGHTS = read_only(np.empty((0, 3)))


@dataclass(frozen=True, slots=True)
class RoadMarkLine:
    """One line of a road mark (chapter "Lanes").

    Attributes:
        s_offset_m: where it starts: from the start of the mark, or of the lane section if explicit.
        t_offset_m: its lateral offset from the lane's border.
        length_m: length of the painted part.
        space_m: length of the gap; 0 for explicit lines.
        width_m: width; None when absent.
        color: colour name; empty when absent.
        rule: ``no passing``, ``caution`` or ``none``; empty when absent.
    """

    s_offset_m: float
    t_offset_m: float
    length_m: float
    space_m: float
    width_m: float | None
    color: str
    rule: str


@dataclass(frozen=True, slots=True)
class RoadMark:
    """Road mark on the outer border of a lane, or on the centre line (chapter "Lanes").

    Attributes:
        s_offset_m: start, from the start of the lane section.
        type: such as ``solid`` or ``broken``; ``none`` if nothing is painted.
        weight: ``standard`` or ``bold``.
        color: colour name.
        width_m: width; None when absent.
        lane_change: ``increase``, ``decrease``, ``both``, ``none``, or None when absent.
        material: name of the material.
        height_m: thickness; None when absent.
        pattern: name of the mark's own type, empty when absent; `lines` make it up.
        pattern_width_m: accumulated width of that type; None when absent.
        lines: repeated lines of that type.
        explicit_lines: single lines, not repeated.
        sway: cubics of the lateral offset, rows ``s, a, b, c, d``; s from the start of the mark.
    """

    s_offset_m: float
    type: str
    weight: str
    color: str
    width_m: float | None
    lane_change: str | None
    material: str = "standard"
    height_m: float | None = None
    pattern: str = ""
    pattern_width_m: float | None = None
    lines: tuple[RoadMarkLine, ...] = ()
    explicit_lines: tuple[RoadMarkLine, ...] = ()
    sway: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class LaneSpeed:
    """Speed limit of a lane from `s_offset_m` on (chapter "Lanes"); `speed_mps` is None for ``no limit``."""

    s_offset_m: float
    speed_mps: float | None


@dataclass(frozen=True, slots=True)
class LaneMaterial:
    """Material of a lane from `s_offset_m` on (chapter "Lanes"); `roughness` is None when absent."""

    s_offset_m: float
    surface: str
    friction: float
    roughness: float | None


@dataclass(frozen=True, slots=True)
class LaneAccess:
    """Who may use a lane from `s_offset_m` on (chapter "Lanes").

    Attributes:
        s_offset_m: start, from the start of the lane section.
        rule: ``allow`` or ``deny``; empty before 1.5, where the restriction names who may use the lane.
        restriction: such as ``bus``.
        restrictions: further types named by child elements (since 1.8).
    """

    s_offset_m: float
    rule: str
    restriction: str
    restrictions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LaneRule:
    """Rule of a lane from `s_offset_m` on, as free text (chapter "Lanes")."""

    s_offset_m: float
    value: str


@dataclass(frozen=True, slots=True, eq=False)
class LaneDetails:
    """What a lane has besides its shape and links (chapter "Lanes").

    Attributes:
        road_marks: marks on the outer border, by s.
        speeds: speed limits, by s.
        materials: materials, by s.
        accesses: restrictions of access, by s.
        rules: rules, by s.
        flags: other attributes of the lane (since 1.8), such as ``roadWorks``, with their values.
        extra: other elements, such as user data.
    """

    road_marks: tuple[RoadMark, ...] = ()
    speeds: tuple[LaneSpeed, ...] = ()
    materials: tuple[LaneMaterial, ...] = ()
    accesses: tuple[LaneAccess, ...] = ()
    rules: tuple[LaneRule, ...] = ()
    flags: tuple[tuple[str, str], ...] = ()
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """One lane of a lane section (chapter "Lanes").

    Attributes:
        id: positive left of the centre lane, negative right of it, 0 for the centre lane.
        type: such as ``driving`` or ``sidewalk``.
        level: keep the lane horizontal, without superelevation.
        predecessors: ids of the linked lanes at the start of the section.
        successors: ids of the linked lanes at its end.
        width: (K, 5) cubics of the width; s counts from the start of the section.
        border: (K, 5) cubics of the t coordinate of the outer border; used only without `width`.
        direction: ``standard``, ``reversed`` or ``both`` (since 1.8).
        height: (K, 3) rows ``s, inner, outer``: height of the lane's borders above the road.
        details: everything else, read when first asked for.
    """

    id: int
    type: str
    level: bool
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    width: FloatArray
    border: FloatArray
    direction: str = "standard"
    height: FloatArray = field(default_factory=lambda: NO_HEIGHTS)
    details: Deferred[LaneDetails] = field(default_factory=lambda: Deferred.of(LaneDetails()))

    road_marks = Detail[tuple[RoadMark, ...]]()
    speeds = Detail[tuple[LaneSpeed, ...]]()
    materials = Detail[tuple[LaneMaterial, ...]]()
    accesses = Detail[tuple[LaneAccess, ...]]()
    rules = Detail[tuple[LaneRule, ...]]()
    flags = Detail[tuple[tuple[str, str], ...]]()
    extra = Detail[tuple[str, ...]]()


@dataclass(frozen=True, slots=True, eq=False)
class LaneSection:
    """Lanes from `s_m` to the next section (chapter "Lanes"), from the leftmost to the rightmost."""

    s_m: float
    single_side: bool
    lanes: tuple[Lane, ...]
    extra: tuple[str, ...] = ()
