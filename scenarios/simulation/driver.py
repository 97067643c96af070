"""A driver who brakes, as the robot does in tests of the United States (FMVSS No. 127, S10)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenarios.brakes import BrakeStage
from scenarios.errors import ScenarioError


@dataclass(frozen=True, slots=True)
class DriverBrake:
    """A brake pedal that is pressed once, and held to the end.

    Args:
        decel_mps2: deceleration that the pedal alone gives.
        ramp_s: from the onset to that deceleration, linear.
        after_warning_s: onset this long after the first warning; None: a warning changes nothing.
        at_ttc_s: onset when the free distance to the target over the speed at which it shrinks falls to this;
            None: the distance changes nothing.

    Raises:
        ScenarioError: a value is out of range, or there is no onset, or there are two.
    """

    decel_mps2: float
    ramp_s: float
    after_warning_s: float | None = None
    at_ttc_s: float | None = None

    def __post_init__(self) -> None:
        if not (0.0 < self.decel_mps2 < math.inf and 0.0 <= self.ramp_s < math.inf):
            raise ScenarioError(
                "driver: decel_mps2 must be positive and ramp_s not negative, got "
                f"{self.decel_mps2:g} m/s2 and {self.ramp_s:g} s"
            )
        onsets = [value for value in (self.after_warning_s, self.at_ttc_s) if value is not None]
        if len(onsets) != 1 or not 0.0 <= onsets[0] < math.inf:
            raise ScenarioError("driver: give one of after_warning_s and at_ttc_s, not negative")

    def stage(self, max_decel_mps2: float) -> BrakeStage:
        """Deceleration over the time since the onset, at most what the brakes give."""
        return BrakeStage(0.0, self.ramp_s, 0.0, min(self.decel_mps2, max_decel_mps2))

    def onset_s(self, time_s: float, warning_time_s: float | None, ttc_s: float | None) -> float | None:
        """When the pedal is pressed; None: nothing says so yet.

        Args:
            time_s: of a decision.
            warning_time_s: of the first warning; None: there was none.
            ttc_s: time to collision with the target now; None: there is none.
        """
        if self.after_warning_s is not None:
            return None if warning_time_s is None else max(warning_time_s + self.after_warning_s, time_s)
        if self.at_ttc_s is None or ttc_s is None or ttc_s > self.at_ttc_s + FORESIGHT_S:
            return None
        return time_s + max(ttc_s - self.at_ttc_s, 0.0)


FORESIGHT_S = 0.1
"""Decisions come in frames. At constant speed the time between two of them is known ahead, so that the pedal
need not wait for a frame; no sensor here has fewer than 10 frames in a second."""
