from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.errors import ShapeError
from smartmot.geometry import (
    circles_touch,
    corners,
    from_frame,
    signed_gap,
    signed_gap_scalar,
)
from smartmot.overlap import bev_giou, bev_iou, intersection_area, iou_pairs, iou_scalar
from smartmot.types import Boxes, FloatArray

Rectangles = tuple[FloatArray, FloatArray, FloatArray]

_YAW = st.one_of(
    st.sampled_from([0.0, np.pi / 2, np.pi, -np.pi / 2, np.pi / 4, 1e-9, np.pi / 2 + 1e-13, 1e-7]),
    st.floats(-7, 7),
)

_POSITION = st.one_of(st.sampled_from([0.0, 1.0, 2.0, -3.0, 0.5]), st.floats(-6, 6))

_SIZE = st.one_of(st.sampled_from([0.5, 1.0, 2.0, 4.0, 0.01]), st.floats(0.01, 8))

_RECTANGLE = st.tuples(_POSITION, _POSITION, _SIZE, _SIZE, _YAW)


def _random(rng: np.random.Generator, *shape: int) -> Rectangles:
    return rng.uniform(-4, 4, (*shape, 2)), rng.uniform(0.05, 6, (*shape, 2)), rng.uniform(-7, 7, shape)


def _polygon(center: FloatArray, size: FloatArray, yaw: FloatArray) -> Any:
    return shapely.polygons(corners(center, size, yaw))


def _arrays(rectangle: tuple[float, ...]) -> Rectangles:
    x, y, length, width, yaw = rectangle
    return np.array([x, y]), np.array([length, width]), np.array(yaw)


@settings(max_examples=400, deadline=None)
@given(_RECTANGLE, _RECTANGLE)
def test_area_iou_and_gap_equal_shapely(a: tuple[float, ...], b: tuple[float, ...]) -> None:
    first, second = _arrays(a), _arrays(b)
    polygon_a, polygon_b = _polygon(*first), _polygon(*second)
    common = shapely.intersection(polygon_a, polygon_b).area
    assert intersection_area(*first, *second) == pytest.approx(common, abs=1e-9)
    union = polygon_a.area + polygon_b.area - common
    assert iou_pairs(*first, *second) == pytest.approx(common / union, abs=1e-6)
    assert iou_scalar(a, b) == pytest.approx(common / union, abs=1e-6)  # type: ignore[arg-type]
    gap = signed_gap(*first, *second)
    assert max(float(gap), 0.0) == pytest.approx(shapely.distance(polygon_a, polygon_b), abs=1e-9)
    assert signed_gap_scalar(a, b) == pytest.approx(float(gap), abs=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("a", "b", "area", "gap"),
    [
        ((0, 0, 4, 2, 0.3), (0, 0, 4, 2, 0.3), 8.0, -2.0),
        ((0, 0, 4, 2, 0.0), (0, 0, 2, 4, np.pi / 2), 8.0, -2.0),
        ((0, 0, 4, 2, 0.0), (4, 0, 4, 2, np.pi), 0.0, 0.0),
        ((0, 0, 4, 2, 0.0), (4, 2, 4, 2, 0.0), 0.0, 0.0),
        ((0, 0, 4, 2, 0.0), (0.5, 0, 0.5, 0.5, 1.0), 0.25, None),
        ((0, 0, 4, 2, 0.0), (0, 0, 4, 2, np.pi / 2), 4.0, -3.0),
        ((0, 0, 2, 2, 0.0), (0, 0, 2, 2, np.pi / 4), 8 * (np.sqrt(2) - 1), None),
        ((0, 0, 100, 0.001, 0.0), (0, 0, 100, 0.001, np.pi / 2), 1e-6, None),
        ((0, 0, 2, 2, 0.0), (5, 6, 2, 2, 0.0), 0.0, 5.0),
        ((0, 0, 2, 2, 0.0), (1.5, 0, 2, 2, 0.0), 1.0, -0.5),
    ],
)
def test_known_cases(a: tuple[float, ...], b: tuple[float, ...], area: float, gap: float | None) -> None:
    assert intersection_area(*_arrays(a), *_arrays(b)) == pytest.approx(area, abs=1e-12)
    iou = area / (a[2] * a[3] + b[2] * b[3] - area)
    assert iou_scalar(a, b) == pytest.approx(iou, abs=1e-12)  # type: ignore[arg-type]
    if gap is not None:
        assert signed_gap(*_arrays(a), *_arrays(b)) == pytest.approx(gap, abs=1e-12)
        assert signed_gap_scalar(a, b) == pytest.approx(gap, abs=1e-12)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("left", "right"), [((), ()), ((9,), (9,)), ((4, 1), (1, 6)), ((3, 1, 2), (5, 1)), ((0,), (0,))]
)
def test_broadcasting_equals_the_loop(left: tuple[int, ...], right: tuple[int, ...]) -> None:
    rng = np.random.default_rng(2)
    a, b = _random(rng, *left), _random(rng, *right)
    shape = np.broadcast_shapes(left, right)
    for function in (intersection_area, iou_pairs, signed_gap):
        found = function(*a, *b)
        assert found.shape == shape
        spread_a = [np.broadcast_to(v, (*shape, *v.shape[len(left) :])) for v in a]
        spread_b = [np.broadcast_to(v, (*shape, *v.shape[len(right) :])) for v in b]
        for index in np.ndindex(shape):
            single = function(*(v[index] for v in spread_a), *(v[index] for v in spread_b))
            assert found[index] == pytest.approx(float(single), abs=1e-12)


def test_iou_laws() -> None:
    rng = np.random.default_rng(3)
    a, b = _random(rng, 500), _random(rng, 500)
    iou, gap = iou_pairs(*a, *b), signed_gap(*a, *b)
    assert iou.min() >= 0.0
    assert iou.max() <= 1.0
    assert 0.0 < (iou > 0).mean() < 1.0
    np.testing.assert_allclose(iou, iou_pairs(*b, *a), atol=1e-12)
    np.testing.assert_allclose(gap, signed_gap(*b, *a), atol=1e-12)
    np.testing.assert_allclose(iou_pairs(*a, *a), 1.0)
    # Rounding may leave 1e-17 m2 between rectangles that are apart.
    assert ((gap < 0.0) == (iou > 1e-12)).all()


@settings(max_examples=50, deadline=None)
@given(st.floats(-500, 500), st.floats(-500, 500), st.floats(-4, 4))
def test_iou_and_gap_do_not_depend_on_the_frame(x: float, y: float, yaw: float) -> None:
    rng = np.random.default_rng(4)
    a, b = _random(rng, 40), _random(rng, 40)
    moved_a = (from_frame(a[0], x, y, yaw), a[1], a[2] + yaw)
    moved_b = (from_frame(b[0], x, y, yaw), b[1], b[2] + yaw)
    np.testing.assert_allclose(iou_pairs(*moved_a, *moved_b), iou_pairs(*a, *b), atol=1e-10)
    np.testing.assert_allclose(signed_gap(*moved_a, *moved_b), signed_gap(*a, *b), atol=1e-10)


def test_the_circle_test_never_rejects_an_overlap() -> None:
    rng = np.random.default_rng(6)
    a, b = _random(rng, 2000), _random(rng, 2000)
    touch = circles_touch(a[0], a[1], b[0], b[1])
    assert touch[signed_gap(*a, *b) <= 0.0].all()
    assert not touch.all()


def test_bev_iou_equals_pairs_and_takes_empty_sets() -> None:
    rng = np.random.default_rng(7)
    a, b = Boxes(*_random(rng, 6)), Boxes(*_random(rng, 4))
    matrix = bev_iou(a, b)
    assert matrix.shape == (6, 4)
    for i, j in np.ndindex(6, 4):
        pair = iou_pairs(a.center_m[i], a.size_m[i], a.yaw_rad[i], b.center_m[j], b.size_m[j], b.yaw_rad[j])
        assert matrix[i, j] == pytest.approx(float(pair), abs=1e-12)
    assert bev_iou(a, Boxes.empty()).shape == (6, 0)
    assert bev_iou(Boxes.empty(), b).shape == (0, 4)


def test_exact_far_from_the_origin() -> None:
    a = (np.array([500_000.0, 5_400_000.0]), np.array([4.4, 1.8]), np.array(0.7))
    b = (a[0] + np.array([1.0, 0.5]), np.array([0.5, 0.5]), np.array(1.9))
    near_a, near_b = (np.zeros(2), *a[1:]), (np.array([1.0, 0.5]), *b[1:])
    assert intersection_area(*a, *b) == pytest.approx(float(intersection_area(*near_a, *near_b)), abs=1e-9)


@pytest.mark.parametrize("spacing_m", [0.5, 8.0])
@pytest.mark.parametrize("counts", [(60, 50), (1, 7), (200, 150)])
def test_bev_iou_equals_shapely(spacing_m: float, counts: tuple[int, int]) -> None:
    rng, n = np.random.default_rng(8), counts[0]
    extent = spacing_m * np.sqrt(n)
    a, b = (
        Boxes(rng.uniform(0, extent, (k, 2)), rng.uniform(0.1, 6, (k, 2)), rng.uniform(-7, 7, k))
        for k in counts
    )
    first, second = (_polygon(x.center_m, x.size_m, x.yaw_rad) for x in (a, b))
    common = shapely.area(shapely.intersection(first[:, None], second))
    union = a.size_m.prod(axis=1)[:, None] + b.size_m.prod(axis=1) - common
    np.testing.assert_allclose(bev_iou(a, b), common / union, atol=1e-9)


def test_bev_iou_takes_rows_and_degenerate_boxes() -> None:
    rows = np.array([[0, 0, 4, 2, 0.3], [0, 0, 0, 2, 0.0], [0, 0, 0, 0, 1.0], [0, 0, 1e-9, 1e-9, 0.0]])
    iou = bev_iou(rows, rows)
    one_by_one = [[iou_scalar(tuple(a), tuple(b)) for b in rows.tolist()] for a in rows.tolist()]
    np.testing.assert_allclose(one_by_one, iou, atol=1e-12)
    assert np.isfinite(iou).all()
    np.testing.assert_allclose(np.diag(iou), [1, 0, 0, 1], atol=1e-9)
    assert not iou[1:3].any()
    assert bev_iou(rows, []).shape == (4, 0)


@pytest.mark.parametrize(
    "rows", [[[0, 0, 1, 1]], [[0, 0, np.nan, 1, 0]], [[0, 0, -1, 1, 0]], [0, 0, 1, 1, 0]]
)
def test_bev_iou_refuses_what_is_no_box(rows: list[Any]) -> None:
    with pytest.raises(ShapeError, match="boxes:"):
        bev_iou(rows, rows)


@pytest.mark.parametrize("turn_rad", [0.0, 1e-30, 1e-17, 1e-13, 1e-12, 1e-9, np.pi / 2, np.pi])
@pytest.mark.parametrize("shift_m", [(0.0, 0.0), (1.0, 0.0), (0.0, 2.0), (3.999999, 0.5)])
def test_almost_parallel_rectangles_have_the_area_of_parallel_ones(
    turn_rad: float, shift_m: tuple[float, float]
) -> None:
    size, b_size = np.array([4.0, 2.0]), np.array([4.0, 4.0])
    for offset in (0.0, 1e5):
        area = intersection_area(
            np.array(shift_m) + offset, size, np.array(0.3 + turn_rad),
            np.array([offset, offset]), b_size, np.array(0.3),
        )  # fmt: skip
        x, y = (np.array([[np.cos(0.3), np.sin(0.3)], [-np.sin(0.3), np.cos(0.3)]]) @ shift_m).tolist()
        length, width = (2.0, 4.0) if turn_rad == np.pi / 2 else (4.0, 2.0)
        common_x = max(0.0, min(x + length / 2, 2.0) - max(x - length / 2, -2.0))
        common_y = max(0.0, min(y + width / 2, 2.0) - max(y - width / 2, -2.0))
        assert area == pytest.approx(common_x * common_y, abs=1e-8 if turn_rad == 1e-9 or offset else 1e-11)


def test_generalised_iou_laws() -> None:
    rng = np.random.default_rng(10)
    a, b = Boxes(*_random(rng, 200)), Boxes(*_random(rng, 200))
    giou, iou = bev_giou(a, b), iou_pairs(a.center_m, a.size_m, a.yaw_rad, b.center_m, b.size_m, b.yaw_rad)
    assert (giou <= iou + 1e-12).all()
    assert giou.min() > -1.0
    np.testing.assert_allclose(giou, bev_giou(b, a), atol=1e-12)
    np.testing.assert_allclose(bev_giou(a, a), 1.0)
    far = Boxes(a.center_m + np.array([5e5, 5e6]), a.size_m, a.yaw_rad)
    moved = Boxes(b.center_m + np.array([5e5, 5e6]), b.size_m, b.yaw_rad)
    np.testing.assert_allclose(bev_giou(far, moved), giou, atol=1e-7)
