"""Named configurations of the tracker, each a frozen value with its source.

`smartmot`: the paper's reference code, in physical units (`TrackerConfig.paper`).

`centerpoint`: CenterPoint's tracker as "PREMOVE", section 4, describes it: state [x, y, vx, vy], constant
velocity, Hungarian assignment on the distance of the centres under a threshold per class, tracks kept for
`max_age` without detection (its 3 drops a track at the third missed frame) and not shown meanwhile; size
and heading are those of the detection. Thresholds: CenterPoint, tools/nusc_tracking/pub_tracker.py, the
99.9 percentile of the displacement within 0.5 s; bus and trailer count as trucks. Its forecast is a
straight line over a settable time, 2 s by default (`forecast_config`). Its parameters are here
`association.gate_m`, `lifecycle.max_age_s` and, for detection_th, `score_threshold`; its class map is the
category that a detection is given, or `classes.csv` beside recorded data. The published code matches
greedily and has no filter: it moves a detection back by its own velocity, so without a detector that measures
velocity it does not predict at all.

`ab3dmot`: AB3DMOT_libs/model.py and kalman_filter.py, parameters for PointRCNN on KITTI at 10 Hz:
generalised IoU over -0.2 for cars and -0.4 for pedestrians, 2 m for cyclists; R = 1, P0 = 10 and 10,000 on
the velocities, Q = 1 and 0.01 on the velocities per frame. It confirms after three hits (one for
pedestrians) and shows coasted tracks for one missed frame (three for the others). Differences: the height
takes no part, IoU is on the ground, and time stands in for counts of frames.

`default`: the best we know for the detections of a real detector. Chosen on KITTI at 10 Hz with PointRCNN
from wide plateaus that the sequences share, not from the highest peak (docs/tracking.md;
`python -m benchmarks.tune_tracker`). Its thresholds on scores are relative to the detector's own
(`smartmot.tracking.scores`). All else is physical.

`imm` and `ukf`: `default` with filters of filterpy, interacting models and an unscented filter
(`smartmot.filters.filterpy_motions`), to compare with.
"""

from __future__ import annotations

import math
from dataclasses import replace

from smartmot.errors import ConfigError
from smartmot.filters.existence import ExistenceConfig
from smartmot.filters.filterpy_motions import InteractingModels, UnscentedTurnRate
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import ConstantVelocity, DecayingAcceleration, PerCategory
from smartmot.forecast import ForecastConfig
from smartmot.tracking.association import AssociationConfig
from smartmot.tracking.lifecycle import LifecycleConfig
from smartmot.tracking.profile import DetectorProfile, is_profile
from smartmot.tracking.tracker import ReportConfig, TrackerConfig

_FRAME_S = 0.1
"""Both peers count in frames; here in those of KITTI, 10 Hz."""


_PLAIN = 0.0
"""The peers tell nothing of who moves: the paper's threshold on the speed alone. Their filters are so unsure
of a velocity that by our rule of 2.5 standard deviations a walking pedestrian would stand for a second."""


def _frames(count: int) -> float:
    """Time that `count` frames take and `count + 1` do not, whatever the jitter of their stamps."""
    return (count + 0.5) * _FRAME_S


def _centerpoint() -> TrackerConfig:
    displacement_m = PerCategory(
        car=4.0, pedestrian=1.0, cyclist=3.0, truck=5.5, motorcycle=13.0, unknown=4.0
    )
    return TrackerConfig(
        motion=ConstantVelocity(velocity_m2ps3=2.0),
        filter=BevFilterConfig(position_sigma_m=0.2, use_size=False, use_yaw=False),
        association=AssociationConfig(cost="distance", gate_m=displacement_m),
        lifecycle=LifecycleConfig(confirm_s=0.0, max_age_s=_frames(2)),
        report=ReportConfig(coasted_s=0.0),
        score_threshold=0.1,
        dynamic_sigmas=_PLAIN,
    )


def _ab3dmot() -> TrackerConfig:
    per_frame = 1.0 / _FRAME_S
    velocity = 0.01 * per_frame**3
    return TrackerConfig(
        motion=ConstantVelocity(
            position_m2ps=per_frame,
            velocity_m2ps3=velocity,
            area_m4ps=per_frame,
            area_rate_m4ps3=0.0,
            ratio_ps=per_frame,
            yaw_rad2ps=per_frame,
            yaw_rate_rad2ps3=0.0,
        ),
        filter=BevFilterConfig(
            position_sigma_m=1.0,
            area_sigma_m2=1.0,
            ratio_sigma=1.0,
            yaw_sigma_rad=1.0,
            heading="detector",
            initial_factor=10.0,
            initial_speed_sigma_mps=math.sqrt(10_000.0) * per_frame,
            initial_area_rate_sigma_m2ps=0.0,
            initial_yaw_rate_sigma_radps=0.0,
        ),
        association=AssociationConfig(
            cost=("generalised_overlap", "generalised_overlap", "distance") + ("generalised_overlap",) * 3,
            method=("hungarian", "greedy", "hungarian", "hungarian", "hungarian", "hungarian"),
            giou_threshold=PerCategory.grouped(-0.2, -0.4, -0.2),
            gate_m=PerCategory.grouped(10.0, 4.0, 2.0),
        ),
        lifecycle=LifecycleConfig(
            confirm_s=PerCategory.grouped(_frames(1), 0.0, _frames(1)),
            max_age_s=PerCategory.grouped(_frames(1), _frames(3), _frames(3)),
        ),
        report=ReportConfig(tentative=False),
        score_threshold=0.0,
        dynamic_sigmas=_PLAIN,
        outlier_speed_mps=60.0,
    )


def _default() -> TrackerConfig:
    return TrackerConfig(
        motion=DecayingAcceleration(),
        filter=BevFilterConfig(
            position_sigma_m=0.2,
            area_sigma_m2=0.5,
            ratio_sigma=0.3,
            yaw_sigma_rad=0.2,
            heading="evidence",
        ),
        association=AssociationConfig(
            widest_gate_m=PerCategory.grouped(20.0, 2.0, 20.0),
            # Half of what parked cars are apart sideways; two steps of who walks past.
            hidden_gate_m=1.0,
        ),
        # Times lie halfway between two frames at 10 Hz, so that jitter of the stamps changes nothing.
        lifecycle=LifecycleConfig(
            confirm_s=PerCategory.grouped(0.0, 0.0, 0.15),
            max_age_s=PerCategory.grouped(1.25, 2.55, 0.75),
            # Matters only where confirmation takes time: one missed frame.
            tentative_max_age_s=0.15,
            # As long as a bus takes to pass, 12 m at walking pace.
            rest_max_age_s=4.05,
        ),
        report=ReportConfig(
            tentative=False,
            coasted_s=PerCategory.grouped(0.15, 0.45, 0.15),
            score=PerCategory.grouped(0.0, 0.0, 0.4),
            mean_score=0.4,
        ),
        score_threshold=0.0,
        second_stage_score=0.4,
        score_reference=None,
        evidence_memory_s=1.0,
        merge_duplicates=True,
        existence=ExistenceConfig(),
    )


TRACKER_CONFIGS: dict[str, TrackerConfig] = {
    "ab3dmot": _ab3dmot(),
    "centerpoint": _centerpoint(),
    "default": _default(),
    "imm": replace(_default(), motion=InteractingModels()),
    "smartmot": TrackerConfig.paper(),
    "ukf": replace(_default(), motion=UnscentedTurnRate()),
}
"""Configurations by name."""


def tracker_config(name: str) -> TrackerConfig:
    """Named configuration.

    Args:
        name: One of TRACKER_CONFIGS, or a file with a detector's profile (`NAME.json`): `default` for that
            detector.

    Returns:
        The configuration, a frozen value: change it with `dataclasses.replace`.

    Raises:
        ConfigError: No configuration has this name, or the file is no profile.
    """
    if is_profile(name):
        return DetectorProfile.load(name).configured(TRACKER_CONFIGS["default"])
    try:
        return TRACKER_CONFIGS[name]
    except KeyError:
        raise ConfigError(
            f"tracker configuration {name!r} is unknown; choose one of {', '.join(sorted(TRACKER_CONFIGS))}, "
            "or a detector's profile (*.json)"
        ) from None


def forecast_config(name: str, horizon_s: float | None = None) -> ForecastConfig:
    """How a named configuration looks ahead.

    `ab3dmot` and `smartmot` with the tracks' turn rates, `centerpoint` in straight lines, the others each
    category as it moves.

    Args:
        name: One of TRACKER_CONFIGS.
        horizon_s: How far. None: 2 s for `centerpoint`, as "PREMOVE" has it; else the paper's 3 s, which grow
            with the braking distance.

    Returns:
        Settings for `smartmot.forecast.forecast_tracks` and `PipelineConfig`.

    Raises:
        ConfigError: No configuration has this name, or the horizon is shorter than a forecast step.
    """
    tracker_config(name)
    if name == "centerpoint":
        horizon_s = 2.0 if horizon_s is None else horizon_s
        return ForecastConfig(min_horizon_s=horizon_s, max_horizon_s=horizon_s, max_yaw_rate_radps=0.0)
    model = "ctrv" if name in ("ab3dmot", "smartmot") else "class"
    if horizon_s is None:
        return ForecastConfig(model=model)
    return ForecastConfig(model=model, min_horizon_s=horizon_s, max_horizon_s=horizon_s)


def forecast_of(config: TrackerConfig) -> ForecastConfig:
    """`forecast_config` of the named configuration whose motion this one has; else the default settings."""
    motion = config.motion
    named = (name for name, each in TRACKER_CONFIGS.items() if each.motion == motion)
    name = next(named, None)
    return ForecastConfig() if name is None else forecast_config(name)
