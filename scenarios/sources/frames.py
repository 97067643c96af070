"""The seam between a world and perception: a source gives frames and takes a command for each of them.

Every source is stepped alike::

    result = source.start()
    while (frame := result.frame) is not None:
        result = source.step(decide(frame))

In a simulated world the command moves the ego; a recorded drive goes on whatever is commanded.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

from smartmot.decision.rules import Command
from smartmot.maps.lane_map import LaneMap
from smartmot.path import PlannedPath
from smartmot.types import Detections, EgoState


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """What perception gets to know at one instant. Ground truth is no part of it.

    Frames come in the order of time: neither `stamp_s` nor the stamp of the detections goes back.

    Args:
        stamp_s: now, seconds; equal to `ego.stamp_s`.
        ego: odometry now, in its own frame, which is the map frame unless `localised` is given. Its heading
            is that of the vehicle, also in reverse, where its speed is negative.
        detections: what has arrived now, in the same frame; stamped with the time of their measurement, which
            is earlier by the latency of sensor and detector.
        measurement: what the detections were made from, if the source has it; None: it is not kept.
        lane_map: the map that perception uses; None: there is none.
        path: where the ego is going to go, in the same frame; the same object as long as that does not
            change, unless `mission` is given. None: not known.
        localised: the ego as it is localised on the map; None: its odometry says that exactly.
        mission: the way over the map that the navigation has chosen lanes for, map frame; the same object as
            long as that does not change. None: it is `path`.
    """

    stamp_s: float
    ego: EgoState
    detections: Detections
    measurement: object | None = None
    lane_map: LaneMap | None = None
    path: PlannedPath | None = None
    localised: EgoState | None = None
    mission: PlannedPath | None = None


@dataclass(frozen=True, slots=True, eq=False)
class StepResult:
    """Where a source stands after `start` or a `step`: at a frame, or at its end.

    Args:
        frame: the frame to decide on; None at the end.
        end_reason: why there is none, a `scenarios.simulation.ends.EndReason` of a simulation; None as
            long as there is one.
    """

    frame: Frame | None
    end_reason: str | None = None

    def __post_init__(self) -> None:
        if (self.frame is None) != (self.end_reason is not None):
            raise ValueError("step result: expected either a frame or a reason for the end")


class FrameSource(Protocol):
    """A world, or a recording of one, that is stepped from frame to frame."""

    def start(self) -> StepResult:
        """Go to the first frame.

        Raises:
            ScenarioError: the source has been started before.
        """
        ...

    def step(self, command: Command | None) -> StepResult:
        """Carry out the decision on the present frame, and go on to the next.

        Args:
            command: the decision; None: nothing is asked of the ego.

        Raises:
            ScenarioError: the source has not been started, or is at its end.
        """
        ...


def frames(source: FrameSource) -> Iterator[Frame]:
    """All frames of a source that no command changes, or of one in which nobody is to brake.

    Args:
        source: not yet started.

    Raises:
        ScenarioError: the source has been started before.
    """
    result = source.start()
    while result.frame is not None:
        yield result.frame
        result = source.step(None)
