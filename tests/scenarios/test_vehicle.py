"""The ego: lane keeping, exact longitudinal motion, and speed adaptation by IDM."""

import math

import numpy as np
import pytest

from opendrive import load_map
from scenarios.actors import KMH
from scenarios.brakes import BrakeConfig
from scenarios.map_builder import shipped_map
from scenarios.vehicle import EgoVehicle, RouteLane
from smartmot.pipeline import LeadObject
from smartmot.route import Route, route_ahead

BRAKES = BrakeConfig(0.2, 0.4, 8.8)
STEP_S = 0.01


def whole_route(map_name: str, lane_id: int) -> Route:
    network = load_map(shipped_map(map_name))
    lane = network.lane_index_of(("1", 0, lane_id))
    entry = network.lanes.s_start_m[lane] if lane_id < 0 else network.lanes.s_end_m[lane]
    return route_ahead(network, lane, float(entry), ahead_m=2000.0)


@pytest.fixture(scope="module")
def street() -> Route:
    return whole_route("urban_street", -1)


def ego_on(route: Route, speed_kmh: float, station_m: float = 50.0) -> EgoVehicle:
    return EgoVehicle(route, station_m, speed_kmh * KMH, 4.4, 1.8, BRAKES)


@pytest.mark.parametrize("lane_id", [-1, 1])
def test_stays_on_the_centre_line_through_a_bend(lane_id: int) -> None:
    network = load_map(shipped_map("urban_bend"))
    lane = network.lane_index_of(("1", 0, lane_id))
    s = np.linspace(0.0, float(network.lanes.s_end_m[lane]), 20_000)
    x, y = network.center_line(lane, s)[:2]
    route = whole_route("urban_bend", lane_id)
    ego = ego_on(route, 40.0, 5.0)
    worst, turned, steps = 0.0, 0.0, round((route.length_m - 20.0) / (40 * KMH) / STEP_S)
    start_yaw = ego.heading
    for step in range(steps):
        now = step * STEP_S
        if step % 5 == 0:
            ego.control(now, False, None)
            worst = max(worst, float(np.hypot(x - ego.position[0], y - ego.position[1]).min()))
        ego.advance(now, STEP_S)
        turned = ego.heading - start_yaw
    assert abs(turned) == pytest.approx(math.pi / 2, abs=0.01)  # the whole bend was driven
    assert worst < 0.3
    assert ego.speed == pytest.approx(40 * KMH)
    # arc length driven is speed times time
    assert route.project(*ego.position)[0] - 5.0 == pytest.approx(steps * STEP_S * 40 * KMH, rel=0.005)


def test_starts_on_the_route_and_keeps_its_speed(street: Route) -> None:
    ego = ego_on(street, 50.0)
    assert street.project(*ego.position) == pytest.approx((50.0, 0.0), abs=1e-9)
    for step in range(300):
        if step % 5 == 0:
            ego.control(step * STEP_S, False, None)
        ego.advance(step * STEP_S, STEP_S)
    assert ego.speed == pytest.approx(50 * KMH, abs=1e-12)
    assert street.project(*ego.position)[0] == pytest.approx(50.0 + 3.0 * 50 * KMH, abs=1e-6)


@pytest.mark.parametrize("speed_kmh", [10.0, 50.0, 80.0])
def test_emergency_stop_takes_the_distance_of_the_brakes(street: Route, speed_kmh: float) -> None:
    ego = ego_on(street, speed_kmh)
    for step in range(600):
        ego.control(step * STEP_S, True, None)  # asked again in every step: the request counts from the first
        ego.advance(step * STEP_S, STEP_S)
    assert ego.speed == 0.0
    driven = street.project(*ego.position)[0] - 50.0
    assert driven == pytest.approx(BRAKES.travel(speed_kmh * KMH, 0.0, 60.0)[0], abs=1e-6)


def test_released_brakes_let_it_drive_on(street: Route) -> None:
    ego = ego_on(street, 30.0)
    for step in range(200):
        ego.control(step * STEP_S, True, None)
        ego.advance(step * STEP_S, STEP_S)
    assert ego.speed == 0.0
    for step in range(200, 1200):
        ego.control(step * STEP_S, False, None)
        ego.advance(step * STEP_S, STEP_S)
        assert ego.accel_mps2 <= ego.COMFORT_ACC_MAX + 1e-9
    assert ego.speed == pytest.approx(30 * KMH, rel=0.05)


def test_looking_ahead_changes_nothing_and_tells_the_truth(street: Route) -> None:
    ego = ego_on(street, 50.0)
    ego.control(0.0, True, None)
    before = ego.state(0.0)
    told = ego.pose_after(0.3, 0.2)
    assert ego.state(0.0) == before
    ego.advance(0.3, 0.2)
    after = ego.state(0.5)
    assert (after.x_m, after.y_m, after.yaw_rad, after.speed_mps) == told
    assert after.accel_mps2 == pytest.approx((told[3] - before.speed_mps) / 0.2)


def follow(
    route: Route, speed_kmh: float, gap_m: float, lead_kmh: float, seconds: float
) -> tuple[float, float]:
    """Least gap on the way and last speed in km/h, behind a lead at constant speed."""
    ego = ego_on(route, speed_kmh, 20.0)
    front, least = 20.0 + 2.2 + gap_m, math.inf
    for step in range(round(seconds / STEP_S)):
        now = step * STEP_S
        gap = front + lead_kmh * KMH * now - route.project(*ego.position)[0] - 2.2
        least = min(least, gap)
        if step % 5 == 0:
            ego.control(now, False, LeadObject(1, gap, lead_kmh * KMH))
        ego.advance(now, STEP_S)
    return least, ego.speed / KMH


@pytest.mark.parametrize(("speed_kmh", "gap_m"), [(50.0, 80.0), (30.0, 40.0), (70.0, 110.0)])
def test_stops_behind_a_standing_lead_without_contact(street: Route, speed_kmh: float, gap_m: float) -> None:
    least, speed = follow(street, speed_kmh, gap_m, 0.0, 40.0)
    assert speed < 0.5
    assert EgoVehicle.STANDSTILL_GAP_M - 0.2 < least < 5.0


def test_settles_at_the_equilibrium_gap_behind_a_slower_lead(street: Route) -> None:
    least, speed = follow(street, 50.0, 60.0, 20.0, 55.0)
    assert speed == pytest.approx(20.0, abs=0.3)
    # Treiber et al. 2000, equation 12: s = (s0 + T v) / sqrt(1 - (v / v0)^4)
    time_gap = EgoVehicle.TIME_WANTED
    equilibrium = (2.0 + time_gap * 20 * KMH) / math.sqrt(1 - (20 / 50) ** 4)
    assert 1.0 < least < equilibrium + 1.0


def test_adapting_the_speed_never_brakes_harder_than_comfort(street: Route) -> None:
    ego = ego_on(street, 50.0)
    ego.control(0.0, False, LeadObject(1, 5.0, 0.0))
    ego.advance(0.0, STEP_S)
    assert ego.accel_mps2 == pytest.approx(-EgoVehicle.COMFORT_DECEL_MPS2)


def test_the_lane_of_the_route_is_its_inverse_pair(street: Route) -> None:
    lane = RouteLane(street)
    for station, lateral in ((10.0, 0.0), (100.0, 1.5), (550.0, -2.0)):
        assert lane.local_coordinates(lane.position(station, lateral)) == pytest.approx((station, lateral))
        assert lane.heading_at(station) == pytest.approx(street.pose(station)[2])
    assert lane.width_at(0.0) == 3.5
    assert lane.to_config() == {"length": street.length_m, "width": 3.5}
    with pytest.raises(TypeError, match="from a Route"):
        RouteLane.from_config({})
