import copy
import pickle

import numpy as np
import pytest

from smartmot.errors import ShapeError, StampError
from smartmot.pointcloud import PointCloud


def cloud(dtype: type = np.float32) -> PointCloud:
    xyz = np.arange(12, dtype=dtype).reshape(4, 3)
    return PointCloud(xyz, xyz[:, 0].copy(), np.arange(4), frame="velodyne", stamp_s=1.5)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_kind_of_numbers_is_kept(dtype: type) -> None:
    assert cloud(dtype).xyz_m.dtype == dtype
    assert PointCloud(np.zeros((2, 3), dtype=np.float16)).xyz_m.dtype == np.float64


def test_points_cannot_be_changed_from_outside() -> None:
    xyz = np.zeros((2, 3), dtype=np.float32)
    points = PointCloud(xyz)
    xyz[0, 0] = 7.0
    assert points.xyz_m[0, 0] == 0.0
    for same in (points, copy.deepcopy(points), pickle.loads(pickle.dumps(points))):
        with pytest.raises(ValueError, match="read-only"):
            same.xyz_m[0, 0] = 1.0


def test_a_subset_takes_every_column_along() -> None:
    subset = cloud()[np.array([False, True, False, True])]
    assert subset.xyz_m[:, 0].tolist() == [3.0, 9.0]
    assert subset.intensity is not None
    assert subset.intensity.tolist() == [3.0, 9.0]
    assert subset.ring is not None
    assert subset.ring.tolist() == [1, 3]
    assert (subset.time_offset_s, subset.frame, subset.stamp_s) == (None, "velodyne", 1.5)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_points_that_are_nowhere_are_refused(bad: float, dtype: type) -> None:
    with pytest.raises(ShapeError, match="xyz_m: a value is not finite"):
        PointCloud(np.array([[0, bad, 0]], dtype=dtype))


def test_shapes_and_stamps_are_checked() -> None:
    with pytest.raises(ShapeError, match="xyz_m"):
        PointCloud(np.zeros((2, 4), dtype=np.float32))
    with pytest.raises(ShapeError, match="intensity"):
        PointCloud(np.zeros((2, 3)), np.zeros(3, dtype=np.float32))
    with pytest.raises(ShapeError, match="ring"):
        PointCloud(np.zeros((2, 3)), None, np.array([0.5, 1]))
    with pytest.raises(StampError, match="nanoseconds"):
        PointCloud(np.zeros((0, 3)), stamp_s=1.6e18)
