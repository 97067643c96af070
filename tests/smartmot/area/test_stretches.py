"""Stretches of strips: what a loop over few objects says is what arrays say, and what all segments say."""

from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from smartmot.area import outline_points
from smartmot.area.stretches import FEW, Stretches
from smartmot.maps.strips import StripSet, lane_strip
from smartmot.types import Boxes, FloatArray

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"
MARGIN = 1.8


def _strips(network: RoadNetwork) -> StripSet:
    lanes = network.lanes
    driving = np.flatnonzero((lanes.lane_type == "driving") & (lanes.s_end_m - lanes.s_start_m > 5.0))
    return StripSet([lane_strip(network, lane, MARGIN) for lane in driving.tolist()])


def _points_beside(strips: StripSet, count: int, rng: np.random.Generator) -> FloatArray:
    """(count, 2) points up to 8 m beside the samples of the strips."""
    samples = np.concatenate([strip.center_m for strip in strips.strips])
    turn, away = rng.uniform(0.0, 2.0 * np.pi, count), rng.uniform(0.0, 8.0, count)
    points: FloatArray = samples[rng.integers(len(samples), size=count)]
    return points + away[:, None] * np.column_stack((np.cos(turn), np.sin(turn)))


@pytest.mark.parametrize("name", ["urban_street", "urban_street_parking", "urban_intersection", "urban_bend"])
def test_few_many_and_all_segments_agree(name: str) -> None:
    """Points in the segments of all strips, between the stations that count, are those of the stretches."""
    strips = _strips(load_map(MAPS / f"{name}.xodr"))
    rng = np.random.default_rng(2)
    points = _points_beside(strips, 60 * FEW, rng)
    size = rng.uniform(0.3, 12.0, (len(points), 2))
    boxes = Boxes(points, size, rng.uniform(-4.0, 4.0, len(points)))
    station, in_lane, in_margin = strips.place(points)
    of_outline, outline_in_lane, _ = strips.place(outline_points(boxes))
    seen = np.zeros(3, dtype=np.int64)
    for _ in range(10):
        first = rng.uniform(-20.0, 200.0, len(strips.strips))
        last = first + rng.uniform(0.1, 60.0, len(first))
        counts = rng.random(len(first)) < 0.8
        chosen = [(k, first[k], last[k]) for k in np.flatnonzero(counts).tolist()]
        stretches = Stretches(strips, chosen)
        low, high, counted = first[strips.strip], last[strips.strip], counts[strips.strip]
        inside = (station >= low) & (station <= high) & counted
        lane, margin = (in_lane & inside).any(axis=1), (in_margin & inside).any(axis=1)
        outline = outline_in_lane & (of_outline >= low) & (of_outline <= high) & counted
        touched = outline.reshape(len(points), 9, -1).any(axis=(1, 2))
        seen += [np.count_nonzero(lane), np.count_nonzero(margin), np.count_nonzero(touched)]
        few = [slice(k, k + FEW) for k in range(0, len(points), FEW)]
        for parts in ([slice(None)], few):
            placed = [stretches.place(points[part]) for part in parts]
            np.testing.assert_array_equal(np.concatenate([each[0] for each in placed]), lane)
            np.testing.assert_array_equal(np.concatenate([each[1] for each in placed]), margin)
            for answer, asked, expected in (
                (stretches.in_lanes, points, lane),
                (stretches.in_margins, points, margin),
                (stretches.touched, boxes, touched),
            ):
                answers = [answer(asked[part]) for part in parts]  # type: ignore[operator]
                np.testing.assert_array_equal(np.concatenate(answers), expected)

    assert 0 < seen[0] < seen[1] < 10 * len(points)
    assert seen[0] < seen[2]


def test_no_stretch_holds_nothing() -> None:
    stretches = Stretches(_strips(load_map(MAPS / "urban_street.xodr")), [])
    for count in (1, FEW + 1):
        points = np.zeros((count, 2))
        boxes = Boxes(points, np.ones((count, 2)), np.zeros(count))
        assert not stretches.touched(boxes).any()
        assert not np.any(stretches.place(points))
        assert len(stretches.in_lanes(points)) == len(stretches.in_margins(points)) == count
