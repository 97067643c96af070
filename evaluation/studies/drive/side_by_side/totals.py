"""What each side of a comparison on recorded drives came to, all drives together."""

from __future__ import annotations

import math
from collections.abc import Sequence as Many

from evaluation.metrics.intervals import Estimate, poisson_mean
from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.drive.measures import DriveRow
from evaluation.studies.drive.tables import HINDSIGHT, common_settings, side_name

_TOTAL_COLUMNS = (
    "strategy", "rule", "settings", "preset", "sees", "seed", "drives", "frames", "km", "hours",
    "pedestrians", "requests", "false_activations", "undecided", "standing", "at_most_per_km",
    "false_per_km", "false_per_km_low", "false_per_km_high", "warnings", "false_warnings",
    "undecided_warnings", "held_s",
)  # fmt: skip


_RATE_ENDS = {"": "value", "_low": "low", "_high": "high"}
"""Ends of columns, and what of an estimate stands there."""


def totals_csv(rows: Many[DriveRow], drives: int) -> bytes:
    """A line per side: counts beside exposure, and the rate of false activations with Garwood's interval."""
    lines = []
    for row in rows:
        rate = _false_rate(row)
        rates = {f"false_per_km{end}": getattr(rate, part) for end, part in _RATE_ENDS.items()}
        lines.append(
            [
                drives if name == "drives" else rates[name] if name in rates else getattr(row, name)
                for name in _TOTAL_COLUMNS
            ]
        )
    return csv_bytes(_TOTAL_COLUMNS, lines)


def _false_rate(row: DriveRow) -> Estimate:
    """False activations per km; NaN of no way."""
    if not row.km > 0.0:
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = poisson_mean(row.false_activations)
    return Estimate(mean.value / row.km, mean.low / row.km, mean.high / row.km, mean.count)


def totals_table(rows: Many[DriveRow]) -> Table:
    """A line per side."""
    common, own = common_settings(row.settings for row in rows)
    varied, warn = any(own.values()), any(row.warnings for row in rows)
    header = [
        "strategy", *(["settings"] if varied else []), "rule", "requests", "false activations", "undecided",
        "false per km (95 %)", *(["warnings", "false warnings"] if warn else []),
    ]  # fmt: skip
    lines = []
    for row in rows:
        rate = _false_rate(row)
        text = f"{_short(rate.value)} [{_short(rate.low)}, {_short(rate.high)}]" if rate.count else EMPTY
        line = [row.strategy, *([own[row.settings]] if varied else []), row.rule, str(row.requests)]
        line += [str(row.false_activations), str(row.undecided), text]
        line += [str(row.warnings), str(row.false_warnings)] if warn else []
        lines.append(tuple(line))
    first = rows[0]
    exposure = f"All on the same way: {told_way(first)}."
    settings = [f"Settings of all: {common}."] if common else []
    garwood = "Intervals of rates are Garwood's: exact for independent events on ways like these."
    return Table(tuple(header), tuple(lines), caption=" ".join((HINDSIGHT, exposure, *settings, garwood)))


def _short(rate: float) -> str:
    """A rate with two digits, without an exponent."""
    return f"{rate:.0f}" if rate >= 10.0 else f"{rate:.2g}"


def told_way(row: DriveRow) -> str:
    """Way, time and pedestrians met."""
    count = row.pedestrians
    met = "" if count is None else f", {count} pedestrian{'s' * (count != 1)} met"
    return f"{row.km:.2f} km, {60.0 * row.hours:.1f} minutes{met}"


def told_exposure(rows: Many[DriveRow]) -> list[str]:
    """What the way that was driven says of rates."""
    first, own = rows[0], common_settings(row.settings for row in rows)[1]
    if not first.km > 0.0:
        return ["The ego stood all the time: nothing can be said of a rate."]
    quiet = [row for row in rows if row.requests == 0]
    false = sorted((row for row in rows if row.false_activations), key=lambda row: -row.false_activations)
    decided = [row.undecided for row in rows]
    lines = []
    if quiet:
        names = "; ".join(side_name(row.strategy, own[row.settings], row.rule) for row in quiet)
        lines.append(
            f"No request in {first.km:.2f} km ({names}): with 95 % confidence fewer than "
            f"{3.0 / first.km:.2g} per km (3 / D)."
        )
    if false:
        worst = false[0]
        rate = _false_rate(worst)
        name = side_name(worst.strategy, own[worst.settings], worst.rule)
        lines.append(
            f"{len(false)} of {len(rows)} sides have false activations, most of them {name}: "
            f"{worst.false_activations}, which is {_short(rate.low)} to {_short(rate.high)} per km on ways "
            "like these."
        )
    else:
        lines.append(
            f"No side has a false activation: with 95 % confidence fewer than {3.0 / first.km:.2g} per km."
        )
    if any(decided):
        lines.append(
            f"{min(decided)} to {max(decided)} requests of a side are undecided: whether they were right, "
            "the recording does not say."
        )
    return lines
