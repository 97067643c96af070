import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.errors import ShapeError
from smartmot.geometry import corners
from smartmot.pointcloud import Boxes3D
from smartmot.pointcloud.boxes import iou_3d, overlaps


def box(x: float = 0, y: float = 0, z: float = 0, length: float = 4, yaw: float = 0) -> Boxes3D:
    return Boxes3D(np.array([[x, y, z]]), np.array([[length, 2.0, 1.5]]), np.array([yaw]))


def random_boxes(seed: int, count: int) -> Boxes3D:
    rng = np.random.default_rng(seed)
    return Boxes3D(rng.uniform(-3, 3, (count, 3)), rng.uniform(0.3, 5, (count, 3)), rng.uniform(-7, 7, count))


def test_a_box_overlaps_itself_wholly_and_half_of_a_shifted_one() -> None:
    # half of the volume is common: 1/2 over 3/2
    assert iou_3d(box(), box())[0, 0] == pytest.approx(1.0, abs=1e-12)
    for shifted in (box(x=2.0), box(y=1.0), box(z=0.75)):
        assert iou_3d(box(), shifted)[0, 0] == pytest.approx(1 / 3, abs=1e-12)
    assert overlaps(box(), box(z=0.75))[0][0, 0] == pytest.approx(1.0, abs=1e-12)


def test_boxes_above_each_other_have_no_common_volume() -> None:
    bev, space = overlaps(box(), box(z=1.6))
    assert bev[0, 0] == pytest.approx(1.0)
    assert space[0, 0] == 0.0


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_overlap_is_that_of_shapely_times_the_common_height(seed: int) -> None:
    a, b = random_boxes(seed, 5), random_boxes(seed + 1, 4)
    bev, space = overlaps(a, b)
    outlines = [shapely.polygons(corners(c.center_m[:, :2], c.size_m[:, :2], c.yaw_rad)) for c in (a, b)]
    area = shapely.area(shapely.intersection(outlines[0][:, None], outlines[1]))
    area_a, area_b = (shapely.area(outline) for outline in outlines)
    low = np.maximum(a.bottom_m[:, None], b.bottom_m)
    high = np.minimum((a.center_m + 0.5 * a.size_m)[:, 2, None], (b.center_m + 0.5 * b.size_m)[:, 2])
    common = area * np.maximum(high - low, 0.0)
    np.testing.assert_allclose(bev, area / (area_a[:, None] + area_b - area), atol=1e-9)
    volume = (area_a * a.size_m[:, 2])[:, None] + area_b * b.size_m[:, 2]
    np.testing.assert_allclose(space, common / (volume - common), atol=1e-9)


def test_corners_are_where_the_definition_puts_them() -> None:
    points = box(x=10.0, yaw=np.pi / 2).corners()[0]
    np.testing.assert_allclose(points[0], [9.0, 2.0, -0.75], atol=1e-12)  # front left, below
    np.testing.assert_allclose(points[6], [11.0, -2.0, 0.75], atol=1e-12)  # rear right, above


def test_points_are_counted_with_those_on_the_faces() -> None:
    turned = box(x=5.0, z=1.0, yaw=np.pi / 2)
    points = np.array([[5.0, 1.9, 1.0], [6.5, 0.0, 1.0], [6.0, 0.0, 1.0], [5.0, 0.0, 1.75], [5.0, 0.0, 1.8]])
    assert turned.point_counts(points).tolist() == [3]
    assert turned.point_counts(points, margin_m=0.1).tolist() == [4]


def test_corners_hold_no_point_that_the_box_does_not() -> None:
    boxes = random_boxes(3, 20)
    assert [int(boxes[n : n + 1].point_counts(c, 1e-9)[0]) for n, c in enumerate(boxes.corners())] == [8] * 20


@pytest.mark.parametrize(
    ("center", "size", "yaw", "message"),
    [
        ([[0, 0]], [[1, 1, 1]], [0], "center_m"),
        ([[0, 0, 0]], [[1, 1]], [0], "size_m"),
        ([[0, 0, 0]], [[1, 1, 0]], [0], "positive"),
        ([[0, 0, np.nan]], [[1, 1, 1]], [0], "finite"),
    ],
)
def test_wrong_boxes_are_refused(center: object, size: object, yaw: object, message: str) -> None:
    with pytest.raises(ShapeError, match=message):
        Boxes3D(center, size, yaw)  # type: ignore[arg-type]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_many_boxes_hold_what_each_holds_alone(dtype: type) -> None:
    """Points are sorted for many boxes and not for one; points on faces and equal ones among them."""
    rng = np.random.default_rng(11)
    boxes = Boxes3D(rng.normal(0, 4, (40, 3)), rng.uniform(0.1, 6, (40, 3)), rng.uniform(-4, 4, 40))
    points = np.concatenate((rng.normal(0, 5, (3000, 3)), boxes.corners().reshape(-1, 3), np.zeros((5, 3))))
    cloud = points.astype(dtype)
    for margin_m in (0.0, 0.3, 1e-9):
        alone = [int(boxes[[row]].point_counts(cloud, margin_m)[0]) for row in range(40)]
        assert boxes.point_counts(cloud, margin_m).tolist() == alone
        assert sum(alone) > 500
    assert boxes.point_counts(np.zeros((0, 3))).tolist() == 40 * [0]
