"""People and riders of many shapes: stance, dress, what they carry, and how a rider sits.

Those of `scenarios.sensors.lidar.bodies` are all in mid-stride with their arms at their sides, and all riders
lean alike. Heights of joints are those of that module; all other shares are assumed.
"""

from __future__ import annotations

import numpy as np

from scenarios.sensors.lidar.bodies import CHILD_BELOW_M, CLOTH, PAINT, SKIN, TYRE
from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, ROLLER, Parts
from smartmot.arrays import FloatArray

Row = tuple[int, tuple[float, float], tuple[float, float], tuple[float, float], float]
"""Kind; from and to along length, width and height, shares of the box; reflectivity."""

STANDS_BELOW_M = 0.5
"""Length of a box in which both legs are side by side: a step is longer."""

LONG_DRESS, BURDEN, PUSHED = 0.15, 0.4, 0.06
"""Shares of people in a coat or a skirt, with a bag or a rucksack, and who push something on wheels."""

LUGGAGE = 0.35
"""Share of bicycles with a basket, bags or a child's seat."""


def drawn_person(size_m: FloatArray, rng: np.random.Generator) -> Parts:
    """A person on foot.

    Args:
        size_m: (3,) length, width and height of the box; what is pushed stands out of it.
        rng: draws the shape.
    """
    hip, shoulder, chin = (0.53, 0.82, 0.87) if size_m[2] >= CHILD_BELOW_M else (0.47, 0.76, 0.81)
    hip += rng.uniform(-0.03, 0.03)
    cloth = CLOTH * rng.uniform(0.3, 1.8)
    deep = rng.uniform(0.16, 0.28) if size_m[0] >= STANDS_BELOW_M else rng.uniform(0.3, 0.46)
    lean, wide = rng.uniform(-0.05, 0.12), rng.uniform(0.30, 0.40)
    rows = _legs(size_m, hip, deep, wide, rng)
    rows.append((COLUMN, (lean - deep, lean + deep), (-wide, wide), (hip - 0.06, shoulder), cloth))
    rows += _arms(lean, deep, wide, hip, shoulder, cloth, rng)
    half = rng.uniform(0.11, 0.18) if size_m[0] >= STANDS_BELOW_M else rng.uniform(0.2, 0.34)
    at = lean + rng.uniform(0.0, 0.1)
    rows.append((ELLIPSOID, (at - half, at + half), (-0.19, 0.19), (chin - 0.03, 1.0), SKIN))
    if rng.random() < BURDEN:
        rows += _burden(lean - deep, hip, shoulder, rng)
    made = _parts(rows).scaled(size_m)
    return _with(made, _pushed(size_m, rng)) if rng.random() < PUSHED else made


def _legs(size_m: FloatArray, hip: float, deep: float, wide: float, rng: np.random.Generator) -> list[Row]:
    trousers = CLOTH * rng.uniform(0.3, 1.5)
    if rng.random() < LONG_DRESS:
        low = rng.uniform(0.0, 0.25)
        dress: Row = (COLUMN, (-1.1 * deep, 1.1 * deep), (-1.1 * wide, 1.1 * wide), (low, hip), trousers)
        return [dress, *_pair((-0.4 * deep, 0.4 * deep), (0.05, 0.22), (0.0, low + 0.01), trousers)]
    if size_m[0] < STANDS_BELOW_M:
        return _pair((-0.8 * deep, 0.8 * deep), (0.03, 0.9 * wide), (0.0, hip), trousers)
    # upright up to the hip: one leg before the other, by a part of a step
    step, thick = rng.uniform(0.05, 0.38), rng.uniform(0.09, 0.14)
    side = rng.choice((-1.0, 1.0))
    inner, outer = sorted((side * 0.03, side * 0.32))
    return [
        (COLUMN, (step - thick, step + thick), (inner, outer), (0.0, hip), trousers),
        (COLUMN, (-step - thick, -step + thick), (-outer, -inner), (0.0, hip), trousers),
    ]


def _arms(
    lean: float,
    deep: float,
    wide: float,
    hip: float,
    shoulder: float,
    cloth: float,
    rng: np.random.Generator,
) -> list[Row]:
    """Each hangs, swings, or is bent to something that the hand holds."""
    rows: list[Row] = []
    for side in (-1.0, 1.0):
        y = sorted((side * (wide - 0.04), side * 0.5))
        across, swing = (y[0], y[1]), lean + rng.uniform(-0.2, 0.2)
        if rng.random() < 0.3:
            rows.append((ELLIPSOID, (lean - 0.1, lean + 0.1), across, (hip + 0.08, shoulder), cloth))
            rows.append(
                (ELLIPSOID, (lean, min(lean + deep + 0.25, 0.5)), across, (hip + 0.06, hip + 0.14), cloth)
            )
        else:
            rows.append((ELLIPSOID, (swing - 0.15, swing + 0.15), across, (hip - 0.09, shoulder), cloth))
    return rows


def _burden(back: float, hip: float, shoulder: float, rng: np.random.Generator) -> list[Row]:
    """A rucksack, or a bag in a hand."""
    share = CLOTH * rng.uniform(0.3, 1.8)
    if rng.random() < 0.5:
        low = rng.uniform(hip - 0.05, hip + 0.1)
        return [(BLOCK, (back - rng.uniform(0.1, 0.3), back + 0.03), (-0.28, 0.28), (low, shoulder), share)]
    side = rng.choice((-1.0, 1.0))
    y = sorted((side * 0.4, side * rng.uniform(0.5, 0.7)))
    top = rng.uniform(0.3, 0.45)
    return [(BLOCK, (-0.25, 0.25), (y[0], y[1]), (top - rng.uniform(0.12, 0.25), top), share)]


def _pushed(size_m: FloatArray, rng: np.random.Generator) -> Parts:
    """A pram or a trolley, lengths in metres."""
    length, width, height = rng.uniform((0.5, 0.4, 0.7), (1.0, 0.6, 1.1))
    ahead = 0.5 * size_m[0] + 0.5 * length + rng.uniform(0.0, 0.2)
    under = rng.uniform(0.2, 0.5)
    half = np.array(
        [[0.5 * length, 0.5 * width, 0.5 * (height - under)], [0.3 * length, 0.4 * width, 0.5 * under]]
    )
    center = np.array([[ahead, 0.0, 0.5 * (height + under)], [ahead, 0.0, 0.5 * under]])
    return Parts(np.array([BLOCK, BLOCK]), center, half, np.full(2, CLOTH))


def drawn_rider(size_m: FloatArray, rng: np.random.Generator) -> Parts:
    """A rider on a bicycle.

    Args:
        size_m: (3,) length, width and height of the box.
        rng: draws the shape.
    """
    cloth, skin = CLOTH * rng.uniform(0.3, 1.8), SKIN * rng.uniform(0.6, 1.2)
    wheel, thin = rng.uniform(0.16, 0.19), rng.uniform(0.02, 0.05)
    tall = 2.0 * wheel * float(size_m[0] / size_m[2])
    saddle = rng.uniform(0.48, 0.57)
    rows: list[Row] = [
        (ROLLER, (0.5 - 2.0 * wheel, 0.5), (-thin, thin), (0.0, tall), TYRE),
        (ROLLER, (-0.5, 2.0 * wheel - 0.5), (-thin, thin), (0.0, tall), TYRE),
        (BLOCK, (-0.2, 0.25), (-0.05, 0.05), (rng.uniform(0.2, 0.35), rng.uniform(0.42, 0.5)), PAINT),
        (BLOCK, (0.2, 0.26), (-0.42, 0.42), (0.54, 0.60), PAINT),
    ]
    # the hip over the saddle, the shoulder before it: upright to bent
    hip, lean = rng.uniform(-0.18, -0.06), rng.uniform(0.02, 0.26)
    top, wide = 0.87 - 0.35 * max(lean - 0.1, 0.0), rng.uniform(0.32, 0.42)
    middle = 0.5 * (saddle + top)
    rows += [
        (
            ELLIPSOID,
            (hip - 0.09, hip + 0.09 + 0.5 * lean),
            (-wide, wide),
            (saddle - 0.05, middle + 0.08),
            cloth,
        ),
        (ELLIPSOID, (hip - 0.06 + 0.4 * lean, hip + 0.08 + lean), (-wide, wide), (middle - 0.06, top), cloth),
    ]
    head = hip + lean + rng.uniform(0.0, 0.06)
    rows.append((ELLIPSOID, (head - 0.06, head + 0.07), (-0.2, 0.2), (top - 0.03, 1.0), skin))
    for side in (-1.0, 1.0):
        foot, knee = rng.uniform(0.08, 0.22), rng.uniform(0.02, 0.14)
        leg = sorted((side * 0.1, side * 0.34))
        arm = sorted((side * 0.32, side * 0.48))
        rows += [
            (COLUMN, (knee - 0.06, knee + 0.05), (leg[0], leg[1]), (foot, saddle - 0.04), cloth),
            (ELLIPSOID, (hip, knee + 0.06), (leg[0], leg[1]), (saddle - 0.1, saddle + 0.04), cloth),
            (ELLIPSOID, (hip + lean - 0.02, 0.26), (arm[0], arm[1]), (0.58, max(top - 0.06, 0.66)), cloth),
        ]
    if rng.random() < LUGGAGE:
        behind = rng.random() < 0.7
        x = (-0.42, -0.2) if behind else (0.26, 0.42)
        low = rng.uniform(0.2, 0.42)
        half = rng.uniform(0.2, 0.5)
        rows.append((BLOCK, x, (-half, half), (low, low + rng.uniform(0.1, 0.3)), CLOTH))
    return _parts(rows).scaled(size_m)


def _pair(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], share: float) -> list[Row]:
    return [(COLUMN, x, y, z, share), (COLUMN, x, (-y[1], -y[0]), z, share)]


def _parts(rows: list[Row]) -> Parts:
    ends = np.array([row[1:4] for row in rows])
    share = np.clip([row[4] for row in rows], 0.0, 1.0)
    return Parts(
        np.array([row[0] for row in rows]), ends.mean(axis=2), 0.5 * (ends[..., 1] - ends[..., 0]), share
    )


def _with(first: Parts, second: Parts) -> Parts:
    columns = (np.concatenate((getattr(first, n), getattr(second, n))) for n in Parts.__slots__)
    return Parts(*columns)
