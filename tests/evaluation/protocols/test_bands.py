"""Colours of Euro NCAP 2026: limits by version, order, tolerance."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.protocols.bands import (
    WEIGHT,
    Colour,
    Version,
    avoidance_colour,
    impact_bands,
    impact_colour,
    mitigation_colour,
    round_half_up,
    warning_colour,
    within_tolerance,
)
from evaluation.protocols.errors import ProtocolError

SPEEDS = (10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 80.0)
VERSIONS = tuple(Version)


@pytest.mark.parametrize(
    ("speed_kmh", "impact_kmh", "older", "newer"),
    [
        # the table of the protocol, and its limits: v1.1 gives them to the better colour, v1.2 to the worse
        (10.0, 0.0, "green", "green"),
        (10.0, 0.1, "red", "red"),
        (20.0, 0.01, "red", "red"),
        (30.0, 0.01, "brown", "brown"),
        (30.0, 10.0, "brown", "red"),
        (40.0, 9.99, "orange", "orange"),
        (40.0, 10.0, "orange", "brown"),
        (40.0, 20.0, "brown", "red"),
        (60.0, 9.99, "yellow", "yellow"),
        (60.0, 10.0, "yellow", "orange"),
        (60.0, 20.0, "orange", "brown"),
        (60.0, 30.0, "brown", "red"),
        (60.0, 30.01, "red", "red"),
        (130.0, 29.99, "brown", "brown"),
    ],
)
def test_colours_and_their_limits(speed_kmh: float, impact_kmh: float, older: str, newer: str) -> None:
    assert impact_colour(speed_kmh, impact_kmh, Version.V1_1) == older
    assert impact_colour(speed_kmh, impact_kmh, Version.V1_2) == newer
    assert impact_colour(speed_kmh, impact_kmh) == newer  # the newest is the default


@given(st.sampled_from(SPEEDS), st.sampled_from(VERSIONS), st.floats(0, 130), st.floats(0, 130))
def test_a_faster_impact_never_weighs_more(speed_kmh: float, version: Version, a: float, b: float) -> None:
    slow, fast = sorted((a, b))
    heavy = WEIGHT[impact_colour(speed_kmh, slow, version)]
    light = WEIGHT[impact_colour(speed_kmh, fast, version)]
    assert 0.0 <= light <= heavy <= 1.0


@given(st.sampled_from(SPEEDS), st.floats(0, 130))
def test_versions_differ_at_limits_only(speed_kmh: float, impact_kmh: float) -> None:
    limits = {band.lower_kmh for band in impact_bands(speed_kmh)}
    if impact_kmh not in limits:
        assert len({impact_colour(speed_kmh, impact_kmh, version) for version in VERSIONS}) == 1


@given(st.sampled_from(SPEEDS), st.sampled_from(VERSIONS), st.floats(0, 130))
def test_the_measured_colour_confirms_itself(speed_kmh: float, version: Version, impact_kmh: float) -> None:
    colour = impact_colour(speed_kmh, impact_kmh, version)
    assert within_tolerance(speed_kmh, colour, impact_kmh, version)


@pytest.mark.parametrize(
    ("predicted", "inside", "outside"),
    [
        # section 4.2.4 at 60 km/h: green v < 2, yellow 0 < v < 12, orange 8 <= v < 22, brown 18 <= v < 32
        ("green", (0.0, 1.99), (2.0,)),
        ("yellow", (0.01, 11.99), (0.0, 12.0)),
        ("orange", (8.0, 21.99), (7.99, 22.0)),
        ("brown", (18.0, 31.99), (17.99, 32.0)),
        ("red", (30.0, 60.0), (29.99,)),
    ],
)
def test_tolerance_of_the_newest_version(
    predicted: str, inside: tuple[float, ...], outside: tuple[float, ...]
) -> None:
    assert all(within_tolerance(60.0, Colour(predicted), v) for v in inside)
    assert not any(within_tolerance(60.0, Colour(predicted), v) for v in outside)


def test_the_older_version_widens_to_its_own_side() -> None:
    assert within_tolerance(60.0, Colour.GREEN, 2.0, Version.V1_1)
    assert within_tolerance(60.0, Colour.YELLOW, 12.0, Version.V1_1)
    assert not within_tolerance(60.0, Colour.ORANGE, 8.0, Version.V1_1)


def test_tests_without_a_scale() -> None:
    assert [avoidance_colour(v) for v in (0.0, 0.01)] == ["green", "red"]
    assert [warning_colour(t) for t in (None, 1.69, 1.7)] == ["red", "red", "green"]
    assert [mitigation_colour(v) for v in (0, 10, 10.1, 20, 20.1, 30)] == [
        "red", "red", "orange", "orange", "green", "green",
    ]  # fmt: skip


@pytest.mark.parametrize("speed_kmh", [0.0, 5.0, 15.0, 45.0, -10.0, float("nan"), float("inf")])
def test_other_speeds_are_refused(speed_kmh: float) -> None:
    with pytest.raises(ProtocolError, match="no bands for a test speed"):
        impact_bands(speed_kmh)


def test_a_colour_that_the_speed_does_not_have_is_refused() -> None:
    with pytest.raises(ProtocolError, match=r"no yellow at 30 km/h; the colours there are green, brown, red"):
        within_tolerance(30.0, Colour.YELLOW, 1.0)


def test_two_decimals_half_up() -> None:
    assert [round_half_up(v) for v in (0.004, 0.005, 2.675, 9.994999, 10.0)] == [0.0, 0.01, 2.68, 9.99, 10.0]
