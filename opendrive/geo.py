"""Between the map frame and latitude and longitude (WGS 84), by way of the file's geoReference.

Positions of the map stay in the file's own inertial frame. Its header offset is applied only here, as the
standard says: rotated by the offset's heading, then moved by its x and y, and after that projected (ASAM
OpenDRIVE 1.8, section 8.5).
"""

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

import _smartmot
from opendrive.arrays import FloatArray
from opendrive.errors import OpenDriveError, PositionError
from opendrive.model import GeoOffset, Header

if TYPE_CHECKING:
    from pyproj import CRS, Transformer

_VERTICAL = re.compile(r"\+(geoidgrids|vunits|vto_meter)=\S+")
_ORIGIN = re.compile(r"\+(lat_0|lon_0)=(\S+)")
_NO_OFFSET = GeoOffset(0.0, 0.0, 0.0, 0.0)


class GeoReferenceError(OpenDriveError):
    """The map cannot be placed on earth: no usable geoReference, or pyproj is not installed."""


def projection_text(geo_reference: str) -> str:
    """Return a geoReference as pyproj understands it.

    Vertical parameters are left out: they need grid files, and only positions in plan are converted. A text
    of nothing but ``+lat_0`` and ``+lon_0``, as CARLA writes it, is read as metres east and north of that
    point: a transverse Mercator projection of the WGS 84 ellipsoid, true to scale there.

    Raises:
        GeoReferenceError: the text is empty, or names neither a projection nor an origin.
    """
    text = _VERTICAL.sub("", geo_reference).strip()
    if not text:
        raise GeoReferenceError(
            "the map has no geoReference in its header; add one to use geographic positions"
        )
    if text.startswith("+") and "+proj=" not in text and "+init=" not in text:
        origin = dict(_ORIGIN.findall(text))
        if origin.keys() < {"lat_0", "lon_0"}:
            raise GeoReferenceError(
                f"geoReference {geo_reference!r:.120}: expected +proj, or +lat_0 and +lon_0"
            )
        at = f"+lat_0={origin['lat_0']} +lon_0={origin['lon_0']}"
        return f"+proj=tmerc {at} +k=1 +datum=WGS84 +units=m +no_defs"
    return text


def coordinate_system(geo_reference: str) -> "CRS":
    """Return the coordinate system that a geoReference names.

    Raises:
        GeoReferenceError: there is none, it is not understood, or it holds degrees, while maps hold metres.
        ImportError: pyproj is not installed.
    """
    from pyproj import CRS
    from pyproj.exceptions import ProjError

    try:
        system = CRS.from_user_input(projection_text(geo_reference))
    except ProjError as error:
        reason = str(error).splitlines()[0]
        raise GeoReferenceError(f"geoReference {geo_reference!r:.120}: {reason}") from None
    if system.is_geographic:
        message = "names degrees, while the map is in metres; name a projection"
        raise GeoReferenceError(f"geoReference {geo_reference!r:.120} {message}")
    return system


@dataclass(frozen=True, slots=True, eq=False)
class GeoReference:
    """Transformation between the map frame and WGS 84.

    Attributes:
        transformer: from the projection to longitude and latitude.
        offset: the header's offset.
    """

    transformer: "Transformer"
    offset: GeoOffset

    @classmethod
    def of(cls, header: Header) -> "GeoReference":
        """Read the geoReference of a header.

        Raises:
            GeoReferenceError: pyproj is not installed, or the geoReference is absent or not understood.
        """
        try:
            from pyproj import Transformer

            system = coordinate_system(header.geo_reference)
        except ImportError as error:
            raise GeoReferenceError(_smartmot.missing_extra("geographic positions", "maps", error)) from None
        transformer = Transformer.from_crs(system, "EPSG:4326", always_xy=True)
        return cls(transformer, header.offset or _NO_OFFSET)

    def to_geographic(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude (N,), degrees, of points (N, 2) of the map frame.

        Raises:
            PositionError: a point lies outside the projection.
        """
        cos, sin = np.cos(self.offset.heading_rad), np.sin(self.offset.heading_rad)
        x, y = xy_m.T
        east, north = cos * x - sin * y + self.offset.x_m, sin * x + cos * y + self.offset.y_m
        longitude, latitude = self.transformer.transform(east, north)
        return _checked(latitude), _checked(longitude)

    def from_geographic(self, latitude_deg: FloatArray, longitude_deg: FloatArray) -> FloatArray:
        """Return points (N, 2) of the map frame at latitude and longitude (N,), degrees.

        Raises:
            PositionError: a point lies outside the projection.
        """
        east, north = self.transformer.transform(longitude_deg, latitude_deg, direction="INVERSE")
        cos, sin = np.cos(self.offset.heading_rad), np.sin(self.offset.heading_rad)
        x, y = _checked(east) - self.offset.x_m, _checked(north) - self.offset.y_m
        return np.stack([cos * x + sin * y, cos * y - sin * x], axis=1)


def _checked(values: FloatArray) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if not np.isfinite(array).all():
        raise PositionError("a position lies outside the projection that the geoReference names")
    return array
