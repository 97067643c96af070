"""Pieces of the reference line (chapter "Geometry")."""

from dataclasses import dataclass
from typing import TypeAlias


@dataclass(frozen=True, slots=True)
class Line:
    """Straight reference line (chapter "Geometry")."""


@dataclass(frozen=True, slots=True)
class Arc:
    """Reference line of constant curvature (chapter "Geometry"); positive bends left."""

    curvature_per_m: float


@dataclass(frozen=True, slots=True)
class Spiral:
    """Clothoid: the curvature changes linearly with s (chapter "Geometry")."""

    curvature_start_per_m: float
    curvature_end_per_m: float


@dataclass(frozen=True, slots=True)
class Poly3:
    """Cubic v(u) in the local frame; s is its arc length (deprecated since 1.6)."""

    coefficients: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ParamPoly3:
    """Cubics u(p), v(p) in the local frame (chapter "Geometry"); s is the arc length, p is not.

    Attributes:
        u: coefficients a, b, c, d of u(p).
        v: coefficients a, b, c, d of v(p).
        normalized: p runs over [0, 1] if true, else over [0, length].
    """

    u: tuple[float, float, float, float]
    v: tuple[float, float, float, float]
    normalized: bool


Shape: TypeAlias = Line | Arc | Spiral | Poly3 | ParamPoly3


@dataclass(frozen=True, slots=True)
class Geometry:
    """One piece of the reference line: its start pose in the map frame, its length and shape."""

    s_m: float
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    shape: Shape
