"""Samples that a network learns from: changes keep points and boxes together, targets are boxes again."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evaluation.studies.lidar.drawn import drawn_frames
from evaluation.studies.training.samples import (
    NO_CHANGES,
    Changes,
    LabelledFrame,
    batch,
    changed,
    changed_window,
    labelled_frame,
    lines_of,
    targets,
)
from scenarios.catalogue.maps import shipped_map
from scenarios.recorded.clouds.files import read_cloud
from scenarios.sensors.lidar import HDL32, HDL64, MID70, LidarConfig
from smartmot.geometry import wrap_angle
from smartmot.lidar.learned import Decoder, PillarGrid, pillars_of
from smartmot.pointcloud import Boxes3D, PointCloud

DECODER = Decoder(PillarGrid(), ("car", "pedestrian", "cyclist"))
CAR, PERSON = (4.2, 1.8, 1.5), (0.6, 0.6, 1.8)


def filled(box: Boxes3D, count: int, rng: np.random.Generator) -> np.ndarray:
    """Points inside each box."""
    points = []
    for center, size, yaw in zip(box.center_m, box.size_m, box.yaw_rad, strict=True):
        local = rng.uniform(-0.45, 0.45, (count, 3)) * size
        c, s = math.cos(yaw), math.sin(yaw)
        points.append(center + local @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]))
    return np.concatenate(points)


def frame(seed: int = 0) -> LabelledFrame:
    """Three bodies, heights over the ground."""
    rng = np.random.default_rng(seed)
    boxes = Boxes3D(
        np.array([[12.0, 3.0, 0.75], [8.0, -4.0, 0.9], [25.0, 10.0, 0.75]]),
        np.array([CAR, PERSON, CAR]),
        np.array([0.3, -2.0, 3.0]),
    )
    points = filled(boxes, 60, rng).astype(np.float32)
    return LabelledFrame(
        "made", points, np.arange(180) % 16, boxes, np.array(["car", "pedestrian", "car"]), np.full(3, 60)
    )


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000), at=st.integers(0, 2))
def test_targets_are_boxes_again(seed: int, at: int) -> None:
    """What a perfect network says is decoded to the labels."""
    made = changed(frame(), Changes(dropped=0.0, lines_dropped=0.0), np.random.default_rng(seed))
    wanted = targets(made, DECODER, 5)
    classes, rows, columns = DECODER.shape
    output = np.zeros((classes, rows * columns), dtype=np.float32)
    output[:3] = np.where(wanted.heat == 1.0, 8.0, -8.0).reshape(3, -1)
    output[3:, wanted.cell] = wanted.values.T
    boxes, _, category = DECODER.decode(output.reshape(DECODER.shape), 0.5)
    assert sorted(category.tolist()) == sorted(made.category.tolist())
    nearest = int(np.hypot(*(boxes.center_m[:, :2] - made.boxes.center_m[at, :2]).T).argmin())
    np.testing.assert_allclose(boxes.center_m[nearest], made.boxes.center_m[at], atol=1e-4)
    np.testing.assert_allclose(boxes.size_m[nearest], made.boxes.size_m[at], rtol=1e-5)
    assert wrap_angle(boxes.yaw_rad[nearest : nearest + 1] - made.boxes.yaw_rad[at]) == pytest.approx(
        [0], abs=1e-5
    )


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000))
def test_changes_move_points_with_their_boxes(seed: int) -> None:
    made = changed(
        frame(),
        Changes(jitter_m=0.0, height_m=0.0, dropped=0.0, lines_dropped=0.0),
        np.random.default_rng(seed),
    )
    assert made.counts.tolist() == [60, 60, 60]
    assert len(made.points) == 180
    ratio = made.boxes.size_m / frame().boxes.size_m
    np.testing.assert_allclose(ratio, ratio[0, 0], rtol=1e-9)
    assert abs(ratio[0, 0] - 1.0) <= 0.05 + 1e-9


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 1000))
def test_a_window_is_the_same_cells_of_the_frame(seed: int) -> None:
    """Pillars of a window are those of the whole grid in its cells, and its labels are the frame's there."""
    given_frame, rng = frame(), np.random.default_rng(seed)
    # off the edges of cells, where rounding decides
    given_frame.points[:, :2] = (np.floor(given_frame.points[:, :2] * 5.0) + 0.3) / 5.0
    window, decoder = changed_window(given_frame, NO_CHANGES, rng, DECODER, 5)
    assert decoder.grid.shape == (96, 96)
    grid = decoder.grid
    made = pillars_of(window.points[:, :2], window.points[:, 2], grid)
    full = pillars_of(given_frame.points[:, :2], given_frame.points[:, 2], DECODER.grid)
    rows, columns = DECODER.grid.shape
    ahead = round((grid.ahead_m[0] - DECODER.grid.ahead_m[0]) / grid.cell_m)
    left = round((grid.left_m[0] - DECODER.grid.left_m[0]) / grid.cell_m)
    assert ahead % 8 == left % 8 == 0
    assert 0 <= ahead <= rows - 96
    assert 0 <= left <= columns - 96
    row, column = full.cell // columns - ahead, full.cell % columns - left
    inside = (row >= 0) & (row < 96) & (column >= 0) & (column < 96)
    np.testing.assert_array_equal(made.cell, (row * 96 + column)[inside])
    np.testing.assert_allclose(made.features, full.features[inside], atol=2e-4)
    x, y = window.boxes.center_m[:, :2].T
    within = (x >= grid.ahead_m[0]) & (x < grid.ahead_m[1]) & (y >= grid.left_m[0]) & (y < grid.left_m[1])
    assert len(targets(window, decoder, 5).cell) == np.count_nonzero(within & (window.counts >= 5))


def test_without_changes_a_frame_stays() -> None:
    made = changed(frame(), NO_CHANGES, np.random.default_rng(3))
    np.testing.assert_allclose(made.points, frame().points, atol=1e-6)
    np.testing.assert_allclose(made.boxes.center_m, frame().boxes.center_m, atol=1e-12)


def test_points_and_lines_are_left_out_as_often_as_asked_for() -> None:
    rng = np.random.default_rng(1)
    shares = [len(changed(frame(), Changes(lines_dropped=0.0), rng).points) / 180 for _ in range(300)]
    assert np.mean(shares) == pytest.approx(0.85, abs=0.02)
    assert min(shares) > 0.55
    lines = [len(np.unique(changed(frame(), Changes(dropped=0.0), rng).line)) for _ in range(300)]
    assert max(lines) == 16
    assert 11.0 < np.mean(lines) < 15.0


def test_bodies_with_few_points_are_neither_wanted_nor_background() -> None:
    few = frame()
    wanted = targets(
        LabelledFrame("few", few.points, few.line, few.boxes, few.category, np.array([4, 60, 60])), DECODER, 5
    )
    assert len(wanted.cell) == 2
    edge = 0.4
    row, column = int(12.0 / edge), int((3.0 + 28.8) / edge)
    assert wanted.ignored[:, row, column].all()
    assert wanted.heat[0].max() == 1.0
    assert wanted.heat[0, row, column] < 1.0
    person = int(8.0 / edge), int((-4.0 + 28.8) / edge)
    assert wanted.heat[1][person] == 1.0
    assert not wanted.ignored[1][person]


def test_bodies_outside_the_grid_or_of_other_classes_are_left_out() -> None:
    boxes = Boxes3D(np.array([[60.0, 0.0, 0.7], [10.0, 0.0, 0.7]]), np.array([CAR, CAR]), np.zeros(2))
    made = LabelledFrame(
        "far",
        np.zeros((0, 3), dtype=np.float32),
        np.zeros(0, dtype=np.int64),
        boxes,
        np.array(["car", "unknown"]),
        np.full(2, 9),
    )
    assert len(targets(made, DECODER, 5).cell) == 0


def test_batches_put_frames_one_after_another() -> None:
    one, two = frame(), changed(frame(), Changes(), np.random.default_rng(5))
    both = batch([one, two], [DECODER, DECODER], 5)
    cells = int(np.prod(DECODER.grid.shape))
    first, second = batch([one], [DECODER], 5), batch([two], [DECODER], 5)
    np.testing.assert_array_equal(both.seen.cell, np.concatenate((first.seen.cell, second.seen.cell + cells)))
    np.testing.assert_array_equal(both.targets.heat[1], second.targets.heat[0])
    assert (
        both.targets.cell[len(first.targets.cell) :] - second.targets.cell == np.prod(DECODER.shape[1:])
    ).all()


def test_heights_of_a_frame_are_over_the_ground_of_its_cloud() -> None:
    """Whatever the height of the mount."""
    x, y = (column.ravel() for column in np.meshgrid(np.arange(2.0, 40.0, 0.5), np.arange(-15.0, 15.0, 0.5)))
    for height in (1.2, 2.4):
        boxes = Boxes3D(np.array([[10.0, 2.0, 0.97 - height]]), np.array([PERSON]), np.zeros(1))
        body = filled(boxes, 40, np.random.default_rng(0))
        cloud = PointCloud(np.concatenate((np.column_stack((x, y, np.full(len(x), -height))), body)))
        made = labelled_frame("one", cloud, boxes, np.array(["pedestrian"]), 50.0)
        assert made.boxes.center_m[0, 2] == pytest.approx(0.97, abs=0.01)
        assert made.points[: len(x), 2] == pytest.approx(np.zeros(len(x)), abs=0.01)
        assert made.counts.tolist() == [40]


# ---- lines of the sensor -----------------------------------------------------------------------------------


@functools.cache
def simulated(config: LidarConfig) -> PointCloud:
    """A cloud of a street, column after column, with the true lines."""
    (frame,) = drawn_frames([shipped_map("urban_street")], config, 1, 5)
    return frame.cloud


def agreement(line: np.ndarray, true: np.ndarray) -> float:
    """Share of points that are in the line in which most points of their true line are, and the reverse."""
    pairs, count = np.unique(np.stack((line, true)), axis=1, return_counts=True)
    shares = []
    for side in pairs:
        most = [count[side == value].max() for value in np.unique(side)]
        shares.append(sum(most) / len(line))
    return min(shares)


@pytest.mark.parametrize(("config", "lines"), [(HDL32, 32), (HDL64, 64)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_lines_are_told_by_the_order_of_the_points(config: LidarConfig, lines: int, sign: float) -> None:
    """As KITTI has them: the highest line first, each from straight ahead all round; and cut to a camera."""
    cloud = simulated(config)
    assert cloud.ring is not None
    azimuth = np.arctan2(cloud.xyz_m[:, 1], cloud.xyz_m[:, 0]).astype(np.float64)
    order = np.lexsort((np.mod(sign * azimuth, 2.0 * np.pi), -cloud.ring))
    for chosen in (order, order[np.abs(azimuth[order]) < math.radians(41.0)]):
        true = cloud.ring[chosen]
        line = lines_of(cloud.xyz_m[chosen])
        assert agreement(line, true) > 0.99
        assert abs(len(np.unique(line)) - len(np.unique(true))) <= 1


@pytest.mark.parametrize("config", [HDL32, HDL64])
def test_lines_are_told_by_gaps_of_elevation(config: LidarConfig) -> None:
    cloud = simulated(config)
    assert cloud.ring is not None
    assert agreement(lines_of(cloud.xyz_m.astype(np.float32)), cloud.ring) == 1.0


def test_where_no_lines_can_be_told_there_is_one() -> None:
    rng = np.random.default_rng(1)
    cloud = simulated(HDL64).xyz_m
    nothing = np.zeros((0, 3))
    for xyz in (simulated(MID70).xyz_m, cloud[rng.permutation(len(cloud))] @ tilt(0.1), nothing):
        assert not lines_of(xyz).any()


def tilt(angle_rad: float) -> np.ndarray:
    c, s = math.cos(angle_rad), math.sin(angle_rad)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def test_a_frame_without_lines_has_those_that_are_told() -> None:
    cloud = simulated(HDL32)
    assert cloud.ring is not None
    none = Boxes3D.empty()
    category = np.zeros(0, dtype=np.str_)
    known, told = (
        labelled_frame("f", given, none, category, 60.0).line
        for given in (cloud, PointCloud(cloud.xyz_m, cloud.intensity))
    )
    assert agreement(told, known) == 1.0
    dropped = Changes(0.0, 0.0, 0.0, 0.0, 0.0, 0.9, mirrored=False)
    frame = labelled_frame("f", PointCloud(cloud.xyz_m), none, category, 60.0)
    left = {len(np.unique(changed(frame, dropped, np.random.default_rng(k)).line)) for k in range(8)}
    assert min(left) < len(np.unique(frame.line))


REAL = next(
    (folder for above in Path(__file__).parents if (folder := above / "shared" / "lidar").is_dir()), None
)


@pytest.mark.skipif(REAL is None, reason="real clouds are not in ../shared/lidar")
@pytest.mark.parametrize(
    ("name", "lines"),
    [
        ("kitti_object/full_sweep/000001.bin", (64, 64)),
        # the camera sees the upper lines only
        ("kitti_object/training/velodyne/000134.bin", (44, 48)),
        # cut at both sides, so that the first line or the last may be seen in part
        ("kitti_sequence_0000/velodyne/*110.bin", (63, 65)),
    ],
)
def test_lines_of_a_real_sensor(name: str, lines: tuple[int, int]) -> None:
    assert REAL is not None
    (path,) = REAL.glob(name)
    xyz = read_cloud(path).cloud.xyz_m.astype(np.float64)
    line = lines_of(xyz)
    assert lines[0] <= len(np.unique(line)) <= lines[1]
    elevation = np.degrees(np.arctan2(xyz[:, 2], np.hypot(xyz[:, 0], xyz[:, 1])))
    middle = [np.median(elevation[line == number]) for number in np.unique(line)]
    # from the highest down, about as far apart as the sensor's are: 1/3 to 1/2 of a degree
    assert np.mean(np.diff(middle) < 0.0) > 0.9
    assert 0.25 < -np.median(np.diff(middle)) < 0.6
