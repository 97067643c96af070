"""Errors of detections as frozen values: by category and range, correlated, with misses and ghosts."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from scenarios.errors import ScenarioError
from smartmot.filters.motion_models import PerCategory, Setting, table
from smartmot.types import CATEGORIES

OCCLUSION_SHARES = (0.85, 0.5)
"""Visible shares from which an object counts as fully visible and as partly hidden; under the last it is
largely hidden. Levels 0, 1 and 2 of KITTI's labels, which name no shares: assumed."""

PERSISTENCE_INTERVAL_S = 0.1
"""Distance in time of the two frames that a persistence compares; KITTI's frames."""

GHOST_AHEAD_M = 1.75
"""Half a lane of 3.5 m on either side of the line ahead: where a false positive is in the ego's way."""

NO_GHOSTS = PerCategory(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Tail:
    """Mixture of two centred Gaussians: the core, and a wider one. Which of them it is, is a Markov chain.

    Args:
        share: of the errors that the wider one makes.
        ratio: its standard deviation over the core's.
        persistence: P(wider, if wider 0.1 s ago) - P(wider, if core 0.1 s ago): gross errors last.

    Raises:
        ScenarioError: share or persistence are outside [0, 1), or the ratio under 1.
    """

    share: float = 0.0
    ratio: float = 1.0
    persistence: float = 0.0

    def __post_init__(self) -> None:
        if not (0.0 <= self.share < 1.0 and 1.0 <= self.ratio < math.inf and 0.0 <= self.persistence < 1.0):
            raise ScenarioError(
                "sensor errors: share and persistence of a tail must lie in [0, 1) and its ratio be 1 or "
                f"more; got {self.share:g}, {self.persistence:g} and {self.ratio:g}"
            )

    @property
    def core_sigma(self) -> float:
        """Standard deviation of the core, where that of the mixture is 1."""
        return 1.0 / math.sqrt(1.0 - self.share + self.share * self.ratio**2)


GAUSSIAN = Tail()


@dataclass(frozen=True, slots=True)
class BoxErrors:
    """Errors of the boxes of some categories, up to a range.

    Args:
        categories: names out of `smartmot.types.CATEGORIES`.
        up_to_m: distance of the centre up to which they hold.
        radial_bias_m: mean error along the line of sight, positive away from the ego.
        radial_sigma_m, tangential_sigma_m: standard deviation of the centre's error along the line of sight
            and across it; None: the sensor's `position_sigma_m`.
        position_tail: how heavy its tails are.
        yaw_sigma_rad: standard deviation of the heading's error, flips apart; None: the sensor's.
        yaw_tail: how heavy its tails are.
        flip: probability that a heading points backwards.
        length_bias, width_bias, length_sigma, width_sigma: mean and standard deviation of the errors of
            length and width, as shares of the true ones.
        confusion: probability that an object is reported in another category; see `CONFUSED_WITH`.
        miss: probabilities that a visible, a partly and a largely hidden object is not reported, on average
            of many frames; see `OCCLUSION_SHARES`. None: the sensor's, whatever is hidden.
        miss_persistence: correlation of two misses 0.1 s apart, at the same three levels:
            P(miss | miss) - P(miss | hit).

    Raises:
        ScenarioError: a value is out of range.
    """

    categories: tuple[str, ...] = CATEGORIES
    up_to_m: float = math.inf
    radial_bias_m: float = 0.0
    radial_sigma_m: float | None = None
    tangential_sigma_m: float | None = None
    position_tail: Tail = GAUSSIAN
    yaw_sigma_rad: float | None = None
    yaw_tail: Tail = GAUSSIAN
    flip: float = 0.0
    length_bias: float = 0.0
    width_bias: float = 0.0
    length_sigma: float = 0.0
    width_sigma: float = 0.0
    confusion: float = 0.0
    miss: tuple[float, float, float] | None = None
    miss_persistence: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not self.categories or set(self.categories) - set(CATEGORIES):
            raise ScenarioError(f"sensor errors: expected categories out of {', '.join(CATEGORIES)}")
        sigmas = (self.radial_sigma_m, self.tangential_sigma_m, self.yaw_sigma_rad)
        widths = [*(s for s in sigmas if s is not None), self.length_sigma, self.width_sigma]
        biases = (self.radial_bias_m, self.length_bias, self.width_bias)
        if not (self.up_to_m > 0.0 and all(0.0 <= s < math.inf for s in widths)):
            raise ScenarioError("sensor errors: ranges must be positive, standard deviations not negative")
        if not (all(map(math.isfinite, biases)) and self.length_bias > -1.0 and self.width_bias > -1.0):
            raise ScenarioError("sensor errors: biases must be finite, those of sizes over -1")
        if not all(0.0 <= p <= 1.0 for p in (self.flip, self.confusion, *(self.miss or ()))):
            raise ScenarioError("sensor errors: probabilities must lie in [0, 1]")
        if not all(0.0 <= c < 1.0 for c in self.miss_persistence):
            raise ScenarioError("sensor errors: persistence of misses must lie in [0, 1)")
        if len(self.miss or (0, 0, 0)) != 3 or len(self.miss_persistence) != 3:
            raise ScenarioError("sensor errors: misses need a value for each of three levels of occlusion")


CONFUSED_WITH = {
    "car": "truck",
    "pedestrian": "cyclist",
    "cyclist": "pedestrian",
    "truck": "car",
    "motorcycle": "cyclist",
    "unknown": "car",
}
"""Category that an object is taken for: of KITTI's pedestrians and cyclists measured, of the others
assumed."""


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """What is wrong with the detections of a sensor, besides the white noise of `SensorConfig`.

    Correlations are times: two errors t apart have the correlation exp(-t / time), whatever the rate; 0:
    none. Where a tail comes and goes, it lessens that of positions and headings.

    Args:
        rows: errors of boxes. Of the rows of its category an object has the first that reaches as far. Beyond
            the last it is not reported if that row has misses; else that row holds on. A category without a
            row has the sensor's own noise alone.
        position_correlation_s: of the errors of the centre.
        heading_correlation_s: of the errors of the heading, and of flips.
        size_correlation_s: of the errors of length and width, and of the category.
        velocity_sigma_mps: standard deviation of a reported velocity's error along each axis, white. None:
            detections carry no velocity. A detector of one's own that observes boxes knows none.
        ghosts_per_frame: false positives in a frame, on average, by category.
        ghost_life_s: mean time for which a ghost is reported, at the same place.
        ghost_range_m: distance within which ghosts appear, uniformly over the area, though not where the ego
            is; None: the sensor's range.
        ghost_view_rad: angle about the ego's heading in which they appear; None: the sensor's field of view.
        ghost_ahead: share of them within `GHOST_AHEAD_M` of the line ahead; None: as the area has it.

    Raises:
        ScenarioError: a value is out of range.
    """

    rows: tuple[BoxErrors, ...] = (BoxErrors(),)
    position_correlation_s: float = 0.0
    heading_correlation_s: float = 0.0
    size_correlation_s: float = 0.0
    velocity_sigma_mps: float | None = None
    ghosts_per_frame: PerCategory = field(default=NO_GHOSTS)
    ghost_life_s: float = 0.1
    ghost_range_m: PerCategory | None = None
    ghost_view_rad: float | None = None
    ghost_ahead: PerCategory | None = None

    def __post_init__(self) -> None:
        times = (self.position_correlation_s, self.heading_correlation_s, self.size_correlation_s)
        if not all(0.0 <= time < math.inf for time in (*times, self.velocity_sigma_mps or 0.0)):
            raise ScenarioError("sensor errors: times and velocity errors must be finite and not negative")
        if not (self.ghost_life_s > 0.0 and all(rate >= 0.0 for rate in self.ghosts_per_frame.values())):
            raise ScenarioError("sensor errors: ghosts must not be negative, their life must be positive")
        if self.ghost_range_m is not None and not all(r > 0.0 for r in self.ghost_range_m.values()):
            raise ScenarioError("sensor errors: ghosts need a positive range")
        if self.ghost_view_rad is not None and not 0.0 < self.ghost_view_rad <= 2.0 * math.pi:
            raise ScenarioError("sensor errors: the view of ghosts must lie in (0, 2 pi]")
        if self.ghost_ahead is not None and not all(
            0.0 <= share <= 1.0 for share in self.ghost_ahead.values()
        ):
            raise ScenarioError("sensor errors: the share of ghosts ahead must lie in [0, 1]")

    def with_rows(self, **changes: object) -> SensorErrors:
        """The same with other values in all rows."""
        rows = tuple(replace(row, **changes) for row in self.rows)  # type: ignore[arg-type]  # of many kinds
        return replace(self, rows=rows)

    def row_at(self, category: str, range_m: float) -> BoxErrors | None:
        """The row for an object; None: it is beyond the last, and not reported."""
        rows = sorted((row for row in self.rows if category in row.categories), key=lambda row: row.up_to_m)
        if not rows:
            return BoxErrors()
        return next((row for row in rows if range_m <= row.up_to_m), None if rows[-1].miss else rows[-1])

    @property
    def has_ghosts(self) -> bool:
        """Whether there are any."""
        return any(self.ghosts_per_frame.values())


def per_category(values: Iterable[float]) -> Setting:
    """One number where all categories have the same, else one for each, in the order of CATEGORIES."""
    numbers = list(values)
    return numbers[0] if len(set(numbers)) == 1 else PerCategory(*numbers)


def greatest(first: Setting, second: Setting) -> Setting:
    """The greater of two settings, category by category."""
    return per_category(np.maximum(table(first), table(second)).tolist())
