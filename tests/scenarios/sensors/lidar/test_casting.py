"""Ray casting against closed forms, and laws that hold for any scene."""

import math
from collections.abc import Callable
from importlib.util import find_spec

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.errors import ScenarioError
from scenarios.sensors.lidar.casting import (
    GROUND,
    NO_BODY,
    Hits,
    Motion,
    RayTable,
    Sectors,
    cast,
    cast_arrays,
    sectors,
)
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, KINDS, ROLLER, Bodies, Parts, joined
from smartmot.arrays import FloatArray
from smartmot.errors import ShapeError

HAS_NUMBA = find_spec("numba") is not None
LOOPS = [False, pytest.param(True, marks=pytest.mark.skipif(not HAS_NUMBA, reason="numba is not installed"))]


def part(
    kind: int, half: tuple[float, float, float], center: tuple[float, float, float] = (0, 0, 0)
) -> Parts:
    return Parts(np.array([kind]), np.array([center], float), np.array([half], float), np.array([0.5]))


def one(
    parts: Parts, x: float, y: float, z: float = 0.0, yaw: float = 0.0, v: tuple[float, float] = (0, 0)
) -> Bodies:
    return Bodies.of([parts], np.array([[x, y, z]]), np.array([yaw]), np.array([v], float))


def fan(
    count: int = 721, elevations: tuple[float, ...] = (-0.2, -0.05, 0.0, 0.03), span_s: float = 0.0
) -> RayTable:
    """Columns all round, shot one after the other from -span to 0."""
    azimuth = np.linspace(-math.pi, math.pi, count, endpoint=False) + 1e-4
    a, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevations, indexing="ij"))
    direction = np.column_stack((np.cos(a) * np.cos(e), np.sin(a) * np.cos(e), np.sin(e)))
    return RayTable.of(direction, np.repeat(np.linspace(-span_s, 0.0, count), len(elevations)))[0]


def aimed(*targets: tuple[float, float, float]) -> RayTable:
    """Rays from (0, 0, 1.5) through points of ascending azimuth, at the stamp."""
    rel = np.array(targets, float) - (0.0, 0.0, 1.5)
    return RayTable(rel / np.linalg.norm(rel, axis=1)[:, None], np.zeros(len(rel)))


@pytest.mark.parametrize("compiled", LOOPS)
def test_ground(compiled: bool) -> None:
    rays = fan()
    hits = cast(rays, Motion(1.5), Bodies.empty(), -0.3, compiled=compiled)
    down = rays.direction[:, 2] < 0.0
    assert hits.range_m[down] == pytest.approx(1.8 / -rays.direction[down, 2], abs=1e-9)
    assert np.isinf(hits.range_m[~down]).all()
    assert (hits.body[down] == GROUND).all()
    assert (hits.body[~down] == NO_BODY).all()
    assert hits.cosine[down] == pytest.approx(-rays.direction[down, 2], abs=1e-12)
    assert np.isinf(cast(rays, Motion(1.5), Bodies.empty(), None, compiled=compiled).range_m).all()


@pytest.mark.parametrize("compiled", LOOPS)
@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0, math.pi / 2.0])
def test_block(compiled: bool, yaw: float) -> None:
    """Ranges of a turned block: the nearest of its faces in a frame that is turned by hand."""
    rays = fan()
    body = one(part(BLOCK, (2.0, 1.0, 0.8), (0.0, 0.0, 0.8)), 9.0, -4.0, 0.3, yaw)
    hits = cast(rays, Motion(1.5), body, None, compiled=compiled)
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    start = np.array([*(turn @ (-9.0, 4.0)), 1.5 - 0.3 - 0.8])
    ahead = np.column_stack((rays.direction[:, :2] @ turn.T, rays.direction[:, 2]))
    nearest = np.full(len(ahead), np.inf)
    for axis, half in enumerate((2.0, 1.0, 0.8)):
        for side in (-half, half):
            with np.errstate(divide="ignore", invalid="ignore"):
                s = (side - start[axis]) / ahead[:, axis]
                at = start + s[:, None] * ahead
            others = [k for k in range(3) if k != axis]
            on = (np.abs(at[:, others]) <= np.array((2.0, 1.0, 0.8))[others]).all(axis=1) & (s > 0)
            nearest = np.where(on, np.minimum(nearest, s), nearest)
    assert np.isfinite(nearest).sum() > 50
    assert hits.range_m == pytest.approx(nearest, abs=1e-9)


@pytest.mark.parametrize("compiled", LOOPS)
def test_sphere(compiled: bool) -> None:
    """Distance along a ray: projection of the centre, less the half chord."""
    rays = fan()
    center = np.array([20.0, 5.0, 1.7])
    hits = cast(rays, Motion(1.5), one(part(ELLIPSOID, (1.3, 1.3, 1.3)), *center), None, compiled=compiled)
    toward = rays.direction @ (center - (0.0, 0.0, 1.5))
    miss = ((center - (0.0, 0.0, 1.5)) ** 2).sum() - toward**2
    met = (miss < 1.3**2) & (toward > 0)
    assert met.sum() > 20
    chord = np.sqrt(1.3**2 - miss[met])
    assert hits.range_m[met] == pytest.approx(toward[met] - chord, abs=1e-9)
    assert np.isinf(hits.range_m[~met]).all()
    assert hits.cosine[met] == pytest.approx(chord / 1.3, abs=1e-9)


@pytest.mark.parametrize("compiled", LOOPS)
def test_upright_cylinder(compiled: bool) -> None:
    """Its side from a circle in the plane; its top from a plane."""
    rays = aimed((10.0, 0.0, 0.7), (10.0, 0.0, 2.2), (10.0, 0.2, 1.2), (11.0, 1.1, 1.0))
    hits = cast(
        rays, Motion(1.5), one(part(COLUMN, (0.5, 0.5, 0.5), (0, 0, 0.5)), 10.0, 0.0), None, compiled=compiled
    )
    d = rays.direction
    flat = np.hypot(d[:, 0], d[:, 1])
    toward = 10.0 * d[:, 0] / flat
    side = (toward - np.sqrt(np.maximum(0.25 - (100.0 - toward**2), 0.0))) / flat
    assert hits.range_m[0] == pytest.approx(side[0], abs=1e-9)  # 0.75 m up at the side
    assert 1.5 + side[2] * d[2, 2] > 1.0  # passes over the near rim
    assert np.isinf(hits.range_m[1:]).all()
    top = cast(
        aimed((10.1, 0.2, 1.0)), Motion(1.5), one(part(COLUMN, (0.5, 0.5, 0.5), (0, 0, 0.5)), 10.0, 0.0), None
    )
    assert top.range_m[0] == pytest.approx(math.dist((0, 0, 1.5), (10.1, 0.2, 1.0)), abs=1e-9)
    assert top.cosine[0] == pytest.approx(0.5 / top.range_m[0], abs=1e-9)


@pytest.mark.parametrize("compiled", LOOPS)
def test_wheel(compiled: bool) -> None:
    """A wheel seen from ahead is met on its tread, seen from the side on its disc."""
    wheel = part(ROLLER, (0.35, 0.1, 0.35), (0, 0, 0.35))
    ahead = cast(aimed((10.0, 0.0, 0.35)), Motion(1.5), one(wheel, 10.0, 0.0), None, compiled=compiled)
    assert ahead.range_m[0] == pytest.approx(math.dist((0, 0, 1.5), (10, 0, 0.35)) - 0.35, abs=1e-9)
    aside = cast(
        aimed((10.0, 0.0, 0.35)), Motion(1.5), one(wheel, 10.0, 0.0, yaw=math.pi / 2), None, compiled=compiled
    )
    assert aside.range_m[0] == pytest.approx(math.dist((0, 0, 1.5), (10, 0, 0.35)) * 9.9 / 10.0, abs=1e-9)
    assert aside.cosine[0] == pytest.approx(10.0 / math.dist((0, 0, 1.5), (10, 0, 0.35)), abs=1e-9)


def scene(rng: np.random.Generator, count: int) -> Bodies:
    """Bodies of one to three parts of all kinds around the sensor, some of them moving fast."""
    parts = []
    for _ in range(count):
        n = int(rng.integers(1, 4))
        parts.append(
            Parts(
                rng.choice(KINDS, n),
                rng.uniform((-1, -1, 0.2), (1, 1, 1.5), (n, 3)),
                rng.uniform(0.05, 1.2, (n, 3)),
                rng.uniform(0, 1, n),
            )
        )
    bearing, distance = rng.uniform(-math.pi, math.pi, count), rng.uniform(1.0, 40.0, count)
    position = np.column_stack(
        (distance * np.cos(bearing), distance * np.sin(bearing), rng.uniform(-1, 1, count))
    )
    return Bodies.of(parts, position, rng.uniform(-4, 4, count), rng.uniform(-30, 30, (count, 2)))


MOTIONS = st.builds(Motion, st.just(1.7), st.floats(-20, 40), st.floats(-1.5, 1.5), st.floats(-1, 2))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), MOTIONS)
def test_no_hit_is_lost_by_the_sectors(seed: int, motion: Motion) -> None:
    """All bodies tried with all rays give the same as each with the rays of its sector."""
    bodies, rays = scene(np.random.default_rng(seed), 8), fan(181, span_s=0.2)
    hits = cast(rays, motion, bodies, None, compiled=False)
    everything = np.tile((len(rays.time_s), 0), (8, 1))
    always = Sectors(np.zeros((8, 2), np.int64), everything, np.full(8, -np.inf), np.full(8, np.inf))
    expected = cast_arrays(rays, motion, bodies, -math.inf, always)
    assert hits.range_m.tolist() == expected.range_m.tolist()
    assert hits.part.tolist() == expected.part.tolist()


@pytest.mark.skipif(not HAS_NUMBA, reason="numba is not installed")
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), MOTIONS)
def test_compiled_loops_give_the_same(seed: int, motion: Motion) -> None:
    bodies, rays = scene(np.random.default_rng(seed), 12), fan(361, span_s=0.2)
    plain, fast = (cast(rays, motion, bodies, 0.0, compiled=compiled) for compiled in (False, True))
    assert plain.part.tolist() == fast.part.tolist()
    assert plain.body.tolist() == fast.body.tolist()
    assert fast.range_m == pytest.approx(plain.range_m, abs=1e-9)
    assert fast.cosine == pytest.approx(plain.cosine, abs=1e-7)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**31), st.floats(2.0, 30.0), st.floats(0.4, 3.0))
def test_nothing_is_seen_behind_an_occluder(seed: int, distance: float, half_width: float) -> None:
    """A wall at x = distance leaves nothing beyond it within its outline, and changes nothing else."""
    bodies, rays = scene(np.random.default_rng(seed), 10), fan()
    wall = one(part(BLOCK, (0.01, half_width, 50.0)), distance + 0.01, 0.0)
    alone, behind = (
        cast(rays, Motion(1.7), group, compiled=False) for group in (bodies, joined([bodies, wall]))
    )
    x, y, _ = rays.direction.T
    through = (x > 0) & (np.abs(y) * distance < x * half_width * (1 - 1e-9))
    assert through.any()
    plane = distance / x[through]
    assert behind.range_m[through] == pytest.approx(np.minimum(alone.range_m[through], plane), abs=1e-9)
    assert (behind.range_m <= alone.range_m).all()


def shear_hits(velocity: tuple[float, float], motion: Motion) -> tuple[RayTable, Hits, FloatArray]:
    rays = fan(3601, (0.0,), span_s=0.1)
    post = one(part(COLUMN, (0.2, 0.2, 2.0)), 15.0, 3.0, v=velocity)
    hits = cast(rays, motion, post, None, compiled=False)
    met = hits.body == 0
    return rays, hits, met


def test_a_target_that_crosses_is_sheared_by_the_shutter() -> None:
    """Every point is on the post where it is when the ray is shot: v dt from where it is at the stamp."""
    rays, hits, met = shear_hits((2.0, 8.0), Motion(1.5))
    assert met.sum() > 10
    points = rays.direction[met, :2] * hits.range_m[met, None]
    center = np.array([15.0, 3.0]) + rays.time_s[met, None] * (2.0, 8.0)
    assert np.hypot(*(points - center).T) == pytest.approx(0.2, abs=1e-9)
    # turning left, away from the sweep, or right with it: wider or narrower by v / (r w) of its width
    width = np.ptp(np.arctan2(points[:, 1], points[:, 0]))
    still = np.count_nonzero(shear_hits((0.0, 0.0), Motion(1.5))[2])
    sweep = 2.0 * math.pi / 0.1
    rate = (8.0 * 15.0 - 2.0 * 3.0) / (15.0**2 + 3.0**2)  # of the post's bearing, rad/s
    assert np.count_nonzero(met) == pytest.approx(still / (1.0 - rate / sweep), abs=1.5)
    assert width == pytest.approx(2.0 * 0.2 / math.hypot(15, 3) / (1.0 - rate / sweep), rel=0.1)


def test_an_ego_that_drives_and_turns_sees_a_post_where_it_is() -> None:
    motion = Motion(1.5, speed_mps=20.0, yaw_rate_radps=0.5, forward_m=1.0)
    rays, hits, met = shear_hits((0.0, 0.0), motion)
    place, turn = motion.pose(rays.time_s[met])
    c, s = np.cos(turn), np.sin(turn)
    x, y = rays.direction[met, 0], rays.direction[met, 1]
    points = place + np.column_stack((c * x - s * y, s * x + c * y)) * hits.range_m[met, None]
    assert met.sum() > 5
    assert np.hypot(*(points - (15.0, 3.0)).T) == pytest.approx(0.2, abs=1e-9)


def test_the_sensor_moves_on_the_arc_of_its_vehicle() -> None:
    place, turn = Motion(1.5, 10.0, 0.5).pose(np.array([-1.0, 0.0]))
    assert turn.tolist() == [-0.5, 0.0]
    assert place[0] == pytest.approx((-20.0 * math.sin(0.5), 20.0 * (1.0 - math.cos(0.5))), abs=1e-12)
    assert place[1].tolist() == [0.0, 0.0]
    straight, _ = Motion(1.5, 10.0).pose(np.array([-0.3]))
    assert straight[0] == pytest.approx((-3.0, 0.0), abs=1e-12)


def test_few_rays_are_tried() -> None:
    """A person at 20 m is tried with the 1.75 deg of its near side, a body around the sensor with all."""
    rays = fan(3600, (0.0,))
    for x, count in ((20.0, 17.45), (-20.0, 17.45), (0.1, 3600)):
        tried = sectors(rays, Motion(1.5), one(part(BLOCK, (0.3, 0.3, 0.9)), x, 0.0))
        assert (tried.last - tried.first).sum() == pytest.approx(count, abs=3)
    person = sectors(rays, Motion(1.5), one(part(BLOCK, (0.3, 0.3, 0.9), (0, 0, 0.9)), 20.0, 0.0))
    assert person.low_slope[0] == pytest.approx(-1.5 / 19.7, rel=1e-4)
    assert person.high_slope[0] == pytest.approx(0.3 / 19.7, rel=1e-4)


@pytest.mark.skipif(HAS_NUMBA, reason="numba is installed")
def test_compiled_loops_name_what_they_need() -> None:
    with pytest.raises(ScenarioError, match=r"smartmot\[fast\]"):
        cast(fan(), Motion(1.5), Bodies.empty(), compiled=True)


@pytest.mark.parametrize(
    "make",
    [
        lambda: part(9, (1, 1, 1)),
        lambda: part(BLOCK, (1, 0, 1)),
        lambda: part(BLOCK, (1, math.nan, 1)),
        lambda: Parts(np.array([0]), np.zeros((1, 3)), np.ones((1, 3)), np.array([1.5])),
        lambda: one(part(BLOCK, (1, 1, 1)), math.nan, 0),
        lambda: Bodies(
            np.zeros((1, 3)), np.zeros(1), np.zeros((1, 2)), part(BLOCK, (1, 1, 1)), np.array([0, 2])
        ),
    ],
)
def test_impossible_bodies_are_refused(make: Callable[[], object]) -> None:
    with pytest.raises(ShapeError):
        make()
