"""What the questions over drawn scenes came to, in sentences from their kept runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

from evaluation.metrics.intervals import Estimate
from evaluation.results.files import ResultsError
from evaluation.results.tables import Table
from evaluation.studies.answers import break_even, sensor, trigger
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.break_even import BreakEven
from evaluation.studies.answers.gain import Gain, exchange
from evaluation.studies.answers.measures import DECISIVE
from evaluation.studies.answers.results import (
    Difference,
    Results,
    benefit_difference,
    decisive_differences,
    difference,
    power_lines,
)
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.answers.sensor import SensorErrors
from evaluation.studies.answers.study import Question
from evaluation.studies.answers.tables import differences_table, points_text, rates_table, verdict
from evaluation.studies.answers.trigger import Trigger
from evaluation.studies.answers.tune import Tuning
from evaluation.studies.answers.tuned import BY_TUNING, told_unchanged
from evaluation.studies.reference.kept import read_records, read_rows
from scenarios.scenes.scenes import SceneRun
from scenarios.settings import settings_text

CONDITIONS = {
    "physical": "With the brakes of a real car and a sensor without errors",
    "real": "With the errors of a real sensor as well",
}
RECTANGLE, AS_PUBLISHED = "rectangle", ", as published"

Asked = TypeVar("Asked", bound=Question)


@dataclass(frozen=True, slots=True, eq=False)
class Kept(Generic[Asked]):
    """A question with its kept runs."""

    question: Asked
    results: Results

    def power(self) -> list[str]:
        """What its scenes can decide."""
        return power_lines(self.results.scenes, self.question.questions)


def read(question: Asked, reports: Path, in_part: bool = False) -> Kept[Asked]:
    """The kept runs of a question.

    Args:
        question: as it is asked today.
        reports: folder of the reference results.
        in_part: whether runs of arms that it has no more may be among them; they are left out.

    Raises:
        ResultsError: they are missing, or belong to other arms.
    """
    given: Any = question.given(reports)
    path = reports / question.name / question.table
    rows, decisions = read_rows(path), read_records(path, question.kind)
    count = 2 * question.sample.count
    kept = {_arm_of(row): k for k, row in zip(range(0, len(rows), count), rows[::count], strict=True)}
    named = {(arm.name, arm.preset, arm.text): arm for arm in given.arms}
    if in_part:
        kept = {name: k for name, k in kept.items() if name in named}
    of_arm = all(_arm_of(row) == name for name, k in kept.items() for row in rows[k : k + count])
    is_right = list(kept) == list(named) and of_arm and len(rows) % count == 0
    if not is_right or not (in_part or len(rows) == count * len(named)):
        raise ResultsError(f"{path}: not the runs of today's {question.name}; make it again")
    scenes = [
        SceneRun(row["scene"], row["variant"], row["must"], "", (), 0.0)  # type: ignore[arg-type]
        for row in rows[:count]
    ]
    runs = {named[name]: tuple(decisions[k : k + count]) for name, k in kept.items()}
    return Kept(given, Results(tuple(scenes), runs))


def _arm_of(row: Mapping[str, str]) -> tuple[str, str, str]:
    """Name, preset and settings of the arm that a run is of."""
    return row["name"], row["preset"], row["settings"]


def _arm(kept: Kept[Gain], name: str, preset: str) -> Arm:
    """An arm of the paper's rule."""
    return next(arm for arm in kept.question.groups[preset, "paper"] if arm.name == name)


def _differences(kept: Kept[Gain]) -> list[Difference]:
    return decisive_differences(kept.results, kept.question.pairs)


# ---- what lanes gain ---------------------------------------------------------------------------------------


BETTER, WORSE, UNDECIDED = "gains", "loses", "undecided"


def outcomes(kept: Kept[Gain]) -> dict[str, tuple[str, Estimate]]:
    """Of each map filter in each preset: whether it gains over the planned path, and how much."""
    by_filter = {}
    for preset in kept.question.presets:
        for arm, against in kept.question.pairs:
            if arm.preset == preset and arm.rule == "paper" and arm.name in (MAP.name, MAP.name + BY_TUNING):
                gained = benefit_difference(kept.results, arm, against)
                outcome = BETTER if gained.low > 0 else WORSE if gained.high < 0 else UNDECIDED
                by_filter[f"{arm.name}, preset {preset}"] = outcome, gained
    return by_filter


def told_verdict(kept: Kept[Gain]) -> str:
    """Whether the lane filter gains anything over the planned path, and in which conditions."""
    by_filter = outcomes(kept)
    better, worse, undecided = (
        [name for name, (outcome, _) in by_filter.items() if outcome == of]
        for of in (BETTER, WORSE, UNDECIDED)
    )
    parts = [
        f"{text} with {'; '.join(names)}."
        for text, names in (
            ("More is gained in collisions avoided and stops saved than lost", better),
            ("More is lost in collisions than gained in stops", worse),
            ("Neither is decided", undecided),
        )
        if names
    ]
    start = "A lane filter gains" if better else "A lane filter gains nothing"
    return f"**{start} over a planned path alone in these scenes.** {' '.join(parts)}"


def told_confirmation(kept: Kept[Gain], again: Kept[Gain]) -> str:
    """Whether scenes on other maps give the same answer.

    Args:
        kept: the scenes of the answer.
        again: those on other maps.
    """
    first, second = outcomes(kept), outcomes(again)
    said = {
        BETTER: "the filter gains",
        WORSE: "the filter loses",
        UNDECIDED: "neither is decided",
    }
    same = [name for name in first if second[name][0] == first[name][0]]
    opposite = [name for name in first if {first[name][0], second[name][0]} == {BETTER, WORSE}]
    if len(same) == len(first):
        start = "confirmed for every filter and preset"
    else:
        start = f"the same answer for {len(same)} of {len(first)} filters and presets, the opposite for "
        start += "; ".join(opposite) or "none"
    parts = [
        f"{name}: {points_text(gained)} points there, {said[outcome]} (here {points_text(first[name][1])})"
        for name, (outcome, gained) in second.items()
    ]
    count = again.question.sample.count
    return (
        f"**And in CARLA's towns?** {count} scenes of each kind: {start}. Avoided less stopped: "
        f"{'; '.join(parts)}."
    )


def told_lanes(kept: Kept[Gain]) -> list[str]:
    """The lane filter against the planned path, with the paper's margin and tuned, in each preset."""
    lines = []
    every = _differences(kept)
    for preset in kept.question.presets:
        for name in (MAP.name, f"{MAP.name}{BY_TUNING}"):
            own = [d for d in every if (d.arm.name, d.arm.preset, d.arm.rule) == (name, preset, "paper")]
            if not own:
                continue
            gained = points_text(benefit_difference(kept.results, own[0].arm, own[0].against))
            text = f"{CONDITIONS.get(preset, preset)}: {verdict(own)}"
            lines.append(f"{text} Avoided less stopped: {gained} points.{exchange(own)}")
    return lines


def told_origin(kept: Kept[Gain]) -> list[str]:
    """Where the gap between the paper's rectangle and the paper's map comes from: path or lanes."""
    lines = []
    for preset in kept.question.presets:
        pairs = (
            ("the paper's map against its rectangle", MAP.name + AS_PUBLISHED, RECTANGLE + AS_PUBLISHED),
            ("both along the planned path", MAP.name, RECTANGLE),
            ("the planned path alone against that rectangle", PATH.name, RECTANGLE),
        )  # fmt: skip
        parts = []
        for text, first, second in pairs:
            arms = _arm(kept, first, preset), _arm(kept, second, preset)
            avoided, stops = (difference(kept.results, *arms, m).estimate for m in DECISIVE)
            parts.append(f"{text}: avoided {points_text(avoided)}, stops {points_text(stops)}")
        lines.append(f"{CONDITIONS.get(preset, preset)}, in points: {'; '.join(parts)}.")
    return lines


def gain_tables(kept: Kept[Gain]) -> list[tuple[str, Table, Table]]:
    """Preset and rule, differences against the planned path, and what each rival came to."""
    every = _differences(kept)
    return [
        (
            f"{preset}, rule {rule}",
            differences_table(
                [d for d in every if d.arm in arms],
                len(every),
                told_unchanged([arm for arm in kept.question.unchanged if arm in arms]),
            ),
            rates_table(kept.results, arms),
        )
        for (preset, rule), arms in kept.question.groups.items()
    ]


def short_table(kept: Kept[Gain]) -> Table:
    """A line per rival with the paper's rule: counts, warning time, speed lost and deceleration."""
    preset = kept.question.presets[-1]
    return rates_table(kept.results, kept.question.groups[preset, "paper"])


# ---- how wrong ---------------------------------------------------------------------------------------------


def told_break_even(kept: Kept[BreakEven]) -> list[str]:
    """Where each map filter loses its benefit, if it has one."""
    curves, named = kept.question.curves(kept.results), kept.question.points_named(kept.results)
    return [line for side in curves for line in break_even.findings(side, curves[side], named[side])]


def told_break_even_in_short(kept: Kept[BreakEven]) -> list[str]:
    """Where the first error of the list, which is the bias of the localisation, takes the benefit."""
    lines = []
    for side, curves in kept.question.curves(kept.results).items():
        curve = curves[0]
        first, last = curve.points[0].benefit, curve.points[-1].benefit
        reach = f"{curve.values[-1]:g} {curve.sweep.unit}"
        text = (
            f"there is no benefit that an error could take: avoided less stopped {points_text(first)} points "
            f"without errors, {points_text(last)} with {curve.sweep.text} by {reach}."
            if first.value <= 0.0
            else break_even.crossing_sentence(curve)
        )
        lines.append(f"**How wrong may the localisation be?** {side}: {text}")
    return lines


def sides(kept: Kept[BreakEven]) -> list[str]:
    """Names of the figures of each map filter."""
    return [kept.question.parts_figure(side[0].name) for side in kept.question.sides]


# ---- sensor, rules, settings -------------------------------------------------------------------------------


def told_sensor(kept: Kept[SensorErrors]) -> list[str]:
    """Which error costs most."""
    return sensor.findings(kept.question.costs(kept.results), kept.question.total(kept.results))


def told_trigger(kept: Kept[Trigger]) -> list[str]:
    """Each rule as published, and at its best."""
    return trigger.findings(kept.question.operating(kept.results))


def told_tuning(kept: Kept[Tuning]) -> list[str]:
    """What was chosen for each rival and rule."""
    return [
        f"{t.rival}, rule {t.rule}: {settings_text(t.settings) or 'as it is'} (trial {t.number} of "
        f"{kept.question.trials})."
        for t in kept.question.chosen(kept.results)
    ]


def contradictions(kept: Kept[Gain]) -> list[str]:
    """What earlier versions of the page said, and these scenes do not."""
    lines = []
    for preset in kept.question.presets:
        arms = _arm(kept, MAP.name, preset), _arm(kept, PATH.name, preset)
        avoided, stops = (difference(kept.results, *arms, m).estimate for m in DECISIVE)
        if avoided.value < 0.0:
            lines.append(
                "Earlier versions of this page counted unnecessary stops that the map avoids and the "
                "rectangle does not as a gain of the map. "
                f"{CONDITIONS.get(preset, preset)}, against a rival that knows the planned path as well, the "
                f"lanes change collisions avoided by {points_text(avoided)} points and unnecessary stops by "
                f"{points_text(stops)}."
            )
    return lines


def told_power(kept: Sequence[Kept[Any]]) -> list[str]:
    """What the scenes of each question decide."""
    return [f"{k.question.name}: {line}" for k in kept for line in k.power()]
