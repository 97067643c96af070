"""Switches and stations (chapter "Railroads")."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Track:
    """Place and direction of a railroad track at a switch (chapter "Railroads")."""

    road_id: str
    s_m: float
    direction: str


@dataclass(frozen=True, slots=True)
class Switch:
    """Railroad switch (chapter "Railroads"); `partner_id` is empty if it has none."""

    id: str
    name: str
    position: str
    main_track: Track
    side_track: Track
    partner_id: str
    partner_name: str
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlatformSegment:
    """Stretch of road that a platform lies beside (chapter "Railroads")."""

    road_id: str
    s_start_m: float
    s_end_m: float
    side: str


@dataclass(frozen=True, slots=True)
class Platform:
    """Platform of a station (chapter "Railroads")."""

    id: str
    name: str
    segments: tuple[PlatformSegment, ...]


@dataclass(frozen=True, slots=True)
class Station:
    """Railroad, tram or bus station (chapter "Railroads")."""

    id: str
    name: str
    type: str
    platforms: tuple[Platform, ...]
    extra: tuple[str, ...] = ()
