"""Sensor model: what is seen, what is hidden, and the statistics of its errors."""

import math

import numpy as np
import pytest
from scipy.stats import binom, chi2

from scenarios.errors import ScenarioError
from scenarios.sensors.boxes import SensorConfig, visible_share
from scenarios.sensors.sensor import Sensor
from smartmot.geometry import corners, wrap_angle
from smartmot.types import Boxes, EgoState, FloatArray, StrArray

EGO = EgoState(0.0, 0.0, 0.0, 0.0, 10.0)
EXACT = {"position_sigma_m": 0.0, "min_visible": 0.0}


def boxes(*rows: tuple[float, ...]) -> Boxes:
    """(x, y, length, width, yaw) each."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 5)
    return Boxes(table[:, :2], table[:, 2:4], table[:, 4])


def people(*places: tuple[float, float]) -> tuple[Boxes, StrArray]:
    return boxes(*((x, y, 0.6, 0.5, 0.0) for x, y in places)), np.full(len(places), "pedestrian")


def seen_x(config: SensorConfig, ego: EgoState, scene: tuple[Boxes, StrArray]) -> list[float]:
    return [float(x) for x in Sensor(config, 0).observe(0, ego, *scene).boxes.center_m[:, 0]]


def test_range_ends_at_the_range() -> None:
    scene = people((69.99, 0.0), (70.01, 30.0), (-69.0, 0.0))
    assert seen_x(SensorConfig(range_m=70.0, **EXACT), EGO, scene) == [69.99, -69.0]


def test_nobody_in_range_is_a_frame_without_detections() -> None:
    frame = Sensor(SensorConfig(range_m=70.0), 0).observe(
        3, EgoState(1.5, 0.0, 0.0, 0.0, 10.0), *people((99, 0))
    )
    assert (frame.stamp_s, len(frame)) == (1.5, 0)


def test_the_error_of_an_object_does_not_depend_on_who_else_is_seen() -> None:
    sensor = Sensor(SensorConfig(range_m=70.0, min_visible=0.0), 5)
    near, both = people((99.0, 0.0), (20.0, 5.0)), people((9.0, 0.0), (20.0, 5.0))
    for number in range(5):
        alone, together = sensor.observe(number, EGO, *near), sensor.observe(number, EGO, *both)
        np.testing.assert_array_equal(alone.boxes.center_m[0], together.boxes.center_m[1])


def test_field_of_view_is_symmetric_about_the_heading() -> None:
    config = SensorConfig(fov_rad=np.radians(90.0), **EXACT)
    scene = people(*((20 * math.cos(a), 20 * math.sin(a)) for a in np.radians([-44, 44, -46, 46, 180])))
    assert len(seen_x(config, EGO, scene)) == 2
    turned = EgoState(0.0, 0.0, 0.0, math.pi, 10.0)
    assert len(seen_x(config, turned, scene)) == 1


def test_ideal_sensor_reports_the_truth() -> None:
    truth = boxes((10.0, 3.0, 4.4, 1.8, 0.4), (20.0, -8.0, 0.6, 0.5, -2.0))
    seen = Sensor(SensorConfig(position_sigma_m=0.0), 3).observe(
        7, EGO, truth, np.array(["car", "pedestrian"])
    )
    assert np.array_equal(seen.boxes.center_m, truth.center_m)
    assert np.array_equal(seen.boxes.size_m, truth.size_m)
    assert seen.boxes.yaw_rad == pytest.approx(truth.yaw_rad)
    assert seen.category.tolist() == ["car", "pedestrian"]
    assert seen.stamp_s == EGO.stamp_s


def test_a_car_hides_the_pedestrian_behind_it() -> None:
    car = (15.0, 0.0, 4.4, 1.8, math.pi / 2)
    share = visible_share(boxes(car, (20.0, 0.0, 0.6, 0.5, 0.0)), 0.0, 0.0)
    assert share.tolist() == [1.0, 0.0]


def test_a_pedestrian_does_not_hide_the_car_behind_it() -> None:
    share = visible_share(boxes((15.0, 0.0, 4.4, 1.8, math.pi / 2), (8.0, 0.0, 0.6, 0.5, 0.0)), 0.0, 0.0)
    assert share[1] == 1.0
    assert 0.5 < share[0] < 1.0


@pytest.mark.parametrize("edge_m", np.linspace(-0.8, 0.8, 9).tolist())
def test_partly_hidden_share_is_the_share_of_the_width(edge_m: float) -> None:
    """Two flat boards one behind the other: the share is that of the far board beyond the near one's edge."""
    near, far = 10.0, 20.0
    # the near board reaches from the far left to a point that, seen from the origin, cuts the far one at edge
    tip = edge_m * near / far
    flat = 1e-6
    scene = boxes((near, (tip + 4.0) / 2, flat, 4.0 - tip, 0.0), (far, 0.0, flat, 2.0, 0.0))
    expected = (edge_m + 1.0) / 2
    share = visible_share(scene, 0.0, 0.0)[1]
    assert share == pytest.approx(expected, abs=0.5 / 9 + 0.005)  # nine rays


def test_too_little_to_see_is_not_seen() -> None:
    scene = boxes((10.0, 2.0, 0.1, 4.4, 0.0), (20.0, -0.4, 0.5, 0.6, 0.0))  # half of the person is covered
    category = np.array(["car", "pedestrian"])
    share = visible_share(scene, 0.0, 0.0)[1]
    assert 0.0 < share < 1.0
    for least, count in ((share - 0.05, 2), (share + 0.05, 1)):
        seen = Sensor(SensorConfig(min_visible=float(least)), 0).observe(0, EGO, scene, category)
        assert len(seen) == count


def test_occlusion_does_not_depend_on_where_and_how_the_world_lies() -> None:
    rng = np.random.default_rng(5)
    table = np.column_stack(
        (rng.uniform(-40, 40, (30, 2)), rng.uniform(0.5, 4.5, (30, 2)), rng.uniform(-3, 3, 30))
    )
    shares = visible_share(boxes(*table), 0.0, 0.0)
    assert 0.0 in shares
    assert 1.0 in shares
    turn = 2.2
    c, s = math.cos(turn), math.sin(turn)
    moved = table.copy()
    moved[:, :2] = table[:, :2] @ np.array([[c, s], [-s, c]]) + (100.0, -50.0)
    moved[:, 4] += turn
    assert visible_share(boxes(*moved), 100.0, -50.0) == pytest.approx(shares)


def observed(config: SensorConfig, frames: int, seed: int = 1) -> tuple[FloatArray, FloatArray]:
    """Errors of the centres and headings of one object over many frames."""
    sensor, truth = Sensor(config, seed), boxes((12.0, 4.0, 0.6, 0.5, 0.5))
    seen = [sensor.observe(k, EGO, truth, np.array(["pedestrian"])).boxes for k in range(frames)]
    centers = np.concatenate([b.center_m for b in seen]) - truth.center_m
    return centers, np.concatenate([b.yaw_rad for b in seen]) - truth.yaw_rad


def test_noise_has_the_stated_deviation_and_no_bias() -> None:
    n = 1500
    centers, yaw = observed(SensorConfig(position_sigma_m=0.05, yaw_sigma_rad=0.02), n)
    low, high = chi2.ppf([0.0005, 0.9995], 2 * n)
    assert low < (centers**2).sum() / 0.05**2 < high
    low, high = chi2.ppf([0.0005, 0.9995], n)
    assert low < (yaw**2).sum() / 0.02**2 < high
    assert np.abs(centers.mean(axis=0)).max() < 3.5 * 0.05 / math.sqrt(n)
    assert abs(np.corrcoef(centers.T)[0, 1]) < 3.5 / math.sqrt(n)
    assert abs(np.corrcoef(centers[:-1, 0], centers[1:, 0])[0, 1]) < 3.5 / math.sqrt(n)


def test_detection_probability_is_a_frequency() -> None:
    n = 1500
    found = len(observed(SensorConfig(detection_probability=0.8), n)[0])
    low, high = binom.ppf([0.0005, 0.9995], n, 0.8)
    assert low <= found <= high
    assert len(observed(SensorConfig(detection_probability=0.0), 20)[0]) == 0
    assert len(observed(SensorConfig(detection_probability=1.0), 20)[0]) == 20


def test_noise_follows_from_seed_and_frame_alone() -> None:
    scene = people((10.0, 2.0), (15.0, -3.0), (30.0, -1.0))
    here, there = EGO, EgoState(0.0, 1.2345678, 0.3, 0.1, 2.0)

    def noise(seed: int, frame: int, ego: EgoState) -> FloatArray:
        return Sensor(SensorConfig(), seed).observe(frame, ego, *scene).boxes.center_m

    assert np.array_equal(noise(4, 9, here), noise(4, 9, there))
    assert not np.array_equal(noise(4, 9, here), noise(5, 9, here))
    assert not np.array_equal(noise(4, 9, here), noise(4, 10, here))


def test_noise_of_an_object_does_not_change_when_another_is_out_of_sight() -> None:
    near, far = people((10.0, 2.0), (30.0, 5.0)), SensorConfig(range_m=20.0)
    both = Sensor(SensorConfig(), 2).observe(3, EGO, *near).boxes.center_m
    first = Sensor(far, 2).observe(3, EGO, *near).boxes.center_m
    assert np.array_equal(first, both[:1])


def test_nothing_there_nothing_seen() -> None:
    seen = Sensor(SensorConfig(), 0).observe(0, EGO, Boxes.empty(), np.zeros(0, dtype=np.str_))
    assert len(seen) == 0


@pytest.mark.parametrize(
    "wrong",
    [
        {"range_m": 0.0},
        {"rate_hz": 0.0},
        {"fov_rad": 0.0},
        {"fov_rad": 7.0},
        {"position_sigma_m": -0.1},
        {"yaw_sigma_rad": -0.1},
        {"latency_s": -0.1},
        {"detection_probability": 1.1},
        {"detection_probability": -0.1},
        {"min_visible": 2.0},
    ],
)
def test_impossible_sensors_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ScenarioError, match="sensor:"):
        SensorConfig(**wrong)


def test_whoever_hides_a_ray_is_found_among_many() -> None:
    """Ray by ray, whichever boxes are nearer: the definition in its plainest form."""
    rng = np.random.default_rng(5)
    for _ in range(20):
        table = np.column_stack(
            (rng.uniform(-30.0, 30.0, (40, 2)), rng.uniform(0.3, 12.0, (40, 2)), rng.uniform(-4.0, 4.0, 40))
        )
        scene = boxes(*map(tuple, table))
        share = visible_share(scene, 1.0, -2.0)
        delta = scene.center_m - (1.0, -2.0)
        corner = corners(scene.center_m, scene.size_m, scene.yaw_rad) - (1.0, -2.0)
        bearing = np.arctan2(delta[:, 1], delta[:, 0])
        spread = wrap_angle(np.arctan2(corner[..., 1], corner[..., 0]) - bearing[:, None])
        for i in range(40):
            seen = 0
            for k in range(9):
                ray = bearing[i] + spread[i].min() + np.ptp(spread[i]) * (k + 0.5) / 9
                off = wrap_angle(ray - bearing)
                nearer = np.hypot(*delta.T) < np.hypot(*delta[i]) - 1e-9
                seen += not (nearer & (off >= spread.min(axis=1)) & (off <= spread.max(axis=1))).any()
            assert share[i] == pytest.approx(seen / 9)
