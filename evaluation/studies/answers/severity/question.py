"""What do false activations cost, and which rule brakes most gently for the same collisions avoided?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.metrics.intervals import Estimate, mean_t, median, sign_test, wilson
from evaluation.metrics.power import holm
from evaluation.results.tables import Table, csv_bytes, fixed
from evaluation.runs.execution import FrameTime
from evaluation.studies.answers.arms import Arm, ArmRun
from evaluation.studies.answers.measures import Decision
from evaluation.studies.answers.results import LEVEL, Results, benefit, difference
from evaluation.studies.answers.rivals import ADAPTIVE, MAP, PATH, Rival
from evaluation.studies.answers.severity.behind import with_followers
from evaluation.studies.answers.severity.figures import severity_rows
from evaluation.studies.answers.severity.runs import (
    FOLLOWERS,
    BrakingDecision,
    Weights,
    decide,
)
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import interval_text, p_text, points_text
from scenarios.scenes.scenes import SceneRun
from smartmot.types import FloatArray

RULES = ("paper", "cascade", "rss", "staged")
"""The first is what the others are compared with."""

ALONE: tuple[tuple[str, Weights], ...] = (
    ("speed lost alone", Weights(1.0, 0.0, 0.0)),
    ("peak deceleration alone", Weights(0.0, 1.0, 0.0)),
    ("those behind alone", Weights(0.0, 0.0, 1.0)),
)
"""Ends of what weights can be: whatever lies between them weighs a mean of these."""

EQUAL = Weights()


@dataclass(frozen=True, slots=True)
class Cost:
    """What a side avoids, and what its unnecessary stops cost.

    Args:
        arm: the side.
        avoided, stops, early: rates, as in the other questions.
        weighed: mean severity over all nothing scenes, 0 where there was no unnecessary stop.
        lost_kmh, peak_mps2, rear: means over the unnecessary stops: speed lost, peak deceleration, share of
            the followers who would touch the ego.
        closing_kmh: mean over the unnecessary stops that followers would touch the ego in.
        rear_brake: mean share of such followers over the must-brake scenes without contact.
    """

    arm: Arm
    avoided: Estimate
    stops: Estimate
    weighed: Estimate
    lost_kmh: Estimate
    peak_mps2: Estimate
    rear: Estimate
    closing_kmh: Estimate
    rear_brake: Estimate
    early: Estimate

    @property
    def benefit(self) -> Estimate:
        """Collisions avoided less weighed stops."""
        return benefit(self.avoided, self.weighed)


@dataclass(frozen=True, slots=True)
class Change:
    """Weighed stops of a side less those of another in the same scenes.

    Args:
        arm, against: the sides.
        weighed: mean difference, with Student's interval.
        avoided: difference of collisions avoided, with Tango's.
        more, fewer: nothing scenes in which the side's severity is greater, and less.
        p_value: of the sign test over these.
        adjusted: the same corrected for all pairs (Holm).
    """

    arm: Arm
    against: Arm
    weighed: Estimate
    avoided: Estimate
    more: int
    fewer: int
    p_value: float
    adjusted: float = math.nan


@dataclass(frozen=True, slots=True)
class Severity(Question):
    """Rules with areas, their unnecessary stops weighed by what they cost.

    Args:
        preset: conditions.
        rules: brake rules; the first is what the others are compared with.
        areas: monitored areas.
        weights: of the costs.
        followers: vehicles of SUMO behind the ego in every run; 0: none.
    """

    preset: str = "real"
    rules: tuple[str, ...] = RULES
    areas: tuple[Rival, ...] = (PATH, MAP, ADAPTIVE)
    weights: Weights = EQUAL
    followers: int = 0
    name = "severity"
    journal = "severity_"
    kind = BrakingDecision  # type: ignore[assignment]  # a decision, and more

    @staticmethod
    def job(item: ArmRun) -> tuple[Decision, FrameTime]:
        """Carry out one run."""
        return decide(item)

    def items_of(self, scenes: Sequence[SceneRun]) -> list[ArmRun]:
        """The runs over some scenes, with those who drive behind."""
        items = super(Severity, self).items_of(scenes)
        if not self.followers:
            return items
        return [replace(item, spec=with_followers(item.spec, self.followers, FOLLOWERS)) for item in items]

    def arm(self, area: Rival, rule: str) -> Arm:
        """An area with a rule."""
        return replace(area.arm(self.preset, rule), name=f"{area.name} with {rule}")

    @property
    def arms(self) -> tuple[Arm, ...]:
        """Every rule with every area."""
        return tuple(self.arm(area, rule) for area in self.areas for rule in self.rules)

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """Every rule against the first with the same area."""
        first, *others = self.rules
        return [(self.arm(area, rule), self.arm(area, first)) for area in self.areas for rule in others]

    @property
    def questions(self) -> int:
        """Differences in weighed stops."""
        return len(self.pairs)

    def answer(self, results: Results) -> Answer:
        """What each side avoids, and what it costs; the side with the most avoided less weighed first."""
        costs = [cost_of(results, arm, self.weights) for arm in self.arms]
        changes = changes_of(results, self.pairs, self.weights)
        tables = {
            "Each by itself": costs_table(costs),
            "By weights": _weights_table(results, self.arms, self.weights),
        }
        if changes:
            tables[f"Against {self.rules[0]}, scene by scene"] = _changes_table(changes)
        if self.followers:
            tables["Those behind, driven by SUMO"] = behind_table(results, self.arms)
        sentences = [*findings(costs, changes), _least_whatever_weighs(results, self.arms)]
        sentences += [behind_sentence(results, arm) for arm in self.arms if self.followers]
        f, w = FOLLOWERS, self.weights
        return Answer(
            "What do false activations cost?",
            sentences,
            tables,
            {"severity": severity_rows(costs, f"preset {self.preset}")},
            {"severity.csv": _costs_csv(costs)},
            (
                "A stop weighs from 0 to 1: the mean, by weights, of the share of the speed that is lost, of "
                "the peak deceleration in g and of the share of followers who would touch the ego. Weights: "
                f"{w.speed:g}, {w.decel:g}, {w.rear:g} (assumed; --weights). 1 is an emergency stop with 1 g "
                "that everybody behind drives into.",
                f"Followers: time gaps lognormal, shifted by {f.shift_s:g} s, median {f.median_s:g} s; "
                f"reactions {f.reaction_s:g} s with a standard deviation of {f.reaction_sigma_s:g} s, and "
                f"half of {f.build_up_s:g} s of build-up; at most {f.decel_mps2:.1f} m/s². Sources: "
                "`evaluation.metrics.rear_end.Followers`. Shares are of who drives behind the ego, if "
                "there is anyone: how often that is so is not known here.",
                "Runs with a contact have no such share, and are in no mean that needs it.",
                *((_BEHIND_NOTE,) if self.followers else ()),
            ),
        )


_BEHIND_NOTE = (
    "Vehicles of SUMO: Krauss' model without dawdling; time gap and time between two decisions are drawn for "
    "each scene from the distribution of the followers above, who also give the greatest deceleration; all "
    "else is SUMO's default. They see the ego, and none of the scene's other road users. Drivers of SUMO "
    "decide at intervals: what happens in between is seen half an interval later on average, so that they "
    "react sooner than those of the closed form."
)


def _stopped_behind(results: Results, arm: Arm) -> list[BrakingDecision]:
    """Runs with a false activation of the emergency brake that a vehicle of SUMO drove behind."""
    return [
        run
        for scene, run in zip(results.scenes, results.runs[arm], strict=True)
        if scene.must == "nothing" and isinstance(run, BrakingDecision) and run.behind_decel_mps2 is not None
    ]


def behind_sentence(results: Results, arm: Arm) -> str:
    """How often a false activation was answered by a contact from behind, in words."""
    runs = _stopped_behind(results, arm)
    if not runs:
        return f"{arm.name}: no false activation with a vehicle of SUMO behind."
    count = sum(run.struck_kmh is not None for run in runs)
    share = _percent(wilson(count, len(runs)))
    return (
        f"{arm.name}: in {count} of {len(runs)} false activations ({share} %) the vehicle of SUMO behind "
        "strikes the ego."
    )


def behind_table(results: Results, arms: Sequence[Arm]) -> Table:
    """A line per side: what its false activations did to the vehicle of SUMO behind."""
    header = (
        "who", "false activations", "struck from behind", "closing speed (km/h)", "least TTC (s)",
        "peak deceleration behind (m/s²)",
    )  # fmt: skip
    rows = []
    for arm in arms:
        runs = _stopped_behind(results, arm)
        closing = [run.struck_kmh for run in runs if run.struck_kmh is not None]
        ttc = [run.behind_ttc_s for run in runs if run.behind_ttc_s is not None]
        decel = [run.behind_decel_mps2 for run in runs if run.behind_decel_mps2 is not None]
        rows.append(
            (
                arm.name, str(len(runs)), str(len(closing)), _mean(mean_t(closing)),
                _mean(median(np.array(ttc)), 2), _mean(mean_t(decel)),
            )
        )  # fmt: skip
    caption = (
        "Of the first vehicle behind, over the false activations in nothing scenes, from the request on; a "
        "scene without room behind the ego is not among them. Closing speed and peak deceleration: means, "
        "least time to collision: median, 0 of a contact; 95 % intervals."
    )
    return Table(header, tuple(rows), (), caption)


def severities(results: Results, arm: Arm, weights: Weights) -> FloatArray:
    """(S,) severity of the unnecessary stop in each nothing scene; NaN elsewhere, and of runs cut off."""
    values = [
        weights.severity(run) if scene.must == "nothing" and not run.cut_off else None
        for scene, run in zip(results.scenes, results.runs[arm], strict=True)
    ]
    return np.array([math.nan if value is None else value for value in values])


def cost_of(results: Results, arm: Arm, weights: Weights) -> Cost:
    """What a side avoids, and what its unnecessary stops cost."""
    runs = [
        (scene.must, run)
        for scene, run in zip(results.scenes, results.runs[arm], strict=True)
        if isinstance(run, BrakingDecision) and run.rear_share is not None and not run.cut_off
    ]
    stops = [run for must, run in runs if must == "nothing" and run.unnecessary_stop]
    return Cost(
        arm,
        results.estimate(arm, "avoided"),
        results.estimate(arm, "stops"),
        _weighed(results, arm, weights),
        mean_t([run.speed_lost_kmh for run in stops]),
        mean_t([run.peak_decel_mps2 for run in stops]),
        _share([run.rear_share or 0.0 for run in stops]),
        mean_t([run.rear_closing_kmh or 0.0 for run in stops if run.rear_share]),
        _share([run.rear_share or 0.0 for must, run in runs if must == "brake"]),
        results.estimate(arm, "early"),
    )


def changes_of(results: Results, pairs: Sequence[tuple[Arm, Arm]], weights: Weights) -> list[Change]:
    """Paired differences in weighed stops, corrected for their number."""
    changes = []
    for arm, against in pairs:
        values = _known(severities(results, arm, weights) - severities(results, against, weights))
        more, fewer = int((values > 0.0).sum()), int((values < 0.0).sum())
        avoided = difference(results, arm, against, "avoided").estimate
        changes.append(Change(arm, against, mean_t(values), avoided, more, fewer, sign_test(more, fewer)))
    adjusted = holm([change.p_value for change in changes])
    return [replace(change, adjusted=p) for change, p in zip(changes, adjusted, strict=True)]


def _known(values: FloatArray) -> FloatArray:
    known: FloatArray = values[~np.isnan(values)]
    return known


def _weighed(results: Results, arm: Arm, weights: Weights) -> Estimate:
    """Mean severity over the nothing scenes."""
    return _share(_known(severities(results, arm, weights)))


def _share(values: Sequence[float] | FloatArray) -> Estimate:
    """Mean of shares with Student's interval, cut at 0 and 1."""
    mean = mean_t(values)
    return replace(mean, low=max(mean.low, 0.0), high=min(mean.high, 1.0))


def findings(costs: Sequence[Cost], changes: Sequence[Change]) -> list[str]:
    """The answer in sentences: sides by what they avoid less what they cost, then the differences."""
    lines = [
        f"{cost.arm.name}: {interval_text(cost.avoided, 'avoided')} % of the collisions avoided at "
        f"{interval_text(cost.stops, 'stops')} % unnecessary stops, which weigh as "
        f"{_percent(cost.weighed)} %."
        for cost in sorted(costs, key=lambda cost: -_or_least(cost.benefit.value))
    ]
    for change in changes:
        end = "decided" if change.adjusted <= LEVEL else "not decided by these scenes"
        lines.append(
            f"{change.arm.name} against {change.against.name}: weighed stops {points_text(change.weighed)} "
            f"points, {end}; collisions avoided {points_text(change.avoided)} points."
        )
    return lines


def _least_whatever_weighs(results: Results, arms: Sequence[Arm]) -> str:
    """Which side has the least weighed stops for every choice of weights, or that it depends on them."""
    least: list[set[str]] = []
    for _, weights in ALONE:
        means = {arm.name: _weighed(results, arm, weights).value for arm in arms}
        lowest = min((value for value in means.values() if not math.isnan(value)), default=math.nan)
        least.append({name for name, value in means.items() if value <= lowest})
    always = set.intersection(*least)
    if len(always) == len(arms) > 1:
        return "Whatever the weights, no side has less weighed stops than another in these scenes."
    if always:
        return f"Whatever the weights, the least weighed stops in these scenes: {', '.join(sorted(always))}."
    parts = [
        f"{', '.join(sorted(names))} ({name})" for (name, _), names in zip(ALONE, least, strict=True) if names
    ]
    return f"Which side has the least weighed stops depends on the weights: {'; '.join(parts)}."


def _or_least(value: float) -> float:
    return -math.inf if math.isnan(value) else value


def _percent(estimate: Estimate) -> str:
    """`4.2 [1.0, 7.4]` of a mean of shares, in percent."""
    value, low, high = (fixed(100 * v, 1) for v in (estimate.value, estimate.low, estimate.high))
    return value if math.isnan(estimate.low) else f"{value} [{low}, {high}]"


def _mean(estimate: Estimate, digits: int = 1) -> str:
    value, low, high = (fixed(v, digits) for v in (estimate.value, estimate.low, estimate.high))
    return value if math.isnan(estimate.low) else f"{value} [{low}, {high}]"


def costs_table(costs: Sequence[Cost]) -> Table:
    """A line per side: what it avoids, and what its stops cost."""
    header = (
        "who", "avoided (%)", "unnecessary stops (%)", "weighed stops (%)", "avoided less weighed (points)",
        "speed lost (km/h)", "peak deceleration (m/s²)", "followers who touch (%)", "closing speed (km/h)",
        "followers who touch, must-brake (%)", "early activations (%)",
    )  # fmt: skip
    rows = tuple(
        (
            cost.arm.name, interval_text(cost.avoided, "avoided"), interval_text(cost.stops, "stops"),
            _percent(cost.weighed), points_text(cost.benefit), _mean(cost.lost_kmh), _mean(cost.peak_mps2),
            _percent(cost.rear), _mean(cost.closing_kmh), _percent(cost.rear_brake),
            interval_text(cost.early, "early"),
        )
        for cost in costs
    )  # fmt: skip
    caption = (
        "95 % intervals over the scenes (rates: Wilson, means: Student, of shares cut at 0 and 1). Speed "
        "lost, peak deceleration and followers: means over the unnecessary stops of a side, so that who "
        "stops seldom has few."
    )
    return Table(header, rows, (), caption)


def _weights_table(results: Results, arms: Sequence[Arm], given: Weights) -> Table:
    columns = (("as given", given), *ALONE)
    rows = tuple(
        (arm.name, *(_percent(_weighed(results, arm, weights)) for _, weights in columns)) for arm in arms
    )
    caption = "Weighed stops (%). Any other weights give a mean of the last three."
    return Table(("who", *(name for name, _ in columns)), rows, (), caption)


def _changes_table(changes: Sequence[Change]) -> Table:
    header = ("who", "against", "weighed stops (points)", "more : fewer", "p", "p (Holm)", "avoided (points)")
    rows = tuple(
        (
            change.arm.name, change.against.name, points_text(change.weighed),
            f"{change.more} : {change.fewer}", p_text(change.p_value), p_text(change.adjusted),
            points_text(change.avoided),
        )
        for change in changes
    )  # fmt: skip
    caption = (
        "The same scenes and sensor noise: mean difference of the severities with Student's interval, "
        "nothing scenes in which the one or the other is greater, p-value of the sign test over these."
    )
    return Table(header, rows, (), caption)


def _costs_csv(costs: Sequence[Cost]) -> bytes:
    names = (
        "avoided",
        "stops",
        "weighed",
        "lost_kmh",
        "peak_mps2",
        "rear",
        "closing_kmh",
        "rear_brake",
        "early",
    )
    rows = [
        (cost.arm.preset, cost.arm.rule, cost.arm.strategy, name, e.value, e.low, e.high, e.count)
        for cost in costs
        for name in names
        if (e := getattr(cost, name))
    ]
    return csv_bytes(("preset", "rule", "strategy", "measure", "value", "low", "high", "count"), rows)
