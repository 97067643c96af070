import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import fresnel

from opendrive.geometry.curves import CurveTable
from opendrive.model import Arc, Geometry, Line, ParamPoly3, Poly3, Shape, Spiral


def evaluate(shape: Shape, s_m, length_m=100.0, heading_rad=0.0, x_m=0.0, y_m=0.0):
    table = CurveTable.stack([[Geometry(0.0, x_m, y_m, heading_rad, length_m, shape)]])
    s_m = np.atleast_1d(np.asarray(s_m, dtype=float))
    return table.evaluate(np.zeros(len(s_m), dtype=np.int64), s_m)


S = np.linspace(0.0, 100.0, 41)


def test_line_runs_straight_from_its_start_pose():
    poses = evaluate(Line(), S, heading_rad=0.3, x_m=10.0, y_m=5.0)
    np.testing.assert_allclose(poses.x_m, 10.0 + S * np.cos(0.3), atol=1e-12)
    np.testing.assert_allclose(poses.y_m, 5.0 + S * np.sin(0.3), atol=1e-12)
    np.testing.assert_array_equal(poses.heading_rad, 0.3)
    np.testing.assert_array_equal(poses.curvature_per_m, 0.0)


@pytest.mark.parametrize("curvature", [0.02, -0.02, 1e-3, -0.5])
def test_arc_stays_on_its_circle(curvature):
    poses = evaluate(Arc(curvature), S)
    np.testing.assert_allclose(poses.x_m, np.sin(curvature * S) / curvature, atol=1e-10)
    np.testing.assert_allclose(poses.y_m, (1.0 - np.cos(curvature * S)) / curvature, atol=1e-10)
    np.testing.assert_allclose(poses.heading_rad, curvature * S)
    np.testing.assert_array_equal(poses.curvature_per_m, curvature)


@pytest.mark.parametrize("shape", [Arc(0.0), Spiral(0.0, 0.0), Poly3((0.0, 0.0, 0.0, 0.0))])
def test_shapes_without_curvature_are_lines(shape):
    poses, line = evaluate(shape, S, heading_rad=1.0), evaluate(Line(), S, heading_rad=1.0)
    for got, expected in zip(poses, line, strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12)


@pytest.mark.parametrize("curvature", [1e-12, 1e-9, 1e-6])
def test_nearly_straight_arc_keeps_its_sagitta(curvature):
    poses = evaluate(Arc(curvature), [100.0])
    assert poses.y_m[0] == pytest.approx(0.5 * curvature * 100.0**2, rel=1e-6)


def test_spiral_of_constant_curvature_is_an_arc():
    for got, expected in zip(evaluate(Spiral(-0.01, -0.01), S), evaluate(Arc(-0.01), S), strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-12)


@pytest.mark.parametrize("end", [0.02, -0.02, 0.3, 1.0])
def test_spiral_from_a_line_has_fresnel_coordinates(end):
    rate = end / 100.0
    poses = evaluate(Spiral(0.0, end), S)
    scale = np.sqrt(np.pi / abs(rate))
    sine, cosine = fresnel(S / scale)
    np.testing.assert_allclose(poses.x_m, scale * cosine, atol=1e-10)
    np.testing.assert_allclose(poses.y_m, np.sign(rate) * scale * sine, atol=1e-10)
    np.testing.assert_allclose(poses.heading_rad, 0.5 * rate * S**2)
    np.testing.assert_allclose(poses.curvature_per_m, rate * S)


def test_spiral_between_two_curvatures_matches_quadrature():
    start, end = -0.05, 0.08
    poses = evaluate(Spiral(start, end), [70.0])
    rate = (end - start) / 100.0
    x = quad(lambda s: np.cos(start * s + 0.5 * rate * s * s), 0.0, 70.0, epsabs=1e-12)[0]
    y = quad(lambda s: np.sin(start * s + 0.5 * rate * s * s), 0.0, 70.0, epsabs=1e-12)[0]
    assert (poses.x_m[0], poses.y_m[0]) == pytest.approx((x, y), abs=1e-10)


U, V = (0.0, 103.25951, 0.0, -5.268342), (0.0, 0.0, 26.341712, -8.429348)


def arc_length(q, u=U, v=V):
    def speed(p):
        return np.hypot(u[1] + 2 * u[2] * p + 3 * u[3] * p * p, v[1] + 2 * v[2] * p + 3 * v[3] * p * p)

    return quad(speed, 0.0, q, epsabs=1e-12)[0]


@pytest.mark.parametrize("q", [0.0, 0.1, 0.5, 0.77, 1.0])
def test_param_poly3_is_run_through_by_arc_length(q):
    s = arc_length(q)
    poses = evaluate(ParamPoly3(U, V, True), [s], length_m=arc_length(1.0))
    u = U[1] * q + U[3] * q**3
    v = V[2] * q**2 + V[3] * q**3
    assert (poses.x_m[0], poses.y_m[0]) == pytest.approx((u, v), abs=1e-8)
    assert poses.heading_rad[0] == pytest.approx(
        np.arctan2(2 * V[2] * q + 3 * V[3] * q * q, U[1] + 3 * U[3] * q * q), abs=1e-9
    )


def test_param_poly3_over_arc_length_equals_the_normalized_form():
    length = arc_length(1.0)
    scaled = [tuple(k / length**i for i, k in enumerate(c)) for c in (U, V)]
    normalized = evaluate(ParamPoly3(U, V, True), S, length_m=length)
    over_length = evaluate(ParamPoly3(scaled[0], scaled[1], False), S, length_m=length)
    for got, expected in zip(over_length, normalized, strict=True):
        np.testing.assert_allclose(got, expected, atol=1e-9)


def test_param_poly3_is_held_at_its_end_when_the_length_is_overstated():
    poses = evaluate(ParamPoly3((0.0, 98.0, 0.0, -5.0), (0.0, 0.0, 25.0, -8.0), True), [99.9, 100.0])
    np.testing.assert_allclose(poses.x_m, 93.0)
    np.testing.assert_allclose(poses.y_m, 17.0)


def test_poly3_is_run_through_by_arc_length():
    c, d = 0.002, 1e-5
    u = 60.0
    s = quad(lambda p: np.hypot(1.0, 2 * c * p + 3 * d * p * p), 0.0, u, epsabs=1e-12)[0]
    poses = evaluate(Poly3((0.0, 0.0, c, d)), [s])
    assert (poses.x_m[0], poses.y_m[0]) == pytest.approx((u, c * u**2 + d * u**3), abs=1e-8)


@settings(deadline=None)
@given(
    shape=st.one_of(
        st.builds(Arc, st.floats(-0.3, 0.3)),
        st.builds(Spiral, st.floats(-0.3, 0.3), st.floats(-0.3, 0.3)),
        st.builds(lambda c, d: Poly3((0.0, 0.0, c, d)), st.floats(-0.01, 0.01), st.floats(-1e-4, 1e-4)),
    ),
    s=st.floats(1.0, 99.0),
)
def test_heading_and_curvature_are_the_derivatives_of_the_position(shape, s):
    h = 1e-4
    poses = evaluate(shape, [s - h, s, s + h])
    step = np.array([poses.x_m[2] - poses.x_m[0], poses.y_m[2] - poses.y_m[0]])
    assert np.hypot(*step) == pytest.approx(2 * h, rel=1e-5)
    turned = np.arctan2(step[1], step[0]) - poses.heading_rad[1]
    assert np.sin(turned) == pytest.approx(0.0, abs=1e-6)
    assert (poses.heading_rad[2] - poses.heading_rad[0]) / (2 * h) == pytest.approx(
        poses.curvature_per_m[1], abs=1e-6
    )


def test_many_roads_are_evaluated_in_one_call():
    pieces = [
        [Geometry(0.0, 0.0, 0.0, 0.0, 10.0, Line()), Geometry(10.0, 10.0, 0.0, 0.0, 10.0, Arc(0.1))],
        [Geometry(0.0, 5.0, 5.0, np.pi / 2, 20.0, Line())],
    ]
    table = CurveTable.stack(pieces)
    poses = table.evaluate(np.array([1, 0, 0, 1]), np.array([2.0, 4.0, 20.0, 20.0]))
    np.testing.assert_allclose(poses.x_m, [5.0, 4.0, 10.0 + np.sin(1.0) / 0.1, 5.0])
    np.testing.assert_allclose(poses.y_m, [7.0, 0.0, (1.0 - np.cos(1.0)) / 0.1, 25.0])


SHAPES = st.one_of(
    st.just(Line()),
    st.builds(Arc, st.floats(-0.2, 0.2)),
    st.builds(Spiral, st.floats(-0.2, 0.2), st.floats(-0.2, 0.2)),
    st.builds(lambda c, d: Poly3((0.0, 0.0, c, d)), st.floats(-0.01, 0.01), st.floats(-1e-4, 1e-4)),
)


@settings(deadline=None)
@given(
    shapes=st.lists(st.tuples(SHAPES, st.floats(0.5, 40.0)), min_size=2, max_size=6),
    heading=st.floats(-np.pi, np.pi),
)
def test_chained_pieces_join_without_gap_or_kink(shapes, heading):
    pieces, s, x, y = [], 0.0, 3.0, -7.0
    for shape, length in shapes:
        pieces.append(Geometry(s, x, y, heading, length, shape))
        end = evaluate(shape, [length], length, heading, x, y)
        s, x, y, heading = s + length, end.x_m[0], end.y_m[0], end.heading_rad[0]
    table = CurveTable.stack([pieces])
    joints = np.array([piece.s_m for piece in pieces[1:]])
    road = np.zeros(len(joints), dtype=np.int64)
    step = 1e-6
    before, after = table.evaluate(road, joints - step), table.evaluate(road, joints + step)
    assert np.hypot(after.x_m - before.x_m, after.y_m - before.y_m) == pytest.approx(2.0 * step, rel=1e-3)
    turned = after.heading_rad - before.heading_rad
    bound = 2.0 * step * (np.maximum(np.abs(before.curvature_per_m), np.abs(after.curvature_per_m)) + 1e-3)
    assert (np.abs(turned) <= bound).all()
