"""Settings that were chosen for a rival and a rule on other scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.tables import EMPTY, Table
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.study import Sample
from scenarios.reading import read_json
from scenarios.settings import PARAMETERS, Setting, Settings

TUNE = "tune"
"""Name of the question that chooses them."""
TUNED = "tuned.json"
"""File that it writes."""

Tuned = tuple[tuple[str, str, Settings], ...]
"""Name of a rival, rule, and the settings that `evaluation.studies.answers.tune` chose for them."""

BY_TUNING = ", tuned"
"""Of the names of rivals with such settings."""

NOTHING_BETTER = "nothing better was found"
"""Of rivals for which the settings that they have anyway were chosen."""


def tuned_settings(rival: str, rule: str, tuned: Tuned) -> Settings | None:
    """What was chosen for a rival and a rule; None where nothing was."""
    return next((settings for name, of, settings in tuned if (name, of) == (rival, rule)), None)


def tuned_arm(arm: Arm, tuned: Tuned) -> Arm | None:
    """A rival with the settings that were chosen for it and its rule; None where none were.

    Where these are what it has anyway, it is the rival itself: the same runs would be counted twice, and
    each question more makes the correction of all others stricter.

    Raises:
        ArgumentError: the settings are not possible.
    """
    settings = tuned_settings(arm.name, arm.rule, tuned)
    if settings is None:
        return None
    changed = arm.having(*settings, name=f"{arm.name}{BY_TUNING}")
    changed.check()
    return arm if changed.conditions == arm.conditions else changed


def told_unchanged(arms: Sequence[Arm]) -> str:
    """A sentence on those for which tuning found nothing better; empty if there are none."""
    names = ", ".join(f"{arm.name}{BY_TUNING}" for arm in arms)
    return (
        f"{names}: {NOTHING_BETTER} on the training scenes, so that there is no line of its own."
        if names
        else ""
    )


def unchanged_table(arms: Sequence[Arm], table: Table) -> Table:
    """A table of who is who with those for which tuning found nothing better.

    Args:
        arms: these, as they are.
        table: with a line per name, and settings at the end.
    """
    lines = [
        (f"{arm.name}{BY_TUNING}", arm.strategy, arm.path_from or EMPTY, f"as {arm.name}: {NOTHING_BETTER}")
        for arm in arms
    ]
    return replace(table, rows=(*table.rows, *dict.fromkeys(lines)))


def read_tuned(path: Path, sample: Sample) -> Tuned:
    """Rival, rule and settings of what was chosen.

    Args:
        path: the file.
        sample: scenes on which the settings are to be shown.

    Raises:
        ArgumentError: the file is not one that `smartmot-eval study tune` wrote, or what it has was chosen on
            these very scenes.
    """
    try:
        content = read_json(path)
        on = content["sample"]
        chosen_on = str(on["split"]), int(on["seed"])
        chosen = tuple(
            (str(v["rival"]), str(v["rule"]), tuple(map(_setting, v["settings"].items())))
            for v in content["chosen"]
        )
        if len({(rival, rule) for rival, rule, _ in chosen}) < len(chosen):
            raise ValueError("a rival and rule twice")
    except (OSError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise ArgumentError(
            f"{path} is not a {TUNED} of `smartmot-eval study tune` ({type(error).__name__}: {error})"
        ) from None
    # scenes follow from split, seed and their number: a smaller sample is a part of a greater one
    if chosen_on == (sample.split, sample.seed):
        raise ArgumentError(
            f"{path}: chosen on these very scenes (split {sample.split}, seed {sample.seed}); show the "
            "settings on others, by --split or --seed"
        )
    return chosen


def _setting(pair: tuple[str, object]) -> tuple[str, Setting]:
    """Name and value of a parameter; whether it admits the value is seen before the first run."""
    name, value = pair
    if name not in PARAMETERS:
        raise ValueError(f"no parameter {name!r}")
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise ValueError(f"{name} cannot be {value!r}")
    return name, value if isinstance(value, str) else float(value)


def given_tuned(out: Path, sample: Sample) -> Tuned:
    """What was chosen in a folder of several studies, for other scenes.

    Raises:
        ArgumentError: `tune` has not been answered there, or on these scenes.
    """
    return read_tuned(out / TUNE / TUNED, sample)
