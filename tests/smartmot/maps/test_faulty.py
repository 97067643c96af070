"""A map with errors: each moves what it says by exactly what it says."""

import math
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opendrive import RoadNetwork, load_map
from scenarios.presets import PHYSICAL
from scenarios.settings import preset_with
from scenarios.sources.perception import faulty_map, map_view
from scenarios.spec import RunSpec, simulation_of
from smartmot import Boxes, ConfigError, EgoState, MapArea, MapAreaConfig, PlannedPath
from smartmot.maps.faulty import FaultyMap, MapErrors

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"
STREET = load_map(MAPS / "urban_street.xodr")
PARKING = load_map(MAPS / "urban_street_parking.xodr")
EAST = PlannedPath.through(np.column_stack((np.arange(50.0, 150.0, 2.0), np.full(50, -1.75))))
EGO = EgoState(0.0, 100.0, -1.75, 0.0, 10.0)
"""In the middle of the right lane, 3.5 m wide, along x."""
MARGIN_M = 1.8


def area(errors: MapErrors, network: RoadNetwork = STREET) -> MapArea:
    view = map_view(faulty_map(network, EAST, errors), EAST)
    return MapArea(view.network, view.route, MapAreaConfig(vru_margin_m=MARGIN_M))


def right_reach_m(made: MapArea) -> float:
    """How far right of y = 0 a pedestrian beside the ego's lane still counts, to a tenth of a millimetre."""
    low, high = 0.0, 12.0
    while high - low > 1e-5:
        middle = (low + high) / 2
        box = Boxes(np.array([[120.0, -middle]]), np.full((1, 2), 0.5), np.zeros(1))
        inside = made.at(EGO).relevance(box, np.array(["pedestrian"])).in_route[0]
        low, high = (middle, high) if inside else (low, middle)
    return low


@pytest.mark.parametrize("network", [STREET, PARKING], ids=["street", "parking"])
@pytest.mark.parametrize("kerb_m", [1.0, 0.3, -0.5])
def test_a_displaced_kerb_moves_the_margin_by_exactly_that(network: RoadNetwork, kerb_m: float) -> None:
    exact = right_reach_m(area(MapErrors(), network))
    assert right_reach_m(area(MapErrors(kerb_m=kerb_m), network)) == pytest.approx(exact + kerb_m, abs=1e-4)


@pytest.mark.parametrize("lane_m", [1.0, -0.5])
def test_displaced_lanes_lie_that_much_farther_left(lane_m: float) -> None:
    exact = right_reach_m(area(MapErrors()))
    made = area(MapErrors(lane_m=lane_m))
    assert right_reach_m(made) == pytest.approx(exact - lane_m, abs=1e-4)
    assert made.route.center_m[:, 1] == pytest.approx(-1.75 + lane_m)
    points = np.array([[120.0, y + lane_m] for y in (-3.51, -3.49, -0.01, 0.01)])
    assert made.at(EGO).on_lane(points).tolist() == [False, True, True, False]
    (lane,) = set(made.network.locate(np.array([[120.0, -1.75 + lane_m]])).lane.tolist())
    assert lane in made.route.lanes


def test_a_sidewalk_that_is_missing_leaves_the_margin_at_the_lane() -> None:
    """Else it is measured from the kerb, beyond the parking strip."""
    for errors in (MapErrors(sidewalk="missing"), MapErrors(types="strips_drive")):
        assert right_reach_m(area(errors, PARKING)) == pytest.approx(3.5 + MARGIN_M, abs=1e-4)
    assert right_reach_m(area(MapErrors(), PARKING)) > 3.5 + MARGIN_M + 1.0


def test_lanes_that_are_missing_are_neither_neighbours_nor_under_a_point() -> None:
    made = area(MapErrors(lanes="missing")).network
    (own,) = made.locate(np.array([[100.0, -1.75]])).lane.tolist()
    assert made.left_neighbour(own) is None
    assert made.locate(np.array([[100.0, 1.75]])).lane.tolist() == []
    assert {str(made.lanes.lane_type[k]) for k in area(MapErrors(lanes="missing")).route.lanes} == {"driving"}


def test_the_nearest_lane_is_one_that_the_map_shows_by_the_type_that_it_shows() -> None:
    """The street's own lanes are 3.5 m wide, the oncoming one from y = 0 to 3.5 m, the sidewalk beyond it."""
    points = np.array([[100.0, 1.75], [100.0, -1.0], [100.0, 4.0]])

    def nearest(errors: MapErrors, *types: str) -> tuple[list[str], list[float]]:
        made = area(errors).network
        near = made.nearest_lane(points, types)
        return [str(made.lanes.lane_type[k]) for k in near.lane[near.found]], near.distance_m[
            near.found
        ].tolist()

    assert nearest(MapErrors(), "driving")[1] == pytest.approx([0.0, 0.0, 0.5])
    assert nearest(MapErrors(lanes="missing"), "driving")[1] == pytest.approx([1.75, 0.0, 4.0])
    assert nearest(MapErrors(lanes="missing", lane_m=0.5), "driving")[1] == pytest.approx([1.25, 0.0, 3.5])
    assert nearest(MapErrors(sidewalk="missing"), "sidewalk") == ([], [])
    assert nearest(MapErrors(types="no_sidewalk"), "sidewalk") == ([], [])
    kinds, distances = nearest(MapErrors(types="no_sidewalk"), "shoulder")
    assert (kinds, distances[2]) == (["shoulder"] * 3, 0.0)


def test_sidewalks_given_as_shoulders_are_crossed_like_them() -> None:
    exact = right_reach_m(area(MapErrors()))
    assert right_reach_m(area(MapErrors(types="no_sidewalk"))) == pytest.approx(3.5 + MARGIN_M, abs=1e-4)
    assert exact == pytest.approx(3.5 + MARGIN_M, abs=1e-4)


@given(st.sampled_from(("sidewalk", "lanes", "types")))
def test_unknown_errors_are_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=rf"{name} must be one of"):
        MapErrors(**{name: "wrong"})  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="finite"):
        MapErrors(kerb_m=math.nan)


def test_the_map_of_a_run_has_the_errors_and_is_pickled_with_it() -> None:
    settings = (("map_kerb_m", 1.0), ("map_lane_m", 0.5), ("path_from", "map"))
    assert preset_with(PHYSICAL, settings).map_errors == MapErrors(kerb_m=1.0, lane_m=0.5)
    spec = RunSpec("cpna", "cpna_paper", (), "map", "physical", "dry", 50.0, settings=settings)
    simulation = simulation_of(spec)
    first = simulation.start().frame
    assert first is not None
    assert isinstance(first.lane_map, FaultyMap)
    again = pickle.loads(pickle.dumps(simulation))
    step = again.step(None)
    assert step.frame is not None
    assert isinstance(step.frame.lane_map, FaultyMap)
    assert np.array_equal(step.frame.lane_map.route.center_m, first.lane_map.route.center_m)
