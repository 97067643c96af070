"""The seam between a world and perception: each frame once, and a command between two."""

import pytest

from scenarios.sources import Frame, FrameSource, StepResult, frames
from scenarios.sources.frames import Command
from smartmot.types import Detections, EgoState


class Clock:
    """A source of frames of nothing, one per second."""

    def __init__(self, count: int) -> None:
        self.left, self.commands = count, 0

    def start(self) -> StepResult:
        if not self.left:
            return StepResult(None, "done")
        self.left -= 1
        now = float(self.left)
        return StepResult(Frame(now, EgoState(now, 0.0, 0.0, 0.0, 0.0), Detections.empty(now)))

    def step(self, command: Command | None) -> StepResult:
        assert command is None
        self.commands += 1
        return self.start()


@pytest.mark.parametrize("count", [0, 1, 5])
def test_all_frames_come_once_each_with_a_step_between(count: int) -> None:
    source = Clock(count)
    as_source: FrameSource = source
    assert [frame.stamp_s for frame in frames(as_source)] == [float(k) for k in reversed(range(count))]
    assert source.commands == count


def test_a_result_is_either_a_frame_or_an_end() -> None:
    frame = Frame(0.0, EgoState(0.0, 0.0, 0.0, 0.0, 0.0), Detections.empty(0.0))
    with pytest.raises(ValueError, match="either a frame or a reason"):
        StepResult(frame, "contact")
    with pytest.raises(ValueError, match="either a frame or a reason"):
        StepResult(None)
    assert StepResult(None, "contact").end_reason == "contact"
