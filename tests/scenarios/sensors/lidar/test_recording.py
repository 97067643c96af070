"""A LiDAR cast along a recording: its frames, on the ground, with the parked cars."""

from dataclasses import replace

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.layouts.sweeps import points_inside, swept, with_least_points
from scenarios.recorded.poses import rigid, turned_about
from scenarios.sensors.lidar import HDL32, Mount, furnished_street
from scenarios.sensors.lidar.patterns import Spinning
from scenarios.sensors.lidar.recording import RecordedSweeps, mounted, turn_ends
from scenarios.sensors.world import MapSurface

COARSE = replace(HDL32, pattern=Spinning(tuple(range(-24, 0, 6)), 20.0, 0.001))
"""Four rows of 50 columns: for laws that do not ask for a real sensor."""


def still(stamp_s: list[float], *, yaw_rad: float = 0.0, labels: Objects | None = None) -> Sequence:
    """An ego that stands on the first lane of the street with parking strips."""
    count = len(stamp_s)
    place = np.tile((100.0, -1.75, 0.0), (count, 1))
    pose = rigid(turned_about(2, np.full(count, yaw_rad)), place)
    names = tuple(map(str, range(count)))
    return Sequence("still", np.array(stamp_s), names, Objects.empty(), labels or Objects.empty(), pose)


@pytest.mark.parametrize(
    ("stamp_s", "rate_hz", "frames"),
    [
        ([0.0, 0.05, 0.1, 0.15], 20.0, [0, 1, 2, 3]),
        ([0.0, 0.05, 0.1, 0.15], 10.0, [0, 2]),
        ([0.02, 0.07, 0.12, 0.1337], 20.0, [0, 1, 2]),  # the instant of a contact
        ([0.0, 0.08, 0.16, 0.24], 10.0, [0, 2]),  # a turn takes 0.1 s
        ([0.0, 0.1, 0.2], 20.0, [0, 1, 2]),
        ([0.5], 20.0, [0]),
        ([], 20.0, []),
    ],
)
def test_frames_are_those_at_which_a_turn_can_end(
    stamp_s: list[float], rate_hz: float, frames: list[int]
) -> None:
    assert turn_ends(np.array(stamp_s), rate_hz).tolist() == frames
    sequence = still(stamp_s)
    config = replace(COARSE, pattern=replace(COARSE.pattern, rate_hz=rate_hz))
    sweeps = RecordedSweeps(sequence, np.zeros(len(sequence)), config)
    assert sweeps.sequence.stamp_s.tolist() == [stamp_s[k] for k in frames]
    assert sweeps.left_out == len(stamp_s) - len(frames)
    assert [cloud.stamp_s for cloud in sweeps] == [stamp_s[k] for k in frames]


def test_labels_of_frames_without_a_cloud_go_with_them() -> None:
    frame = np.array([0, 1, 1, 3])
    labels = Objects.of(frame, np.array([[110.0, -1.75]] * 4), size_m=np.ones((4, 2)), yaw_rad=np.zeros(4),
                        object_id=np.array([7, 7, 8, 9]), velocity_mps=np.zeros((4, 2)))  # fmt: skip
    slow = replace(COARSE, pattern=replace(COARSE.pattern, rate_hz=10.0))
    sweeps = RecordedSweeps(still([0.0, 0.05, 0.1, 0.15], labels=labels), np.zeros(4), slow)
    assert sweeps.sequence.labels is not None
    assert sweeps.sequence.labels.object_id.tolist() == [7]


def test_parked_cars_are_labels_on_the_ground() -> None:
    network = load_map(shipped_map("urban_street_parking"))
    street = furnished_street(network, 0.0, 1, parked_share=1.0)
    sequence = still([0.0, 0.05])
    sweeps = RecordedSweeps(sequence, np.zeros(2), HDL32, street=street, surface=MapSurface(network))
    made = swept(sweeps.sequence, sweeps, sweeps.ego_SE3_lidar, lambda k, cloud: None)
    assert made.labels is not None
    assert made.sweeps is not None
    assert set(made.labels.category.tolist()) == {"car"}
    distance = np.hypot(*(made.labels.center_m - (100.0, -1.75)).T)
    assert distance.max() <= HDL32.range_m
    # every place is taken, 6 m apart, left and right, and the nearest are hit hundreds of times
    assert len(made.labels) > 2 * 40
    assert made.sweeps.point_count[distance < 10.0].min() > 200
    # the same car in both frames
    first, second = (made.labels.object_id[made.labels.frame == k].tolist() for k in (0, 1))
    assert first == second
    seen = with_least_points(made, 1)
    assert seen.labels is not None
    assert seen.sweeps is not None
    assert 0 < len(seen.labels) < len(made.labels)  # those behind other cars are not seen
    assert seen.sweeps.point_count.min() >= 1
    assert len(seen.labels) == (made.sweeps.point_count >= 1).sum()


def test_on_a_hill_all_stand_on_it() -> None:
    """Ego, labels and cloud: the points on the road are as high as the road there."""

    class Slope:
        def elevation_m(self, points_m: np.ndarray, yaw_rad: np.ndarray) -> np.ndarray:
            return 5.0 + 0.04 * np.asarray(points_m)[:, 0]

    labels = Objects.of(np.zeros(1), np.array([[120.0, -1.75]]), size_m=np.array([[0.6, 0.6]]),
                        yaw_rad=np.zeros(1), height_m=np.array([1.8]), category=np.array(["pedestrian"]),
                        velocity_mps=np.zeros((1, 2)))  # fmt: skip
    sequence = still([0.0], labels=labels, yaw_rad=0.3)
    quiet = replace(HDL32, range_sigma_m=0.0)
    sweeps = RecordedSweeps(sequence, np.zeros(1), quiet, surface=Slope())
    assert sweeps.sequence.world_SE3_ego is not None
    assert sweeps.sequence.labels is not None
    assert sweeps.sequence.world_SE3_ego[0, 2, 3] == pytest.approx(9.0)
    assert sweeps.sequence.labels.bottom_m.tolist() == pytest.approx([9.8])
    [cloud] = sweeps
    pose = sweeps.sequence.world_SE3_ego[0] @ sweeps.ego_SE3_lidar
    world = cloud.xyz_m.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
    off = world[:, 2] - (5.0 + 0.04 * world[:, 0])
    assert np.quantile(np.abs(off), 0.99) < 1e-3  # all but the pedestrian's
    assert points_inside(sweeps.sequence.labels, pose, cloud)[0] >= 5


def test_a_pitched_sensor_is_where_its_pose_says() -> None:
    pose = mounted(Mount(1.6, 0.4, 0.1))
    assert pose[:3, 3].tolist() == [0.4, 0.0, 1.6]
    ahead = pose[:3, :3] @ (1.0, 0.0, 0.0)
    assert ahead == pytest.approx([np.cos(0.1), 0.0, -np.sin(0.1)])  # nose down
    level = RecordedSweeps(still([0.0]), np.zeros(1), replace(HDL32, range_sigma_m=0.0))
    tilted = replace(HDL32, range_sigma_m=0.0, mount=Mount(1.6, 0.4, 0.1))
    sweeps = RecordedSweeps(still([0.0]), np.zeros(1), tilted)
    for made, mount_pose in ((level, level.ego_SE3_lidar), (sweeps, pose)):
        [cloud] = made
        ground = cloud.xyz_m.astype(np.float64) @ mount_pose[:3, :3].T + mount_pose[:3, 3]
        assert len(ground) > 1000
        assert np.abs(ground[:, 2]).max() < 1e-4
