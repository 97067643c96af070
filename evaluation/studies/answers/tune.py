"""Settings of every strategy and rule, chosen with the same effort on scenes other than the test's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np

from evaluation.metrics.intervals import Estimate
from evaluation.results.files import json_bytes
from evaluation.results.tables import Table, csv_bytes
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE
from evaluation.studies.answers.results import Results, benefit
from evaluation.studies.answers.rivals import PATH, Rival, rivals
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import interval_text, points_text
from evaluation.studies.answers.trigger import SENSITIVITIES
from evaluation.studies.answers.tuned import TUNE, TUNED
from evaluation.studies.compare.grid import FAIR
from scenarios.settings import PARAMETERS, TRIGGERS, Settings, settings_text

BOX: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "half_width_m": (0.9, 5.0),
        "length_m": (12.0, 80.0),
        "margin_m": (0.0, 5.0),
        "corridor_m": (0.9, 20.0),
        "probability": (0.0, 0.95),
        "horizon_s": (1.5, 5.0),
    }
)
"""Least and greatest value that is tried of each parameter of an area; a trigger's are those of
`evaluation.studies.answers.trigger.SENSITIVITIES`. Assumed: from the ego's half width to a
lane beyond its own; the corridor, whose preset has no limit, to where it leaves out nobody of the drawn
scenes that could be in the ego's way; the probability up to
what is nearly certain."""


@dataclass(frozen=True, slots=True)
class Trial:
    """Settings that were tried.

    Args:
        rival, rule: of whom.
        number: 0 as it is without tuning.
        settings: what was set.
        avoided, stops: rates.
    """

    rival: str
    rule: str
    number: int
    settings: Settings
    avoided: Estimate
    stops: Estimate

    @property
    def benefit(self) -> Estimate:
        """The objective: collisions avoided less unnecessary stops."""
        return benefit(self.avoided, self.stops)


@dataclass(frozen=True, slots=True)
class Tuning(Question):
    """Every rival and rule with the same number of settings, drawn at random from a box.

    Args:
        preset: conditions.
        rules: brake rules: the first with every rival, the others with the planned path.
        own: strategies of the user's own; of these the parameters of all strategies are drawn.
        trials: settings of each, with that of the preset.
    """

    preset: str = "physical"
    rules: tuple[str, ...] = ("paper",)
    own: tuple[str, ...] = ()
    trials: int = 12
    name = TUNE

    def drawn(self, rival: Rival, rule: str) -> list[Settings]:
        """The settings that are tried, in their order; the first are none."""
        arm = rival.arm(self.preset, rule)
        box = {key: ends for key, ends in BOX.items() if PARAMETERS[key].changes(arm.strategy)}
        trigger = TRIGGERS.get(rule)
        if trigger is not None:
            box[trigger] = (min(SENSITIVITIES[trigger]), max(SENSITIVITIES[trigger]))
        lines: list[Settings] = [()]
        for number in range(1, self.trials):
            # the same point of the unit box for all: none has luckier draws
            unit = np.random.default_rng([self.sample.seed, number]).random(len(box))
            lines.append(
                tuple((key, _value(ends, u)) for (key, ends), u in zip(box.items(), unit, strict=True))
            )
        return lines

    @property
    def pairs(self) -> list[tuple[str, Rival]]:
        """Rules with their rivals."""
        # those with other settings are the same areas, as published
        fair = [rival for rival in rivals(self.own) if rival.settings == FAIR]
        return [(r, rival) for k, r in enumerate(self.rules) for rival in (fair if k == 0 else [PATH])]

    @property
    def tried(self) -> list[tuple[Rival, str, int, Settings, Arm]]:
        """Rival, rule, number, settings and arm of each trial."""
        return [
            (
                rival,
                rule,
                k,
                settings,
                rival.arm(self.preset, rule).having(*settings, name=f"{rival.name}, trial {k}"),
            )
            for rule, rival in self.pairs
            for k, settings in enumerate(self.drawn(rival, rule))
        ]

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys(arm for *_, arm in self.tried))

    @property
    def questions(self) -> int:
        """None is tested: the choice is tested on other scenes."""
        return 0

    def trials_of(self, results: Results) -> list[Trial]:
        """What was tried, with its rates."""
        return [
            Trial(rival.name, rule, k, settings, *(results.estimate(arm, name) for name in DECISIVE))
            for rival, rule, k, settings, arm in self.tried
        ]

    def chosen(self, results: Results) -> list[Trial]:
        """The best of each rival and rule."""
        return choose(self.trials_of(results))

    def answer(self, results: Results) -> Answer:
        """What was chosen for each, and all that was tried."""
        trials = self.trials_of(results)
        chosen = choose(trials)
        files = {TUNED: _json(chosen, self), "tune.csv": _csv(trials)}
        return Answer(
            "Which settings are best on the training scenes?",
            [
                f"{t.rival}, rule {t.rule}: {settings_text(t.settings) or 'as it is'}, "
                f"{interval_text(t.avoided, 'avoided')} % avoided at {interval_text(t.stops, 'stops')} "
                "% unnecessary "
                f"stops (trial {t.number} of {self.trials})."
                for t in chosen
            ],
            {"Chosen": _table(chosen), "Everything that was tried": _table(trials)},
            {},
            files,
            (
                "Objective: collisions avoided per must-brake scene less unnecessary stops per nothing "
                "scene; of "
                "equals the first. Rates of what was chosen look better than they are: test it on other "
                "scenes with "
                "`smartmot-eval study gain --tuned`.",
                f"Every rival and rule has {self.trials} trials: the preset's own settings, and others "
                "drawn from the "
                "same points of its box.",
            ),
        )


def _value(ends: tuple[float, float], share: float) -> float:
    """A value of the box, in three digits; by its logarithm where both ends are a decade apart."""
    low, high = ends
    by_logarithm = low > 0 and high >= 10 * low
    value = low * (high / low) ** share if by_logarithm else low + share * (high - low)
    return float(f"{value:.3g}")


def choose(trials: Sequence[Trial]) -> list[Trial]:
    """The best of each rival and rule by the objective; of equals the first."""
    groups: dict[tuple[str, str], list[Trial]] = {}
    for trial in trials:
        groups.setdefault((trial.rival, trial.rule), []).append(trial)
    return [
        max(own, key=lambda t: -math.inf if math.isnan(t.benefit.value) else t.benefit.value)
        for own in groups.values()
    ]


def _json(chosen: Sequence[Trial], study: Tuning) -> bytes:
    values = {
        "preset": study.preset,
        "objective": "collisions avoided per must-brake scene less unnecessary stops per nothing scene",
        "sample": {"split": study.sample.split, "seed": study.sample.seed},
        "trials": study.trials,
        "chosen": [{"rival": t.rival, "rule": t.rule, "settings": dict(t.settings)} for t in chosen],
    }
    return json_bytes(values, indent=1)


def _table(trials: Sequence[Trial]) -> Table:
    header = (
        "who",
        "rule",
        "trial",
        "settings",
        "avoided (%)",
        "unnecessary stops (%)",
        "avoided less stopped (points)",
    )
    rows = tuple(
        (
            t.rival,
            t.rule,
            str(t.number),
            settings_text(t.settings) or "as it is",
            interval_text(t.avoided, "avoided"),
            interval_text(t.stops, "stops"),
            points_text(t.benefit),
        )
        for t in trials
    )
    return Table(header, rows)


def _csv(trials: Sequence[Trial]) -> bytes:
    header = (
        "rival", "rule", "trial", "settings", "avoided", "avoided_low", "avoided_high", "stops", "stops_low",
        "stops_high", "benefit",
    )  # fmt: skip
    rows = [
        (
            t.rival, t.rule, t.number, settings_text(t.settings),
            t.avoided.value, t.avoided.low, t.avoided.high,
            t.stops.value, t.stops.low, t.stops.high, t.benefit.value,
        )
        for t in trials
    ]  # fmt: skip
    return csv_bytes(header, rows)
