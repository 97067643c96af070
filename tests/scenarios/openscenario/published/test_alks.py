"""ASAM's ALKS scenarios (UN R157), each with the numbers of the file and with other ones.

The ego follows its speed throughout; its straight road has lanes of 3.5 m between borders of 2.75 m.
"""

import math

import numpy as np
import pytest

from tests.scenarios.openscenario.published.conftest import Lane, ramp

FOLDER = "alks/logical_scenarios/concrete_scenarios"
BESIDE_M = 2.75
LANE_M = 3.5


def middle_m(lane):
    """Y of the middle of a lane of the straight road."""
    return math.copysign(BESIDE_M + (abs(lane) - 2.5) * LANE_M, lane)


@pytest.fixture
def play(published):
    def run(number, values=None):
        names = {
            "4_1_1": "free_driving",
            "4_1_2": "swerving_lead_vehicle",
            "4_1_3": "side_vehicle",
            "4_2_1": "fully_blocking_target",
            "4_2_2": "partially_blocking_target",
            "4_2_3": "crossing_pedestrian",
            "4_2_4": "multiple_blocking_targets",
            "4_3_1": "follow_lead_vehicle_comfortable",
            "4_3_2": "follow_lead_vehicle_emergency_brake",
            "4_4_1": "cut_in_no_collision",
            "4_4_2": "cut_in_unavoidable_collision",
            "4_5_1": "cut_out_fully_blocking",
            "4_5_2": "cut_out_multiple_blocking_targets",
            "4_6_1": "forward_detection_range",
            "4_6_2": "lateral_detection_range",
        }
        played = published(f"{FOLDER}/alks_scenario_{number}_{names[number]}_template.xosc", values)
        return played, dict(played.engine.definition.parameters)

    return run


def ego_at_speed(played, numbers, lane=-4):
    """The ego's speed, which it keeps; from s = 5 m on along its lane."""
    v = numbers["Ego_InitSpeed_Ve0_kph"] / 3.6
    x, y, _, speed = played.of("Ego")
    along = 1.0 if lane < 0 else -1.0
    np.testing.assert_allclose(x, 5 + along * v * played.time_s, atol=1e-6)
    np.testing.assert_allclose(y, middle_m(lane), atol=1e-9)
    np.testing.assert_allclose(speed, v, atol=1e-9)
    return v


@pytest.mark.parametrize("number", ["4_1_1", "4_1_3"])
@pytest.mark.parametrize("kmh", [60.0, 59.5])
def test_along_changing_bends(play, number, kmh):
    """5 km by s, or in the file's own time; a vehicle beside keeps its lane and its speed."""
    played, numbers = play(number, {"Ego_InitSpeed_Ve0_kph": kmh})
    v = kmh / 3.6
    lane = Lane(played.network, "0", -4)
    x, y, _, speed = played.of("Ego")
    np.testing.assert_allclose(speed, v)
    off = np.column_stack((x, y)) - lane.points(lane.s_after(5, v * played.time_s))
    assert np.hypot(*off.T).max() < 0.01
    assert played.run.end_time_s == pytest.approx(min(5000 / v, 300.0), abs=1e-6)
    if number == "4_1_3":
        beside = numbers["SideVehicle_InitPosition_RelativeLaneId"]
        left = -beside * numbers["SideVehicle_InitLateralOffset_m"]
        other = Lane(played.network, "0", -4 + beside, left)
        x, y, _, speed = played.of("SideVehicle")
        start = 5 + numbers["SideVehicle_InitLongitudinalOffset_m"]
        off = np.column_stack((x, y)) - other.points(other.s_after(start, v * played.time_s))
        assert np.hypot(*off.T).max() < 0.01
        np.testing.assert_allclose(speed, v)


@pytest.mark.parametrize(("kmh", "left", "right", "limit"), [(60.0, 1.5, -1.5, 0.3), (40.0, 1.0, -0.5, 0.6)])
def test_a_lead_vehicle_that_swerves(play, kmh, left, right, limit):
    """Sinusoidal offsets within an acceleration: the time is pi x sqrt(change / (2 a)); 5 s between."""
    played, numbers = play(
        "4_1_2",
        {
            "Ego_InitSpeed_Ve0_kph": kmh,
            "Swerve_Offset_Left_m": left,
            "Swerve_Offset_Right_m": right,
            "Swerve_MaxLateralAcc_mps2": limit,
        },
    )
    v = ego_at_speed(played, numbers)
    t = played.time_s
    long_s, short_s = (math.pi * math.sqrt(abs(change) / (2 * limit)) for change in (left, right))
    begins = np.cumsum([10.0, long_s + 5, long_s, short_s + 5])
    offset = np.zeros_like(t)
    for begin, length, change in zip(
        begins, (long_s, long_s, short_s, short_s), (left, -left, right, -right), strict=True
    ):
        share = np.clip((t - begin) / length, 0, 1)
        offset += change * 0.5 * (1 - np.cos(np.pi * share))
    x, y, _, speed = played.of("LeadVehicle")
    np.testing.assert_allclose(y, middle_m(-4) + offset, atol=1e-3)
    np.testing.assert_allclose(speed, v, atol=1e-9)
    # 2 s of free space ahead of the ego; sqrt(v^2 - y'^2) ahead
    start = 5 + 2 * v + played.reach_m("Ego")[1] + played.reach_m("LeadVehicle")[0]
    lost = np.cumsum(v - np.sqrt(v**2 - np.gradient(offset, t) ** 2)) * 0.01
    np.testing.assert_allclose(x, start + v * t - lost, atol=0.01)
    assert played.run.end_time_s == pytest.approx(50.0, abs=1e-9)


@pytest.mark.parametrize("number", ["4_2_1", "4_2_2", "4_2_4", "4_6_1"])
@pytest.mark.parametrize(("kmh", "ahead_m"), [(60.0, 500.0), (30.0, 200.0)])
def test_targets_that_stand(play, number, kmh, ahead_m):
    """The ego hits whom it does not pass; a run lasts 10 s longer than the way to the target."""
    values = {"Ego_InitSpeed_Ve0_kph": kmh, "TargetBlocking_InitPosition_LongitudinalOffset_m": ahead_m}
    played, numbers = play(number, values)
    v = ego_at_speed(played, numbers)
    left = numbers.get("TargetBlocking_InitPosition_LateralOffset_m", 0.0)
    x, y, _, speed = played.of("TargetBlocking")
    np.testing.assert_allclose((x, y, speed), np.array([[ahead_m], [middle_m(-4) + left], [0.0]]) + 0 * x)
    by_name = {e.name: e for e in played.engine.definition.entities}
    clear = abs(left) - 0.5 * (by_name["Ego"].width_m + by_name["TargetBlocking"].width_m)
    if clear > 0:
        assert played.run.contact_time_s is None
    else:
        way = ahead_m - 5 - played.reach_m("Ego")[1] - played.reach_m("TargetBlocking")[0]
        assert played.run.contact_time_s == pytest.approx(way / v, abs=1e-6)
    assert played.run.end_time_s == pytest.approx(ahead_m / v + 10, abs=1e-6)
    if number == "4_2_4":
        assert played.of("TargetBlocking2")[0][-1] == pytest.approx(ahead_m + 15)


@pytest.mark.parametrize(
    ("kmh", "walk_kmh", "side_m"), [(60.0, 5.0, -5.0), (50.0, 8.0, -4.0), (30.0, 5.0, -3.0)]
)
def test_a_pedestrian_who_crosses(play, kmh, walk_kmh, side_m):
    """Once the free space along the road is what it takes to the middle of the lane, at its speed across."""
    played, numbers = play(
        "4_2_3",
        {
            "Ego_InitSpeed_Ve0_kph": kmh,
            "TargetBlocking_Speed_kph": walk_kmh,
            "TargetBlocking_InitPosition_LateralOffset_m": side_m,
        },
    )
    v = ego_at_speed(played, numbers)
    takes_s = abs(side_m) / (walk_kmh / 3.6)
    # its outline reaches along the road by its width as it faces it, almost at a right angle
    d = next(e for e in played.engine.definition.entities if e.name == "TargetBlocking")
    heading = numbers["TargetBlocking_InitPosition_Heading_rad"]
    half = 0.5 * (d.length_m * abs(math.cos(heading)) + d.width_m * abs(math.sin(heading)))
    centre = d.center_x_m * math.cos(heading) - d.center_y_m * math.sin(heading)
    along = 500 - 5 + centre - half - played.reach_m("Ego")[1]
    starts_s = along / v - takes_s
    t = played.time_s
    x, y, _, speed = played.of("TargetBlocking")
    expected = middle_m(-4) + np.maximum(side_m + walk_kmh / 3.6 * (t - starts_s), side_m)  # and on
    np.testing.assert_allclose(y, expected, atol=0.02)
    np.testing.assert_allclose(x, 500.0, atol=1e-6)
    walking = (t > starts_s + 0.02) & (t < starts_s + 2 * takes_s - 0.02)
    np.testing.assert_allclose(speed[walking], walk_kmh / 3.6, atol=1e-6)
    assert played.run.end_time_s == pytest.approx(500 / v + 10, abs=1e-6)


@pytest.mark.parametrize(("kmh", "headway_s", "rate"), [(60.0, 1.6, 1.0), (40.0, 2.5, 2.0)])
@pytest.mark.parametrize("number", ["4_3_1", "4_3_2"])
def test_a_lead_vehicle_that_changes_its_speed(play, number, kmh, headway_s, rate):
    """5 m/s faster from 10 s on, then 5 m/s slower than the ego; or down to standstill."""
    values = {"Ego_InitSpeed_Ve0_kph": kmh, "LeadVehicle_Init_HeadwayTime_s": headway_s}
    name = "VaryingSpeed_Rate" if number == "4_3_1" else "Deceleration_Rate"
    values[f"LeadVehicle_{name}_mps2"] = rate
    played, numbers = play(number, values)
    v = ego_at_speed(played, numbers)
    if number == "4_3_1":
        up, down = (numbers[f"LeadVehicle_VaryingSpeed_{s}_Offset_mps"] for s in ("Positive", "Negative"))
        second_s = 10 + up / rate + 10
        changes = ((10.0, rate, v + up), (second_s, rate, v + down))
        end_s = second_s + (up - down) / rate + 20
    else:
        changes = ((10.0, rate, 0.0),)
        end_s = 10 + v / rate + 10
    way, speed = ramp(played.time_s, *changes, v0=v)
    x, y, _, speeds = played.of("LeadVehicle")
    start = 5 + headway_s * v + played.reach_m("Ego")[1] + played.reach_m("LeadVehicle")[0]
    np.testing.assert_allclose(x, start + way, atol=1e-6)
    np.testing.assert_allclose(speeds, speed, atol=1e-6)
    np.testing.assert_allclose(y, middle_m(-4) + numbers["LeadVehicle_Init_LateralOffset_m"], atol=1e-9)
    assert played.run.end_time_s == pytest.approx(end_s, abs=1e-6)


@pytest.mark.parametrize("number", ["4_4_1", "4_4_2"])
@pytest.mark.parametrize(
    ("kmh", "relative_kmh", "trigger_m", "rate"), [(60.0, -20.0, 20.0, 1.5), (50.0, -10.0, 30.0, 1.0)]
)
def test_a_vehicle_that_cuts_in(play, number, kmh, relative_kmh, trigger_m, rate):
    """Sinusoidal with a greatest speed across: pi / 2 x 3.5 m / that; 10 s after it the end."""
    played, numbers = play(
        number,
        {
            "Ego_InitSpeed_Ve0_kph": kmh,
            "CutInVehicle_RelativeInitSpeed_Ve0_Vo0_kph": relative_kmh,
            "CutInVehicle_HeadwayDistanceTrigger_dx0_m": trigger_m,
            "CutInVehicle_LaneChange_MaxLateralVelocity_Vy_mps": rate,
        },
    )
    v = ego_at_speed(played, numbers)
    t, closing = played.time_s, -relative_kmh / 3.6
    side = numbers["CutInVehicle_InitPosition_RelativeLaneId"]
    start_m = 5 + trigger_m + 10 * closing
    free_m = start_m - 5 - played.reach_m("Ego")[1] - played.reach_m("CutInVehicle")[0]
    starts_s = max((free_m - trigger_m) / closing, 0.0)
    length_s = math.pi / 2 * LANE_M / rate
    share = np.clip((t - starts_s) / length_s, 0, 1)
    x, y, _, speed = played.of("CutInVehicle")
    np.testing.assert_allclose(
        y, middle_m(-4 + side) - side * LANE_M * 0.5 * (1 - np.cos(np.pi * share)), atol=2e-3
    )
    acceleration = numbers["CutInVehicle_Acceleration_Rate_mps2"]
    if acceleration == 0.0:
        np.testing.assert_allclose(speed, v - closing, atol=1e-9)
    else:
        goal = numbers["CutInVehicle_Acceleration_Target_kph"] / 3.6
        _, expected = ramp(t, (starts_s, abs(acceleration), goal), v0=v - closing)
        np.testing.assert_allclose(speed, expected, atol=1e-6)
    before = t <= starts_s
    np.testing.assert_allclose(x[before], start_m + (v - closing) * t[before], atol=1e-6)
    assert played.run.end_time_s == pytest.approx(starts_s + length_s + 10, abs=2e-3)


@pytest.mark.parametrize("number", ["4_5_1", "4_5_2"])
@pytest.mark.parametrize(("kmh", "side", "before_m", "rate"), [(60.0, 1, 50.0, 2.0), (40.0, -1, 30.0, 1.5)])
def test_a_vehicle_that_cuts_out(play, number, kmh, side, before_m, rate):
    """So far of free space before the target it changes lanes; the ego goes on into the target."""
    played, numbers = play(
        number,
        {
            "Ego_InitSpeed_Ve0_kph": kmh,
            "CutOutVehicle_RelativeTargetLane": side,
            "FrontOfLead_Distance_dx0_f_m": before_m,
            "CutOutVehicle_LaneChange_MaxLateralVelocity_Vy_mps": rate,
        },
    )
    v = ego_at_speed(played, numbers)
    t = played.time_s
    start_m = 5 + 2 * v + played.reach_m("Ego")[1] + played.reach_m("LeadVehicle")[0]
    free_m = 500 - start_m - played.reach_m("LeadVehicle")[1] - played.reach_m("TargetBlocking")[0]
    starts_s, length_s = (free_m - before_m) / v, math.pi / 2 * LANE_M / rate
    share = np.clip((t - starts_s) / length_s, 0, 1)
    _, y, _, speed = played.of("LeadVehicle")
    np.testing.assert_allclose(y, middle_m(-4) + side * LANE_M * 0.5 * (1 - np.cos(np.pi * share)), atol=2e-3)
    np.testing.assert_allclose(speed, v, atol=1e-9)
    way = 500 - 5 - played.reach_m("Ego")[1] - played.reach_m("TargetBlocking")[0]
    assert played.run.contact_time_s == pytest.approx(way / v, abs=1e-6)


@pytest.mark.parametrize(("kmh", "side", "limit"), [(60.0, -1, 0.1), (40.0, 1, 0.2)])
def test_a_motorbike_that_comes_closer(play, kmh, side, limit):
    """From 7 m beside to 1.75 m beside the ego, sinusoidal within the acceleration."""
    played, numbers = play(
        "4_6_2",
        {
            "Ego_InitSpeed_Ve0_kph": kmh,
            "SideVehicle_InitLateralOffset_m": 7 * side,
            "SideVehicle_FinalLateralOffset_m": 1.75 * side,
            "Swerve_MaxLateralAcc_mps2": limit,
        },
    )
    v = ego_at_speed(played, numbers)
    t = played.time_s
    length_s = math.pi * math.sqrt(5.25 / (2 * limit))
    share = np.clip((t - 10) / length_s, 0, 1)
    _, y, _, speed = played.of("SideVehicle")
    expected = middle_m(-4) + side * (7 - 5.25 * 0.5 * (1 - np.cos(np.pi * share)))
    np.testing.assert_allclose(y, expected, atol=2e-3)
    np.testing.assert_allclose(speed, v, atol=1e-9)
