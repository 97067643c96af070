"""A drive in words: which requests came, for what, and what the recording says of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED
from evaluation.views.account.account import Account
from evaluation.views.account.story import status_of
from evaluation.views.frames import LogFrames
from scenarios.sources.requests import EMERGENCY, WARNING

SHOWN_S = 1.0
"""A warning is shown so long, and a request at least: the tables do not say when they end."""

_REASONS = {
    "entered": "a road user entered the way that the ego was yet to sweep",
    "driver braked": "the driver braked hard",
    "recording ends": "the recording ends before the horizon",
    "labels end": "labels of a road user beside the way end before the horizon",
    "no labels": "nothing is labelled",
    "the ego stands": "the ego stands or reverses",
}

_QUIET = {
    False: "The brake was never requested.",
    True: "The brake was requested only of an ego that stood or reversed, of which it asks nothing.",
}
"""By whether there are requests at all."""


def explain_drive(frames: LogFrames, events: Sequence[Mapping[str, str]]) -> Account:
    """Say what happened on a drive.

    Args:
        frames: its log by frames.
        events: its rows of `events.csv`.
    """
    emergencies = [event for event in events if event["kind"] == EMERGENCY]
    false = [event for event in emergencies if event["verdict"] == FALSE]
    undecided = [event for event in emergencies if event["verdict"] == UNDECIDED]
    counts = [f"{len(false)} false activation{'s' * (len(false) != 1)}"] if false else []
    counts += [f"{len(undecided)} undecided"] if undecided else []
    shown = next(iter(false or undecided or emergencies or events), None)
    return Account(
        outcome=", ".join(counts) or "no request",
        kind="false" if false else "cut" if undecided else "pass",
        must="",
        finding=" ".join(map(_sentence, [*false, *undecided])) or _QUIET[bool(emergencies)],
        why="",
        false_activation=bool(false) or (None if undecided else False),
        unnecessary=False,
        frame=0 if shown is None else frames.frame_at(_number(shown, "time_s")),
        story=_story(frames, events),
        status=status_of(frames),
    )


def _sentence(event: Mapping[str, str]) -> str:
    """One request."""
    speed = f"{_number(event, 'speed_kmh'):.0f} km/h"
    return f"t = {_number(event, 'time_s'):.1f} s, {speed}{_cause(event)}: {verdict_text(event)}."


def _cause(event: Mapping[str, str]) -> str:
    if not event["track"]:
        return ""
    gap = f", {_number(event, 'gap_m'):.1f} m ahead" if event["gap_m"] else ""
    return f", for {event['category'] or 'object'} (track {event['track']}{gap})"


def verdict_text(event: Mapping[str, str]) -> str:
    """Verdict of a request, with its reason."""
    reason = _REASONS.get(event["reason"], event["reason"])
    if event["verdict"] == FALSE:
        return FALSE
    if event["verdict"] == STANDING:
        return "asks nothing, since the ego stands or reverses"
    return f"{UNDECIDED}, {reason}"


def _story(frames: LogFrames, events: Sequence[Mapping[str, str]]) -> tuple[str, ...]:
    """(F,) what is requested, frame by frame."""
    texts = ["Drives as recorded; nothing is requested."] * len(frames)
    for event in sorted(events, key=lambda e: (e["kind"] == EMERGENCY, _number(e, "time_s"))):
        first_s = _number(event, "time_s")
        if event["kind"] == WARNING:
            text, last_s = f"Warns at t = {first_s:.1f} s{_cause(event)}: {verdict_text(event)}.", SHOWN_S
        else:
            text = f"Emergency brake requested at t = {first_s:.1f} s{_cause(event)}: {verdict_text(event)}."
            last_s = max(_number(event, "stop_s"), SHOWN_S)
        for frame in range(frames.frame_at(first_s), frames.frame_at(first_s + last_s) + 1):
            texts[frame] = text
    return tuple(texts)


def _number(event: Mapping[str, str], name: str) -> float:
    return float(event[name])
