"""Maps of this project against values of libcarla; tests/data/opendrive/make_values.py has made them."""

import gzip
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from opendrive import LaneKey, RoadNetwork, load_map

ROOT = Path(__file__).parents[2]
VALUES = ROOT / "tests" / "data" / "opendrive"
FOLDERS = (VALUES, ROOT / "scenarios" / "maps", ROOT / "scenarios" / "scenes" / "maps")
NAMES = sorted(file.name.removesuffix(".json.gz") for file in VALUES.glob("*.json.gz"))

POSITION_M = 1e-3
"""libcarla counts with 32 bits, and lays a polyline of its own along cubics."""
HEADING_RAD = 1e-3
WIDTH_M = 2e-5
ONE_WAY = ("Left", "Right")
"""What libcarla makes of "decrease" and "increase"; the standard means lesser and greater lane ids."""


def map_file(name: str) -> Path:
    return next(folder / f"{name}.xodr" for folder in FOLDERS if (folder / f"{name}.xodr").is_file())


@pytest.fixture(params=NAMES)
def case(request: pytest.FixtureRequest) -> tuple[RoadNetwork, Mapping[str, Any]]:
    values = json.loads(gzip.decompress((VALUES / f"{request.param}.json.gz").read_bytes()))
    file = map_file(request.param)
    assert hashlib.sha256(file.read_bytes()).hexdigest() == values["sha256"], "run make_values.py again"
    return load_map(file), values


def lane_at(network: RoadNetwork, road: int, lane_id: int, s_m: float) -> int:
    lanes = network.lanes
    return next(
        k
        for k, key in enumerate(lanes.key)
        if (key.road_id, key.lane_id) == (str(road), lane_id)
        and lanes.s_start_m[k] - 1e-6 <= s_m < lanes.s_end_m[k] + 1e-6
    )


def test_there_are_values_for_every_map_of_the_project() -> None:
    assert {file.stem for folder in FOLDERS for file in folder.glob("*.xodr")} == set(NAMES)
    assert len(NAMES) >= 16


def test_poses_widths_and_types(case: tuple[RoadNetwork, Mapping[str, Any]]) -> None:
    network, values = case
    rows = values["lanes"]
    lane = np.array([network.lane_index_of(LaneKey(str(row[0]), row[1], row[2])) for row in rows])
    s = np.array([row[3] for row in rows])
    x, y, z, yaw = network.center_line(lane, s)
    expected = np.array([row[4:9] for row in rows])
    assert np.hypot(x - expected[:, 0], y - expected[:, 1]).max() < POSITION_M
    raised = np.diff(network.lanes.inner_height.first)[lane] > 0  # libcarla ignores heights of lanes
    assert np.abs(z - expected[:, 2])[~raised].max(initial=0.0) < POSITION_M
    # libcarla gives the heading of the road; a lane whose distance from it changes is turned against it
    step = 1e-3
    inner, outer = (np.array(network.lane_offsets(lane, s + sign * step)) for sign in (-1, 1))
    slanted = np.abs((outer - inner).mean(axis=0)) > 1e-4 * step
    turned = np.abs((yaw - expected[:, 3] + np.pi) % (2 * np.pi) - np.pi)
    assert turned[~slanted].max() < HEADING_RAD
    assert turned.max() < 0.2
    assert np.abs(network.lane_width(lane, s) - expected[:, 4]).max() < WIDTH_M
    assert network.lanes.lane_type[lane].tolist() == [row[9] for row in rows]


def test_lane_successors(case: tuple[RoadNetwork, Mapping[str, Any]]) -> None:
    network, values = case
    lanes = network.lanes
    begins = {
        (key.road_id, key.lane_id, round(float(start if forward > 0 else end), 3)): k
        for k, (key, start, end, forward) in enumerate(
            zip(lanes.key, lanes.s_start_m, lanes.s_end_m, lanes.direction, strict=True)
        )
        if lanes.lane_type[k] == "driving"
    }

    def at(road: int, s_m: float, lane_id: int) -> int:
        return min(
            (abs(s - s_m), k) for (r, number, s), k in begins.items() if (r, number) == (str(road), lane_id)
        )[1]

    expected = {(at(*edge[:3]), at(*edge[3:])) for edge in values["edges"]}
    edges = {(i, j) for i in begins.values() for j in network.successors(i) if j in set(begins.values())}
    # a lane without successor is listed as its own
    assert {(i, j) for i, j in expected if i != j} == edges


def test_neighbours_and_permission_to_change(case: tuple[RoadNetwork, Mapping[str, Any]]) -> None:
    network, values = case
    for road, lane_id, s_m, _, _, left, right, permission, left_mark, right_mark in values["neighbours"]:
        lane = lane_at(network, road, lane_id, s_m)
        sides = (
            ("left", network.left_neighbour(lane), left, left_mark),
            ("right", network.right_neighbour(lane), right, right_mark),
        )
        for side, neighbour, expected, mark in sides:
            key = None if neighbour is None else network.lanes.key[neighbour]
            assert (None if key is None else [int(key.road_id), key.lane_id]) == expected, (
                road,
                lane_id,
                s_m,
            )
            if expected is not None and mark is not None and mark[1] not in ONE_WAY:
                allowed = permission.lower() in (side, "both")
                assert network.lane_change(lane, s_m, side) == allowed, (road, lane_id, s_m, side)


@pytest.mark.parametrize(("column", "backward"), [(3, False), (4, True)], ids=["ahead", "back"])
def test_five_metres_on(case: tuple[RoadNetwork, Mapping[str, Any]], column: int, backward: bool) -> None:
    network, values = case
    rows, lanes = values["neighbours"], network.lanes
    lane = np.array([lane_at(network, *row[:3]) for row in rows])
    places = network.places_ahead(lane, np.array([row[2] for row in rows]), 5.0, backward)
    compared = 0
    for k, row in enumerate(rows):
        expected = {(str(road), lane_id): s for road, lane_id, s in row[column]}
        reached = {
            (lanes.key[i].road_id, lanes.key[i].lane_id): s
            for i, s in zip(
                places.lane[places.start == k].tolist(), places.s_m[places.start == k].tolist(), strict=True
            )
        }
        if not reached:
            continue  # the road ends; libcarla then gives its end
        assert reached.keys() == expected.keys(), row[:3]
        for place, s in expected.items():
            assert reached[place] == pytest.approx(s, abs=2e-2), row[:3]
            compared += 1
    assert compared
