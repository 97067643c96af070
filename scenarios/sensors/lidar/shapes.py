"""What rays can meet: bodies that stand upright and move, each of several parts of three kinds."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from smartmot.arrays import FloatArray, IntArray, frozen
from smartmot.errors import ShapeError

BLOCK, ELLIPSOID, COLUMN, ROLLER = range(4)
"""Kinds of parts: a block; an ellipsoid; an elliptic cylinder with an upright axis; one whose axis lies
across the body, as a wheel's does. All are unit shapes that are scaled along the body's axes."""

KINDS = (BLOCK, ELLIPSOID, COLUMN, ROLLER)


@dataclass(frozen=True, slots=True, eq=False)
class Parts:
    """P parts of bodies, in the frame of their body: x ahead, y left, z up, origin on its underside.

    Args:
        kind: (P,) out of `KINDS`.
        center_m: (P, 3) middles.
        half_m: (P, 3) half of the extents along the body's axes, positive.
        reflectivity: (P,) share of the light that comes back at right angles, 0 to 1.

    Raises:
        smartmot.errors.ShapeError: shapes disagree, a kind is unknown, or a value is out of range.
    """

    kind: IntArray
    center_m: FloatArray
    half_m: FloatArray
    reflectivity: FloatArray

    def __post_init__(self) -> None:
        kind = frozen(self.kind, np.int64, (None,), "kind")
        count = len(kind)
        center = frozen(self.center_m, np.float64, (count, 3), "center_m")
        half = frozen(self.half_m, np.float64, (count, 3), "half_m")
        reflectivity = frozen(self.reflectivity, np.float64, (count,), "reflectivity")
        if count and not (kind.min() >= KINDS[0] and kind.max() <= KINDS[-1]):
            raise ShapeError(f"kind: expected numbers from 0 to {KINDS[-1]}, got {kind.tolist()}")
        if not (np.isfinite(center).all() and np.isfinite(half).all() and (half > 0.0).all()):
            raise ShapeError("parts: centres must be finite, extents finite and positive")
        if not ((reflectivity >= 0.0) & (reflectivity <= 1.0)).all():
            raise ShapeError("reflectivity: every value must lie in [0, 1]")
        for name, column in zip(self.__slots__, (kind, center, half, reflectivity), strict=True):
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.kind)

    def scaled(self, factor: FloatArray) -> Parts:
        """The parts stretched along the three axes of the body, by (3,) or (P, 3) factors."""
        return Parts(self.kind, self.center_m * factor, self.half_m * factor, self.reflectivity)


@dataclass(frozen=True, eq=False)
class Bodies:
    """B upright bodies of P parts, in any level frame.

    Args:
        position_m: (B, 3) middles of their undersides at the stamp.
        yaw_rad: (B,) headings.
        velocity_mps: (B, 2) horizontal velocities: constant while a cloud is measured.
        parts: P parts, those of a body in sequence.
        first: (B + 1,) the parts of body b are ``first[b]`` to ``first[b + 1] - 1``; none is empty.

    Raises:
        smartmot.errors.ShapeError: shapes disagree or a value is not finite.
    """

    position_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    parts: Parts
    first: IntArray

    def __post_init__(self) -> None:
        position = frozen(self.position_m, np.float64, (None, 3), "position_m")
        count = len(position)
        yaw = frozen(self.yaw_rad, np.float64, (count,), "yaw_rad")
        velocity = frozen(self.velocity_mps, np.float64, (count, 2), "velocity_mps")
        first = frozen(self.first, np.int64, (count + 1,), "first")
        if not np.isfinite(position.sum() + yaw.sum() + velocity.sum()):
            raise ShapeError("bodies: a position, yaw or velocity is not finite")
        if first[0] != 0 or first[-1] != len(self.parts) or (np.diff(first) <= 0).any():
            raise ShapeError(f"first: expected to ascend from 0 to {len(self.parts)}, got {first.tolist()}")
        checked = {"position_m": position, "yaw_rad": yaw, "velocity_mps": velocity, "first": first}
        for name, column in checked.items():
            object.__setattr__(self, name, column)

    def __len__(self) -> int:
        return len(self.yaw_rad)

    @classmethod
    def empty(cls) -> Bodies:
        """No bodies."""
        parts = Parts(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))
        return cls(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 2)), parts, np.zeros(1, np.int64))

    @classmethod
    def of(
        cls,
        parts: list[Parts],
        position_m: FloatArray,
        yaw_rad: FloatArray,
        velocity_mps: FloatArray | None = None,
    ) -> Bodies:
        """Bodies from the parts of each; without velocities they stand."""
        if not parts:
            return cls.empty()
        columns = (
            np.concatenate([getattr(part, name) for part in parts])
            for name in ("kind", "center_m", "half_m", "reflectivity")
        )
        first = np.concatenate(([0], np.cumsum([len(part) for part in parts])))
        velocity = np.zeros((len(parts), 2)) if velocity_mps is None else velocity_mps
        return cls(position_m, yaw_rad, velocity, Parts(*columns), first)

    def take(self, rows: IntArray) -> Bodies:
        """Some of the bodies."""
        count = self.first[rows + 1] - self.first[rows]
        first = np.concatenate(([0], np.cumsum(count)))
        number = np.arange(first[-1]) + np.repeat(self.first[rows] - first[:-1], count)
        parts = self.parts
        chosen = Parts(
            parts.kind[number], parts.center_m[number], parts.half_m[number], parts.reflectivity[number]
        )
        return Bodies(self.position_m[rows], self.yaw_rad[rows], self.velocity_mps[rows], chosen, first)

    def seen_from(self, place_m: FloatArray, yaw_rad: float) -> Bodies:
        """The bodies in a frame that lies at (2,) a horizontal place and is turned; heights stay."""
        c, s = np.cos(yaw_rad), np.sin(yaw_rad)
        turn = np.array([[c, -s], [s, c]])
        position = self.position_m.copy()
        position[:, :2] = (position[:, :2] - place_m) @ turn
        return Bodies(position, self.yaw_rad - yaw_rad, self.velocity_mps @ turn, self.parts, self.first)

    @property
    def radius_m(self) -> FloatArray:
        """(B,) how far each reaches from its position, horizontally."""
        low, high = self.bounds
        reach: FloatArray = np.hypot(*np.maximum(np.abs(low), np.abs(high))[:, :2].T)
        return reach

    @cached_property
    def turned(self) -> FloatArray:
        """(B, 2) cosines and sines of the headings."""
        return np.column_stack((np.cos(self.yaw_rad), np.sin(self.yaw_rad)))

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """(B, 3) lowest and (B, 3) highest corner of the parts of each body, frame of the body."""
        if not len(self):
            return np.zeros((0, 3)), np.zeros((0, 3))
        low = np.minimum.reduceat(self.parts.center_m - self.parts.half_m, self.first[:-1])
        high = np.maximum.reduceat(self.parts.center_m + self.parts.half_m, self.first[:-1])
        return low, high


def joined(groups: list[Bodies]) -> Bodies:
    """All bodies of several groups, in their order."""
    groups = [group for group in groups if len(group)]
    if not groups:
        return Bodies.empty()
    parts = [group.parts for group in groups]
    columns = (
        np.concatenate([getattr(part, name) for part in parts])
        for name in ("kind", "center_m", "half_m", "reflectivity")
    )
    before = np.cumsum([0, *(len(part) for part in parts)])
    first = [group.first[:-1] + start for group, start in zip(groups, before, strict=False)]
    return Bodies(
        np.concatenate([group.position_m for group in groups]),
        np.concatenate([group.yaw_rad for group in groups]),
        np.concatenate([group.velocity_mps for group in groups]),
        Parts(*columns),
        np.concatenate((*first, before[-1:])),
    )
