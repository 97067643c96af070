"""Errors of detections against closed forms and against what was measured of a detector."""

import copy
import itertools
import math
import pickle
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from scenarios.errors import ScenarioError
from scenarios.sensors import (
    BoxDetector,
    BoxErrors,
    BoxSensor,
    Sensor,
    SensorConfig,
    SensorErrors,
    Tail,
    World,
)
from scenarios.sensors.boxes import BoxMeasurement
from scenarios.sensors.errors import GAUSSIAN, NO_GHOSTS, per_category
from scenarios.sensors.measured_errors import REAL_ERRORS
from scenarios.sensors.process import ErrorProcess
from smartmot.filters.motion_models import PerCategory
from smartmot.types import CATEGORIES, Boxes, EgoState, FloatArray

EGO = EgoState(0.0, 0.0, 0.0, 0.0, 10.0)
SEEN = {0: 1.0, 1: 0.7, 2: 0.3}
"""Visible shares of the three levels of occlusion."""


def around(count: int, range_m: float, category: str) -> tuple[Boxes, np.ndarray]:
    """Objects on a circle about the ego."""
    bearing = np.linspace(-3.0, 3.0, count)
    center = range_m * np.column_stack((np.cos(bearing), np.sin(bearing)))
    return Boxes(center, np.tile((0.6, 0.5), (count, 1)), np.full(count, 0.5)), np.full(count, category)


@dataclass
class Seen:
    """What became of N objects in K frames: (K, N), errors NaN where an object was missed."""

    missed: np.ndarray
    radial_m: FloatArray
    tangential_m: FloatArray
    yaw_rad: FloatArray
    width: FloatArray
    length: FloatArray
    category: np.ndarray


def seen(
    config: SensorConfig, range_m: float = 150.0, category: str = "pedestrian", level: int = 0,
    objects: int = 150, frames: int = 200,
) -> Seen:  # fmt: skip
    """Many frames of objects at rest."""
    assert config.errors is not None
    config = replace(config, errors=replace(config.errors, ghosts_per_frame=NO_GHOSTS))
    process, (boxes, names) = ErrorProcess(config, 7), around(objects, range_m, category)
    share, visible = np.full(objects, SEEN[level]), np.full(objects, True)
    columns = {name: np.full((frames, objects), np.nan) for name in Seen.__dataclass_fields__}
    reported = np.full((frames, objects), "", dtype="U16")
    sight = boxes.center_m / range_m
    for k in range(frames):
        detections = process.report(BoxMeasurement(k / 10, k, boxes, names, visible, EGO, share))
        # errors are smaller than the distance between two objects
        bearing = np.arctan2(detections.boxes.center_m[:, 1], detections.boxes.center_m[:, 0])
        nearest = np.rint((bearing + 3.0) / 6.0 * (objects - 1)).astype(int)
        error = detections.boxes.center_m - boxes.center_m[nearest]
        along, left = sight[nearest], np.column_stack((-sight[nearest, 1], sight[nearest, 0]))
        columns["radial_m"][k, nearest] = (error * along).sum(axis=1)
        columns["tangential_m"][k, nearest] = (error * left).sum(axis=1)
        columns["yaw_rad"][k, nearest] = np.angle(np.exp(1j * (detections.boxes.yaw_rad - 0.5)))
        columns["length"][k, nearest] = detections.boxes.size_m[:, 0] / 0.6 - 1.0
        columns["width"][k, nearest] = detections.boxes.size_m[:, 1] / 0.5 - 1.0
        reported[k, nearest] = detections.category
    columns["missed"], columns["category"] = np.isnan(columns["radial_m"]), reported
    return Seen(**columns)


def lag(values: FloatArray, frames: int = 1) -> float:
    """Correlation of values some frames apart."""
    centred = values - np.nanmean(values)
    return float(np.nanmean(centred[frames:] * centred[:-frames]) / np.nanmean(centred**2))


def after(missed: np.ndarray) -> tuple[float, float]:
    """P(miss | hit) and P(miss | miss)."""
    return float(missed[1:][~missed[:-1]].mean()), float(missed[1:][missed[:-1]].mean())


def plain(**changes: object) -> SensorConfig:
    """A sensor at 10 Hz with errors in one row."""
    beside = {name: changes.pop(name) for name in list(changes) if name in SensorErrors.__dataclass_fields__}
    errors = SensorErrors(rows=(BoxErrors(**changes),), **beside)  # type: ignore[arg-type]
    return SensorConfig(rate_hz=10.0, errors=errors)


# The mixture


@pytest.mark.parametrize("tail", [Tail(0.2, 2.5, 0.9), Tail(0.015, 21.0, 0.9), Tail(0.5, 1.5), GAUSSIAN])
def test_errors_have_the_distribution_of_the_mixture(tail: Tail) -> None:
    """Of the standard deviation that was asked for, at any persistence of its wider part."""
    core, share = 0.13 * tail.core_sigma, tail.share
    wide = core * tail.ratio
    assert (1 - share) * core**2 + share * wide**2 == pytest.approx(0.13**2)
    config = plain(radial_sigma_m=0.13, tangential_sigma_m=0.13, position_tail=tail)
    sample = seen(config, range_m=1000.0, frames=3000)  # so far away that nobody is taken for another
    for errors in (sample.radial_m, sample.tangential_m):
        assert errors.std() == pytest.approx(0.13, rel=0.05)
        for limit in (0.05, 0.1, 0.2, 0.4):
            beyond = 2 * ((1 - share) * norm.sf(limit / core) + share * norm.sf(limit / wide))
            assert (np.abs(errors) > limit).mean() == pytest.approx(beyond, rel=0.1)


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 20.0])
def test_gross_errors_last_as_long_at_any_rate(rate_hz: float) -> None:
    """Share p and persistence c at 0.1 s; that wide a tail has hardly an error in the core's reach."""
    p, c = 0.1, 0.8
    config = plain(radial_sigma_m=1.0, tangential_sigma_m=0.0, position_tail=Tail(p, 1e6, c))
    gross = np.abs(seen(replace(config, rate_hz=rate_hz), frames=1500).radial_m) > 1e-4
    kept = c ** (10.0 / rate_hz)
    assert gross.mean() == pytest.approx(p, rel=0.05)
    assert after(gross) == pytest.approx((p * (1 - kept), p + (1 - p) * kept), rel=0.05)


# Correlation in time


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 20.0, 50.0])
def test_correlation_belongs_to_time_not_to_frames(rate_hz: float) -> None:
    config = replace(plain(position_correlation_s=0.25, heading_correlation_s=0.5), rate_hz=rate_hz)
    sample = seen(replace(config, position_sigma_m=0.1, yaw_sigma_rad=0.05), frames=300)
    for frames in (1, 2):
        assert lag(sample.radial_m, frames) == pytest.approx(math.exp(-frames / rate_hz / 0.25), abs=0.03)
        assert lag(sample.tangential_m, frames) == pytest.approx(math.exp(-frames / rate_hz / 0.25), abs=0.03)
        assert lag(sample.yaw_rad, frames) == pytest.approx(math.exp(-frames / rate_hz / 0.5), abs=0.03)
    assert sample.radial_m.std() == pytest.approx(0.1, rel=0.03)
    assert abs(np.corrcoef(sample.radial_m.ravel(), sample.tangential_m.ravel())[0, 1]) < 0.03


def test_errors_are_stationary_from_the_first_frame_on() -> None:
    config = replace(plain(position_correlation_s=10.0), position_sigma_m=0.1)
    first = [seen(config, objects=150, frames=2).radial_m[k] for k in (0, 1)]
    for errors in first:
        assert errors.std() == pytest.approx(0.1, rel=0.12)
    assert np.corrcoef(*first)[0, 1] == pytest.approx(math.exp(-0.01), abs=0.01)


def test_along_and_across_the_line_of_sight() -> None:
    sample = seen(plain(radial_bias_m=0.4, radial_sigma_m=0.2, tangential_sigma_m=0.02))
    assert sample.radial_m.mean() == pytest.approx(0.4, abs=0.01)
    assert sample.radial_m.std() == pytest.approx(0.2, rel=0.05)
    assert sample.tangential_m.mean() == pytest.approx(0.0, abs=0.001)
    assert sample.tangential_m.std() == pytest.approx(0.02, rel=0.05)


# Headings, sizes, categories, velocities


def test_headings_flip_with_their_probability_and_stay_so() -> None:
    sample = seen(plain(flip=0.1, heading_correlation_s=0.3), frames=400)
    flipped = np.abs(sample.yaw_rad) > np.pi / 2
    assert flipped.mean() == pytest.approx(0.1, rel=0.06)
    assert np.abs(np.abs(sample.yaw_rad[flipped]) - np.pi).max() < 1e-9
    # two deviates with this correlation, both under the decile: integral of their density over correlations
    z, rho = norm.ppf(0.1), np.linspace(0.0, math.exp(-0.1 / 0.3), 2001)
    density = np.exp(-(z**2) / (1.0 + rho)) / (2.0 * np.pi * np.sqrt(1.0 - rho**2))
    both = 0.01 + np.trapezoid(density, rho)
    assert flipped[1:][flipped[:-1]].mean() == pytest.approx(both / 0.1, rel=0.05)


def test_sizes() -> None:
    sample = seen(plain(length_bias=0.1, length_sigma=0.05, width_bias=-0.2, width_sigma=0.02))
    assert (sample.length.mean(), sample.length.std()) == pytest.approx((0.1, 0.05), rel=0.05)
    assert (sample.width.mean(), sample.width.std()) == pytest.approx((-0.2, 0.02), rel=0.05)
    assert seen(plain(length_sigma=3.0), frames=50).length.min() == pytest.approx(0.2 - 1.0)


@pytest.mark.parametrize(
    ("category", "other"), [("pedestrian", "cyclist"), ("car", "truck"), ("truck", "car")]
)
def test_categories_are_confused(category: str, other: str) -> None:
    sample = seen(plain(confusion=0.2), category=category)
    assert (sample.category == other).mean() == pytest.approx(0.2, rel=0.05)
    assert set(np.unique(sample.category).tolist()) == {category, other}


def moving(count: int, time_s: float = 0.0, range_m: float = 10.0) -> World:
    """Pedestrians at 1.5 m/s along their headings of 0.5 rad."""
    boxes, names = around(count, range_m, "pedestrian")
    speed, there = np.full(count, 1.5), np.full(count, True)
    return World(time_s, boxes, speed, np.full(count, 1.8), np.arange(count), names, there, there)


def test_velocities_are_reported_with_noise_or_not_at_all() -> None:
    world = moving(30)
    for sigma in (None, 0.25):
        config = SensorConfig(rate_hz=10.0, min_visible=0.0, errors=SensorErrors(velocity_sigma_mps=sigma))
        sensor, detector = BoxSensor(config), BoxDetector(config, 3)
        frames = [
            detector.detect(sensor.measure(replace(world, time_s=k / 10), replace(EGO, stamp_s=k / 10)))
            for k in range(300)
        ]
        if sigma is None:
            assert all(frame.velocity_mps is None for frame in frames)
            continue
        errors = np.stack([frame.velocity_mps for frame in frames]) - 1.5 * np.array(
            [math.cos(0.5), math.sin(0.5)]
        )
        assert errors.std(axis=(0, 1)) == pytest.approx([sigma, sigma], rel=0.05)
        assert np.abs(errors.mean(axis=(0, 1))).max() < 0.01


# Misses


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 20.0])
def test_misses_come_in_runs_of_the_right_length(rate_hz: float) -> None:
    """Rate p and correlation c at 0.1 s: P(miss | hit) = p (1 - c^n), n tenths of a second apart."""
    p, c = 0.3, 0.6
    sample = seen(replace(plain(miss=(p, p, p), miss_persistence=(c, c, c)), rate_hz=rate_hz), frames=500)
    kept = c ** (10.0 / rate_hz)
    assert sample.missed.mean() == pytest.approx(p, rel=0.03)
    assert after(sample.missed) == pytest.approx((p * (1 - kept), p + (1 - p) * kept), rel=0.04)
    runs = [
        len(run) for column in sample.missed.T for run in "".join("x" if m else " " for m in column).split()
    ]
    assert np.mean(runs) == pytest.approx(1.0 / ((1 - p) * (1 - kept)), rel=0.05)  # geometric


def test_a_sensor_without_rates_of_its_own_misses_as_it_says() -> None:
    sample = seen(replace(plain(miss_persistence=(0.5, 0.5, 0.5)), detection_probability=0.8), frames=400)
    assert sample.missed.mean() == pytest.approx(0.2, rel=0.04)
    assert after(sample.missed) == pytest.approx((0.1, 0.6), rel=0.05)


def test_the_frame_before_is_forgotten_where_the_random_number_decides() -> None:
    """Runs that saw an object at different ranges miss the same frames soon after it is at the same."""
    near, far = (
        BoxErrors(up_to_m=20.0, miss=(0.2, 0.2, 0.2), miss_persistence=(0.7, 0.7, 0.7)),
        BoxErrors(miss=(0.8, 0.8, 0.8), miss_persistence=(0.7, 0.7, 0.7)),
    )
    config = SensorConfig(rate_hz=10.0, min_visible=0.0, errors=SensorErrors(rows=(near, far)))
    histories = []
    for start_m in (10.0, 40.0):
        sensor, history = Sensor(config, 1), []
        for k in range(120):
            boxes, names = around(20, start_m if k < 60 else 10.0, "pedestrian")
            history.append(len(sensor.observe(k, EGO, boxes, names)))
        histories.append(history)
    assert histories[0][:60] != histories[1][:60]
    assert histories[0][90:] == histories[1][90:]  # P(not yet forgotten) = 20 x 0.7^30 = 5e-4


# The measured set


def rows() -> list[tuple[str, float, tuple[float, ...], float, float, float]]:
    """Category, range, P(detected) by occlusion, radial and tangential sd, P(flip), as they were measured."""
    return [
        ("car", 15.0, (1.00, 1.00, 0.99), 0.09, 0.08, 0.004),
        ("car", 25.0, (1.00, 0.96, 0.90), 0.12, 0.08, 0.003),
        ("car", 35.0, (0.96, 0.82, 0.77), 0.15, 0.09, 0.02),
        ("car", 50.0, (0.86, 0.68, 0.46), 0.21, 0.11, 0.04),
        ("pedestrian", 5.0, (0.96, 0.87, 0.44), 0.13, 0.11, 0.02),
        ("pedestrian", 15.0, (0.92, 0.69, 0.34), 0.14, 0.15, 0.03),
        ("pedestrian", 25.0, (0.66, 0.42, 0.20), 0.13, 0.11, 0.05),
        ("cyclist", 15.0, (1.00, 0.68, 0.22), 0.04, 0.03, 0.0),
    ]


REAL = SensorConfig(rate_hz=10.0, errors=REAL_ERRORS)


@pytest.mark.parametrize(("category", "range_m", "detected", "radial", "tangential", "flip"), rows())
def test_the_measured_table_comes_out(
    category: str, range_m: float, detected: tuple[float, ...], radial: float, tangential: float, flip: float
) -> None:
    # gross errors of pedestrians are rare, and last: many measurements tell their deviation
    objects = max(int(1.2 * range_m), 10)  # 5 m apart, that errors do not take one for another
    sample = seen(
        REAL,
        range_m,
        category,
        objects=objects,
        frames=(150000 if category == "pedestrian" else 15000) // objects,
    )
    assert 1.0 - sample.missed.mean() == pytest.approx(detected[0], abs=0.015)
    assert np.nanstd(sample.radial_m) == pytest.approx(radial, rel=0.1)
    assert np.nanstd(sample.tangential_m) == pytest.approx(tangential, rel=0.1)
    assert (np.abs(sample.yaw_rad) > np.pi / 2).sum() / (~sample.missed).sum() == pytest.approx(
        flip, abs=0.005
    )
    for level in (1, 2):
        hidden = seen(REAL, range_m, category, level, objects=10, frames=500)
        assert 1.0 - hidden.missed.mean() == pytest.approx(detected[level], abs=0.03)


@pytest.mark.parametrize(
    ("category", "range_m", "level", "measured"),
    [
        ("pedestrian", 15.0, 0, (0.04, 0.43)), ("pedestrian", 25.0, 0, (0.11, 0.76)),
        ("pedestrian", 15.0, 1, (0.12, 0.70)), ("pedestrian", 15.0, 2, (0.32, 0.86)),
    ],
)  # fmt: skip
def test_misses_follow_one_another_as_measured(
    category: str, range_m: float, level: int, measured: tuple[float, float]
) -> None:
    assert after(seen(REAL, range_m, category, level, objects=10, frames=1000).missed) == pytest.approx(
        measured, abs=0.04
    )


@pytest.mark.parametrize(
    ("category", "range_m", "median_deg", "p90_deg"),
    [("car", 15.0, 0.7, 2.2), ("car", 25.0, 1.0, 2.5), ("pedestrian", 5.0, 6.0, 20.0),
     ("pedestrian", 15.0, 5.5, 18.0), ("pedestrian", 25.0, 4.0, 12.0), ("cyclist", 15.0, 1.6, 4.1)],
)  # fmt: skip
def test_headings_are_as_far_off_as_measured(
    category: str, range_m: float, median_deg: float, p90_deg: float
) -> None:
    yaw = seen(REAL, range_m, category, objects=10, frames=700).yaw_rad
    folded = np.degrees(np.abs(np.angle(np.exp(2j * yaw[~np.isnan(yaw)])) / 2))
    assert np.median(folded) == pytest.approx(median_deg, rel=0.07)
    assert np.quantile(folded, 0.9) == pytest.approx(p90_deg, rel=0.15)


def test_positions_are_correlated_as_measured() -> None:
    """0.6 to 0.7 at 0.1 s, of pedestrians with and without gross errors; 95 % under 0.10 to 0.12 m."""
    assert 0.6 < lag(seen(REAL, 25.0, "car", objects=20, frames=400).radial_m) < 0.7
    sample = seen(REAL, 15.0, "pedestrian", objects=20, frames=3000)
    for errors in (sample.radial_m, sample.tangential_m):
        assert 0.55 < lag(np.clip(errors, -0.3, 0.3)) < 0.7
        assert 0.5 < lag(errors) < 0.73
    assert 0.095 < np.nanquantile(np.abs(sample.radial_m - np.nanmean(sample.radial_m)), 0.95) < 0.125


def test_gross_errors_of_pedestrians_are_as_many_as_measured_and_last() -> None:
    """Over 0.3 m: 37 of 2,541 along and 27 across at 10 to 20 m; 70 and 59 % of them again in the next."""
    sample = seen(REAL, 15.0, "pedestrian", objects=18, frames=5600)
    for errors, share in ((sample.radial_m, 37 / 2541), (sample.tangential_m, 27 / 2541)):
        gross, known = np.abs(errors) > 0.3, ~np.isnan(errors)
        assert gross.sum() / known.sum() == pytest.approx(share, abs=0.006)
        assert gross[1:][gross[:-1] & known[1:]].mean() == pytest.approx(0.65, abs=0.08)


def test_out_of_the_measured_ranges_nobody_is_reported() -> None:
    for category, range_m in (("pedestrian", 41.0), ("cyclist", 41.0), ("car", 61.0)):
        assert seen(REAL, range_m, category, objects=20, frames=5).missed.all()
        assert not seen(REAL, range_m - 2.0, category, objects=20, frames=50).missed.all()


# Ghosts


def ghosts(config: SensorConfig, frames: int, ego: EgoState = EGO) -> list[np.ndarray]:
    """(G, 4) category, place and heading of the ghosts of each frame."""
    sensor, nothing = Sensor(config, 5), np.zeros(0, dtype="U10")
    made = [sensor.observe(k, ego, Boxes.empty(), nothing) for k in range(frames)]
    return [
        np.column_stack(([CATEGORIES.index(name) for name in d.category], d.boxes.center_m, d.boxes.yaw_rad))
        if len(d) else np.zeros((0, 4))
        for d in made
    ]  # fmt: skip


def test_ghosts_are_as_many_as_measured_and_where() -> None:
    turned = EgoState(0.0, 100.0, -50.0, 2.0, 10.0)
    frames = ghosts(REAL, 15000, turned)
    every = np.concatenate(frames)
    code = every[:, 0].astype(int)
    for name, rate, median_m in (("car", 0.156, 35.0), ("pedestrian", 0.052, 14.0), ("cyclist", 0.020, 22.0)):
        own = every[code == CATEGORIES.index(name)]
        assert len(own) / len(frames) == pytest.approx(rate, rel=0.12)
        delta = own[:, 1:3] - (100.0, -50.0)
        assert np.median(np.hypot(*delta.T)) == pytest.approx(median_m, rel=0.06)
        # the nearest that were measured, and white noise: none in the ego, whose corners are at 2.4 m
        nearest_m = {"car": 4.2, "pedestrian": 5.0, "cyclist": 3.2}[name]
        assert np.hypot(*delta.T).min() > nearest_m - 4.5 * 0.145
        bearing = np.angle(np.exp(1j * (np.arctan2(delta[:, 1], delta[:, 0]) - 2.0)))
        assert np.quantile(np.abs(bearing), 0.99) < math.radians(40.5) + 0.02  # and their white noise
        aside = np.hypot(*delta.T) * np.abs(np.sin(bearing))
        share = {"car": 0.026, "pedestrian": 0.055, "cyclist": 0.20}[name]
        # a third of them live on in the next frame, so that the deviation is that of fewer
        assert (aside < 1.75).mean() == pytest.approx(share, abs=3.0 * math.sqrt(1.5 * share / len(own)))
        assert abs((bearing > 0).mean() - 0.5) < 3.0 / math.sqrt(len(own))
    assert set(code.tolist()) == {0, 1, 2}
    # a third of them has another within 1 m in the next frame
    again = [
        (np.hypot(*(a[:, None, 1:3] - b[None, :, 1:3]).transpose(2, 0, 1)) < 1.0).any(axis=1)
        for a, b in itertools.pairwise(frames)
        if len(a) and len(b)
    ]
    assert sum(a.sum() for a in again) / len(every) == pytest.approx(math.exp(-0.1 / 0.09), abs=0.03)


def test_ghosts_ahead_have_their_share_and_the_others_lie_evenly_beside() -> None:
    view, share, range_m = math.radians(81.0), 0.1, 40.0
    errors = SensorErrors(
        ghosts_per_frame=PerCategory(50.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        ghost_life_s=1e-3,  # all anew in each frame
        ghost_view_rad=view,
        ghost_ahead=PerCategory(share, share, share, share, share, share),
    )
    config = SensorConfig(range_m=range_m, position_sigma_m=0.0, rate_hz=10.0, errors=errors)
    x, y = np.concatenate(ghosts(config, 400))[:, 1:3].T
    far = np.hypot(x, y) > 1.75 / math.sin(view / 2)  # nearer ones have no angle beside
    x, y = x[far], y[far]
    ahead = np.abs(y) < 1.75
    assert abs(ahead.mean() - share) < 3.0 * math.sqrt(share * (1 - share) / len(x))
    edge = np.arcsin(1.75 / np.hypot(x, y))
    beside = ((np.abs(np.arctan2(y, x)) - edge) / (view / 2 - edge))[~ahead]  # uniform in [0, 1]
    assert beside.mean() == pytest.approx(0.5, abs=3.0 / math.sqrt(12 * len(beside)))
    assert beside.var() == pytest.approx(1 / 12, rel=0.05)
    assert abs((y > 0).mean() - 0.5) < 1.5 / math.sqrt(len(y))


@pytest.mark.parametrize("rate_hz", [10.0, 40.0])
def test_ghosts_live_as_long_at_any_rate(rate_hz: float) -> None:
    errors = SensorErrors(ghosts_per_frame=PerCategory(0.0, 1.5, 0.0, 0.0, 0.0, 0.0), ghost_life_s=0.5)
    frames = ghosts(SensorConfig(rate_hz=rate_hz, position_sigma_m=0.0, errors=errors), 2500)
    count = np.array([len(frame) for frame in frames], dtype=float)
    seconds = len(frames) / rate_hz
    # Poisson, with the correlation exp(-t / 0.5 s): the mean of so many seconds has this deviation
    sigma = math.sqrt(1.5 * 2.0 * 0.5 / seconds)
    assert abs(count.mean() - 1.5) < 3.0 * sigma
    assert abs(count.var() - 1.5) < 5.0 * sigma
    assert lag(count) == pytest.approx(math.exp(-1.0 / rate_hz / 0.5), abs=0.03)
    places = np.concatenate(frames)[:, 1:3]
    assert np.hypot(*places.T).max() < 70.0


# Determinism


def flight(sensor: Sensor, start: int, stop: int, count: int = 6) -> list[bytes]:
    """Bytes of detections along a drive past some people."""
    written = []
    for k in range(start, stop):
        boxes, names = around(count, 15.0, "pedestrian")
        frame = sensor.observe(k, EgoState(k / 10, 0.3 * k, 0.0, 0.0, 3.0), boxes, names)
        written.append(
            frame.boxes.center_m.tobytes() + frame.boxes.yaw_rad.tobytes() + frame.category.tobytes()
        )
    return written


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda sensor: pickle.loads(pickle.dumps(sensor))])
def test_a_copy_goes_on_with_the_same_bytes(copied: object) -> None:
    sensor = Sensor(REAL, 11)
    begun = flight(sensor, 0, 20)
    other = copied(sensor)  # type: ignore[operator]
    assert flight(sensor, 20, 60) == flight(other, 20, 60)
    assert begun == flight(Sensor(REAL, 11), 0, 20)
    assert begun != flight(Sensor(REAL, 12), 0, 20)
    assert flight(sensor, 0, 20) == begun  # for a frame before the last, all begins anew


def test_the_error_of_an_object_does_not_depend_on_who_else_is_there() -> None:
    quiet = replace(REAL, errors=replace(REAL_ERRORS, ghosts_per_frame=NO_GHOSTS), min_visible=0.0)
    boxes, names = around(8, 15.0, "pedestrian")
    alone, together = Sensor(quiet, 2), Sensor(quiet, 2)
    differences = 0
    for k in range(60):
        few = alone.observe(k, EGO, boxes[:3], names[:3]).boxes.center_m
        many = together.observe(k, EGO, boxes, names).boxes.center_m
        np.testing.assert_array_equal(few, many[: len(few)])
        differences += len(many) - len(few)
    assert differences > 0


def test_the_error_is_that_of_the_measurement_however_far_away_the_ego_is() -> None:
    """The unit processes stay; what is decided only scales them with the range."""
    config = replace(
        plain(radial_sigma_m=0.1, tangential_sigma_m=0.1, position_correlation_s=0.3), min_visible=0.0
    )
    far = replace(config, errors=config.errors.with_rows(radial_sigma_m=0.4, tangential_sigma_m=0.4))  # type: ignore[union-attr]
    boxes, names = around(1, 15.0, "car")
    one, two = Sensor(config, 4), Sensor(far, 4)
    for k in range(30):
        errors = [s.observe(k, EGO, boxes, names).boxes.center_m - boxes.center_m for s in (one, two)]
        np.testing.assert_allclose(4.0 * errors[0], errors[1], rtol=1e-9)


def test_frames_that_are_left_out_are_passed_through() -> None:
    config = replace(plain(position_correlation_s=1.0), min_visible=0.0)
    boxes, names = around(3, 15.0, "car")
    every, third = Sensor(config, 4), Sensor(config, 4)
    frames = [every.observe(k, EGO, boxes, names).boxes.center_m for k in range(31)]
    for k in range(0, 31, 3):
        np.testing.assert_array_equal(third.observe(k, EGO, boxes, names).boxes.center_m, frames[k])


def test_without_errors_the_bytes_are_those_of_the_plain_noise() -> None:
    """By hand: a stream for each frame, three deviates for each object, then one number for its detection."""
    boxes, names = around(4, 20.0, "pedestrian")
    config = SensorConfig(detection_probability=0.7, yaw_sigma_rad=0.1, min_visible=0.0)
    for k in range(5):
        rng = np.random.default_rng((9, k))
        noise, kept = rng.standard_normal((4, 3)), rng.random(4) < 0.7
        frame = Sensor(config, 9).observe(k, EGO, boxes, names)
        assert frame.boxes.center_m.tobytes() == (boxes.center_m + 0.05 * noise[:, :2])[kept].tobytes()


# The values themselves


@pytest.mark.parametrize(
    "wrong",
    [
        {"categories": ()}, {"categories": ("lorry",)}, {"up_to_m": 0.0}, {"radial_sigma_m": -1.0},
        {"yaw_sigma_rad": math.nan}, {"radial_bias_m": math.inf}, {"width_bias": -1.0}, {"flip": 1.5},
        {"confusion": -0.1}, {"miss": (0.0, 0.0, 2.0)}, {"miss": (0.0, 0.0)},
        {"miss_persistence": (1.0, 0.0, 0.0)},
    ],
)  # fmt: skip
def test_impossible_rows_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ScenarioError, match="sensor errors:"):
        BoxErrors(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"position_correlation_s": -1.0}, {"heading_correlation_s": math.inf}, {"velocity_sigma_mps": -0.1},
        {"ghost_life_s": 0.0}, {"ghosts_per_frame": PerCategory(-1.0, 0.0, 0.0, 0.0, 0.0, 0.0)},
        {"ghost_range_m": PerCategory.grouped(0.0, 1.0, 1.0)}, {"ghost_view_rad": 7.0},
    ],
)  # fmt: skip
def test_impossible_errors_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ScenarioError, match="sensor errors:"):
        SensorErrors(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [(1.0, 2.0), (-0.1, 2.0), (0.1, 0.5), (0.1, math.inf)])
def test_impossible_tails_are_refused(wrong: tuple[float, float]) -> None:
    with pytest.raises(ScenarioError, match="tail"):
        Tail(*wrong)


def test_an_object_has_the_first_row_that_reaches_as_far() -> None:
    near, far, cars = (
        BoxErrors(("pedestrian",), 10.0),
        BoxErrors(("pedestrian",), 30.0),
        BoxErrors(("car",), 5.0),
    )
    errors = SensorErrors(rows=(far, cars, near))
    assert [errors.row_at("pedestrian", r) for r in (0.0, 10.0, 10.1, 30.0, 99.0)] == [
        near,
        near,
        far,
        far,
        far,
    ]
    assert errors.row_at("car", 50.0) == cars
    assert errors.row_at("truck", 50.0) == BoxErrors()
    unseen = SensorErrors(rows=(replace(near, miss=(0.1, 0.2, 0.3)),))
    assert unseen.row_at("pedestrian", 10.1) is None


@settings(max_examples=30, deadline=None)
@given(
    st.floats(0.0, 1.0), st.floats(0.0, 1.0), st.floats(0.0, 0.95), st.floats(0.0, 0.5), st.floats(1.0, 20.0)
)
def test_any_errors_give_boxes_that_perception_takes(
    flip: float, confusion: float, persistence: float, share: float, ratio: float
) -> None:
    row = BoxErrors(
        flip=flip,
        confusion=confusion,
        miss_persistence=(persistence,) * 3,
        position_tail=Tail(share, ratio),
        length_sigma=2.0,
        width_sigma=2.0,
    )
    config = SensorConfig(
        errors=SensorErrors(rows=(row,), ghosts_per_frame=PerCategory(1.0, 1.0, 1.0, 1.0, 1.0, 1.0)),
        detection_probability=0.5,
    )
    boxes, names = around(5, 12.0, "cyclist")
    sensor = Sensor(config, 0)
    for k in range(4):
        frame = sensor.observe(k, EGO, boxes, names)
        checked = Boxes(frame.boxes.center_m, frame.boxes.size_m, frame.boxes.yaw_rad)
        assert (checked.size_m > 0.0).all()
        assert set(frame.category.tolist()) <= set(CATEGORIES)
        assert (frame.score == 1.0).all()


def test_a_measurement_that_does_not_say_what_is_hidden_is_refused() -> None:
    boxes, names = around(2, 12.0, "cyclist")
    bare = BoxMeasurement(0.0, 0, boxes, names, np.full(2, True))
    with pytest.raises(ScenarioError, match="sensor errors: the measurement has no"):
        BoxDetector(REAL, 0).detect(bare)


def test_one_number_where_all_are_equal() -> None:
    assert per_category([0.1] * 6) == 0.1
    assert per_category([0.1, 0.2, 0.1, 0.1, 0.1, 0.1]) == PerCategory(0.1, 0.2, 0.1, 0.1, 0.1, 0.1)
