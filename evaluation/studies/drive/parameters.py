"""Which parameters can be varied on recorded drives, and what all strategies have by default."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence

from evaluation.errors import ArgumentError
from evaluation.studies.compare.grid import varied_points
from evaluation.studies.drive.drive import LABELS, RULE
from scenarios.sensors.variation import ERROR_NUMBERS
from scenarios.settings import PARAMETERS, Setting, Settings

OF_SENSOR = ("range_m", "latency_s", "sensor_errors", "detector", *ERROR_NUMBERS)
"""Of a sensor that sees labels: what was detected when the drive was recorded has errors of its own."""

OF_MAP = ("path_from", *(name for name in PARAMETERS if name.startswith(("localisation_", "map_"))))
"""Of a map, or of where the ego believes to be on it."""

RECORDED = {"rate_hz": "a recording has frames of its own"}
"""What the recording decides."""

Vary = Mapping[str, Sequence[Setting]]


def check_vary(vary: Vary, strategies: Sequence[str], sees: str, without_map: Sequence[str]) -> None:
    """See that every parameter means something on the drives.

    Args:
        vary: values by parameter.
        strategies: that are driven.
        sees: what perception sees, one of `SEES`.
        without_map: names of drives that have no map.

    Raises:
        ArgumentError: one means nothing.
    """
    for name in vary:
        if name in RECORDED:
            raise ArgumentError(f"--vary {name}: means nothing on recorded drives: {RECORDED[name]}")
        if name in OF_SENSOR and sees != LABELS:
            hint = "; tracker_sigma_m is what the tracker expects" if name == "position_sigma_m" else ""
            raise ArgumentError(
                f"--vary {name}: means nothing for recorded detections, which have errors of their own; "
                f"--detections labels has a sensor{hint}"
            )
        if name in OF_MAP and without_map:
            raise ArgumentError(
                f"--vary {name}: means nothing without a map, and {without_map[0]} has none; give --map FILE"
            )
        if not any(PARAMETERS[name].changes(strategy) for strategy in strategies):
            raise ArgumentError(
                f"--vary {name}: means nothing for {', '.join(strategies)}; it is a parameter of "
                f"{', '.join(PARAMETERS[name].strategies)}"
            )


def settings_of(strategies: Sequence[str], vary: Vary) -> list[tuple[str, Settings]]:
    """Each strategy with every combination of what is varied; what is not is fair.

    The planned path of a recording is the way that was driven.
    The settings stand in the order of `PARAMETERS`, without the brake rule.
    """
    return [(point.strategy, ordered(point.settings)) for point in varied_points(strategies, vary)]


def ordered(settings: Settings) -> Settings:
    """Settings in the order of `PARAMETERS`; what is none of these stands first."""
    order = {name: k for k, name in enumerate(PARAMETERS)}
    return tuple(sorted(settings, key=lambda setting: order.get(setting[0], -1)))


def with_rules(
    sides: Sequence[tuple[str, Settings]], rules: Sequence[str]
) -> list[tuple[str, str, Settings]]:
    """Strategy, brake rule and all settings: each side with each rule."""
    usual = PARAMETERS[RULE].choices[0]
    return [
        (strategy, rule, settings if rule == usual else (*settings, (RULE, rule)))
        for (strategy, settings), rule in itertools.product(sides, rules)
    ]
