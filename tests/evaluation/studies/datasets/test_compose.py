"""The composer of cut-out road users: overlap, shadows, thinning, what varies, what stays apart."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.studies.datasets.compose import FARTHEST_M, Composer
from evaluation.studies.datasets.crops import crops_of, mirrored, scaled, simulated_crops
from evaluation.studies.datasets.frames import LabelledFrame
from scenarios.errors import DatasetError
from scenarios.recorded.layouts.scenes import ScenePlace
from scenarios.sensors.lidar import HDL32
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.pointcloud.boxes import overlaps

TRAIN = ScenePlace(0, 0, "train")


@pytest.fixture(scope="module", name="frames")
def _frames() -> list[LabelledFrame]:
    return list(Composer(HDL32, 3).frames(TRAIN, 4))


def test_road_users_stand_on_the_floor_and_do_not_overlap(frames: list[LabelledFrame]) -> None:
    assert sum(len(frame.boxes) for frame in frames) > 12
    for frame in frames:
        assert frame.boxes.bottom_m == pytest.approx(-HDL32.mount.height_m)
        assert np.hypot(*frame.boxes.center_m[:, :2].T).max() <= FARTHEST_M
        bev = overlaps(frame.boxes, frame.boxes)[0]
        assert bev[~np.eye(len(bev), dtype=np.bool_)].max(initial=0.0) == 0.0
        assert len(frame.category) == len(frame.boxes)


def test_nothing_is_seen_through_a_road_user(frames: list[LabelledFrame]) -> None:
    """No ray to the floor passes through the middle half of a box that has points all over it."""
    behind = 0
    for frame in frames:
        xyz = frame.cloud.xyz_m.astype(np.float64)
        floor = xyz[np.abs(xyz[:, 2] + HDL32.mount.height_m) < 0.06]
        counts = frame.boxes.point_counts(xyz)
        for row in np.flatnonzero(counts > 40).tolist():
            center, size = frame.boxes.center_m[row], frame.boxes.size_m[row]
            distance = math.hypot(*center[:2])
            azimuth = np.arctan2(floor[:, 1], floor[:, 0]) - math.atan2(center[1], center[0])
            offset = np.abs(np.remainder(azimuth + math.pi, 2 * math.pi) - math.pi) * distance
            beyond = np.hypot(floor[:, 0], floor[:, 1]) > distance + 0.5 * size[0]
            # the ray's height over the floor where it passes the middle
            height = HDL32.mount.height_m * (1.0 - distance / np.hypot(floor[:, 0], floor[:, 1]))
            through = beyond & (offset < 0.25 * size[1]) & (height < 0.5 * size[2])
            assert not through.any()
            behind += int((beyond & (offset < 3.0) & (height < 0.5 * size[2])).sum())
    assert behind > 100  # beside the shadows there is floor


def test_points_fall_with_the_square_of_the_distance() -> None:
    library = simulated_crops(HDL32, "train", 5)
    composer = Composer(HDL32, 5, turn_rad=0.0)
    share, expected = 0.0, 0.0
    empty = PointCloud(np.zeros((0, 3), dtype=np.float32))
    ground = LabelledFrame(empty, Boxes3D.empty(), np.zeros(0, dtype=np.str_), (0.0, 0.0, 0.0, 0.0))
    rng = np.random.default_rng(1)
    for crop in library[:40]:
        frame = composer._composed((crop,), ground, rng)
        if len(frame.boxes) == 1:
            distance = math.hypot(*frame.boxes.center_m[0, :2])
            share += len(frame.cloud)
            expected += len(crop.xyz_m) * (crop.distance_m / distance) ** 2
    assert expected > 50.0
    assert share == pytest.approx(expected, abs=5.0 * math.sqrt(expected))


def test_crops_keep_the_side_that_was_seen() -> None:
    """Without a turn the points are on the near side of the box, as when they were recorded."""
    frames = Composer(HDL32, 7, turn_rad=0.0).frames(TRAIN, 4)
    cars = 0
    for frame in frames:
        for row in np.flatnonzero(frame.category == "car").tolist():
            box = frame.boxes[[row]]
            inside = _inside(box, frame.cloud.xyz_m.astype(np.float64))
            if len(inside) < 10:
                continue
            distance = math.hypot(*box.center_m[0, :2])
            assert np.hypot(*inside[:, :2].T).mean() < distance
            cars += 1
    assert cars > 1


def _inside(box: Boxes3D, xyz: np.ndarray) -> np.ndarray:
    c, s = np.cos(box.yaw_rad[0]), np.sin(box.yaw_rad[0])
    rel = np.abs((xyz - box.center_m[0]) @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    return xyz[(rel <= 0.5 * box.size_m[0]).all(axis=1)]


def test_no_split_has_a_crop_of_another() -> None:
    libraries = [simulated_crops(HDL32, split, 1) for split in ("train", "val", "test")]
    crops = [{crop.xyz_m.tobytes() for crop in library} for library in libraries]
    assert [len(each) for each in crops] == [len(library) for library in libraries]
    assert min(map(len, crops)) > 40
    assert len(crops[0] | crops[1] | crops[2]) == sum(map(len, crops))


def test_mirrored_and_scaled() -> None:
    [crop, *_] = simulated_crops(HDL32, "train", 1)
    twice = mirrored(mirrored(crop))
    assert twice.xyz_m.tolist() == crop.xyz_m.tolist()
    assert twice.bearing_rad == crop.bearing_rad
    assert mirrored(crop).bearing_rad == -crop.bearing_rad
    larger = scaled(crop, 1.1)
    assert larger.size_m == pytest.approx(1.1 * crop.size_m)
    assert (np.abs(larger.xyz_m[:, :2]) <= 0.5 * larger.size_m[:2] + 1e-9).all()


def test_what_varies_is_asked_for() -> None:
    plain, same = Composer(HDL32, 2), Composer(HDL32, 2)
    frames = [next(composer.frames(TRAIN, 1)) for composer in (plain, same, replace(plain, noise_m=0.1))]
    assert frames[0].cloud.xyz_m.tobytes() == frames[1].cloud.xyz_m.tobytes()
    assert frames[0].boxes.center_m.tolist() == frames[2].boxes.center_m.tolist()
    assert frames[0].cloud.xyz_m.tobytes() != frames[2].cloud.xyz_m.tobytes()


def test_a_folder_without_crops_is_refused(tmp_path: Path) -> None:
    (tmp_path / "ImageSets").mkdir()
    (tmp_path / "ImageSets/train.txt").write_text("")
    with pytest.raises(DatasetError, match="split train has no pedestrian, cyclist or car with 30 points"):
        crops_of(tmp_path, "train")
