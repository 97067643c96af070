"""Where frames come from: simulated worlds, recorded drives, live topics."""

from scenarios.sources.frames import Frame, FrameSource, StepResult, frames

__all__ = ["Frame", "FrameSource", "StepResult", "frames"]
