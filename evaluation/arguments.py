"""What users type, turned into values; every mistake becomes one clear `ArgumentError`."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from pathlib import Path

from evaluation.errors import ArgumentError
from scenarios.settings import OF_PRESET, PARAMETERS, Setting, Settings

DEFAULT_MAP = "urban_street"
"""Shipped map that a test takes place on unless the user names another."""

DEFAULT_SPEED_STEP_KMH = 10.0
MAX_SPEEDS = 200


def parse_speeds(text: str) -> tuple[float, ...]:
    """Speeds in km/h: `10..60` (step 10), `10..60:5`, `30,50`, or any of these joined by commas.

    Raises:
        ArgumentError: not of that form, not positive, or too many.
    """
    form = "use 10..60, 10..60:5 or 30,50"
    speeds: list[float] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*([^.\s:]+(?:\.\d+)?)\s*(?:\.\.\s*([^:\s]+)\s*(?::\s*(\S+)\s*)?)?", part)
        if match is None:
            raise ArgumentError(f"--speeds: cannot read {part.strip()!r} in {text!r}; {form}")
        try:
            low, high, step = (None if g is None else float(g) for g in match.groups())
        except ValueError:
            raise ArgumentError(f"--speeds: {part.strip()!r} is not a number or a range; {form}") from None
        assert low is not None
        high = low if high is None else high
        step = DEFAULT_SPEED_STEP_KMH if step is None else step
        if not all(map(math.isfinite, (low, high, step))) or low <= 0 or step <= 0 or high < low:
            raise ArgumentError(
                f"--speeds: {part.strip()!r} must be positive and rise from low to high; {form}"
            )
        if len(speeds) + (high - low) / step + 1 > MAX_SPEEDS + 1e-9:
            raise ArgumentError(
                f"--speeds: {part.strip()!r} gives over {MAX_SPEEDS} speeds; use a larger step"
            )
        speeds += [round(low + k * step, 9) for k in range(math.floor((high - low) / step + 1e-9) + 1)]
    return tuple(sorted(set(speeds)))


def parse_names(text: str, allowed: Sequence[str], option: str, own: bool = False) -> tuple[str, ...]:
    """Comma-separated names, each once, in the order given.

    Args:
        text: what was typed.
        allowed: possible names.
        option: where, for the message.
        own: whether `package.module:name` of the user's own is possible as well.

    Raises:
        ArgumentError: a name is not allowed, or there is none.
    """
    names = [n.strip() for n in text.split(",") if n.strip()]
    for name in names:
        if name not in allowed and not (own and ":" in name):
            more = " or package.module:name" if own else ""
            raise ArgumentError(f"{option}: unknown {name!r}; use one or more of: {', '.join(allowed)}{more}")
    if not names:
        raise ArgumentError(f"{option}: nothing given; use one or more of: {', '.join(allowed)}")
    return tuple(dict.fromkeys(names))


def parse_name(text: str, allowed: Sequence[str], option: str, own: bool = False) -> str:
    """A single name; see `parse_names`."""
    name = text.strip()
    if name not in allowed and not (own and ":" in name):
        more = " or package.module:name" if own else ""
        raise ArgumentError(f"{option}: unknown {name!r}; use one of: {', '.join(allowed)}{more}")
    return name


def parse_place(text: str) -> tuple[str, int, float]:
    """`ROAD,LANE,S`: id of the road, id of the lane, road coordinate in metres.

    Raises:
        ArgumentError: not of that form.
    """
    parts = [p.strip() for p in text.split(",")]
    try:
        road, lane, s = parts
        place = (road, int(lane), float(s))
    except ValueError:
        place = ("", 0, math.nan)
    if not math.isfinite(place[2]):
        raise ArgumentError(f"--at: expected ROAD,LANE,S such as 1,-1,250.0; got {text!r}")
    return place


def parse_parameters(texts: Sequence[str]) -> dict[str, str]:
    """`NAME=VALUE` each, as values by name.

    Raises:
        ArgumentError: not of that form, or a name twice.
    """
    values: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip().removeprefix("$")
        if not equals or not name:
            raise ArgumentError(f"--param: expected NAME=VALUE such as Ego_speed_kmh=50, got {text!r}")
        if name in values:
            raise ArgumentError(f"--param: {name} is given twice; give it once")
        values[name] = value.strip()
    return values


def available_cores() -> int:
    """Cores that this process may use."""
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:  # systems without affinity
        return os.cpu_count() or 1


def writable_folder(path: Path) -> Path:
    """Make a folder for results and see that files can be written there.

    Raises:
        ArgumentError: it cannot be made or written to.
    """
    probe = path / ".smartmot-write-test"
    try:
        path.mkdir(parents=True, exist_ok=True)
        probe.touch()
        probe.unlink()
    except OSError as error:
        reason = error.strerror or str(error)
        raise ArgumentError(f"--out: cannot write to folder {path}: {reason}; choose another one") from None
    return path


MAX_VALUES = 100
"""Of one parameter of `--vary`."""


def parse_vary(texts: Sequence[str]) -> dict[str, tuple[Setting, ...]]:
    """`NAME=VALUES` each: names, numbers joined by commas, or ranges `0..4:0.5`.

    Raises:
        ArgumentError: not of that form, an unknown parameter or name, or a parameter twice.
    """
    found: dict[str, tuple[Setting, ...]] = {}
    for text in texts:
        name, equals, values = (part.strip() for part in text.partition("="))
        if name not in PARAMETERS or not equals:
            raise ArgumentError(
                f"--vary: expected NAME=VALUES with one of {', '.join(PARAMETERS)}; got {text!r}"
            )
        if name in found:
            raise ArgumentError(f"--vary: {name} is given twice; give all its values at once")
        choices = PARAMETERS[name].choices
        parts = [part.strip() for part in values.split(",")]
        if choices:
            for part in parts:
                parse_name(part, choices, f"--vary {name}", own=PARAMETERS[name].own)
            found[name] = tuple(dict.fromkeys(parts))
        else:
            numbers = [number for part in parts for number in _numbers(name, part)]
            found[name] = tuple(dict.fromkeys(numbers))
    return found


def parse_plugged(tracker: str, detector: str) -> Settings:
    """The options `--tracker` and `--detector` as settings; what the preset has anyway is none.

    Raises:
        ArgumentError: an unknown name.
    """
    typed = {"tracker": tracker, "detector": detector}
    chosen = {
        name: parse_name(text, PARAMETERS[name].choices, f"--{name}", own=True)
        for name, text in typed.items()
    }
    return tuple((name, value) for name, value in chosen.items() if value != OF_PRESET)


def _numbers(name: str, text: str) -> list[float]:
    """A number, or a range LOW..HIGH:STEP."""
    form = f"--vary {name}: cannot read {text!r}; use 1.8, 0,1,2 or 0..4:0.5"
    match = re.fullmatch(r"(.+?)(?:\.\.(.+?):(.+))?", text)
    try:
        low, high, step = (None if g is None else float(g) for g in match.groups()) if match else (None,) * 3
    except ValueError:
        raise ArgumentError(form) from None
    if low is None or not math.isfinite(low):
        raise ArgumentError(form)
    if high is None or step is None:
        return [low]
    if not (math.isfinite(high) and math.isfinite(step) and step > 0 and high >= low):
        raise ArgumentError(form)
    count = math.floor((high - low) / step + 1e-9) + 1
    if count > MAX_VALUES:
        raise ArgumentError(f"--vary {name}: {text!r} gives {count} values; use at most {MAX_VALUES}")
    return [round(low + k * step, 9) for k in range(count)]
