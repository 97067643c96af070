"""Kerbs and furniture: on the right lanes, as many and as high as stated."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from scenarios.errors import ScenarioError
from scenarios.sensors import MapSurface, World
from scenarios.sensors.lidar import HDL64, LidarSensor, Street, furnished_street
from scenarios.sensors.lidar.street import KERB_M
from smartmot.types import Boxes, EgoState

MAPS = Path(__file__).parents[4] / "scenarios" / "maps"


def shipped(name: str) -> RoadNetwork:
    return load_map(MAPS / f"{name}.xodr")


def furniture(street: Street) -> np.ndarray:
    return street.bodies.position_m[street.sidewalk_blocks :, :2]


@pytest.mark.parametrize("name", ["urban_street", "urban_bend", "urban_intersection", "euro_ncap_street"])
@pytest.mark.parametrize("seed", [1, 2])
def test_no_furniture_stands_on_a_lane_for_traffic(name: str, seed: int) -> None:
    network = shipped(name)
    street = furnished_street(network, 30.0, seed)
    standing = np.array([kind != "parked" for kind in street.kind])
    hits = network.locate(furniture(street)[standing])
    assert np.count_nonzero(standing) > 10
    assert not set(network.lanes.lane_type[hits.lane].tolist()) & {"driving", "biking", "shoulder", "parking"}
    assert len(street.kind) == len(street.bodies) - street.sidewalk_blocks


def test_cars_park_in_their_lanes() -> None:
    network = shipped("urban_street_parking")
    street = furnished_street(network, 0.0, 3, parked_share=0.5)
    assert set(street.kind) == {"parked"}
    hits = network.locate(furniture(street))
    assert set(network.lanes.lane_type[hits.lane].tolist()) == {"parking"}
    lanes = np.flatnonzero(network.lanes.lane_type == "parking")
    places = sum(math.floor((network.lanes.s_end_m - network.lanes.s_start_m)[lane] / 6.0) for lane in lanes)
    assert len(street.kind) + street.dropped == pytest.approx(
        0.5 * places, abs=3.0 * math.sqrt(0.25 * places)
    )
    assert furnished_street(network, 0.0, 3, parked_share=0.0).kind == ()


def test_density_is_per_length_of_each_side() -> None:
    network = shipped("urban_street")
    walks = network.lanes.lane_type == "sidewalk"
    length = float((network.lanes.s_end_m - network.lanes.s_start_m)[walks].sum())
    mean = 0.01 * 20.0 * length
    counts = [
        len(street.kind) + street.dropped for street in (furnished_street(network, 20.0, s) for s in range(4))
    ]
    assert np.mean(counts) == pytest.approx(mean, abs=4.0 * math.sqrt(mean / 4.0))
    assert len(set(counts)) > 1


def test_a_seed_gives_the_same_street() -> None:
    network = shipped("urban_bend")
    one, same, other = (furnished_street(network, 10.0, seed) for seed in (5, 5, 6))
    assert one.bodies.position_m.tolist() == same.bodies.position_m.tolist()
    assert one.kind == same.kind
    assert one.kind != other.kind


def test_a_place_can_be_kept_clear() -> None:
    network = shipped("urban_street_parking")
    everything = furnished_street(network, 40.0, 1)
    x, y = furniture(everything)[5]
    cleared = furnished_street(network, 40.0, 1, clear_m=np.array([[x, y, 15.0]]))
    assert np.hypot(*(furniture(cleared) - (x, y)).T).min() > 15.0
    assert cleared.dropped > everything.dropped


@pytest.mark.parametrize("name", ["urban_street", "urban_bend"])
def test_sidewalks_are_raised_and_roads_are_not(name: str) -> None:
    network = shipped(name)
    street = furnished_street(network, 0.0, kerbs=True)
    for kind, height in (("sidewalk", KERB_M), ("driving", 0.0)):
        for lane in np.flatnonzero(network.lanes.lane_type == kind).tolist():
            low, high = network.lanes.s_start_m[lane], network.lanes.s_end_m[lane]
            s = np.linspace(low + 0.5, high - 0.5, 200)
            x, y, _, _ = network.center_line(np.full(len(s), lane), s)
            assert street.raised_m(np.column_stack((x, y))) == pytest.approx(height, abs=1e-12)
    assert street.raised_m(np.zeros((0, 2))).shape == (0,)
    assert furnished_street(network, 0.0, kerbs=False).sidewalk_blocks == 0


def test_a_bend_is_made_of_short_blocks() -> None:
    """Corners of the blocks are within 5 cm of the sidewalk's borders, joints included."""
    network = shipped("urban_bend")
    street = furnished_street(network, 0.0)
    bodies, half = street.bodies, street.bodies.parts.half_m
    assert 20 < len(bodies) < 200
    c, s = np.cos(bodies.yaw_rad), np.sin(bodies.yaw_rad)
    for side in (-1.0, 1.0):
        across = side * (half[:, 1] + 0.05)
        outside = bodies.position_m[:, :2] + np.column_stack((-s * across, c * across))
        hits = network.locate(outside)
        assert not (network.lanes.lane_type[hits.lane] == "sidewalk").any()


STATED = """<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="1" length="100" junction="-1"><planView>
<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane>
<lane id="-2" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/>
<height sOffset="0" inner="0.2" outer="0.2"/></lane>
</right></laneSection></lanes></road></OpenDRIVE>"""


def test_the_map_s_own_height_of_a_sidewalk_counts(tmp_path: Path) -> None:
    (tmp_path / "stated.xodr").write_text(STATED)
    street = furnished_street(load_map(tmp_path / "stated.xodr"), 0.0)
    assert street.raised_m(np.array([[50.0, -5.0], [50.0, -2.0]])).tolist() == pytest.approx([0.2, 0.0])


def test_blocks_of_a_sidewalk_climb_with_the_road(tmp_path: Path) -> None:
    """5 % over 100 m: each block is within 3 cm of the slope, at its ends too."""
    climb = '<elevationProfile><elevation s="0" a="0" b="0.05" c="0" d="0"/></elevationProfile><lanes>'
    (tmp_path / "climb.xodr").write_text(STATED.replace("<lanes>", climb))
    blocks = furnished_street(load_map(tmp_path / "climb.xodr"), 0.0).bodies
    top = blocks.position_m[:, 2] + 2.0 * blocks.parts.half_m[:, 2]
    assert len(blocks) >= 90
    assert top == pytest.approx(0.05 * blocks.position_m[:, 0] + 0.2, abs=1e-6)
    assert 0.05 * blocks.parts.half_m[:, 0].max() <= 0.031


def test_the_lidar_sees_kerbs_and_people_stand_on_them(tmp_path: Path) -> None:
    """Sidewalk at its height, road at its own, kerb between them; feet on the sidewalk."""
    (tmp_path / "stated.xodr").write_text(STATED)
    network = load_map(tmp_path / "stated.xodr")
    boxes = Boxes(np.array([[20.0, -5.0], [24.0, -2.0]]), np.tile((0.6, 0.5), (2, 1)), np.zeros(2))
    columns = (np.zeros(2), np.full(2, 1.8), np.arange(2), np.full(2, "pedestrian"), np.ones(2, bool))
    world = World(1.0, boxes, *columns, np.ones(2, bool), MapSurface(network))
    sensor = LidarSensor(replace(HDL64, range_sigma_m=0.0), 0, furnished_street(network, 0.0), compiled=False)
    measurement, row = sensor.label(world, EgoState(1.0, 10.0, -2.0, 0.0, 0.0))
    x, y, z = measurement.cloud.xyz_m.T + np.array([[10.0], [-2.0], [1.73]])
    still = row == -1
    on_walk = still & (y < -4.01) & (y > -5.99) & (x > 5.0) & (x < 100.0)
    on_road = still & (y > -3.9) & (y < 0.0)
    kerb = still & (np.abs(y + 4.0) < 1e-4)
    assert z[on_walk] == pytest.approx(0.2, abs=1e-4)
    assert z[on_road] == pytest.approx(0.0, abs=1e-4)
    assert kerb.sum() > 20
    assert z[kerb].min() >= -1e-4
    assert z[kerb].max() <= 0.2 + 1e-4
    assert z[row == 0].max() == pytest.approx(2.0, abs=0.1)
    assert z[row == 0].min() >= 0.2 - 1e-4
    assert z[row == 1].max() == pytest.approx(1.8, abs=0.1)


@pytest.mark.parametrize(("density", "parked"), [(-1.0, 0.5), (math.inf, 0.5), (1.0, 1.5), (math.nan, 0.5)])
def test_impossible_streets_are_refused(density: float, parked: float) -> None:
    with pytest.raises(ScenarioError, match="street"):
        furnished_street(shipped("urban_street"), density, parked_share=parked)


def test_only_what_is_near_is_looked_at() -> None:
    street = furnished_street(shipped("urban_street"), 10.0, 1)
    x, y = street.bodies.position_m[street.sidewalk_blocks, :2]
    near = street.near(x, y, 20.0)
    assert 0 < len(near) < len(street.bodies)
    assert (np.hypot(*(near.position_m[:, :2] - (x, y)).T) - near.radius_m <= 20.0).all()
