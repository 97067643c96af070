"""What a run came to and why, in plain words."""

from __future__ import annotations

import math

import _smartmot
from evaluation.runs.folder import UNKNOWN_SETUP, Run, RunSetup
from evaluation.views.account.account import KINDS, NO_BRAKING, Account
from evaluation.views.account.braking import BrakeRequest, brake_requests
from evaluation.views.account.objects import nearest_at_end
from evaluation.views.account.slowing import SLOWED_KMH, Slowing, down_to, slowing_of
from evaluation.views.account.story import status_of, story_of
from evaluation.views.frames import LogFrames
from evaluation.views.plots.style import MPS_TO_KMH
from scenarios.simulation.ends import CUT_OFF, EndReason
from smartmot.decision.rules import STANDING_MPS

__all__ = ["KINDS", "LOG_ALONE", "Account", "explain"]

LOG_ALONE: Run = {
    "strategy": "", "collided": False, "v_impact_kmh": math.nan, "score": math.nan, "score_max": math.nan,
    "t0_s": math.nan, "stop_gap_m": math.nan, "false_activation": None, "end_reason": "",
}  # fmt: skip
"""Stands for the row of a run of which nothing but its log is known, as of a recorded drive."""

_LONG_STOP_S = 60.0
"""Longer than any car brakes: `BrakeConfig.travel` over this time is the whole way to standstill."""

_SHORT_WORDS = {
    "false": "false activation",
    "cut": "cut off",
    "invalid": "no conflict",
    "pass": "no braking",
}
"""Outcome of the kinds that need no number."""


def explain(frames: LogFrames, run: Run = LOG_ALONE, setup: RunSetup = UNKNOWN_SETUP) -> Account:
    """Say what happened in a run.

    Args:
        frames: its log by frames.
        run: its row in the table of runs.
        setup: map and conditions; without them there are fewer reasons.
    """
    requests = brake_requests(frames, setup)
    slowing = slowing_of(frames, run, setup)
    hit = nearest_at_end(frames) if run["collided"] else ""
    kind = _kind(frames, run, setup.must, requests, slowing)
    finding, why = _finding(frames, run, kind, requests, slowing, hit, setup)
    if requests:
        shown = requests[0].frame
    elif run["collided"]:
        shown = len(frames) - 1
    else:
        shown = slowing.last if slowing else 0
    false_activation = _false_activation(run)
    return Account(
        outcome=_outcome(frames, run, kind, requests, slowing),
        kind=kind,
        must=setup.must,
        finding=finding,
        why=why,
        false_activation=false_activation,
        unnecessary=setup.must == "nothing" and (bool(false_activation) or _adapts(slowing)),
        frame=shown,
        story=story_of(frames, run, requests, slowing, hit),
        status=status_of(frames),
    )


def _false_activation(run: Run) -> bool | None:
    """Whether the run has one; None where it cannot have any."""
    value = run["false_activation"]
    return None if value is None or value != value else bool(value)  # NaN where the column is empty


def _cut_off(run: Run) -> bool:
    """Whether the time limit ended the run; folders of version 0.1.0 do not say."""
    return bool(run["end_reason"] in CUT_OFF)


def _adapts(slowing: Slowing | None) -> bool:
    return slowing is not None and slowing.adapts


def _kind(
    frames: LogFrames, run: Run, must: str, requests: list[BrakeRequest], slowing: Slowing | None
) -> str:
    """One of `KINDS`: the first that applies."""
    brakes = bool(requests or (slowing and slowing.cause))
    if run["collided"]:
        before = float(frames.ego["speed_mps"].abs().max()) * MPS_TO_KMH
        return "mitigated" if brakes and run["v_impact_kmh"] < before - SLOWED_KMH else "hit"
    if _false_activation(run):
        return "false"
    if must == "nothing" and _adapts(slowing):
        return "unnecessary"
    if _cut_off(run):
        return "cut"
    if not math.isnan(run["score_max"]) and math.isnan(run["score"]):
        return "invalid"  # the command has found that without any brake there is no contact
    asked = must == "brake" or not math.isnan(run["score_max"]) or run["strategy"] == NO_BRAKING
    if asked and must != "nothing" and not brakes:
        return "invalid"  # nothing has braked: without any brake there is no contact either
    return "stop" if requests or slowing else "pass"


def _outcome(
    frames: LogFrames, run: Run, kind: str, requests: list[BrakeRequest], slowing: Slowing | None
) -> str:
    """What came out, in a few words."""
    if kind in ("hit", "mitigated"):
        return f"{kind}, {run['v_impact_kmh']:.1f} km/h"
    if kind in _SHORT_WORDS:
        return _SHORT_WORDS[kind]
    if kind == "unnecessary" and slowing is not None:
        return f"unnecessary braking{slowing.end}"
    if not math.isnan(run["t0_s"]):
        return "stopped"
    ends = [_least_mps(frames, request.frame) for request in requests[:1]]
    ends += [slowing.to_mps] if slowing else []
    return "stopped" if min(ends) < STANDING_MPS else f"slowed{down_to(min(ends))}"


def _least_mps(frames: LogFrames, frame: int) -> float:
    """Least speed from a frame on."""
    return float(frames.ego["speed_mps"].abs().iloc[frame:].min())


def _finding(
    frames: LogFrames,
    run: Run,
    kind: str,
    requests: list[BrakeRequest],
    slowing: Slowing | None,
    hit: str,
    setup: RunSetup,
) -> tuple[str, str]:
    """What came out, and why."""
    if requests:
        what, why = _emergency(frames, run, requests[0], hit, setup)
        if slowing is not None and slowing.first < requests[0].frame:
            why += f" Before that, the ego had slowed {slowing.text}."
    elif run["collided"]:
        what, why = _unbraked_contact(frames, run, slowing, hit)
    elif slowing is not None:
        begin = "Unnecessary braking: slows" if kind == "unnecessary" else "Slows"
        what, why = f"{begin} {slowing.text}, without an emergency.", slowing.why
        if not slowing.cause:
            why = "Nothing that it tracks is in its way then." if run["strategy"] != NO_BRAKING else (
                "Nothing watches in this run: the scenario slows the ego."
            )  # fmt: skip
    else:
        what, why = f"Keeps its speed within {SLOWED_KMH:g} km/h, and passes without contact.", ""
    if kind == "invalid":
        why = f"{why} There was nothing to avoid: a test without conflict, which counts in no rate."
    if setup.must == "brake" and kind == "stop":
        what = f"Collision avoided. {what}"
    if _cut_off(run) and not run["collided"]:
        who = "time limit" if run["end_reason"] == EndReason.TIME_LIMIT else "scenario's stop trigger"
        what += f" The {who} ended the run at t = {frames.time_s[-1]:.1f} s."
    return what, why.strip()


def _unbraked_contact(frames: LogFrames, run: Run, slowing: Slowing | None, hit: str) -> tuple[str, str]:
    """What came out, and why, where a contact came without any emergency request."""
    if run["v_impact_kmh"] < STANDING_MPS * MPS_TO_KMH:
        return f"Is hit by {hit} while it stands.", ""
    what = f"Hits {hit} at {run['v_impact_kmh']:.1f} km/h"
    if slowing is None:
        return f"{what} without braking.", _why_never(frames, run)
    return f"{what}, slowed {slowing.text}, but without an emergency brake.", _why_never(frames, run)


def _emergency(
    frames: LogFrames, run: Run, first: BrakeRequest, hit: str, setup: RunSetup
) -> tuple[str, str]:
    """What came out, and why, where the emergency brake was requested."""
    impact, speed = f"{run['v_impact_kmh']:.1f} km/h", f"{first.speed_mps * MPS_TO_KMH:.0f} km/h"
    least = down_to(_least_mps(frames, first.frame))
    request = f"The brake was requested for {first.who}"
    if not math.isnan(first.gap_m):
        request = (
            f"The brake was requested {first.gap_m:.1f} m before {'it' if first.who == hit else first.who}"
        )
    if _false_activation(run):
        contact = f", then hits {hit} at {impact}" if hit else ""
        what = f"False activation: emergency braking from {speed}{least} for {first.who}{contact}."
        request += f", {first.how}"
    elif run["collided"]:
        what = f"Hits {hit} at {impact}."
        if setup.preset is not None:
            need_m = setup.preset.brakes.travel(first.speed_mps, 0.0, _LONG_STOP_S)[0]
            request += f"; from {speed} these brakes need {need_m:.1f} m"
    elif math.isnan(run["t0_s"]):
        what = f"Slows{least} in an emergency, and passes without contact."
    elif math.isnan(run["stop_gap_m"]):
        what = "Stops without contact."
    elif run["stop_gap_m"] > 0:
        what = f"Stops with {run['stop_gap_m']:.1f} m left."
    else:
        what = "Stops without contact, but only beside the target or past it: it had walked on."
    return what, f"{request}. {first.why}".strip()


def _why_never(frames: LogFrames, run: Run) -> str:
    """Why an ego that hits an object has not braked."""
    if run["strategy"] == NO_BRAKING:
        return "Nothing watches and nothing brakes in this run."
    detections, tracks = frames.objects["detection"], frames.objects["track"]
    if detections.empty:
        return "Nothing was ever detected."
    if not (detections["label"] == "kept").any():
        return "The monitored area dropped every detection."
    if not (tracks["label"] == "threat").any():
        return "What was tracked never counted as being on a collision course."
    return "The threat was never near enough to count."


__getattr__ = _smartmot.renamed(__name__, {"Trigger": "evaluation.views.account.braking.BrakeRequest"})
