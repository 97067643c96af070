"""Emergency requests and warnings of a drive: when each begins, and how long it would have lasted."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scenarios.brakes import BrakeConfig, stop_time_s
from scenarios.sources.frames import Frame
from smartmot.area import ego_extent
from smartmot.decision.aeb import Event
from smartmot.decision.rules import STANDING_MPS
from smartmot.pipeline import FrameResult

EMERGENCY, WARNING = "emergency", "warning"


@dataclass(frozen=True, slots=True)
class Request:
    """A request for the emergency brake, or a warning.

    Args:
        kind: `EMERGENCY` or `WARNING`.
        time_s: when it came.
        speed_mps: of the ego then.
        horizon_s: how far ahead the decision looked then.
        track_id: nearest track on a collision course, else the one whose forecast comes nearest to the ego's;
            None: nothing is tracked.
        category: of it.
        ttc_s: time until the forecasts meet; None where they do not.
        gap_m: free distance ahead of the ego to it; None without a track.
        decel_mps2: of a partial brake, as it was first asked for; None: full braking.
    """

    kind: str
    time_s: float
    speed_mps: float
    horizon_s: float
    track_id: int | None
    category: str
    ttc_s: float | None
    gap_m: float | None
    decel_mps2: float | None


class RequestWatch:
    """Sees every frame of a drive, and tells when requests begin and when the rule has to let go.

    In closed loop a request ends at standstill. The recorded vehicle drives on, and a rule that holds its
    request would say nothing for the rest of the drive. So the rule begins anew once the braked vehicle would
    stand. If it then asks for the same track within a horizon, that is still the same request.

    Args:
        brakes: that would brake.
    """

    def __init__(self, brakes: BrakeConfig) -> None:
        self.requests: list[Request] = []
        self.held_s = 0.0
        self._brakes = brakes
        self._current: Request | None = None
        self._last: tuple[Request, float] | None = None
        self._until_s = 0.0
        self._warned_until_s = -np.inf
        self._before_s: float | None = None

    def see(self, frame: Frame, result: FrameResult) -> bool:
        """Take one frame; whether the rule is to begin anew in the next."""
        now, command = frame.stamp_s, result.command
        if self._current is not None and self._before_s is not None:
            self.held_s += now - self._before_s
        self._before_s = now
        if command.warning:
            if now > self._warned_until_s:
                self.requests.append(_request(WARNING, frame, result))
            self._warned_until_s = now + _horizon_s(result)
        if not command.emergency:
            self._let_go(now)
            return False
        if self._current is None:
            self._begin(_request(EMERGENCY, frame, result))
        if now < self._until_s or frame.ego.speed_mps < STANDING_MPS:
            return False
        self._let_go(now)
        return True

    def _begin(self, request: Request) -> None:
        speed_mps = max(request.speed_mps, 0.0)
        self._until_s = request.time_s + stop_time_s(self._brakes, speed_mps, request.decel_mps2)
        if self._last is not None:
            before, end_s = self._last
            same = request.track_id is not None and request.track_id == before.track_id
            if same and request.time_s <= end_s + before.horizon_s:
                self._current = before
                return
        self._current = request
        self.requests.append(request)

    def _let_go(self, now: float) -> None:
        if self._current is not None:
            self._last = self._current, now
        self._current = None


def begun_anew(result: FrameResult, time_s: float) -> FrameResult:
    """The result of the frame in which the rule begins anew, with the end of its request as an event."""
    events = [event for event in result.events if event.name != "run_start"]
    return replace(result, events=(Event(time_s, "unexpected", "end_unexpected"), *events))


def _horizon_s(result: FrameResult) -> float:
    return float(result.ego_forecast.time_s[-1])


def _nearest(result: FrameResult) -> int:
    """The track whose forecast comes nearest to the ego's at the same time."""
    apart = result.forecast.center_m - result.ego_forecast.center_m
    return int(np.argmin(np.hypot(apart[..., 0], apart[..., 1]).min(axis=1)))


def _request(kind: str, frame: Frame, result: FrameResult) -> Request:
    threats, tracks = result.threats, result.tracks
    track_id = ttc_s = gap_m = None
    if len(threats.track_id):
        track_id, ttc_s, gap_m = (
            int(threats.track_id[0]),
            float(threats.time_to_collision_s[0]),
            float(threats.gap_m[0]),
        )
    elif len(tracks):
        # a rule may look at something else than predicted collisions: then the nearest to the ego's way
        nearest = _nearest(result)
        track_id = int(tracks.track_id[nearest])
        gap_m = max(float(ego_extent(tracks.boxes[[nearest]], frame.ego)[0][0]) - frame.ego.length_m / 2, 0.0)
    named = tracks.category[tracks.track_id == track_id] if track_id is not None else []
    return Request(
        kind,
        frame.stamp_s,
        frame.ego.speed_mps,
        _horizon_s(result),
        track_id,
        str(named[0]) if len(named) else "",
        ttc_s,
        gap_m,
        result.command.decel_mps2 if kind == EMERGENCY else None,
    )
