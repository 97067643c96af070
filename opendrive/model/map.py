"""A whole file and its header."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType

from opendrive.errors import MapWarning
from opendrive.model.deferred import Deferred
from opendrive.model.junctions import Junction, JunctionGroup
from opendrive.model.railroads import Station
from opendrive.model.roads import Road
from opendrive.model.signals import Controller


@dataclass(frozen=True, slots=True)
class GeoOffset:
    """Offset between the map frame and the georeferenced frame; never applied to positions."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Header:
    """File header (chapter "Header"); `extra` holds its other elements, such as the licence."""

    rev_major: int
    rev_minor: int
    name: str
    version: str
    date: str
    vendor: str
    north_m: float | None
    south_m: float | None
    east_m: float | None
    west_m: float | None
    geo_reference: str
    offset: GeoOffset | None
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class MapModel:
    """A whole file.

    Attributes:
        header: its header.
        roads: roads by id.
        junctions: junctions by id.
        noted: the defects that were tolerated in reading; to ask for them reads everything.
        controllers: controllers of signals, by id.
        junction_groups: groups of junctions.
        stations: stations.
        extra: other elements, such as user data.
    """

    header: Header
    roads: Mapping[str, Road]
    junctions: Mapping[str, Junction]
    noted: Deferred[tuple[MapWarning, ...]]
    controllers: Mapping[str, Controller] = field(default_factory=dict)
    junction_groups: tuple[JunctionGroup, ...] = ()
    stations: tuple[Station, ...] = ()
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Protect the mappings against writing."""
        for name in ("roads", "junctions", "controllers"):
            if isinstance(value := getattr(self, name), dict):
                object.__setattr__(self, name, MappingProxyType(dict(value)))

    @property
    def warnings(self) -> tuple[MapWarning, ...]:
        """The defects that were tolerated in reading."""
        return self.noted()

    def __reduce__(self) -> tuple[type["MapModel"], tuple[object, ...]]:
        """Pickle the mappings as plain dictionaries."""
        values = (getattr(self, item.name) for item in fields(self))
        return MapModel, tuple(dict(value) if isinstance(value, Mapping) else value for value in values)
