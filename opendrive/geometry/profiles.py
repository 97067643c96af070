"""Piecewise cubics, many at once.

Width, border, lane offset, elevation and superelevation are all of this kind (ASAM OpenDRIVE 1.8).
All profiles of a network sit in one table, so that a query over any mix of profiles is one array operation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import FloatArray, IntArray, until_next
from opendrive.geometry.cubic import slope_of, value_of


def sort_keys(owner: IntArray, start: FloatArray) -> NDArray[np.complex128]:
    """Return keys that sort by owner first and by start second.

    NumPy orders complex numbers lexicographically, so that one `searchsorted` finds the record of every
    query, whatever its owner, without loss of precision in `start`.
    """
    keys = np.empty(np.broadcast(owner, start).shape, dtype=np.complex128)
    keys.real = owner
    keys.imag = start
    return keys


@dataclass(frozen=True, slots=True, eq=False)
class CubicTable:
    """Many piecewise cubics.

    Attributes:
        key: (R,) owner and start of each record, ascending.
        start_m: (R,) where each record starts.
        coefficients: (R, 4) a, b, c, d.
        first: (P + 1,) index of the first record of each of the P profiles.
    """

    key: NDArray[np.complex128]
    start_m: FloatArray
    coefficients: FloatArray
    first: IntArray

    @classmethod
    def of_rows(
        cls, owner: IntArray, rows: FloatArray, profiles: int, origin_m: FloatArray | None = None
    ) -> "CubicTable":
        """Sort records into profiles.

        Args:
            owner: (R,) profile of each record.
            rows: (R, 5) columns ``s, a, b, c, d``, ascending in s within a profile.
            profiles: number of profiles P.
            origin_m: (P,) added to the s of each profile; 0 when absent.
        """
        order = np.argsort(owner, kind="stable")
        owner, rows = owner[order], rows[order]
        start_m = rows[:, 0] if origin_m is None else rows[:, 0] + origin_m[owner]
        return cls(
            sort_keys(owner, start_m),
            np.ascontiguousarray(start_m),
            np.ascontiguousarray(rows[:, 1:]),
            np.searchsorted(owner, np.arange(profiles + 1)),
        )

    @classmethod
    def stack(cls, profiles: Sequence[FloatArray], origin_m: FloatArray | None = None) -> "CubicTable":
        """Stack P profiles, arrays (K, 5) with columns ``s, a, b, c, d``, ascending in s; see `of_rows`."""
        owner = np.repeat(np.arange(len(profiles)), [len(profile) for profile in profiles])
        return cls.of_rows(owner, np.concatenate([np.empty((0, 5)), *profiles]), len(profiles), origin_m)

    def records(self, profile: IntArray, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coefficients (N, 4) that hold at `s_m` (N,) and the distance (N,) from their start.

        Both are 0 before the first record of a profile. There has to be a record of any profile.
        """
        row = np.searchsorted(self.key, sort_keys(profile, s_m), side="right") - 1
        is_there = row >= self.first[profile]
        ds = np.where(is_there, s_m - self.start_m[row], 0.0)
        return np.where(is_there[..., None], self.coefficients[row], 0.0), ds

    def value_and_slope(self, profile: IntArray, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Evaluate profiles; a profile is 0 before its first record.

        Args:
            profile: (N,) indices of profiles.
            s_m: (N,) where to evaluate.

        Returns:
            value (N,) and derivative by s (N,).
        """
        if not len(self.start_m):
            zero = np.zeros(np.broadcast(profile, s_m).shape)
            return zero, zero
        k, ds = self.records(profile, s_m)
        return value_of(k, ds), slope_of(k, ds)

    def value(self, profile: IntArray, s_m: FloatArray) -> FloatArray:
        """Evaluate profiles; see `value_and_slope`."""
        return self.value_and_slope(profile, s_m)[0]

    def greatest(self, end: FloatArray, slope: bool = False) -> FloatArray:
        """Return bounds (P,) of the magnitude of each profile up to `end` (P,), or of its slope.

        The cubic of the coefficients' magnitudes is nowhere less than the cubic's magnitude, and ascends.
        """
        owner = np.repeat(np.arange(len(end)), np.diff(self.first))
        last = np.minimum(until_next(owner, self.start_m, end[owner]), end[owner])
        span = np.maximum(last - self.start_m, 0.0)
        greatest = np.zeros(len(end))
        np.maximum.at(greatest, owner, (slope_of if slope else value_of)(np.abs(self.coefficients), span))
        return greatest
