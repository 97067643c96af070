"""What the comparison over scenes and the ablations came to, in sentences from the tables."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import EMPTY, Table
from evaluation.studies.compare.answer import answer
from evaluation.studies.compare.differences import differences, pairs_with, told_differences
from evaluation.studies.compare.grid import COMPARED, FAIR, FRONTIER, Point, fair_points
from evaluation.studies.compare.measures import RunMeasures
from evaluation.studies.compare.table import Summary, scene_table, summaries, summarise
from evaluation.studies.reference.words import counted, listed

ALIKE = {
    "the rectangle": Point("rectangular", (("half_width_m", 2.6), *FAIR)),
    "the map": Point("map", (("margin_m", 1.8), *FAIR)),
    "the path": Point("path", FAIR),
    "everything": Point("all", FAIR),
}
"""Areas of the paper's widths and without lanes, alike in all else."""

AS_PUBLISHED = {
    "the rectangle as published": Point("rectangular"),
    "the map as published": Point("map"),
    "everything as published": Point("all"),
}
"""The paper's own settings: the ego is forecast by its turn rate, and each area answers for itself."""

SHOWN = ALIKE | AS_PUBLISHED
"""What the page compares."""

SIDE_BY_SIDE = {name: point for name, point in SHOWN.items() if point.strategy != "all"}
"""What the tables with a column each compare."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What a run of one kind of scene came to.

    Args:
        text: in words.
        must: kind of the scene.
        is_so: whether it came to that.
    """

    text: str
    must: str
    is_so: Callable[[RunMeasures], bool]

    def runs(self, runs: Iterable[RunMeasures]) -> list[RunMeasures]:
        """The runs that could come to that."""
        return [run for run in runs if run.must == self.must]


OUTCOMES: Mapping[str, Outcome] = MappingProxyType(
    {
        "avoided": Outcome("collisions avoided", "brake", lambda run: run.avoided),
        "needless_stops": Outcome("unnecessary stops", "nothing", lambda run: run.needless_stop),
    }
)
"""By the names of the measures of a summary."""


def of_point(runs: Sequence[RunMeasures], point: Point) -> list[RunMeasures]:
    """Runs of a strategy with settings."""
    return [run for run in runs if (run.strategy, run.settings) == (point.strategy, point.text)]


def _named(strategy: str, settings: str) -> str:
    return next(name for name, p in SHOWN.items() if (p.strategy, p.text) == (strategy, settings))


def _of(rate: Estimate) -> str:
    return f"{rate.hits} of {rate.count}"


def strategy_table(runs: Sequence[RunMeasures]) -> Table:
    """A line per strategy shown: what it avoids and what it costs."""
    header = (
        "strategy", "collisions avoided", "mean impact (km/h)", "false activations", "unnecessary stops",
        "mean delay (s)", "tracks per frame",
    )  # fmt: skip
    lines = [
        (
            _named(row.strategy, row.settings), _of(row.avoided), f"{row.v_impact_kmh.value:.1f}",
            _of(row.false_activations), _of(row.needless_stops), f"{row.delay_s.value:.2f}",
            f"{row.tracks.value:.1f}",
        )
        for row in summaries([run for point in SHOWN.values() for run in of_point(runs, point)])
    ]  # fmt: skip
    return Table(header, tuple(lines))


def speed_table(runs: Sequence[RunMeasures]) -> Table:
    """Collisions avoided and unnecessary stops by test speed."""
    kinds = (OUTCOMES["avoided"], OUTCOMES["needless_stops"])
    header = ("v_test (km/h)", *(f"{name}: {word}" for word in ("avoided", "stops") for name in SIDE_BY_SIDE))
    lines = []
    for speed in sorted({run.v_test_kmh for run in runs}):
        cells = []
        for outcome, point in itertools.product(kinds, SIDE_BY_SIDE.values()):
            marks = [outcome.is_so(r) for r in outcome.runs(of_point(runs, point)) if r.v_test_kmh == speed]
            cells.append(f"{sum(marks)} of {len(marks)}" if marks else EMPTY)
        lines.append((f"{speed:g}", *cells))
    return Table(header, tuple(lines))


def different_scenes(runs: Sequence[RunMeasures]) -> Table:
    """The lines of the table by scene in which the strategies differ."""
    every = scene_table(runs, list(SIDE_BY_SIDE.values()))
    return Table(
        (*every.header[:2], *SIDE_BY_SIDE), tuple(row for row in every.rows if len(set(row[2:])) > 1)
    )


def told_scenes(runs: Sequence[RunMeasures]) -> list[str]:
    """Who is better where: areas that differ in nothing else, then as published."""
    pairs = (
        ("the map", "the path"),
        ("the rectangle", "the path"),
        ("the map", "the rectangle"),
        ("the map as published", "the rectangle as published"),
        ("the map as published", "everything as published"),
    )
    return [told_pair(runs, *pair) for pair in pairs]


def told_alike(runs: Sequence[RunMeasures]) -> list[str]:
    """What areas come to that differ in nothing else, and what each comes to as published."""
    lines = [
        f"{lead}, collisions avoided and unnecessary stops are "
        f"{listed(_told_counts(runs, name) for name in points)}."
        for lead, points in (("Alike, all along the planned path", ALIKE), ("As published", AS_PUBLISHED))
    ]
    ends = [
        {(r.scene, r.variant, r.seed, r.avoided, r.needless_stop) for r in of_point(runs, ALIKE[name])}
        for name in ("everything", "the path")
    ]
    if ends[0] == ends[1]:
        lines.append("Everything alike is the path again: every run ends as with the path.")
    return lines


def _told_counts(runs: Sequence[RunMeasures], name: str) -> str:
    """`22 of 26 and 3 of 29 with the map`."""
    row = summarise(of_point(runs, SHOWN[name]))
    return f"{_of(row.avoided)} and {_of(row.needless_stops)} with {name.removesuffix(' as published')}"


def told_clear(runs: Sequence[RunMeasures]) -> str:
    """Which differences another choice of scenes would not explain."""
    shown = tuple(SHOWN.values())
    clear = differences(runs, pairs_with(shown, shown))
    return told_differences(clear, lambda point: _named(point.strategy, point.text))


def told_pair(runs: Sequence[RunMeasures], strategy: str, against: str) -> str:
    """What each of two strategies avoids that the other does not."""
    ways = ((strategy, against), (against, strategy))
    better, worse = (contacts_avoided(runs, *way) for way in ways)
    calmer, wilder = (stops_avoided(runs, *way) for way in ways)
    return (
        f"{strategy.capitalize()} avoids {_text(better, 'contact')} that {against} does not; the other way "
        f"round {_text(worse, 'contact')}. It avoids {_text(calmer, 'stop')} that {against} does not; the "
        f"other way round {_text(wilder, 'stop')}."
    )


Places = dict[str, list[float]]
"""Test speeds in km/h of variants by scene."""


def contacts_avoided(runs: Sequence[RunMeasures], strategy: str, against: str) -> Places:
    """Where the first strategy never has a contact and the second has."""
    return _where(runs, SHOWN[strategy], SHOWN[against], "brake", lambda run: not run.avoided)


def stops_avoided(runs: Sequence[RunMeasures], strategy: str, against: str) -> Places:
    """Where the first strategy never stops unnecessarily and the second does."""
    return _where(runs, SHOWN[strategy], SHOWN[against], "nothing", lambda run: run.needless_stop)


def _where(
    runs: Sequence[RunMeasures], point: Point, against: Point, must: str, bad: Callable[[RunMeasures], bool]
) -> Places:
    """Scenes and speeds of the variants in which the first is never bad and the second is."""
    first, second = (
        {
            (run.scene, run.variant): run.v_test_kmh
            for run in of_point(runs, side)
            if run.must == must and bad(run)
        }
        for side in (point, against)
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
    return answer(summaries(runs), fair_points(COMPARED))


def short_table(physical: Sequence[RunMeasures], paper: Sequence[RunMeasures]) -> Table:
    """Collisions avoided and unnecessary stops in both presets."""
    header = ["strategy"]
    for title in ("real car", "paper"):
        header += [f"{title}: collisions avoided", "false activations", "unnecessary stops"]
    lines = []
    for name, point in SHOWN.items():
        rows = [summarise(of_point(runs, point)) for runs in (physical, paper)]
        cells = [_of(r) for row in rows for r in (row.avoided, row.false_activations, row.needless_stops)]
        lines.append((name, *cells))
    return Table(tuple(header), tuple(lines))


# ---- ablations ---------------------------------------------------------------------------------------------


def _ablations(
    runs: Sequence[RunMeasures],
) -> list[tuple[Summary, list[tuple[Summary, tuple[int, int, int]]]]]:
    """Each strategy as the preset has it: with a choice changed, and by how much the counts change."""
    rows = summaries(runs)
    return [
        (usual, [(r, _changes(r, usual)) for r in rows if r.strategy == usual.strategy and r.settings])
        for usual in rows
        if not usual.settings
    ]


def _changes(row: Summary, usual: Summary) -> tuple[int, int, int]:
    return (
        row.avoided.hits - usual.avoided.hits,
        row.false_activations.hits - usual.false_activations.hits,
        row.needless_stops.hits - usual.needless_stops.hits,
    )


def ablation_table(runs: Sequence[RunMeasures]) -> Table:
    """Changes against the preset of every choice that changes a count."""
    lines = [
        (row.strategy, row.settings, *(f"{change:+d}" if change else "0" for change in changes))
        for _, rows in _ablations(runs)
        for row, changes in rows
        if any(changes)
    ]
    header = ("strategy", "changed", "collisions avoided", "false activations", "unnecessary stops")
    return Table(header, tuple(lines))


def told_ablation(runs: Sequence[RunMeasures]) -> list[str]:
    """Which of the paper's choices change anything."""
    lines = []
    for usual, rows in _ablations(runs):
        idle = [row.settings for row, changes in rows if not any(changes)]
        free = [
            row.settings
            for row, (avoided, false, stops) in rows
            if avoided >= 0 and false <= 0 and stops <= 0 and any((avoided, false, stops))
        ]
        avoided, stops = (counted(rate.hits, rate.count) for rate in (usual.avoided, usual.needless_stops))
        lines.append(
            f"As the preset has it, {usual.strategy} avoids {avoided} collisions and stops unnecessarily in "
            f"{stops}."
        )
        if idle:
            lines.append(f"No count of {usual.strategy} changes with {listed(idle)}.")
        if free:
            lines.append(f"Better in one count and worse in none ({usual.strategy}): {listed(free)}.")
    return lines


# ---- in short ----------------------------------------------------------------------------------------------


def told_in_short(runs: Sequence[RunMeasures]) -> list[str]:
    """What the areas come to, where the map's lanes help and where not, and what the path is worth."""
    lines = [*told_alike(runs), told_pair(runs, "the map", "the path")]
    for name in ("the map", "the rectangle"):
        published = f"{name} as published"
        cured, caused = (stops_avoided(runs, *pair) for pair in ((name, published), (published, name)))
        won, lost = (contacts_avoided(runs, *pair) for pair in ((name, published), (published, name)))
        lines.append(
            f"What the planned path changes for {name}: it cures {_text(cured, 'stop')} and causes "
            f"{_text(caused, 'stop')}; it avoids {_text(won, 'contact')} and costs {_text(lost, 'contact')}."
        )
    missed = contacts_avoided(runs, "everything", "the map")
    if missed:
        widest = max(FRONTIER["margin_m"], key=float)
        wide = Point("map", (("margin_m", widest), *FAIR))
        left = _where(runs, wide, ALIKE["the map"], "brake", lambda run: not run.avoided)
        lines.append(
            f"The price of the map's margin: {_text(missed, 'contact')} that everything avoids. With "
            f"{widest:g} m instead of 1.8 m the map avoids {_text(left, 'contact')} more."
        )
    return lines


def contradictions(runs: Sequence[RunMeasures]) -> list[str]:
    """Statements of the paper that did not come out beyond its own test."""
    worse = contacts_avoided(runs, "the rectangle as published", "the map as published")
    if not worse:
        return []
    return [
        "The paper's map is never worse than its rectangle. Under the paper's own conditions the rectangle "
        f"avoids {_text(worse, 'contact')} that the map does not."
    ]
