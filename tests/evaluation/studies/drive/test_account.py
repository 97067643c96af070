"""Drives in words."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from evaluation.studies.drive.account import explain_drive
from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED
from evaluation.views.frames import LogFrames, frames_of
from scenarios.simulation.log import RunLog
from smartmot.types import Boxes, EgoState


@pytest.fixture
def frames() -> LogFrames:
    """A second of a car that stands."""
    log, nobody = RunLog(np.zeros(0, dtype=np.str_), np.zeros(0, dtype=np.str_)), np.zeros(0)
    boxes = Boxes(np.zeros((0, 2)), np.zeros((0, 2)), nobody)
    for k in range(11):
        log.frame(EgoState(0.1 * k, 0.0, 0.0, 0.0, 0.0), boxes, nobody, np.zeros(0, dtype=np.int64))
    return frames_of(pd.DataFrame(log.table()))


def request(verdict: str, reason: str = "") -> dict[str, str]:
    return {
        "kind": "emergency", "verdict": verdict, "reason": reason, "time_s": "0.5", "speed_kmh": "0",
        "track": "3", "category": "car", "gap_m": "0.6", "stop_s": "0.2",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("events", "kind", "finding"),
    [
        ([], "pass", "The brake was never requested."),
        ([request(STANDING, "the ego stands")], "pass", "The brake was requested only of an ego that stood"),
        (
            [request(UNDECIDED, "entered"), request(STANDING)],
            "cut",
            "t = 0.5 s, 0 km/h, for car (track 3, 0.6 m",
        ),
        (
            [request(UNDECIDED, "entered"), request(FALSE)],
            "false",
            "t = 0.5 s, 0 km/h, for car (track 3, 0.6 m",
        ),
    ],
)
def test_what_was_requested_is_not_said_to_be_nothing(
    frames: LogFrames, events: list[dict[str, str]], kind: str, finding: str
) -> None:
    account = explain_drive(frames, events)
    assert account.kind == kind
    assert account.finding.startswith(finding)
    assert account.story[6].startswith("Emergency brake requested" if events else "Drives as recorded")
