"""Road users as bodies: inside their boxes, as tall and wide as these, and of the right shape."""

import numpy as np
import pytest

from scenarios.sensors.lidar.bodies import SHAPES, road_users, shape_of, unit_body
from scenarios.sensors.lidar.shapes import Bodies, joined
from smartmot.types import CATEGORIES


@pytest.mark.parametrize("shape", SHAPES)
def test_a_body_fills_its_box(shape: str) -> None:
    """The box around the parts is the box of the road user: labels fit by construction."""
    parts = unit_body(shape)
    low, high = (parts.center_m - parts.half_m).min(axis=0), (parts.center_m + parts.half_m).max(axis=0)
    assert (low >= (-0.5 - 1e-12, -0.5 - 1e-12, -1e-12)).all()
    assert (high <= (0.5 + 1e-12, 0.5 + 1e-12, 1.0 + 1e-12)).all()
    assert low[2] == pytest.approx(0.0, abs=1e-12)
    assert high[2] == pytest.approx(1.0)
    assert high[1] - low[1] == pytest.approx(1.0)
    # a person's arms end short of the stride of the box
    assert high[0] - low[0] >= 0.65


def test_all_but_a_plain_box_have_several_parts() -> None:
    assert {shape for shape in SHAPES if len(unit_body(shape)) < 5} == {"unknown"}
    assert {shape_of(name, 1.7) for name in CATEGORIES} == set(SHAPES) - {"child"}


def test_a_pedestrian_that_is_not_tall_is_a_child() -> None:
    assert shape_of("pedestrian", 1.154) == "child"
    assert shape_of("pedestrian", 1.8) == "adult"
    assert shape_of("animal", 0.5) == "unknown"
    # the head of a child is a larger share of its height
    heads = [2.0 * unit_body(shape).half_m[-1, 2] for shape in ("adult", "child")]
    assert heads == pytest.approx([0.16, 0.22])


def test_bodies_are_stretched_to_their_boxes() -> None:
    size = np.array([[4.3, 1.8, 1.5], [0.6, 0.5, 1.8], [1.0, 1.0, 1.0]])
    position = np.array([[1.0, 2.0, 0.1], [5.0, 0.0, 0.0], [9.0, 0.0, 0.0]])
    bodies = road_users(np.array(["car", "pedestrian", "unknown"]), size, position, np.zeros(3))
    low, high = bodies.bounds
    assert (high - low)[[0, 2]] == pytest.approx(size[[0, 2]])
    assert (high - low)[1, 1:] == pytest.approx(size[1, 1:])
    assert bodies.velocity_mps.tolist() == [[0.0, 0.0]] * 3
    plain = road_users(np.array(["car", "pedestrian"]), size[:2], position[:2], np.zeros(2), single_box=True)
    assert plain.first.tolist() == [0, 1, 2]


def test_bodies_are_chosen_joined_and_turned() -> None:
    size, position = np.tile((4.0, 2.0, 1.5), (3, 1)), np.array([[10.0, 0, 0], [0, 10.0, 0], [5.0, 5.0, 1.0]])
    users = np.array(["car", "cyclist", "unknown"])
    bodies = road_users(users, size, position, np.array([0.0, 1.0, 2.0]), np.tile((3.0, 0.0), (3, 1)))
    swapped = joined([bodies.take(np.array([2])), Bodies.empty(), bodies.take(np.array([0, 1]))])
    again = swapped.take(np.array([1, 2, 0]))
    assert again.first.tolist() == bodies.first.tolist()
    assert again.position_m.tolist() == position.tolist()
    assert again.parts.half_m.tolist() == bodies.parts.half_m.tolist()
    # seen by one who looks north from (10, 0): the second is 10 m ahead and 10 m to the left
    seen = bodies.seen_from(np.array([10.0, 0.0]), np.pi / 2.0)
    assert seen.position_m[:2] == pytest.approx(np.array([[0.0, 0.0, 0.0], [10.0, 10.0, 0.0]]), abs=1e-12)
    assert seen.velocity_mps[0] == pytest.approx((0.0, -3.0), abs=1e-12)
    assert seen.yaw_rad[0] == pytest.approx(-np.pi / 2.0)
    assert joined([]).first.tolist() == [0]
    assert bodies.radius_m == pytest.approx(np.hypot(2.0, 1.0))
