"""Switches and stations (chapter "Railroads")."""

from opendrive.model import Platform, PlatformSegment, Station, Switch, Track
from opendrive.xml.fields import REQUIRED, REST, Table, child, children_of, number, text

_TRACK = Table(Track, s_m=number("s"), road_id=text("id", REQUIRED), direction=text("dir", "+"))

SWITCH = Table(
    Switch,
    name=text("name"),
    id=text("id", REQUIRED),
    position=text("position", "dynamic"),
    main_track=child("mainTrack", _TRACK, required=True),
    side_track=child("sideTrack", _TRACK, required=True),
    partner_id=text("id", REQUIRED).inside("partner"),
    partner_name=text("name").inside("partner"),
    extra=REST,
)

_SEGMENT = Table(
    PlatformSegment,
    s_start_m=number("sStart"),
    s_end_m=number("sEnd"),
    side=text("side"),
    road_id=text("roadId", REQUIRED),
)
_PLATFORM = Table(
    Platform,
    name=text("name"),
    id=text("id", REQUIRED),
    segments=children_of("segment", _SEGMENT),
)

STATION = Table(
    Station,
    name=text("name"),
    type=text("type"),
    id=text("id", REQUIRED),
    platforms=children_of("platform", _PLATFORM, kept=True),
    extra=REST,
)
