"""Boxes of a network's output: closed forms, and targets that come back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.errors import ShapeError
from smartmot.geometry import wrap_angle
from smartmot.lidar.learned import CHANNELS, Decoder, PillarGrid

DECODER = Decoder(PillarGrid((0.0, 16.0), (-8.0, 8.0), 0.5, 4), ("car", "pedestrian", "cyclist"))


def output(*bodies: tuple[int, int, int, float, tuple[float, ...]]) -> np.ndarray:
    """(class, row, column, logit, values) of each body."""
    made = np.full(DECODER.shape, -12.0, dtype=np.float32)
    made[3:] = 0.0
    for which, row, column, logit, values in bodies:
        made[which, row, column] = logit
        made[3:, row, column] = values
    return made


def values(x: float, y: float, z: float, size: tuple[float, ...], yaw: float) -> tuple[float, ...]:
    return (
        x, y, z, *map(math.log, size),
        math.sin(2 * yaw), math.cos(2 * yaw), math.sin(yaw), math.cos(yaw),
    )  # fmt: skip


def test_a_box_by_hand() -> None:
    """Cells of the output are 1 m: row 7 begins 7 m ahead, column 3 at -5 m."""
    made = output((1, 7, 3, math.log(4.0), values(0.25, -0.5, 0.9, (0.6, 0.5, 1.8), 2.0)))
    boxes, score, category = DECODER.decode(made, 0.3)
    assert category.tolist() == ["pedestrian"]
    assert score == pytest.approx([0.8])
    np.testing.assert_allclose(boxes.center_m, [[7.75, -5.0, 0.9]], atol=1e-6)
    np.testing.assert_allclose(boxes.size_m, [[0.6, 0.5, 1.8]], rtol=1e-6)
    assert boxes.yaw_rad == pytest.approx([2.0])


@settings(deadline=None)
@given(yaw=st.floats(-math.pi, math.pi), turned=st.booleans())
def test_headings_come_back(yaw: float, turned: bool) -> None:
    """The direction decides between the ends of the axis, and no more."""
    wanted = list(values(0.0, 0.0, 0.8, (4.0, 1.8, 1.5), yaw))
    if turned:
        wanted[-2:] = [-v for v in wanted[-2:]]
    boxes, _, _ = DECODER.decode(output((0, 5, 5, 3.0, tuple(wanted))), 0.3)
    error = wrap_angle(boxes.yaw_rad - yaw - turned * math.pi)
    assert np.abs(error) == pytest.approx([0.0], abs=1e-5)
    assert np.abs(boxes.yaw_rad) <= math.pi + 1e-6


def test_of_overlapping_boxes_the_surest_stays_and_neighbours_are_no_peaks() -> None:
    car, person = values(0, 0, 0.8, (4.0, 1.8, 1.5), 0.0), values(0, 0, 0.9, (0.6, 0.6, 1.8), 0.0)
    made = output((0, 5, 5, 2.0, car), (0, 6, 5, 1.0, car), (2, 7, 5, 1.5, car), (1, 12, 5, 0.5, person))
    boxes, score, category = DECODER.decode(made, 0.3)
    assert category.tolist() == ["car", "pedestrian"]
    assert (np.diff(score) < 0).all()
    assert boxes.center_m[:, 0] == pytest.approx([5.5, 12.5])
    assert len(DECODER.decode(made, 0.7)[1]) == 1
    assert len(DECODER.decode(made, 1.0)[1]) == 0


def test_two_people_in_cells_that_touch_at_a_corner_are_two() -> None:
    """And a body whose centre is between such cells is one."""
    first, second = values(-0.3, 0.3, 0.9, (0.5, 0.6, 1.8), 0.0), values(0.3, -0.3, 0.9, (0.5, 0.6, 1.8), 0.0)
    boxes, _, category = DECODER.decode(output((1, 5, 5, 2.0, first), (1, 6, 4, 1.0, second)), 0.3)
    assert category.tolist() == ["pedestrian", "pedestrian"]
    assert boxes.center_m[:, 0] == pytest.approx([5.2, 6.8])
    here, there = values(0.5, -0.5, 0.9, (0.5, 0.6, 1.8), 0.0), values(-0.5, 0.5, 0.9, (0.5, 0.6, 1.8), 0.0)
    boxes, _, _ = DECODER.decode(output((1, 5, 5, 2.0, here), (1, 6, 4, 1.0, there)), 0.3)
    assert len(boxes) == 1
    beside = values(-0.5, 0.0, 0.9, (0.5, 0.6, 1.8), 0.0)
    assert len(DECODER.decode(output((1, 5, 5, 2.0, first), (1, 6, 5, 1.0, beside)), 0.3)[0]) == 1


def test_nonsense_of_a_network_gives_no_boxes() -> None:
    huge = values(0, 0, 0.8, (4.0, 1.8, 1.5), 0.0)
    made = output((0, 5, 5, 2.0, huge), (0, 10, 10, 2.0, huge))
    made[3 + CHANNELS.index("log_length"), 5, 5] = 9.0
    made[3 + CHANNELS.index("height"), 10, 10] = np.nan
    assert len(DECODER.decode(made, 0.3)[1]) == 0
    made[0, 2, 2] = 1e30
    assert len(DECODER.decode(made, 0.3)[1]) == 1
    with pytest.raises(ShapeError, match="expected an output of shape"):
        DECODER.decode(made[:, :4], 0.3)


def test_no_more_boxes_than_asked_for() -> None:
    decoder = Decoder(DECODER.grid, DECODER.classes, most_boxes=5)
    small = values(0, 0, 0.9, (0.3, 0.3, 1.8), 0.0)
    made = output(*((1, r, c, 0.01 * (r + c), small) for r in range(0, 16, 2) for c in range(0, 16, 2)))
    boxes, score, _ = decoder.decode(made, 0.3)
    assert len(boxes) == 5
    assert score == pytest.approx(1 / (1 + np.exp(-np.array([0.28, 0.26, 0.26, 0.24, 0.24]))))
