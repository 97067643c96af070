"""The LiDAR in the world: density, noise, shutter, pitch and labels."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarios.sensors import FlatGround, World
from scenarios.sensors.lidar import HDL32, HDL64, MID70, LidarConfig, LidarSensor, Mount, Rosette, Spinning
from scenarios.sensors.lidar.patterns import HDL32_ELEVATION_DEG
from smartmot.types import Boxes, EgoState

STANDING = EgoState(1.0, 0.0, 0.0, 0.0, 0.0)


def people(
    *places: tuple[float, float], yaw: float = math.pi / 2, speed: float = 0.0, **columns: object
) -> World:
    n = len(places)
    boxes = Boxes(np.array(places).reshape(n, 2), np.tile((0.6, 0.5), (n, 1)), np.full(n, yaw))
    values: dict[str, object] = {
        "height_m": np.full(n, 1.8),
        "object_id": np.arange(n),
        "category": np.full(n, "pedestrian"),
        "exists": np.full(n, True),
        "seen": np.full(n, True),
    } | columns
    return World(1.0, boxes, np.full(n, speed), **values)  # type: ignore[arg-type]


def quiet(config: LidarConfig, **changes: object) -> LidarSensor:
    """Without noise, and in numpy, so that nothing is compiled."""
    return LidarSensor(replace(config, range_sigma_m=0.0, **changes), compiled=False)  # type: ignore[arg-type]


HDL32_1024 = replace(HDL32, pattern=Spinning(HDL32_ELEVATION_DEG, 20.0, 0.05 / 1024))
HALF_SHOTS = [replace(MID70, pattern=Rosette(integration_s=t, shot_s=2e-5)) for t in (0.05, 0.2)]


@pytest.mark.parametrize(
    ("config", "counts"),
    [
        (HDL32_1024, (38, 10, 5, 0, 0)),
        (HDL64, (306, 86, 38, 19, 9)),
        (HALF_SHOTS[0], (70, 32, 20, 14, 9)),
        (HALF_SHOTS[1], (268, 137, 86, 66, 44)),
    ],
    ids=["hdl32", "hdl64", "mid70 50 ms", "mid70 200 ms"],
)
def test_points_on_a_pedestrian_fall_with_range(config: LidarConfig, counts: tuple[int, ...]) -> None:
    """Counts of an earlier measurement with bodies of its own, at 10 to 60 m: within 20 % and two points.

    Its Mid-70 had 50,000 shots a second, half of the sensor's.
    """
    sensor = quiet(config)
    for distance, count in zip((10.0, 20.0, 30.0, 40.0, 60.0), counts, strict=True):
        worlds = [people((distance, 0.0), yaw=yaw) for yaw in np.linspace(0.0, math.pi, 5)]
        points = [np.count_nonzero(sensor.label(world, STANDING)[1] == 0) for world in worlds]
        assert np.mean(points) == pytest.approx(count, rel=0.2, abs=2.0)


def test_a_rosette_is_as_dense_as_its_closed_form() -> None:
    """Shots within r of the axis: the share (2 / pi) asin(r / 2d), each prism bending by d = 14.99 deg."""
    wall = people((20.0, 0.0), height_m=np.array([40.0]), category=np.array(["unknown"]))
    wall = replace(wall, boxes=Boxes(np.array([[20.0, 0.0]]), np.array([[0.1, 60.0]]), np.zeros(1)))
    config = replace(MID70, pattern=Rosette(integration_s=0.5), mount=Mount(20.0), blind_m=0.0)
    cloud = quiet(config).measure(wall, STANDING).cloud
    angle = np.arctan2(np.hypot(cloud.xyz_m[:, 1], cloud.xyz_m[:, 2]), cloud.xyz_m[:, 0])
    for inside_deg in (1.0, 2.0, 5.0):
        share = np.count_nonzero(angle < math.radians(inside_deg)) / 50_000
        assert share == pytest.approx(2.0 / math.pi * math.asin(inside_deg / 29.98), rel=0.03)


def test_points_of_a_still_scene_lie_where_its_surfaces_are() -> None:
    measurement, row = quiet(HDL64).label(people((10.0, 1.0), (14.0, -2.0)), STANDING)
    points = measurement.cloud.xyz_m
    assert not measurement.is_truth
    assert measurement.stamp_s == 1.0
    assert measurement.number == 10
    assert points[row == -1, 2] == pytest.approx(-1.73, abs=1e-5)
    for number, place in enumerate(((10.0, 1.0), (14.0, -2.0))):
        rel = points[row == number] - (*place, 0.0)
        assert len(rel) > 50
        assert (np.abs(rel[:, :2]) <= (0.2501, 0.3001)).all()
        assert rel[:, 2].min() > -1.74
        assert rel[:, 2].max() == pytest.approx(1.8 - 1.73, abs=0.1)
    assert measurement.cloud.intensity is not None
    assert 0.0 <= measurement.cloud.intensity.min() <= measurement.cloud.intensity.max() <= 1.0
    assert measurement.cloud.time_offset_s is not None
    assert (np.diff(measurement.cloud.time_offset_s) >= 0.0).all()
    assert measurement.cloud.ring is not None
    assert set(np.unique(measurement.cloud.ring)) <= set(range(64))


def test_who_does_not_exist_or_is_unseen_returns_nothing() -> None:
    world = people((10.0, 0.0), (10.0, 3.0), (10.0, -3.0), seen=np.array([False, True, True]))
    world = replace(world, exists=np.array([False, True, True]))
    rows = quiet(HDL64).label(world, STANDING)[1]
    assert set(rows.tolist()) == {-1, 1, 2}
    assert set(quiet(HDL64).label(people(), STANDING)[1].tolist()) == {-1}


def test_noise_is_that_of_the_frame_and_of_the_stated_size() -> None:
    config = replace(HDL32, range_sigma_m=0.03)
    alone, noisy, other = (
        LidarSensor(config, seed, compiled=False).measure(people(*places), STANDING).cloud
        for seed, places in ((1, ()), (1, [(10.0, 0.0)]), (2, ()))
    )
    still = quiet(HDL32).measure(people(), STANDING).cloud
    error = np.linalg.norm(alone.xyz_m, axis=1) - np.linalg.norm(still.xyz_m, axis=1)
    assert error.std() == pytest.approx(0.03, rel=0.05)
    assert abs(error.mean()) < 0.001
    # a pedestrian in front changes no other ray
    assert np.isin(noisy.xyz_m[:, 0], alone.xyz_m[:, 0]).mean() > 0.98
    assert not np.array_equal(alone.xyz_m, other.xyz_m)


def test_lost_echoes_are_as_many_as_stated() -> None:
    everything = len(quiet(HDL32).measure(people(), STANDING).cloud)
    kept = len(quiet(HDL32, dropout=0.3).measure(people(), STANDING).cloud)
    assert kept / everything == pytest.approx(0.7, abs=0.02)
    assert len(quiet(HDL32, dropout=1.0).measure(people(), STANDING).cloud) == 0


def test_echoes_lie_between_the_blind_zone_and_the_reach() -> None:
    cloud = quiet(HDL64, range_m=30.0, blind_m=6.0).measure(people(), STANDING).cloud
    distance = np.linalg.norm(cloud.xyz_m, axis=1)
    assert distance.min() >= 6.0 - 1e-5
    assert distance.max() <= 30.0 + 1e-5


def test_a_pitched_and_raised_sensor_sees_the_same_ground() -> None:
    mount = Mount(2.0, 1.0, math.radians(5.0))
    world = replace(people((10.0, 0.0)), surface=FlatGround(3.0))
    measurement, row = quiet(HDL64, mount=mount).label(world, STANDING)
    points = measurement.cloud.xyz_m[row == -1]
    c, s = math.cos(mount.pitch_rad), math.sin(mount.pitch_rad)
    assert c * points[:, 2] - s * points[:, 0] == pytest.approx(-2.0, abs=1e-5)
    person = measurement.cloud.xyz_m[row == 0]
    ahead = 1.0 + c * person[:, 0] + s * person[:, 2]
    assert ahead.mean() == pytest.approx(9.8, abs=0.15)


def test_a_pedestrian_that_crosses_is_where_it_was_when_it_was_shot() -> None:
    """Lateral shift v dt: half a turn before the stamp for what is ahead (closed form)."""
    speed = 3.0
    still, still_row = quiet(HDL64).label(people((10.0, 0.0)), STANDING)
    moved, row = quiet(HDL64).label(people((10.0, 0.0), speed=speed), STANDING)
    middle = [cloud.cloud.xyz_m[rows == 0, 1].mean() for cloud, rows in ((still, still_row), (moved, row))]
    assert middle[1] - middle[0] == pytest.approx(-speed * 0.05, abs=0.02)
    # a front that is scanned alone is over sooner
    front = replace(HDL64, pattern=replace(HDL64.pattern, field_rad=2.0 * math.pi / 3.0))  # type: ignore[type-var]
    sooner, row = quiet(front).label(people((10.0, 0.0), speed=speed), STANDING)
    shift = sooner.cloud.xyz_m[row == 0, 1].mean() - middle[0]
    assert shift == pytest.approx(-speed * 0.1 / 6.0, abs=0.02)


@pytest.mark.parametrize("yaw_rate", [0.0, 0.4])
def test_the_motion_of_the_ego_is_taken_out_or_left_in(yaw_rate: float) -> None:
    """Of a standing person, points lie at its place at the stamp, or v T / 2 farther when left as shot."""
    ego = replace(STANDING, speed_mps=20.0, yaw_rate_radps=yaw_rate)
    world = people((15.0, 0.0))
    exact, row = quiet(HDL64).label(world, ego)
    middle = exact.cloud.xyz_m[row == 0].mean(axis=0)
    still, still_row = quiet(HDL64).label(world, STANDING)
    assert middle[:2] == pytest.approx(still.cloud.xyz_m[still_row == 0].mean(axis=0)[:2], abs=0.05)
    raw, row = quiet(HDL64, motion_compensated=False).label(world, ego)
    assert raw.cloud.xyz_m[row == 0, 0].mean() - middle[0] == pytest.approx(20.0 * 0.05, abs=0.05)
