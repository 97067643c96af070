"""Differences between strategies, run by run: both sides meet the same scenes, variants and noise."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import TypeVar

from evaluation.metrics.intervals import Estimate, clustered_difference, clustered_mean, sign_test
from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.compare.grid import Point
from evaluation.studies.compare.measures import RunMeasures, impact_kmh
from scenarios.settings import PARAMETERS, Settings
from scenarios.strategies import STRATEGIES


@dataclass(frozen=True, slots=True)
class Compared:
    """What of a run is compared.

    Args:
        text: in words.
        must: kind of scenes in which it is measured; empty: all.
        value: of a run; None where it has none, and a pair without both is left out.
        more_is_better: whether more of it is better.
        unit: of its values; empty: outcomes, whose differences are -1, 0 and 1.
        digits: that are printed; a difference that rounds to 0 is none.
    """

    text: str
    must: str
    value: Callable[[RunMeasures], float | None]
    more_is_better: bool = False
    unit: str = ""
    digits: int = 0


COMPARED: Mapping[str, Compared] = {
    "avoided": Compared("collisions avoided", "brake", lambda run: run.avoided, True),
    "v_impact_kmh": Compared("mean impact", "brake", impact_kmh, False, "km/h", 1),
    "flag_time_s": Compared(
        "time of the flag",
        "brake",
        lambda run: None if run.false_activation else run.flag_time_s,
        False,
        "s",
        2,
    ),
    "false_activations": Compared("false activations", "nothing", lambda run: run.false_activation),
    "early_activations": Compared("early activations", "brake", lambda run: run.false_activation),
    "needless_stops": Compared("unnecessary stops", "nothing", lambda run: run.needless_stop),
    "speed_loss_kmh": Compared("speed loss", "nothing", lambda run: run.speed_loss_kmh, False, "km/h", 1),
    "delay_s": Compared("mean delay", "nothing", lambda run: run.delay_s, False, "s", 2),
    "tracks": Compared("tracks per frame", "", lambda run: run.tracks_mean, False, "tracks", 1),
}
"""By the names of the columns of the summaries; the time of a flag has a meaning in one and the same run."""

SHOWN = ("avoided", "v_impact_kmh", "false_activations", "needless_stops", "delay_s")
"""Those that are shown as text."""

Group = TypeVar("Group", bound=Hashable)

Pair = tuple[Point, Point]
"""A point, and the one that it is compared with."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One measure of a point less that of another in the same runs.

    Args:
        weather: of the runs.
        point, against: what is compared.
        measure: name of what is measured.
        estimate: mean difference, with an interval over the scenes; the count is that of pairs of runs.
        better, worse, equal: variants in which the point is so, on the mean of their seeds.
        scenes_better, scenes_worse: the same of scenes, on the mean of their runs.
        p_value: of the sign test over these scenes.
    """

    weather: str
    point: Point
    against: Point
    measure: str
    estimate: Estimate
    better: int
    worse: int
    equal: int
    scenes_better: int
    scenes_worse: int
    p_value: float


def pairs_with(points: Sequence[Point], usual: Sequence[Point]) -> list[Pair]:
    """Every point against every usual one that it differs from in the area alone or in settings alone.

    Of two usual ones the later is set against the earlier.
    """
    rank = {point: k for k, point in enumerate(usual)}
    return [
        (point, other)
        for point in points
        for other in usual
        if point != other
        and rank.get(point, math.inf) > rank[other]
        and (point.strategy == other.strategy or _common(point) == _common(other))
    ]


def _common(point: Point) -> Settings:
    """The settings that mean something for every area."""
    return tuple((name, value) for name, value in point.settings if PARAMETERS[name].strategies == STRATEGIES)


def pairs_with_bases(points: Sequence[Point]) -> list[Pair]:
    """Every point with a changed choice against its strategy as the preset has it."""
    return [(point, base) for point in points for base in [Point(point.strategy)] if point.settings]


def differences(runs: Sequence[RunMeasures], pairs: Sequence[Pair]) -> list[Difference]:
    """Differences by weather, pair and measure; without measures of which there is no pair of runs."""
    by_point: dict[tuple[str, str, str], dict[tuple[str, str, int], RunMeasures]] = {}
    for run in runs:
        group = by_point.setdefault((run.weather, run.strategy, run.settings), {})
        group[run.scene, run.variant, run.seed] = run
    made = []
    for weather in dict.fromkeys(run.weather for run in runs):
        for point, other in pairs:
            first, second = (by_point[weather, p.strategy, p.text] for p in (point, other))
            both = [(run, second[key]) for key, run in first.items() if key in second]
            for name in COMPARED:
                difference = _difference(weather, point, other, name, both)
                if difference.estimate.count:
                    made.append(difference)
    return made


def _difference(
    weather: str, point: Point, other: Point, name: str, both: Iterable[tuple[RunMeasures, RunMeasures]]
) -> Difference:
    compared = COMPARED[name]
    changes: list[float] = []
    scenes: list[str] = []
    variants: list[tuple[str, str]] = []
    for first, second in both:
        a, b = compared.value(first), compared.value(second)
        if first.must == (compared.must or first.must) and a is not None and b is not None:
            changes.append(a - b)
            scenes.append(first.scene)
            variants.append((first.scene, first.variant))
    better, worse, equal = _signs(changes, variants, compared)
    scenes_better, scenes_worse, _ = _signs(changes, scenes, compared)
    if not compared.unit:
        by_variant = _means(changes, variants)
        estimate = clustered_difference([*by_variant.values()], [scene for scene, _ in by_variant])
        estimate = replace(estimate, count=len(changes))
    else:
        estimate = clustered_mean(changes, scenes)
        if not any(changes):  # nothing differs: how much it may elsewhere is unknown
            estimate = replace(estimate, low=math.nan, high=math.nan)
    p_value = sign_test(scenes_better, scenes_worse)
    return Difference(
        weather, point, other, name, estimate, better, worse, equal, scenes_better, scenes_worse, p_value
    )


def _means(changes: Sequence[float], groups: Sequence[Group]) -> dict[Group, float]:
    """Mean change of each group, in the order in which they first come."""
    by_group: dict[Group, list[float]] = {}
    for change, group in zip(changes, groups, strict=True):
        by_group.setdefault(group, []).append(change)
    return {group: sum(values) / len(values) for group, values in by_group.items()}


def _signs(changes: Sequence[float], groups: Sequence[Hashable], compared: Compared) -> tuple[int, int, int]:
    """In how many groups the mean change is for the better, for the worse, and none."""
    means = [*_means(changes, groups).values()]
    if compared.unit:
        means = [round(mean, compared.digits) for mean in means]
    more, less = sum(mean > 0 for mean in means), sum(mean < 0 for mean in means)
    better, worse = (more, less) if compared.more_is_better else (less, more)
    return better, worse, len(means) - more - less


_COLUMNS = (
    "weather", "strategy", "settings", "against", "against_settings", "measure", "difference",
    "difference_low", "difference_high", "difference_count", "better", "worse", "equal", "scenes_better",
    "scenes_worse", "p_value",
)  # fmt: skip


def differences_csv(compared: Sequence[Difference]) -> bytes:
    """One line per difference."""
    lines = [
        (
            d.weather, d.point.strategy, d.point.text, d.against.strategy, d.against.text, d.measure,
            d.estimate.value, d.estimate.low, d.estimate.high, d.estimate.count, d.better, d.worse, d.equal,
            d.scenes_better, d.scenes_worse, d.p_value,
        )
        for d in compared
    ]  # fmt: skip
    return csv_bytes(_COLUMNS, lines)


def difference_table(compared: Sequence[Difference]) -> Table:
    """A line per pair and weather, if anything that is shown differs in any variant."""
    weathers = len({d.weather for d in compared}) > 1
    lines: dict[tuple[str, Point, Point], dict[str, Difference]] = {}
    for d in compared:
        if d.measure in SHOWN:
            lines.setdefault((d.weather, d.point, d.against), {})[d.measure] = d
    header = (
        *(("weather",) if weathers else ()), "strategy", "against",
        *(f"{COMPARED[name].text} ({_unit(name)})" for name in SHOWN),
    )  # fmt: skip
    rows = [
        (
            *((weather,) if weathers else ()),
            point.name,
            other.name,
            *(_cell(cells[name]) if name in cells else EMPTY for name in SHOWN),
        )
        for (weather, point, other), cells in lines.items()
        if any(d.better or d.worse for d in cells.values())
    ]
    caption = (
        "Run by run on the same scenes and noise: difference, interval (95 %) over the scenes, scenes in "
        "which the first is better and worse, and p-value of the exact sign test over them. Pairs without "
        "any difference are left out. All measures: `differences.csv`."
    )
    return Table(header, tuple(rows), (), caption)


def told_differences(
    compared: Sequence[Difference], name: Callable[[Point], str] = attrgetter("name")
) -> str:
    """Which measures differ by more than another choice of scenes would explain, in one sentence.

    Args:
        compared: differences.
        name: of a point.
    """
    together = "Run by run on the same scenes and noise"
    shown = [d for d in compared if d.measure in SHOWN and (d.better or d.worse)]
    if not shown:
        return f"{together}, the strategies do not differ."
    clear = [d for d in shown if d.estimate.low > 0.0 or d.estimate.high < 0.0]
    weathers = len({d.weather for d in compared}) > 1
    groups: dict[str, list[str]] = {}
    for d in clear:
        where = f" ({d.weather})" if weathers else ""
        text = f"{COMPARED[d.measure].text} {_interval(d)} {_unit(d.measure)}"
        groups.setdefault(f"{name(d.point)} against {name(d.against)}{where}", []).append(text)
    texts = "; ".join(f"{pair}: {', '.join(group)}" for pair, group in groups.items())
    count = f"{len(clear) or 'none'} of {len(shown)} differences have an interval over the scenes without 0"
    open_ = f"; which side is better{' in the others' if clear else ''}, these scenes do not decide"
    return f"{together}, {count}{f' ({texts})' if texts else ''}{open_ if len(clear) < len(shown) else ''}."


def _unit(name: str) -> str:
    return COMPARED[name].unit or "points"


def _cell(d: Difference) -> str:
    return f"{_interval(d)}, {d.scenes_better}:{d.scenes_worse}, p {d.p_value:.2g}"


def _interval(d: Difference) -> str:
    """`+7 [-3, +17]`; outcomes in percentage points."""
    compared, estimate = COMPARED[d.measure], d.estimate
    scale = 1.0 if compared.unit else 100.0
    value, low, high = (
        f"{round(scale * number, compared.digits) + 0.0:+.{compared.digits}f}"
        for number in (estimate.value, estimate.low, estimate.high)
    )
    return value if math.isnan(estimate.low) else f"{value} [{low}, {high}]"
