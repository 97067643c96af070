"""Brake rules: from an assessed frame to a command. The paper's rule is one; yours is another."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Protocol, cast

import numpy as np

from smartmot.decision.aeb import AebConfig, AebState, Event, Situation, decide
from smartmot.decision.braking import overhang_m
from smartmot.decision.ego_path import PathRelation, path_of_forecast, relation
from smartmot.errors import ShapeError
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, EgoState, FloatArray, Forecast, Threats, Tracks, frozen, unchecked

STANDING_MPS = 0.1
"""Below this the ego counts as standing still."""


@dataclass(frozen=True, slots=True)
class LeadObject:
    """The object on the route that the speed is adapted to.

    Args:
        track_id: its track.
        gap_m: free distance from the ego's front.
        speed_mps: its speed along the ego's heading.

    Raises:
        ShapeError: gap or speed is no finite number.
    """

    track_id: int
    gap_m: float
    speed_mps: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.gap_m) and math.isfinite(self.speed_mps)):
            raise ShapeError(f"lead object: gap and speed must be finite, got {self}")


@dataclass(frozen=True, slots=True)
class Command:
    """What perception asks of the vehicle.

    Args:
        emergency: brake, and hold; fully unless `decel_mps2` is given.
        lead: the object whose speed the ego adapts its own to, where it does that; None: none.
        warning: warn the driver. It changes nothing of the drive: the ego has no driver.
        decel_mps2: deceleration of a partial brake, at most what the brakes give; None: full.

    Raises:
        ShapeError: `emergency` or `warning` is no truth value, `lead` no object to follow, or `decel_mps2` no
            positive number of an emergency.
    """

    emergency: bool
    lead: LeadObject | None = None
    warning: bool = False
    decel_mps2: float | None = None

    def __post_init__(self) -> None:
        # any text or class would count as true, and brake
        for name in ("emergency", "warning"):
            value = getattr(self, name)
            if not isinstance(value, (bool, np.bool_)):
                raise ShapeError(f"command: {name} must be true or false, got {value!r}")
        asked = self.decel_mps2
        if asked is not None and not (
            self.emergency and isinstance(asked, (float, int, np.number)) and 0.0 < asked < math.inf
        ):
            raise ShapeError(
                f"command: decel_mps2 must be a positive number, and only with emergency, got {asked!r}"
            )
        if not (self.lead is None or isinstance(self.lead, LeadObject)):
            raise ShapeError(f"command: lead must be a LeadObject or None, got {self.lead!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Assessment:
    """What a brake rule knows of one frame: the ego, M tracks, and how these relate to the ego's way.

    Args:
        ego: odometry now.
        tracks: M tracks at the detections' time.
        forecast: of the tracks, from the ego's time on.
        ego_forecast: of the ego, at the same times.
        threats: tracks on a collision course that count, nearest in time first.
        time_to_collision_s: (M,) first time at which the forecasts meet; infinite where they never do, and of
            objects that do not count.
        ahead_m: (M,) distance along the ego's heading from its centre to each box; negative behind it.
        on_way: (M,) known to be in the ego's way.
        entering: (M,) moving vulnerable road users whose forecast enters the ego's way.
        threatening: (M,) on a collision course, and counting.
        vulnerable: (M,) vulnerable road users.
        lead: the object on the route that the speed would be adapted to.
        braking_distance_m: that the ego needs at its present speed.
        counts: (M,) which the monitored area lets count at all, wherever they are going to be.
        path: the ego's planned path, if its forecast follows it; None: the ego keeps its turn rate.

    What the properties `path_...` say is computed when a rule first asks for one of them.

    Raises:
        ShapeError: shapes disagree.
    """

    ego: EgoState
    tracks: Tracks
    forecast: Forecast
    ego_forecast: Forecast
    threats: Threats
    time_to_collision_s: FloatArray
    ahead_m: FloatArray
    on_way: BoolArray
    entering: BoolArray
    threatening: BoolArray
    vulnerable: BoolArray
    lead: LeadObject | None
    braking_distance_m: float
    counts: BoolArray
    path: PlannedPath | None = None
    _on_path: PathRelation | None = field(default=None, init=False, repr=False)

    def __post_init__(self) -> None:
        shape = (len(self.tracks),)
        for name in ("time_to_collision_s", "ahead_m"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, shape, name))
        for name in ("on_way", "entering", "threatening", "vulnerable", "counts"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.bool_, shape, name))

    @property
    def path_gap_m(self) -> FloatArray:
        """(M,) free distance along the ego's path, from its front to the near face of each object."""
        return self._relation().gap_m

    @property
    def path_aside_m(self) -> FloatArray:
        """(M,) free distance from each object to the width that the ego sweeps; 0 or negative: in it."""
        return self._relation().aside_m

    @property
    def path_speed_mps(self) -> FloatArray:
        """(M,) speed of each object along the ego's path; negative: it comes towards the ego."""
        return self._relation().speed_mps

    @property
    def path_aside_mps(self) -> FloatArray:
        """(M,) rate at which `path_aside_m` grows; negative: the object comes nearer to the swept width."""
        return self._relation().aside_mps

    @property
    def path_offset_m(self) -> FloatArray:
        """(M,) distance of each centre from the middle of the width that the ego sweeps; left is positive."""
        return self._relation().offset_m

    def _relation(self) -> PathRelation:
        """How the tracks, moved on to the ego's time, lie to the ego's path."""
        if self._on_path is None:
            path = self.path or path_of_forecast(self.ego, self.ego_forecast)
            of_tracks = relation(self.ego, path, self.tracks, self.forecast, self.ego_forecast)
            object.__setattr__(self, "_on_path", of_tracks)
        return cast(PathRelation, self._on_path)


class BrakeRule(Protocol):
    """Decides; remembers nothing but in the state that it returns, so that a run can go on from any frame."""

    def decide(self, state: Any, now: Assessment, /) -> tuple[Any, Command, tuple[Event, ...]]:
        """One decision.

        Args:
            state: what the rule returned in the frame before, of whatever type; None in the first frame.
            now: the frame.

        Returns:
            The next state, the command, and the events of this frame.
        """
        ...


class PaperRule:
    """Brakes for what is on a collision course and near: the rule of the paper, `smartmot.decision.aeb`.

    Args:
        config: its conditions.
    """

    def __init__(self, config: AebConfig | None = None) -> None:
        self.config = config or AebConfig()

    def decide(self, state: AebState | None, now: Assessment) -> tuple[AebState, Command, tuple[Event, ...]]:
        """One decision; see `BrakeRule`."""
        next_state, emergency, events = decide(state or AebState(), self._situation(now), self.config)
        return next_state, unchecked(Command, emergency, now.lead, False, None), events

    def _situation(self, now: Assessment) -> Situation:
        predicted = entering = occupied = False
        nearest, braking_distance = math.inf, self.config.braking_factor * now.braking_distance_m
        if len(now.tracks):
            distance = now.ahead_m - overhang_m(now.ego)
            near = distance < max(braking_distance, self.config.near_m)
            predicted = bool(np.count_nonzero(now.threatening))
            entering = bool(np.count_nonzero(now.entering))
            # VRUs hold the ego wherever they are on its way, all others only near
            occupied = bool(np.count_nonzero(now.on_way & (near | now.vulnerable)))
            relevant = now.on_way | now.threatening
            if np.count_nonzero(relevant):
                nearest = max(float(distance[relevant].min()), 0.0)
        standing = now.ego.speed_mps < STANDING_MPS
        return unchecked(
            Situation, now.ego.stamp_s, predicted, nearest, braking_distance, entering, occupied, standing
        )
