"""The ground on maps with hills: rays against closed forms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from scenarios.sensors import FlatGround, MapSurface, World
from scenarios.sensors.lidar import HDL32, LidarSensor
from scenarios.sensors.lidar.casting import GROUND, Motion, RayTable, cast
from scenarios.sensors.lidar.shapes import Bodies
from scenarios.sensors.lidar.terrain import Terrain
from smartmot.arrays import FloatArray
from smartmot.types import Boxes, EgoState

MAPS = Path(__file__).parents[4] / "scenarios" / "maps"
RAMP = """<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="1" length="300" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="3" b="0.05" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right></laneSection></lanes>
</road></OpenDRIVE>"""


class Bowl:
    """Ground that rises with the square of x."""

    def elevation_m(self, points_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
        return points_m[:, 0] ** 2 / 400.0


def rays() -> RayTable:
    a, e = (
        g.ravel() for g in np.meshgrid(np.linspace(-3.0, 3.0, 61), np.linspace(-0.5, 0.04, 28), indexing="ij")
    )
    direction = np.column_stack((np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)))
    return RayTable.of(direction, np.zeros(len(a)))[0]


def test_rays_meet_a_ramp_where_a_plane_is(tmp_path: Path) -> None:
    """A heading of 30 deg on ground that climbs by 5 % along x of the map."""
    (tmp_path / "ramp.xodr").write_text(RAMP)
    terrain = Terrain(MapSurface(load_map(tmp_path / "ramp.xodr")))
    assert not terrain.is_flat
    yaw, table = math.radians(30.0), rays()
    relief = terrain.around(EgoState(0.0, 150.0, -2.0, yaw, 0.0), 0.0, 60.0)
    hits = cast(table, Motion(3.0 + 7.5 + 1.7), Bodies.empty(), relief, compiled=False)
    d = table.direction
    fall = 0.05 * (math.cos(yaw) * d[:, 0] - math.sin(yaw) * d[:, 1]) - d[:, 2]
    with np.errstate(divide="ignore"):
        expected = np.where(fall > 0.0, 1.7 / fall, np.inf)
    near = expected < 55.0
    assert near.sum() > 500
    assert hits.range_m[near] == pytest.approx(expected[near], abs=1e-6)
    assert hits.cosine[near] == pytest.approx(1.7 / expected[near] / math.hypot(1.0, 0.05), abs=1e-6)
    assert (hits.body[near] == GROUND).all()
    assert np.isinf(hits.range_m[fall <= 0.0]).all()


def test_rays_meet_the_first_flank_of_a_bowl() -> None:
    """Roots of a quadratic, within the 1 / 1600 m of sagitta between heights 1 m apart."""
    table = rays()
    relief = Terrain(Bowl()).around(EgoState(0.0, 0.0, 0.0, 0.0, 0.0), 0.0, 50.0)
    hits = cast(table, Motion(2.0), Bodies.empty(), relief, compiled=False)
    a, b = table.direction[:, 0] ** 2 / 400.0, table.direction[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.where(a > 1e-9, (b + np.sqrt(b * b + 8.0 * a)) / (2.0 * a), np.inf)
    near = (root < 45.0) & (np.abs(table.direction[:, 0]) > 0.2)
    assert near.sum() > 300
    z = 2.0 + hits.range_m[near] * table.direction[near, 2]
    ground = (hits.range_m[near] * table.direction[near, 0]) ** 2 / 400.0
    assert z == pytest.approx(ground, abs=1.0 / 1500.0)
    assert hits.range_m[near] == pytest.approx(root[near], rel=0.01)


def test_a_level_map_is_a_plane() -> None:
    assert Terrain(FlatGround(2.0)).is_flat
    assert Terrain(MapSurface(load_map(MAPS / "urban_bend.xodr"))).is_flat
    assert not Terrain(Bowl()).is_flat


def test_the_lidar_sees_the_road_climb(tmp_path: Path) -> None:
    (tmp_path / "ramp.xodr").write_text(RAMP)
    surface = MapSurface(load_map(tmp_path / "ramp.xodr"))
    boxes = Boxes(np.array([[120.0, -2.0]]), np.array([[0.6, 0.5]]), np.zeros(1))
    columns = (np.zeros(1), np.full(1, 1.8), np.arange(1), np.array(["pedestrian"]), np.ones(1, bool))
    world = World(1.0, boxes, *columns, np.ones(1, bool), surface)
    sensor = LidarSensor(replace(HDL32, range_sigma_m=0.0, range_m=50.0), compiled=False)
    measurement, row = sensor.label(world, EgoState(1.0, 100.0, -2.0, 0.0, 0.0))
    points = measurement.cloud.xyz_m
    assert points[row == -1, 2] == pytest.approx(0.05 * points[row == -1, 0] - 1.73, abs=1e-4)
    person = points[row == 0]
    assert len(person) > 5
    assert person[:, 2].min() >= 1.0 - 1.73 - 0.02
    assert person[:, 2].max() <= 1.0 - 1.73 + 1.8
