"""Patterns against the manuals of the sensors and against Snell's law in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest

from scenarios.errors import ScenarioError
from scenarios.sensors.lidar import HDL32, HDL64, MID70, LidarConfig, Mount, Rosette, Spinning, lidar_config
from scenarios.sensors.lidar.patterns import rosette_direction
from smartmot.arrays import FloatArray

HDL32_MANUAL_DEG = (
    -30.67, -29.33, -28.00, -26.66, -25.33, -24.00, -22.67, -21.33, -20.00, -18.67, -17.33, -16.00, -14.67,
    -13.33, -12.00, -10.67, -9.33, -8.00, -6.66, -5.33, -4.00, -2.67, -1.33, 0.00, 1.33, 2.67, 4.00, 5.33,
    6.67, 8.00, 9.33, 10.67,
)  # fmt: skip
"""Vertical angles of the HDL-32E User's Manual, sorted."""

BEAM_DEG = 0.28
"""Larger divergence of the Mid-70's beam (User Manual): the width of a cell that a shot covers."""


def elevation_deg(direction: FloatArray) -> FloatArray:
    return np.degrees(np.arcsin(direction[:, 2]))


def test_rows_of_the_32_line_scanner_are_those_of_its_manual() -> None:
    rays = HDL32.pattern.rays(0)
    rows = [float(elevation_deg(rays.direction[rays.ring == ring])[0]) for ring in range(32)]
    assert rows == pytest.approx(HDL32_MANUAL_DEG, abs=0.0101)  # the manual rounds, twice downwards


def test_rows_of_the_64_line_scanner_are_two_blocks() -> None:
    rows = np.unique(elevation_deg(HDL64.pattern.rays(0).direction).round(6))
    assert len(rows) == 64
    assert rows[[0, 31, 32, 63]] == pytest.approx([-24.3333, -8.8333, -8.3333, 2.0], abs=1e-3)
    assert np.diff(rows)[:31] == pytest.approx(0.5, abs=1e-5)
    assert np.diff(rows)[32:] == pytest.approx(1.0 / 3.0, abs=1e-5)


@pytest.mark.parametrize(("config", "columns"), [(HDL32, 1085), (HDL64, 2083)])
def test_a_turn_goes_clockwise_and_ends_at_the_stamp(config: LidarConfig, columns: int) -> None:
    rays = config.pattern.rays(3)
    rows = int(rays.ring.max()) + 1
    assert len(rays) == columns * rows
    assert np.linalg.norm(rays.direction, axis=1) == pytest.approx(1.0, abs=1e-12)
    azimuth = np.arctan2(rays.direction[:, 1], rays.direction[:, 0])[::rows]
    assert np.diff(azimuth) == pytest.approx(-2.0 * math.pi / columns)
    time = rays.time_offset_s[::rows]
    assert time[-1] == 0.0
    assert time[0] == pytest.approx(-1.0 / config.pattern.rate_hz, rel=2.0 / columns)
    assert config.pattern.duration_s == pytest.approx(-time[0], abs=1e-15)


def test_a_narrow_field_is_the_middle_of_the_turn() -> None:
    assert isinstance(HDL64.pattern, Spinning)
    front = replace(HDL64.pattern, field_rad=2.0 * math.pi / 3.0)
    rays = front.rays(0)
    assert len(rays) == 694 * 64
    azimuth = np.arctan2(rays.direction[:, 1], rays.direction[:, 0])
    assert azimuth.max() == pytest.approx(-azimuth.min(), abs=1e-12)
    assert azimuth.max() == pytest.approx(math.pi / 3.0, abs=0.003)
    assert front.duration_s == pytest.approx(0.1 / 3.0, rel=3e-3)


def test_a_rosette_is_as_wide_as_two_refractions_allow() -> None:
    # by hand: 18 deg in at the first slope, 26.194 deg at the second, 1.8144 sin 26.194 deg = sin 53.216 deg
    assert math.degrees(Rosette().widest_rad) == pytest.approx(35.2158, abs=1e-4)
    direction = replace(Rosette(), integration_s=1.0).rays(0).direction
    angle = np.degrees(np.arccos(direction[:, 0]))
    assert angle.max() == pytest.approx(35.2158, abs=1e-4)
    assert angle.min() < 0.05
    assert np.linalg.norm(direction, axis=1) == pytest.approx(1.0, abs=1e-12)


def test_aligned_wedges_bend_to_the_same_side() -> None:
    # the second slope is minus the first: of the same phase both bend to the same side
    pattern = Rosette(first_rpm=600.0, second_rpm=600.0)
    aligned = rosette_direction(pattern, np.linspace(0.0, 1.0, 7))
    widest = np.degrees(np.arccos(aligned[:, 0]))
    assert widest == pytest.approx(math.degrees(pattern.widest_rad), abs=1e-9)
    # glass like air bends nothing
    straight = rosette_direction(replace(pattern, index=1.0), np.linspace(0.0, 1.0, 7))
    assert straight == pytest.approx(np.tile((1.0, 0.0, 0.0), (7, 1)), abs=1e-12)


def test_a_rosette_goes_on_from_cloud_to_cloud() -> None:
    pattern = Rosette(rate_hz=10.0, integration_s=0.2)
    before, after = pattern.rays(4), pattern.rays(5)
    assert len(after) == 20_000
    assert after.time_offset_s[[0, -1]] == pytest.approx([-0.2 + 1e-5, 0.0], abs=1e-12)
    assert before.direction[10_000:] == pytest.approx(after.direction[:10_000], abs=1e-12)
    assert abs(before.direction - after.direction).max() > 0.1
    assert pattern.rays(4) is before


def coverage(direction: FloatArray) -> float:
    """Share of cells as wide as a beam, in the field of 70.4 deg, that a shot falls into."""
    angle = np.degrees(np.arccos(direction[:, 0]))
    toward = np.arctan2(direction[:, 2], direction[:, 1])
    count = math.ceil(70.4 / BEAM_DEG)
    cells = np.zeros((count, count), dtype=bool)
    row, column = (
        np.floor((angle * part(toward) + 35.2) / BEAM_DEG).astype(int) for part in (np.cos, np.sin)
    )
    inside = (row >= 0) & (row < count) & (column >= 0) & (column < count)
    cells[row[inside], column[inside]] = True
    middle = (np.arange(count) + 0.5) * BEAM_DEG - 35.2
    field = np.hypot(*np.meshgrid(middle, middle)) <= 35.2
    return float((cells & field).sum() / field.sum())


def test_coverage_grows_as_the_manual_says() -> None:
    """Near a 32-line scanner's after 0.2 s, 86 % after 1.5 s (Mid-70 User Manual)."""
    direction = replace(Rosette(), integration_s=1.5).rays(0).direction
    lines = 32 * BEAM_DEG / (31 * 4.0 / 3.0)  # of the scanner's own field
    assert coverage(direction[-20_000:]) == pytest.approx(lines, abs=0.03)
    assert coverage(direction) == pytest.approx(0.86, abs=0.01)


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: Spinning((1.0,), rate_hz=0.0), "rate and cycle"),
        (lambda: Spinning((1.0,), field_rad=7.0), "field_rad"),
        (lambda: Spinning((2.0, 1.0)), "ascend"),
        (lambda: Spinning(()), "ascend"),
        (lambda: Rosette(integration_s=0.0), "integration"),
        (lambda: Rosette(integration_s=math.nan), "integration"),
        (lambda: Rosette(wedge_rad=0.6), "prisms"),
        (lambda: Rosette(index=0.5), "prisms"),
        (lambda: Mount(height_m=0.0), "mount"),
        (lambda: Mount(forward_m=math.inf), "mount"),
        (lambda: replace(MID70, range_m=0.01), "echoes"),
        (lambda: replace(MID70, dropout=1.5), "dropout"),
        (lambda: replace(MID70, range_sigma_m=-1.0), "noise"),
        (lambda: lidar_config("vlp16"), "choose hdl32, hdl64, mid70"),
    ],
)
def test_impossible_sensors_are_refused(made: object, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        made()  # type: ignore[operator]


def test_sensors_have_names() -> None:
    assert lidar_config("hdl64") is HDL64
    assert HDL64.mount.height_m == 1.73
