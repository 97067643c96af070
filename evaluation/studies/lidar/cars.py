"""Cars of many shapes: from small hatchbacks to vans, with rounded corners, and windows that rays pass.

The car of `scenarios.sensors.lidar.bodies` has one shape, and its windows send rays back. Real cars have
roofs that end anywhere between the rear axle and the bumper, and their glass lets most rays through to the
seats. All shares are assumed, after side views of common cars.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarios.sensors.lidar.bodies import CLOTH, GLASS, PAINT, TYRE
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, ROLLER, Parts
from smartmot.arrays import FloatArray

Part = tuple[int, tuple[float, float, float], tuple[float, float, float], float]
"""Kind, middle, half extents, reflectivity; shares of the box, origin in the middle of its underside."""

LEVELS = 3
"""Steps by which windscreen and rear window lean."""

CLOSED = 0.35
"""Share of cars whose windows rays do not pass: tinted, at a grazing angle, or vans without any."""

VAN_M = 1.8
"""Height from which a body is a van's or an off-road car's."""


@dataclass(frozen=True, slots=True)
class _Style:
    """From and to of what differs between kinds of bodies, shares of the length and of the height.

    Args:
        rear: where the cabin ends at the belt.
        rear_roof: how much farther ahead the roof ends.
        screen: where the windscreen starts at the belt.
        lean: how much farther back it ends at the roof.
        bonnet: height of the bonnet over that of the belt.
    """

    rear: tuple[float, float]
    rear_roof: tuple[float, float]
    screen: tuple[float, float]
    lean: tuple[float, float]
    bonnet: tuple[float, float] = (0.80, 0.98)


_HATCHBACK = _Style((-0.49, -0.43), (0.03, 0.10), (0.20, 0.32), (0.12, 0.20))
_SALOON = _Style((-0.36, -0.26), (0.08, 0.16), (0.18, 0.28), (0.12, 0.20))
_ESTATE = _Style((-0.49, -0.46), (0.01, 0.06), (0.18, 0.28), (0.10, 0.18))
_VAN = _Style((-0.49, -0.48), (0.0, 0.02), (0.30, 0.46), (0.06, 0.16), (0.85, 1.0))


def drawn_car(size_m: FloatArray, rng: np.random.Generator) -> Parts:
    """A car in a box of (3,) length, width and height; its mirrors stand out of it.

    Args:
        size_m: of the box.
        rng: draws the shape.
    """
    style = (
        _VAN
        if size_m[2] >= VAN_M
        else (_HATCHBACK, _SALOON, _ESTATE)[int(rng.choice(3, p=(0.5, 0.25, 0.25)))]
    )
    belt = rng.uniform(0.54, 0.66)
    screen, rear = rng.uniform(*style.screen), rng.uniform(*style.rear)
    paint = PAINT * rng.uniform(0.3, 1.6)
    rows = _lower(belt, belt * rng.uniform(*style.bonnet), screen, paint, rng)
    ends = (rear, rear + rng.uniform(*style.rear_roof)), (screen, screen - rng.uniform(*style.lean))
    rows += _cabin(belt, *ends, paint, is_open=rng.random() >= CLOSED, rng=rng)
    rows += _mirrors(belt, screen, rng)
    kind, center, half, share = zip(*rows, strict=True)
    unit = Parts(np.array(kind), np.array(center), np.array(half), np.array(share))
    return unit.scaled(np.asarray(size_m, dtype=np.float64))


def _block(
    x: tuple[float, float], y: float, z: tuple[float, float], share: float, middle: float = 0.0
) -> Part:
    center = (0.5 * (x[0] + x[1]), middle, 0.5 * (z[0] + z[1]))
    return BLOCK, center, (0.5 * (x[1] - x[0]), y, 0.5 * (z[1] - z[0])), share


def _lower(belt: float, bonnet: float, screen: float, paint: float, rng: np.random.Generator) -> list[Part]:
    """Body up to the belt, lower under the bonnet, with rounded corners, and wheels."""
    under = rng.uniform(0.10, 0.17)
    ahead, aside = rng.uniform(0.03, 0.10), rng.uniform(0.10, 0.28)
    rows = [
        _block((-0.5 + ahead, 0.5 - ahead), 0.5, (under, bonnet), paint),
        _block((-0.5, 0.5), 0.5 - aside, (under, bonnet), paint),
        _block((-0.5 + 0.7 * ahead, screen), 0.49, (bonnet - 0.01, belt), paint),
    ]
    half = 0.5 * (bonnet - under)
    rows += [
        (COLUMN, (x, y, under + half), (ahead, aside, half), paint)
        for x in (-0.5 + ahead, 0.5 - ahead)
        for y in (-0.5 + aside, 0.5 - aside)
    ]
    radius, axle = rng.uniform(0.20, 0.24), rng.uniform(0.28, 0.33)
    rows += [
        (ROLLER, (x, side * 0.43, radius), (0.075, 0.06, radius), TYRE)
        for x in (-axle, axle)
        for side in (-1.0, 1.0)
    ]
    return rows


def _cabin(
    belt: float,
    rear: tuple[float, float],
    front: tuple[float, float],
    paint: float,
    *,
    is_open: bool,
    rng: np.random.Generator,
) -> list[Part]:
    """Roof on pillars with seats under it, or windows that send rays back.

    Args:
        belt: height where windows begin.
        rear: end of the cabin at the belt and at the roof.
        front: its beginning at the belt and at the roof.
        paint: reflectivity of the body.
        is_open: whether rays pass the windows.
        rng: of all that is drawn.
    """
    top, narrow = 0.93, rng.uniform(0.38, 0.45)
    edges = np.linspace(belt, top, LEVELS + 1)
    rows = [_block((rear[1], front[1]), narrow, (top - 0.01, 1.0), paint)]
    for level in range(LEVELS):
        share = (level + 0.5) / LEVELS
        x0, x1 = (a + share * (b - a) for a, b in (rear, front))
        half = 0.48 + share * (narrow - 0.48)
        z = (float(edges[level]), float(edges[level + 1]))
        if not is_open:
            rows.append(_block((x0, x1), half, z, GLASS))
            continue
        for at, wide in ((x1 - 0.012, 0.012), (x0 + 0.02, 0.02), (0.45 * x0 + 0.55 * x1, 0.012)):
            rows += [
                _block((at - wide, at + wide), 0.02, z, paint, side * (half - 0.02)) for side in (-1.0, 1.0)
            ]
    if is_open:
        seat = 0.45 * rear[0] + 0.55 * front[0]
        tall = rng.uniform(0.72, 0.86)
        rows += [
            _block((seat - 0.08, seat - 0.04), 0.13, (belt - 0.1, tall), CLOTH, side * 0.2)
            for side in (-1.0, 1.0)
        ]
        rows.append(_block((rear[0] + 0.12, rear[0] + 0.16), 0.38, (belt - 0.1, tall - 0.06), CLOTH))
    return rows


def _mirrors(belt: float, screen: float, rng: np.random.Generator) -> list[Part]:
    out = rng.uniform(0.03, 0.07)
    return [
        (ELLIPSOID, (screen - 0.05, side * (0.5 + out), belt + 0.04), (0.02, 0.05, 0.05), PAINT)
        for side in (-1.0, 1.0)
    ]


LOST = (0.6, 0.7)
"""Share of the cars that lose echoes, and the greatest share of these that is lost: dark paint and polished
flanks send little back (assumed)."""


def lost_share(rng: np.random.Generator) -> float:
    """The share of a car's echoes that do not come back."""
    return 0.0 if rng.random() >= LOST[0] else LOST[1] * math.pow(rng.random(), 2.0)
