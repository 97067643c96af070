"""Errors of where the ego believes to be, and of how it believes to move; ground truth stays what it is.

Two frames are kept apart. Objects are tracked in the *odometry frame*: it begins where the ego is, and drifts
with the errors of its speed and turn rate. *Localisation* says where the ego is on the map, and its errors
move the map against everything perceived: lanes, kerbs and the margin lie elsewhere, detections do not.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from scenarios.sources.frames import Frame, FrameSource, StepResult
from smartmot.area.localised import Alignment
from smartmot.decision.rules import Command
from smartmot.errors import ConfigError
from smartmot.geometry import from_frame, to_frame
from smartmot.types import Detections, EgoState, FloatArray


@dataclass(frozen=True, slots=True)
class LocalisationErrors:
    """How far the pose on the map is from the true one, in the ego's frame.

    Published: 0.05 to 0.1 m RMS for GNSS, LiDAR and inertial sensors against a map (Wan et al., ICRA 2018);
    what local streets need is 0.29 m and 0.5 degrees (Reid et al., arXiv 1906.01061).

    Args:
        lateral_m: bias; positive: the ego believes to be farther left than it is.
        longitudinal_m: bias; positive: farther ahead.
        heading_rad: bias; positive: turned farther to the left.
        drift_sigma_m: standard deviation of a slow error along and across, each a Gauss-Markov process.
        drift_time_s: its correlation time (assumed).
        noise_sigma_m: standard deviation of an error along and across that each frame draws anew.
        noise_heading_rad: the same of the heading.

    Raises:
        ConfigError: a value is not finite, a deviation is negative, or the time is not positive.
    """

    lateral_m: float = 0.0
    longitudinal_m: float = 0.0
    heading_rad: float = 0.0
    drift_sigma_m: float = 0.0
    drift_time_s: float = 10.0
    noise_sigma_m: float = 0.0
    noise_heading_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.lateral_m + self.longitudinal_m) and abs(self.heading_rad) <= math.pi):
            raise ConfigError("localisation: biases must be finite, that of the heading half a turn or less")
        deviations = (self.drift_sigma_m, self.noise_sigma_m, self.noise_heading_rad)
        if not all(0.0 <= deviation < math.inf for deviation in deviations):
            raise ConfigError(f"localisation: deviations must not be negative, got {deviations}")
        if not 0.0 < self.drift_time_s < math.inf:
            raise ConfigError(f"localisation: drift_time_s must be positive, got {self.drift_time_s}")


@dataclass(frozen=True, slots=True)
class OdometryErrors:
    """What the ego knows of its own motion.

    Args:
        speed: relative error of the speed, as of a worn tyre: 0.01 is 1 % too fast.
        yaw_rate_radps: bias of the turn rate.

    Raises:
        ConfigError: the speed would not be positive any more, or the bias is not finite.
    """

    speed: float = 0.0
    yaw_rate_radps: float = 0.0

    def __post_init__(self) -> None:
        if not (-1.0 < self.speed < math.inf and math.isfinite(self.yaw_rate_radps)):
            raise ConfigError(f"odometry: speed must be over -1 and all finite, got {self}")


NO_LOCALISATION_ERRORS, NO_ODOMETRY_ERRORS = LocalisationErrors(), OdometryErrors()

_DRIFT_STEP_S = 0.01
"""Spacing of the drift's values; between two of them it is the earlier one."""
_DRIFT_BLOCK = 100
"""So many values are drawn at once."""
_DRIFT, _NOISE = 0x10C1, 0x10C2
"""Streams of random numbers of their own, apart from the sensor's."""


class _Drift:
    """A stationary Gauss-Markov process in two components, a function of seed and time alone."""

    def __init__(self, errors: LocalisationErrors, seed: int) -> None:
        kept = math.exp(-_DRIFT_STEP_S / errors.drift_time_s)
        # each value keeps a share of the one before, and the variance stays sigma squared
        self._first_m, self._step_m = errors.drift_sigma_m, errors.drift_sigma_m * math.sqrt(1.0 - kept**2)
        age = np.subtract.outer(np.arange(_DRIFT_BLOCK), np.arange(_DRIFT_BLOCK))
        self._kept = np.where(age >= 0, kept ** np.maximum(age, 0), 0.0)
        self._kept_of_last = kept ** np.arange(1, _DRIFT_BLOCK + 1)
        self._seed = seed
        self._values: FloatArray = np.zeros((0, 2))

    def at(self, time_s: float) -> tuple[float, float]:
        """The errors ahead and to the left, metres, at a time from 0 on."""
        k = max(int(time_s / _DRIFT_STEP_S + 1e-6), 0)
        while k >= len(self._values):
            self._values = np.concatenate((self._values, self._block(len(self._values) // _DRIFT_BLOCK)))
        ahead_m, left_m = self._values[k].tolist()
        return ahead_m, left_m

    def _block(self, number: int) -> FloatArray:
        drawn = np.random.default_rng((self._seed, _DRIFT, number)).standard_normal((_DRIFT_BLOCK, 2))
        drawn[1:] *= self._step_m
        drawn[0] *= self._step_m if number else self._first_m
        block: FloatArray = self._kept @ drawn
        if number:
            block += np.outer(self._kept_of_last, self._values[-1])
        return block


class PoseErrors:
    """Puts the errors of localisation and odometry into the frames of one run.

    Args:
        localisation, odometry: the errors.
        seed: of the run; frames and decisions change nothing in what is drawn for a time.
        start_s: time of the run's start, from which the drift is counted.
    """

    def __init__(
        self,
        localisation: LocalisationErrors = NO_LOCALISATION_ERRORS,
        odometry: OdometryErrors = NO_ODOMETRY_ERRORS,
        seed: int = 0,
        start_s: float = 0.0,
    ) -> None:
        self._localisation, self._odometry = localisation, odometry
        self._seed, self._start_s = seed, start_s
        self._drift = _Drift(localisation, seed)
        self._poses: list[tuple[EgoState, EgoState]] = []  # true and believed, in the order of time

    def drive(self, ego: EgoState) -> EgoState:
        """Go on to the true pose of a moment, no earlier than the last.

        Returns:
            The odometry then, in its own frame, which is the true one at the first moment.
        """
        if self._odometry == NO_ODOMETRY_ERRORS:
            return ego
        if self._poses and self._poses[-1][0].stamp_s == ego.stamp_s:
            return self._poses[-1][1]
        speed, bias = 1.0 + self._odometry.speed, self._odometry.yaw_rate_radps
        x_m, y_m, yaw_rad = ego.x_m, ego.y_m, ego.yaw_rad
        if self._poses:
            before, believed = self._poses[-1]
            elapsed_s = ego.stamp_s - before.stamp_s
            driven = to_frame(np.array([ego.x_m, ego.y_m]), before.x_m, before.y_m, before.yaw_rad) * speed
            # the chord of an arc lies half its turn to the side
            course_rad = believed.yaw_rad + bias * elapsed_s / 2
            x_m, y_m = from_frame(driven, believed.x_m, believed.y_m, course_rad).tolist()
            yaw_rad = believed.yaw_rad + (ego.yaw_rad - before.yaw_rad) + bias * elapsed_s
        self._poses.append(
            (
                ego,
                replace(
                    ego,
                    x_m=x_m,
                    y_m=y_m,
                    yaw_rad=math.remainder(yaw_rad, 2 * math.pi),
                    speed_mps=ego.speed_mps * speed,
                    accel_mps2=ego.accel_mps2 * speed,
                    yaw_rate_radps=ego.yaw_rate_radps + bias,
                ),
            )
        )
        return self._poses[-1][1]

    def localised(self, ego: EgoState) -> EgoState:
        """Where the ego believes to be on the map when it is truly at a pose, map frame."""
        errors = self._localisation
        ahead_m, left_m, turn_rad = errors.longitudinal_m, errors.lateral_m, errors.heading_rad
        if errors.drift_sigma_m:
            drift_ahead_m, drift_left_m = self._drift.at(ego.stamp_s - self._start_s)
            ahead_m, left_m = ahead_m + drift_ahead_m, left_m + drift_left_m
        if errors.noise_sigma_m or errors.noise_heading_rad:
            milliseconds = round((ego.stamp_s - self._start_s) * 1e3)
            drawn = np.random.default_rng((self._seed, _NOISE, max(milliseconds, 0))).standard_normal(3)
            ahead_m += errors.noise_sigma_m * float(drawn[0])
            left_m += errors.noise_sigma_m * float(drawn[1])
            turn_rad += errors.noise_heading_rad * float(drawn[2])
        x_m, y_m = from_frame(np.array([ahead_m, left_m]), ego.x_m, ego.y_m, ego.yaw_rad).tolist()
        return replace(ego, x_m=x_m, y_m=y_m, yaw_rad=math.remainder(ego.yaw_rad + turn_rad, 2 * math.pi))

    def perceived(self, frame: Frame) -> Frame:
        """A true frame as the ego perceives it: detections and path lie to it as they do in truth."""
        odometry = self.drive(frame.ego)
        localised = self.localised(frame.ego)
        if odometry is frame.ego:
            return replace(frame, localised=localised)
        pose = {"speed_mps": odometry.speed_mps, "yaw_rate_radps": odometry.yaw_rate_radps}
        now = Alignment(frame.ego, odometry)
        return replace(
            frame,
            ego=odometry,
            detections=self._measured(frame.detections),
            path=None if frame.path is None else now.path(frame.path),
            mission=frame.mission or frame.path,
            localised=replace(localised, **pose),
        )

    def _measured(self, detections: Detections) -> Detections:
        """Detections in the odometry frame as it was when they were measured."""
        while len(self._poses) > 1 and self._poses[1][0].stamp_s <= detections.stamp_s:
            del self._poses[0]  # later frames are measured later
        then = Alignment(*self._poses[0])
        velocity = detections.velocity_mps
        if velocity is not None:
            turn_rad = then.turn_rad
            velocity = from_frame(velocity, 0.0, 0.0, turn_rad)
        return replace(detections, boxes=then.boxes(detections.boxes), velocity_mps=velocity)


class WithPoseErrors:
    """A source of frames with errors of localisation and odometry, such as a recorded drive.

    A simulation has those of its preset anyway.

    Args:
        source: not yet started; its frames are taken for true.
        localisation, odometry: the errors.
        seed: of what is drawn.
    """

    def __init__(
        self,
        source: FrameSource,
        localisation: LocalisationErrors = NO_LOCALISATION_ERRORS,
        odometry: OdometryErrors = NO_ODOMETRY_ERRORS,
        seed: int = 0,
    ) -> None:
        self._source = source
        self._made = (localisation, odometry, seed)
        self._errors: PoseErrors | None = None

    def start(self) -> StepResult:
        """Go to the first frame; see `FrameSource`."""
        return self._perceived(self._source.start())

    def step(self, command: Command | None) -> StepResult:
        """Go on to the next frame; see `FrameSource`."""
        return self._perceived(self._source.step(command))

    def _perceived(self, at: StepResult) -> StepResult:
        if at.frame is None:
            return at
        if self._errors is None:
            self._errors = PoseErrors(*self._made, start_s=at.frame.stamp_s)
        return replace(at, frame=self._errors.perceived(at.frame))
