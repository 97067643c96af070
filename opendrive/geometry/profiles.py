"""Piecewise cubics, many at once.

Width, border, lane offset, elevation and superelevation are all of this kind (ASAM OpenDRIVE 1.8).
All profiles of a network sit in one table, so that a query over any mix of profiles is one array operation.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import BoolArray, FloatArray, IntArray


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

    def find(self, profile: IntArray, s_m: FloatArray) -> tuple[IntArray, BoolArray]:
        """Return the record that holds at `s_m`, and whether there is one."""
        row = np.searchsorted(self.key, sort_keys(profile, s_m), side="right") - 1
        return row, row >= self.first[profile]

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
        row, found = self.find(profile, s_m)
        ds = np.where(found, s_m - self.start_m[row], 0.0)
        a, b, c, d = np.where(found[..., None], self.coefficients[row], 0.0).T
        return a + ds * (b + ds * (c + ds * d)), b + ds * (2.0 * c + ds * 3.0 * d)

    def value(self, profile: IntArray, s_m: FloatArray) -> FloatArray:
        """Evaluate profiles; see `value_and_slope`."""
        return self.value_and_slope(profile, s_m)[0]
