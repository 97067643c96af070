"""Colours of a Euro NCAP 2026 cell, their limits, and the tolerance around a predicted colour.

Sources: Crash Avoidance - Frontal Collisions protocol v1.1 (October 2025) and v1.2 (July 2026), sections
4.2.4 and 5.2; v1.2 as Euro NCAP's own calculator `euroncap-rating-2026` 5.4.9 implements it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from evaluation.protocols.errors import ProtocolError


class Colour(StrEnum):
    """Colour of a cell, best first."""

    GREEN = "green"
    YELLOW = "yellow"
    ORANGE = "orange"
    BROWN = "brown"
    RED = "red"


WEIGHT = {
    Colour.GREEN: 1.0,
    Colour.YELLOW: 0.75,
    Colour.ORANGE: 0.5,
    Colour.BROWN: 0.25,
    Colour.RED: 0.0,
}
"""Share of a standard cell's points (section 5.2)."""


class Version(StrEnum):
    """Edition of the protocol. They differ in the owner of a limit: 1.1 the better band, 1.2 the worse."""

    V1_1 = "1.1"
    V1_2 = "1.2"


NEWEST = Version.V1_2

TOLERANCE_KMH = 2.0
"""Only for confirming a predicted colour by an impact speed (section 4.2.4)."""

WARNING_TTC_S = 1.7
"""Earliest enough warning in the FCW tests (section 5.2: green from 1.7 s)."""


@dataclass(frozen=True, slots=True)
class Band:
    """Impact speeds of one colour in km/h; the version says which of its limits belongs to it."""

    colour: Colour
    lower_kmh: float
    upper_kmh: float


_WORSE = (Colour.YELLOW, Colour.ORANGE, Colour.BROWN)
_BANDS_BELOW_RED = {10.0: 0, 20.0: 0, 30.0: 1, 40.0: 2}
_FULL_FROM_KMH = 50.0
_BAND_WIDTH_KMH = 10.0


def impact_bands(speed_kmh: float) -> tuple[Band, ...]:
    """Bands of the impact speed at one test speed, best first (section 5.2, figure 5-1).

    Args:
        speed_kmh: test speed of the VUT: 10, 20, 30, 40, or from 50 on.

    Raises:
        ProtocolError: the protocol has no bands for this speed.
    """
    count = 3 if _FULL_FROM_KMH <= speed_kmh < math.inf else _BANDS_BELOW_RED.get(speed_kmh)
    if count is None:
        raise ProtocolError(
            f"Euro NCAP 2026 has no bands for a test speed of {speed_kmh:g} km/h; "
            "it has them for 10, 20, 30, 40 km/h and from 50 km/h on"
        )
    edges = [i * _BAND_WIDTH_KMH for i in range(count + 1)]
    between = [
        Band(colour, low, low + _BAND_WIDTH_KMH)
        for colour, low in zip(_WORSE[3 - count :], edges[:-1], strict=True)
    ]
    return (Band(Colour.GREEN, 0.0, 0.0), *between, Band(Colour.RED, edges[-1], math.inf))


def impact_colour(speed_kmh: float, impact_kmh: float, version: Version = NEWEST) -> Colour:
    """Colour of an impact speed, without any tolerance.

    Args:
        speed_kmh: test speed of the VUT.
        impact_kmh: relative impact speed, 0 without contact.
        version: which band a limit belongs to.

    Raises:
        ProtocolError: the protocol has no bands for this test speed.
    """
    bands = impact_bands(speed_kmh)
    if impact_kmh <= 0.0:
        return Colour.GREEN
    for band in bands[1:]:
        if _below(impact_kmh, band.upper_kmh, version):
            return band.colour
    return Colour.RED


def within_tolerance(
    speed_kmh: float, predicted: Colour, impact_kmh: float, version: Version = NEWEST
) -> bool:
    """Whether an impact speed confirms a predicted colour: it lies in the band widened by 2 km/h.

    Red is not widened, and an avoided collision confirms green only. The widened limits belong where the
    version's own limits do; for 1.1 no source says so.

    Raises:
        ProtocolError: the protocol has no bands for this speed, or not this colour.
    """
    bands = {band.colour: band for band in impact_bands(speed_kmh)}
    if predicted not in bands:
        raise ProtocolError(f"no {predicted} at {speed_kmh:g} km/h; the colours there are {', '.join(bands)}")
    band = bands[predicted]
    if predicted is Colour.RED:
        return impact_colour(speed_kmh, impact_kmh, version) is Colour.RED
    if predicted is Colour.GREEN:
        return _below(impact_kmh, TOLERANCE_KMH, version)
    lower = band.lower_kmh - TOLERANCE_KMH
    above = impact_kmh > 0.0 if lower <= 0.0 else not _below(impact_kmh, lower, version)
    return above and _below(impact_kmh, band.upper_kmh + TOLERANCE_KMH, version)


def avoidance_colour(impact_kmh: float) -> Colour:
    """Colour where only an avoided collision counts (turning and crossing paths, section 5.2)."""
    return Colour.GREEN if impact_kmh <= 0.0 else Colour.RED


def warning_colour(ttc_s: float | None) -> Colour:
    """Colour of an FCW test; no warning is red."""
    return Colour.GREEN if ttc_s is not None and ttc_s >= WARNING_TTC_S else Colour.RED


def mitigation_colour(speed_reduction_kmh: float) -> Colour:
    """Colour of a head-on test (figure 5-2) as the calculator has it.

    The figure itself is in no source. That a reduction above 30 km/h is red is the calculator's reading.
    """
    for colour, upper_kmh in ((Colour.RED, 10.0), (Colour.ORANGE, 20.0), (Colour.GREEN, 30.0)):
        if speed_reduction_kmh <= upper_kmh:
            return colour
    return Colour.RED


def round_half_up(value: float, digits: int = 2) -> float:
    """Measured values count with two decimals (Overall Assessment v10.0, calculation rules)."""
    scale = 10.0**digits
    return math.floor(value * scale + 0.5 + 1e-7) / scale


def _below(value: float, limit: float, version: Version) -> bool:
    return value < limit if version is Version.V1_2 else value <= limit
