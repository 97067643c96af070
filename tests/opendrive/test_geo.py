import builtins

import numpy as np
import pyproj
import pytest

from opendrive import OpenDriveError, PositionError
from opendrive.geo import GeoReferenceError, projection_text

UTM = "+proj=utm +zone=32 +ellps=WGS84 +datum=WGS84 +units=m +no_defs"
POINTS = np.array([[0.0, 0.0], [1200.0, -340.0], [-55.5, 812.25]])


def header(geo_reference, offset=""):
    return (
        '<OpenDRIVE><header revMajor="1" revMinor="8" name="" version="1">'
        f"<geoReference><![CDATA[{geo_reference}]]></geoReference>{offset}</header>"
    )


@pytest.fixture
def placed(load, text):
    """Load a straight road with a geoReference and an offset."""

    def make(geo_reference, offset=""):
        return load(header(geo_reference, offset), text.road(), "</OpenDRIVE>", whole=True)

    return make


@pytest.mark.parametrize("reference", [UTM, f"{UTM} +geoidgrids=egm96_15.gtx +vunits=m", "EPSG:32632"])
def test_projections_are_those_of_pyproj(placed, reference):
    offset = '<offset x="691000" y="5336000" z="500" hdg="0"/>'
    network = placed(reference, offset)
    latitude, longitude = network.to_geographic(POINTS)
    expected = pyproj.Proj("EPSG:32632")(POINTS[:, 0] + 691000.0, POINTS[:, 1] + 5336000.0, inverse=True)
    np.testing.assert_allclose(longitude, expected[0], atol=1e-10)
    np.testing.assert_allclose(latitude, expected[1], atol=1e-10)
    np.testing.assert_allclose(network.from_geographic(latitude, longitude), POINTS, atol=1e-4)


def test_the_offset_turns_first_and_moves_then(placed):
    """The formula of the standard's chapter on georeferencing, in complex numbers."""
    network = placed(UTM, '<offset x="500000" y="4649776" z="0" hdg="0.3"/>')
    world = (POINTS @ [1.0, 1j]) * np.exp(0.3j) + (500000.0 + 4649776.0j)
    expected = pyproj.Proj(UTM)(world.real, world.imag, inverse=True)
    latitude, longitude = network.to_geographic(POINTS)
    np.testing.assert_allclose([longitude, latitude], expected, atol=1e-10)
    np.testing.assert_allclose(network.from_geographic(latitude, longitude), POINTS, atol=1e-4)


def test_positions_of_the_map_do_not_move_with_the_offset(placed):
    moved, plain = placed(UTM, '<offset x="5" y="6" z="7" hdg="1"/>'), placed(UTM)
    np.testing.assert_array_equal(moved.center_line(0, 5.0), plain.center_line(0, 5.0))


def test_an_origin_alone_means_metres_east_and_north_of_it(placed):
    """Against distances along the ellipsoid."""
    network = placed("+lat_0=4.9000000000000000e+1 +lon_0=8.0000000000000000e+0")
    latitude, longitude = network.to_geographic([[0.0, 0.0], [300.0, 400.0], [0.0, -250.0]])
    assert (latitude[0], longitude[0]) == pytest.approx((49.0, 8.0), abs=1e-10)
    azimuth, _, distance = pyproj.Geod(ellps="WGS84").inv(
        np.full(3, 8.0), np.full(3, 49.0), longitude, latitude
    )
    np.testing.assert_allclose(distance, [0.0, 500.0, 250.0], atol=1e-4)
    np.testing.assert_allclose(np.abs(azimuth[1:]), [np.degrees(np.arctan2(300.0, 400.0)), 180.0], atol=1e-3)


def test_maps_with_a_reference_have_geographic_positions(network_of, map_name):
    network = network_of(map_name)
    if not network.model.header.geo_reference.strip():
        with pytest.raises(GeoReferenceError, match="no geoReference"):
            network.to_geographic(POINTS)
        return
    latitude, longitude = network.to_geographic(POINTS)
    np.testing.assert_allclose(network.from_geographic(latitude, longitude), POINTS, atol=1e-3)


@pytest.mark.parametrize(
    "reference",
    [
        "+proj=nonsense",
        "nowhere",
        "+lat_0=49",
        "+lat_0=a +lon_0=b",
        # Degrees: metres would be taken for them.
        "EPSG:4326",
        "+proj=longlat +datum=WGS84 +no_defs",
    ],
)
def test_references_that_are_not_understood_are_refused(placed, reference):
    with pytest.raises(GeoReferenceError, match="geoReference") as error:
        placed(reference).to_geographic(POINTS)
    assert "\n" not in str(error.value)
    assert isinstance(error.value, OpenDriveError)


def test_points_off_the_projection_are_refused(placed):
    with pytest.raises(PositionError, match="outside the projection"):
        placed(UTM).from_geographic(95.0, 9.0)
    with pytest.raises(PositionError, match="finite"):
        placed(UTM).from_geographic(np.nan, 9.0)


def test_without_pyproj_the_error_says_what_to_install(placed, monkeypatch):
    real = builtins.__import__

    def without(name, *args, **kwargs):
        if name.startswith("pyproj"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(GeoReferenceError, match=r"pip install 'smartmot\[maps\]'"):
        placed(UTM).to_geographic(POINTS)


def test_vertical_parameters_are_left_out():
    assert "geoidgrids" not in projection_text("+proj=utm +zone=32 +geoidgrids=egm96_15.gtx +vunits=m")
