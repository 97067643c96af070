"""What the comparison over scenes, the ablations and the growth came to, in sentences from the tables."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import Table
from evaluation.runs.execution import FrameTime
from evaluation.studies.compare.answer import answer
from evaluation.studies.compare.differences import differences, pairs_with, told_differences
from evaluation.studies.compare.grid import FRONTIER, Point, points_of
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.table import Summary, scene_table, summaries
from evaluation.studies.growth import GrowthRun
from evaluation.studies.reference.words import counted, listed
from scenarios.strategies import STRATEGIES

RECTANGLE = Point("rectangular", (("half_width_m", 2.6),))
MAP = Point("map", (("margin_m", 1.8), ("ego_forecast", "ctrv")))
MAP_ROUTE = Point("map", (("margin_m", 1.8), ("ego_forecast", "route")))
ALL = Point("all")
SHOWN = {
    "the rectangle": RECTANGLE,
    "the map": MAP,
    "the map that knows its way": MAP_ROUTE,
    "everything": ALL,
}
"""What the page compares: the paper's rectangle and its map, the map that also tells where the ego will go,
and everything that is seen."""


def of_point(runs: Sequence[RunMeasures], point: Point) -> list[RunMeasures]:
    """Runs of a strategy with settings."""
    return [run for run in runs if (run.strategy, run.settings) == (point.strategy, point.text)]


def _named(strategy: str, settings: str) -> str:
    return next(name for name, p in SHOWN.items() if (p.strategy, p.text) == (strategy, settings))


def strategy_table(runs: Sequence[RunMeasures]) -> Table:
    """A line per strategy shown: what it avoids and what it costs."""
    header = (
        "strategy", "collisions avoided", "mean impact (km/h)", "false activations", "unnecessary stops",
        "mean delay (s)", "tracks per frame",
    )  # fmt: skip
    lines = []
    for row in summaries([run for point in SHOWN.values() for run in of_point(runs, point)]):
        avoided, stops, any_stop = (
            f"{_count(rate)} of {rate.count}"
            for rate in (row.avoided, row.false_activations, row.needless_stops)
        )
        lines.append(
            (
                _named(row.strategy, row.settings), avoided, f"{row.v_impact_kmh.value:.1f}", stops, any_stop,
                f"{row.delay_s.value:.2f}", f"{row.tracks.value:.1f}",
            )
        )  # fmt: skip
    return Table(header, tuple(lines))


def speed_table(runs: Sequence[RunMeasures]) -> Table:
    """Collisions avoided and unnecessary stops by test speed."""
    header = (
        "v_test (km/h)",
        *(f"{name}: avoided" for name in SHOWN),
        *(f"{name}: stops" for name in SHOWN),
    )
    lines = []
    for speed in sorted({run.v_test_kmh for run in runs}):
        cells = []
        for must, good in (
            ("brake", lambda run: run.avoided),
            ("nothing", lambda run: run.needless_stop),
        ):
            for point in SHOWN.values():
                mine = [r for r in of_point(runs, point) if r.v_test_kmh == speed and r.must == must]
                cells.append(f"{sum(map(good, mine))} of {len(mine)}" if mine else "–")
        lines.append((f"{speed:g}", *cells))
    return Table(header, tuple(lines))


def different_scenes(runs: Sequence[RunMeasures]) -> Table:
    """The lines of the table by scene in which the strategies differ."""
    whole = scene_table(runs, list(SHOWN.values()))
    header = (*whole.header[:2], *SHOWN)
    return Table(header, tuple(row for row in whole.rows if len(set(row[2:])) > 1))


def told_scenes(runs: Sequence[RunMeasures]) -> list[str]:
    """Who is better where: map against rectangle, and against everything."""
    return [
        told_pair(runs, one, two)
        for one in ("the map", "the map that knows its way")
        for two in ("the rectangle", "everything")
    ]


def told_clear(runs: Sequence[RunMeasures]) -> str:
    """Which differences another choice of scenes would not explain."""
    shown = tuple(SHOWN.values())
    found = differences(runs, pairs_with(shown, shown))
    return told_differences(found, lambda point: _named(point.strategy, point.text))


def told_pair(runs: Sequence[RunMeasures], one: str, two: str) -> str:
    """What each of two strategies avoids that the other does not."""
    better, worse = (contacts_avoided(runs, first, second) for first, second in ((one, two), (two, one)))
    calmer, wilder = (stops_avoided(runs, first, second) for first, second in ((one, two), (two, one)))
    return (
        f"{one.capitalize()} avoids {_text(better, 'contact')} that {two} does not; the other way round "
        f"{_text(worse, 'contact')}. It avoids {_text(calmer, 'stop')} that {two} does not; the "
        f"other way round {_text(wilder, 'stop')}."
    )


Places = dict[str, list[float]]
"""Test speeds in km/h of variants by scene."""


def contacts_avoided(runs: Sequence[RunMeasures], one: str, two: str) -> Places:
    """Where the first strategy never has a contact and the second has."""
    return _where(runs, SHOWN[one], SHOWN[two], "brake", lambda run: not run.avoided)


def stops_avoided(runs: Sequence[RunMeasures], one: str, two: str) -> Places:
    """Where the first strategy never stops unnecessarily and the second does."""
    return _where(runs, SHOWN[one], SHOWN[two], "nothing", lambda run: run.needless_stop)


def _where(
    runs: Sequence[RunMeasures], one: Point, two: Point, must: str, bad: Callable[[RunMeasures], bool]
) -> Places:
    """Scenes and speeds of the variants in which the first is never bad and the second is."""
    first, second = (
        {
            (run.scene, run.variant): run.v_test_kmh
            for run in of_point(runs, point)
            if run.must == must and bad(run)
        }
        for point in (one, two)
    )
    places: Places = {}
    for (scene, variant), speed in second.items():
        if (scene, variant) not in first:
            places.setdefault(scene, []).append(speed)
    return places


_NOUNS = {"contact": ("collision", "collisions"), "stop": ("unnecessary stop", "unnecessary stops")}


def _text(places: Places, what: str) -> str:
    """`2 contacts (crosses in a bend at 40 km/h, ...)`, or `no contact`."""
    number = sum(len(speeds) for speeds in places.values())
    if not number:
        return f"no {_NOUNS[what][0]}"
    noun = _NOUNS[what][number > 1]
    where = listed(f"{scene} at {listed(sorted(set(speeds)))} km/h" for scene, speeds in places.items())
    return f"{number} {noun} ({where})"


def told_width(runs: Sequence[RunMeasures]) -> list[str]:
    """Which width of each area."""
    return answer(summaries(runs), points_of(STRATEGIES, FRONTIER))


def short_table(physical: Sequence[RunMeasures], paper: Sequence[RunMeasures]) -> Table:
    """Collisions avoided and unnecessary stops in both presets."""
    header = ["strategy"]
    for title in ("real car", "paper"):
        header += [f"{title}: collisions avoided", "false activations", "unnecessary stops"]
    lines = []
    for name, point in SHOWN.items():
        cells = []
        for runs in (physical, paper):
            row = summaries(of_point(runs, point))[0]
            rates = (row.avoided, row.false_activations, row.needless_stops)
            cells += [f"{_count(rate)} of {rate.count}" for rate in rates]
        lines.append((name, *cells))
    return Table(tuple(header), tuple(lines))


# ---- ablations ---------------------------------------------------------------------------------------------


def ablation_table(runs: Sequence[RunMeasures]) -> Table:
    """Changes against the preset of every choice that changes a count."""
    rows = summaries(runs)
    base = {row.strategy: row for row in rows if not row.settings}
    lines = []
    for row in rows:
        changes = _changes(row, base[row.strategy])
        if row.settings and any(changes):
            lines.append(
                (row.strategy, row.settings, *(f"{change:+d}" if change else "0" for change in changes))
            )
    header = ("strategy", "changed", "collisions avoided", "false activations", "unnecessary stops")
    return Table(header, tuple(lines))


def _changes(row: Summary, base: Summary) -> tuple[int, int, int]:
    return (
        _count(row.avoided) - _count(base.avoided),
        _count(row.false_activations) - _count(base.false_activations),
        _count(row.needless_stops) - _count(base.needless_stops),
    )


def _count(rate: Estimate) -> int:
    return round(rate.value * rate.count)


def told_ablation(runs: Sequence[RunMeasures]) -> list[str]:
    """Which of the paper's choices change anything."""
    rows = summaries(runs)
    base = {row.strategy: row for row in rows if not row.settings}
    lines = []
    for strategy, usual in base.items():
        changed = [row for row in rows if row.strategy == strategy and row.settings]
        changes = {row.settings: _changes(row, usual) for row in changed}
        idle = [settings for settings, change in changes.items() if not any(change)]
        free = [
            settings
            for settings, (avoided, false, stops) in changes.items()
            if avoided >= 0 and false <= 0 and stops <= 0 and any((avoided, false, stops))
        ]
        brake, nothing = usual.avoided, usual.needless_stops
        avoided = counted(_count(brake), brake.count)
        stops = counted(_count(nothing), nothing.count)
        lines.append(
            f"As the preset has it, {strategy} avoids {avoided} collisions and stops unnecessarily in "
            f"{stops}."
        )
        if idle:
            lines.append(f"No count of {strategy} changes with {listed(idle)}.")
        if free:
            lines.append(f"Better in one count and worse in none ({strategy}): {listed(free)}.")
    return lines


# ---- growth ------------------------------------------------------------------------------------------------


def told_growth(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> list[str]:
    """What more others cost each strategy."""
    most, few = max(run.others for run in runs), min(run.others for run in runs)
    half = max((run.others for run in runs if run.others <= most / 2), default=few)

    def mean(
        strategy: str, others: int, value: Callable[[GrowthRun, FrameTime], float | None]
    ) -> float | None:
        found = [
            value(run, time)
            for run, time in zip(runs, spent, strict=True)
            if (run.strategy, run.others) == (strategy, others)
        ]
        numbers = [number for number in found if number is not None]
        return sum(numbers) / len(numbers) if numbers else None

    def milliseconds(strategy: str, others: int) -> float:
        return mean(strategy, others, lambda run, time: time.median_ms) or 0.0

    lines = []
    for strategy in dict.fromkeys(run.strategy for run in runs):
        alone, middle, crowd = (milliseconds(strategy, n) for n in (few, half, most))
        tracks = mean(strategy, most, lambda run, time: run.tracks_mean) or 0.0
        flags = [
            mean(strategy, n, lambda run, time: None if run.false_activation else run.flag_time_s)
            for n in (few, most)
        ]
        false = sum(run.false_activation for run in runs if run.strategy == strategy and run.others == most)
        runs_there = sum(run.strategy == strategy and run.others == most for run in runs)
        text = (
            f"{strategy.capitalize()}: {alone:.2f} ms per frame with {few} others, {middle:.2f} with {half}, "
            f"{crowd:.2f} with {most} ({tracks:.0f} tracks)"
        )
        if flags[1] is None:
            text += f"; no emergency request for the pedestrian with {most} others"
        elif flags[0] is not None:
            text += f"; the flag comes {flags[1] - flags[0]:+.2f} s later".replace(
                "+0.00 s later", "no later"
            )
        if false:
            text += f"; {false} of {runs_there} runs with {most} others have a false activation"
        lines.append(f"{text}.")
    return lines


def grows_in_proportion(runs: Sequence[GrowthRun], spent: Sequence[FrameTime]) -> bool:
    """Whether the time of no strategy outgrows the number of others from half of them to all, noise apart."""
    most = max(run.others for run in runs)
    for strategy in {run.strategy for run in runs}:
        by_count: dict[int, list[float]] = defaultdict(list)
        for run, time in zip(runs, spent, strict=True):
            if run.strategy == strategy:
                by_count[run.others].append(time.median_ms)
        # the least of the seeds: what else the machine does only adds
        if by_count[most // 2] and min(by_count[most]) > 2.5 * min(by_count[most // 2]):
            return False
    return True


# ---- in short ----------------------------------------------------------------------------------------------


def told_in_short(runs: Sequence[RunMeasures]) -> list[str]:
    """Where the map helps, where it does not, and what knowing its way is worth."""
    lines = [told_pair(runs, "the map", "the rectangle")]
    cured = stops_avoided(runs, "the map that knows its way", "the map")
    lost = contacts_avoided(runs, "the map", "the map that knows its way")
    lines.append(
        f"Forecasting the ego along its route cures {_text(cured, 'stop')} and costs "
        f"{_text(lost, 'contact')}."
    )
    missed = contacts_avoided(runs, "everything", "the map")
    if missed:
        widest = max(FRONTIER["margin_m"], key=float)
        wide = Point("map", (("margin_m", widest), ("ego_forecast", "ctrv")))
        left = _where(runs, wide, MAP, "brake", lambda run: not run.avoided)
        lines.append(
            f"The price of the map's margin: {_text(missed, 'contact')} that everything avoids. With "
            f"{widest:g} m instead of 1.8 m the map avoids {_text(left, 'contact')} more."
        )
    return lines


def contradictions(
    runs: Sequence[RunMeasures], growth: Sequence[GrowthRun], spent: Sequence[FrameTime]
) -> list[str]:
    """Statements of the paper that did not come out beyond its own test."""
    lines = []
    worse = contacts_avoided(runs, "the rectangle", "the map")
    if worse:
        lines.append(
            "The paper's map is never worse than its rectangle. Under the paper's own conditions the "
            f"rectangle avoids {_text(worse, 'contact')} that the map does not."
        )
    if grows_in_proportion(growth, spent):
        lines.append("The paper expects an exponential increase with the number of others; see *Crowds*.")
    return lines
