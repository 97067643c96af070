"""Life of a track: born from an unmatched detection, confirmed, coasted and deleted, all by elapsed time."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.filters.motion_models import Setting, check_range, table
from smartmot.types import BoolArray, FloatArray, IntArray

_ROUNDING_S = 1e-6
"""Stamps in seconds since 1970 carry 2.4e-7 s of rounding; a limit of three frames must include the third."""


LONGEST_GAP_S = 2.0
"""A frame that comes so late still finds the tracks of the one before, however short `max_age_s` is: data at
1 Hz can be tracked. After a longer pause, as between two recordings, nobody knows who is who."""


REST_MPS = 1.0
"""Slower than anybody walks (1.4 m/s), and over the error of a velocity that follows 1 s of detections."""

REST_SEEN_S = 1.0
"""A velocity is known after about that time; before, everything new counts as slow."""


@dataclass(frozen=True, slots=True)
class LifecycleConfig:
    """When a track changes its status.

    Args:
        confirm_s: Age at which a matched track is confirmed; until then it is tentative. 0: at birth, the
            paper's min_hits 1.
        max_age_s: Time without a match, or outside the monitored area, that a track survives. The paper's
            max_age of 3 frames at 20 Hz. A match in the first frame after that time still counts, unless no
            frame came for over `LONGEST_GAP_S`.
        tentative_max_age_s: The same for a tentative track. None: as `max_age_s`.
        birth_score: Detections under it start no track.
        rest_max_age_s: The same for what was at rest when last seen: hidden by a passing bus it is still
            there afterwards. None: as `max_age_s`. At rest is a confirmed track that was followed for
            `REST_SEEN_S` and is slower than `REST_MPS`.

    Raises:
        ConfigError: A value is outside its range.
    """

    confirm_s: Setting = 0.0
    max_age_s: Setting = 0.15
    tentative_max_age_s: Setting | None = None
    birth_score: Setting = 0.0
    rest_max_age_s: Setting | None = None

    def __post_init__(self) -> None:
        check_range(self, "confirm_s", 0.0, math.inf)
        check_range(self, "max_age_s", 0.0, math.inf)
        if self.tentative_max_age_s is not None:
            check_range(self, "tentative_max_age_s", 0.0, math.inf)
        check_range(self, "birth_score", 0.0, 1.0)
        if self.rest_max_age_s is not None:
            check_range(self, "rest_max_age_s", 0.0, math.inf)


class Lifecycle:
    """The rules for M tracks at a time.

    Args:
        config: Times.

    Attributes:
        knows_rest: Whether what was at rest lives longer.
        least_max_age_s: The shortest of all categories' times without a match.
    """

    def __init__(self, config: LifecycleConfig) -> None:
        self._confirm_s = table(config.confirm_s) - _ROUNDING_S
        self._max_age_s = table(config.max_age_s) + _ROUNDING_S
        tentative = config.tentative_max_age_s
        self._tentative_max_age_s = None if tentative is None else table(tentative) + _ROUNDING_S
        rest_max_age = config.rest_max_age_s
        self._rest_max_age_s = (
            None if rest_max_age is None else np.maximum(table(rest_max_age) + _ROUNDING_S, self._max_age_s)
        )
        self.knows_rest = rest_max_age is not None
        self.least_max_age_s = float(self._max_age_s.min())
        self._least_of_any_s = self.least_max_age_s
        if self._tentative_max_age_s is not None:
            self._least_of_any_s = min(self.least_max_age_s, float(self._tentative_max_age_s.min()))

    def confirm(
        self, confirmed: BoolArray, age_s: FloatArray, coasted_s: FloatArray, code: IntArray
    ) -> BoolArray:
        """Which tracks are confirmed now; a confirmed track stays so.

        Args:
            confirmed: (M,) before this frame.
            age_s: (M,) time since birth.
            coasted_s: (M,) time since the last match.
            code: (M,) positions in CATEGORIES.

        Returns:
            (M,) flags.
        """
        return confirmed | ((coasted_s <= 0.0) & (age_s >= self._confirm_s.take(code)))

    def bridges(self, gap_s: float, code: IntArray) -> BoolArray:
        """Which tracks may be matched after a time without frames.

        Args:
            gap_s: Time since the last frame.
            code: (M,) positions in CATEGORIES.

        Returns:
            (M,) flags.
        """
        return gap_s <= np.maximum(self._max_age_s, LONGEST_GAP_S).take(code)

    def overdue(self, coasted_s: FloatArray, code: IntArray) -> BoolArray:
        """(M,) which tracks live on only because they were at rest.

        Args:
            coasted_s: (M,) time since the last match.
            code: (M,) positions in CATEGORIES.
        """
        late: BoolArray = coasted_s > self._max_age_s.take(code)
        return late

    def all_young(self, coasted_s: FloatArray, confirmed: bool) -> bool:
        """Whether no track is old enough to die, whatever its category.

        Args:
            coasted_s: (M,) time since the last match.
            confirmed: Whether no track is tentative.
        """
        least_s = self.least_max_age_s if confirmed else self._least_of_any_s
        return not np.count_nonzero(coasted_s > least_s)

    def survives(
        self,
        confirmed: BoolArray | None,
        coasted_s: FloatArray,
        outside_s: FloatArray | None,
        code: IntArray,
        resting: BoolArray | None = None,
    ) -> BoolArray:
        """Which tracks live on.

        Args:
            confirmed: (M,) flags; None: all are.
            coasted_s: (M,) time since the last match.
            outside_s: (M,) time since the track was last seen inside the monitored area; None: all are there.
            code: (M,) positions in CATEGORIES.
            resting: (M,) what was at rest when last seen; None: nothing.

        Returns:
            (M,) flags; False for tracks unmatched or outside for longer than they may be.
        """
        unseen_s = coasted_s if outside_s is None else np.maximum(coasted_s, outside_s)
        alive: BoolArray = unseen_s <= self._max_age_s.take(code)
        if resting is not None and self._rest_max_age_s is not None:
            hidden = resting & (coasted_s <= self._rest_max_age_s.take(code))
            if outside_s is not None:
                hidden &= outside_s <= coasted_s
            alive |= hidden
        if self._tentative_max_age_s is not None and confirmed is not None:
            alive &= confirmed | (coasted_s <= self._tentative_max_age_s.take(code))
        return alive
