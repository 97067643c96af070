"""Road users as bodies of several parts, stretched to the box of each.

Proportions are shares of the box: length, width and height. Those of people are segment lengths over stature
after Drillis and Contini (1966, in Winter, Biomechanics and Motor Control of Human Movement): hip 0.53,
shoulder 0.82, chin 0.87. Those of a child of six are assumed: hip 0.47, shoulder 0.76, chin 0.81. Those of
vehicles and all reflectivities are assumed. People stand in mid-stride and wheels are discs.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scenarios.sensors.lidar.shapes import BLOCK, COLUMN, ELLIPSOID, ROLLER, Bodies, Parts
from smartmot.arrays import FloatArray, StrArray

CHILD_BELOW_M = 1.4
"""A pedestrian that is less tall has the proportions of a child; Euro NCAP's child target has 1.154 m."""

PAINT, GLASS, TYRE, CLOTH, SKIN = 0.35, 0.10, 0.06, 0.30, 0.45
"""Reflectivities at right angles, near infrared: assumed."""

Row = tuple[int, tuple[float, float], tuple[float, float], tuple[float, float], float]
"""Kind; from and to along length, width and height; reflectivity."""


def _pair(
    kind: int, x: tuple[float, float], y: tuple[float, float], z: tuple[float, float], share: float
) -> list[Row]:
    """A part on the left and its mirror image on the right."""
    return [(kind, x, y, z, share), (kind, x, (-y[1], -y[0]), z, share)]


def _wheels(x: float, half: float, top: float, inner: float) -> list[Row]:
    return _pair(ROLLER, (x - half, x + half), (inner, 0.5), (0.0, top), TYRE)


def _person(hip: float, shoulder: float, chin: float) -> list[Row]:
    """Legs one before the other, trunk, arms against the legs, head."""
    return [
        (COLUMN, (0.08, 0.34), (0.04, 0.30), (0.0, hip), CLOTH),
        (COLUMN, (-0.34, -0.08), (-0.30, -0.04), (0.0, hip), CLOTH),
        (COLUMN, (-0.20, 0.20), (-0.34, 0.34), (hip - 0.06, shoulder), CLOTH),
        (ELLIPSOID, (-0.32, 0.05), (0.32, 0.50), (hip - 0.09, shoulder), CLOTH),
        (ELLIPSOID, (-0.05, 0.32), (-0.50, -0.32), (hip - 0.09, shoulder), CLOTH),
        (ELLIPSOID, (-0.17, 0.17), (-0.17, 0.17), (chin - 0.03, 1.0), SKIN),
    ]


def _rider(saddle: float) -> list[Row]:
    return [
        *_pair(COLUMN, (-0.08, 0.03), (0.10, 0.34), (0.12, saddle + 0.04), CLOTH),
        (ELLIPSOID, (-0.14, 0.08), (-0.38, 0.38), (saddle - 0.04, 0.86), CLOTH),
        *_pair(ELLIPSOID, (0.0, 0.26), (0.30, 0.50), (0.60, 0.74), CLOTH),
        (ELLIPSOID, (-0.05, 0.07), (-0.20, 0.20), (0.84, 1.0), SKIN),
    ]


SHAPES: dict[str, list[Row]] = {
    "car": [
        (BLOCK, (-0.5, 0.5), (-0.5, 0.5), (0.12, 0.60), PAINT),
        (BLOCK, (-0.44, 0.26), (-0.44, 0.44), (0.60, 0.82), GLASS),
        (BLOCK, (-0.36, 0.14), (-0.40, 0.40), (0.82, 1.0), PAINT),
        *_wheels(0.31, 0.075, 0.43, 0.38),
        *_wheels(-0.31, 0.075, 0.43, 0.38),
    ],
    "truck": [
        (BLOCK, (0.27, 0.5), (-0.48, 0.48), (0.12, 0.85), PAINT),
        (BLOCK, (-0.5, 0.24), (-0.5, 0.5), (0.30, 1.0), PAINT),
        (BLOCK, (-0.48, 0.30), (-0.35, 0.35), (0.14, 0.30), PAINT),
        *_wheels(0.38, 0.06, 0.28, 0.38),
        *_wheels(-0.30, 0.06, 0.28, 0.38),
        *_wheels(-0.43, 0.06, 0.28, 0.38),
    ],
    "adult": _person(0.53, 0.82, 0.87),
    "child": _person(0.47, 0.76, 0.81),
    "cyclist": [
        (ROLLER, (0.14, 0.5), (-0.05, 0.05), (0.0, 0.37), TYRE),
        (ROLLER, (-0.5, -0.14), (-0.05, 0.05), (0.0, 0.37), TYRE),
        (BLOCK, (-0.20, 0.25), (-0.05, 0.05), (0.20, 0.50), PAINT),
        *_rider(0.52),
    ],
    "motorcycle": [
        (ROLLER, (0.20, 0.5), (-0.10, 0.10), (0.0, 0.42), TYRE),
        (ROLLER, (-0.5, -0.20), (-0.10, 0.10), (0.0, 0.42), TYRE),
        (BLOCK, (-0.40, 0.30), (-0.22, 0.22), (0.20, 0.58), PAINT),
        *_rider(0.56),
    ],
    "unknown": [(BLOCK, (-0.5, 0.5), (-0.5, 0.5), (0.0, 1.0), PAINT)],
}
"""Parts of each body, in shares of its box."""


@lru_cache(maxsize=16)
def unit_body(shape: str) -> Parts:
    """The parts of a shape in a box of 1 m x 1 m x 1 m."""
    rows = SHAPES[shape]
    ends = np.array([row[1:4] for row in rows])
    return Parts(
        np.array([row[0] for row in rows]),
        ends.mean(axis=2),
        0.5 * (ends[..., 1] - ends[..., 0]),
        np.array([row[4] for row in rows]),
    )


@lru_cache(maxsize=1)
def _unit_bodies() -> Bodies:
    """One of each shape."""
    count = len(SHAPES)
    return Bodies.of([unit_body(shape) for shape in SHAPES], np.zeros((count, 3)), np.zeros(count))


def shape_of(category: str, height_m: float) -> str:
    """The shape of a road user: a pedestrian's depends on its height, those without one are boxes."""
    if category == "pedestrian":
        return "child" if height_m < CHILD_BELOW_M else "adult"
    return category if category in SHAPES else "unknown"


def road_users(
    category: StrArray,
    size_m: FloatArray,
    position_m: FloatArray,
    yaw_rad: FloatArray,
    velocity_mps: FloatArray | None = None,
    *,
    single_box: bool = False,
) -> Bodies:
    """Bodies of N road users.

    Args:
        category: (N,) names out of `smartmot.types.CATEGORIES`.
        size_m: (N, 3) length, width and height.
        position_m: (N, 3) middles of their undersides.
        yaw_rad: (N,) headings.
        velocity_mps: (N, 2) horizontal velocities; None: they stand.
        single_box: each is its box and nothing else.
    """
    names = list(SHAPES)
    shapes = [
        "unknown" if single_box else shape_of(name, height)
        for name, height in zip(category.tolist(), size_m[:, 2].tolist(), strict=True)
    ]
    count = len(shapes)
    units = _unit_bodies().take(np.array([names.index(shape) for shape in shapes], dtype=np.int64))
    stretch = np.repeat(size_m.reshape(count, 3), np.diff(units.first), axis=0)
    velocity = np.zeros((count, 2)) if velocity_mps is None else velocity_mps
    return Bodies(position_m, yaw_rad, velocity, units.parts.scaled(stretch), units.first)
