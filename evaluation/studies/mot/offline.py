"""Tracks with hindsight: smoothed by all detections, gaps filled, kept or left out as a whole."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.studies.mot.score_scale import with_score_scale
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.recorded.dataset import Dataset, Objects
from smartmot.filters.channels import ChannelFilter
from smartmot.filters.kalman import sizes
from smartmot.filters.motion_models import (
    AREA,
    RATIO,
    YAW,
    ConstantAcceleration,
    ConstantVelocity,
    DecayingAcceleration,
    LinearMotion,
    table,
)
from smartmot.filters.smoothing import Smoother
from smartmot.geometry import wrap_angle
from smartmot.plugins import Plugin
from smartmot.tracking.settings import CODES, ReportConfig, TrackerConfig
from smartmot.tracking.tracker import box_filter
from smartmot.types import CATEGORIES, IntArray

OFFLINE = "offline"
"""Folder of tracks and scores with hindsight."""

NEEDS_LINEAR = "--offline: smooths tracks of linear motion models: default, smartmot, centerpoint, ab3dmot"


def offline_config(config: TrackerConfig | Plugin, data: Dataset) -> TrackerConfig:
    """A configuration that shows all that hindsight needs: every match of every track, tentative ones too.

    Raises:
        ArgumentError: Its filter has no linear motion model, or it is a tracker of the user's own.
    """
    if not isinstance(config, TrackerConfig) or not isinstance(
        box_filter(config.motion, config.filter), ChannelFilter
    ):
        raise ArgumentError(NEEDS_LINEAR)
    shown = ReportConfig(tentative=True, coasted_s=0.0)
    return replace(with_score_scale(config, data, "file"), report=shown)


def with_hindsight(tracked: TrackedSequence, config: TrackerConfig, several: bool = False) -> TrackedSequence:
    """Tracks of a whole sequence, smoothed.

    A track counts if it was confirmed and the mean score of all its detections reaches
    `ReportConfig.mean_score`; then from its first detection to its last, in every frame between; weaker ones
    than `ReportConfig.score` are no ends. The category of each row is what the tracker took it for then.

    Args:
        tracked: The matches of a tracker with `offline_config`, tentative ones too.
        config: What the online tracker shows, with its score scale.
        several: Whether scores are relative to each detector's own already.
    """
    tracks, mean, covariance = tracked.tracks, tracked.mean, tracked.covariance
    assert mean is not None
    assert covariance is not None
    assert tracked.confirmed is not None
    reference = config.score_reference
    scale = 1.0 if several or reference is None else reference
    least = table(config.report.mean_score) * table(scale)
    least_end = table(config.report.score) * table(scale)
    stamp_s = tracked.sequence.stamp_s
    smoothers: dict[int, Smoother] = {}
    parts: list[Objects] = []
    for rows in _tracks(tracks):
        code = _category(tracks, rows)
        if not tracked.confirmed[rows].any() or tracks.score[rows].mean() < least[code]:
            continue
        sure = np.flatnonzero(tracks.score[rows] >= least_end[code])
        if not len(sure):
            continue
        rows = rows[sure[0] : sure[-1] + 1]
        smoother = smoothers.setdefault(code, Smoother(_linear(config), code))
        frames = np.arange(tracks.frame[rows[0]], tracks.frame[rows[-1]] + 1)
        states, _ = smoother.smoothed(
            stamp_s[tracks.frame[rows]], mean[rows], covariance[rows], stamp_s[frames]
        )
        before = rows[np.searchsorted(tracks.frame[rows], frames, side="right") - 1]
        parts.append(
            replace(
                tracks[before],
                frame=frames,
                center_m=states[:, :AREA],
                size_m=sizes(states[:, AREA], states[:, RATIO]),
                yaw_rad=wrap_angle(states[:, YAW]),
                velocity_mps=states[:, 5:7],
            )
        )
    smooth = _together(parts)
    count = len(smooth)
    return TrackedSequence(tracked.sequence, smooth, np.zeros(count), np.zeros((count, 2)), np.zeros(count))


def _linear(config: TrackerConfig) -> LinearMotion:
    assert isinstance(config.motion, ConstantVelocity | ConstantAcceleration | DecayingAcceleration)
    return config.motion


def _tracks(tracks: Objects) -> list[IntArray]:
    """Rows of each track in the order of time."""
    order = np.lexsort((tracks.frame, tracks.object_id))
    ends = np.flatnonzero(np.diff(tracks.object_id[order])) + 1
    return [rows for rows in np.split(order, ends) if len(rows)]


def _category(tracks: Objects, rows: IntArray) -> int:
    """The category with the greatest sum of scores."""
    code = np.array([CODES[name] for name in tracks.category[rows].tolist()], dtype=np.int64)
    return int(np.bincount(code, tracks.score[rows], len(CATEGORIES)).argmax())


def _together(parts: list[Objects]) -> Objects:
    """The rows of all tracks in the order of the frames."""
    if not parts:
        return Objects.empty()
    names = [item.name for item in fields(Objects)]
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    order = np.argsort(columns["frame"], kind="stable")
    return Objects(**{name: values[order] for name, values in columns.items()})
