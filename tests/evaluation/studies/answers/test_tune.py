"""Tuning: the same effort for all, the best by the objective, a file that can be read again."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.study import Sample
from evaluation.studies.answers.tune import BOX, Tuning
from evaluation.studies.answers.tuned import TUNED, read_tuned


def test_all_have_the_same_number_of_trials_within_the_box() -> None:
    study = Tuning(trials=5)
    names = [rival.name for rival, *_ in study.tried]
    assert len(set(map(names.count, names))) == 1
    for _, _, number, settings, arm in study.tried:
        assert (number == 0) == (settings == ())
        for key, value in settings:
            low, high = BOX.get(key, (float("-inf"), float("inf")))
            assert low <= float(value) <= high
        arm.check()


def test_the_best_by_the_objective_is_chosen_and_read_again(make, tmp_path: Path) -> None:
    study = Tuning(Sample("train"), trials=4, rules=("paper",))
    best = {arm for rival, _, k, _, arm in study.tried if k == (2 if rival.name == "map" else 0)}
    answer = study.answer(make(study.arms, 20, lambda arm: (0.9, 0.1) if arm in best else (0.8, 0.1)))
    path = tmp_path / TUNED
    path.write_bytes(answer.files[TUNED])
    chosen = {(name, rule): settings for name, rule, settings in read_tuned(path, Sample())}
    tried = {(rival.name, k): settings for rival, _, k, settings, _ in study.tried}
    assert dict(chosen["map", "paper"]) == dict(tried["map", 2])
    assert chosen["path", "paper"] == ()
    assert len(answer.files["tune.csv"].decode().splitlines()) == 1 + len(study.arms)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "{}",
        "[]",
        '{"chosen": []}',
        *(
            '{"sample": {"split": "train", "seed": 0}, "chosen": [' + lines + "]}"
            for lines in (
                '{"rival": "map", "rule": "paper", "settings": {"x": 1}}',
                '{"rival": "map", "rule": "paper", "settings": {"margin_m": true}}',
                '{"rival": "map", "rule": "paper", "settings": {"margin_m": [1]}}',
                '{"rival": "map", "rule": "paper", "settings": {"margin_m": 1' + "0" * 400 + "}}",
                ", ".join(['{"rival": "map", "rule": "paper", "settings": {}}'] * 2),
            )
        ),
    ],
)
def test_another_file_is_refused(content: str, tmp_path: Path) -> None:
    path = tmp_path / TUNED
    path.write_text(content)
    with pytest.raises(ArgumentError, match=r"is not a tuned\.json"):
        read_tuned(path, Sample())


def test_settings_are_not_shown_on_the_scenes_that_they_were_chosen_on(make, tmp_path: Path) -> None:
    """Scenes follow from split, seed and number: fewer of them are a part of them."""
    study = Tuning(Sample("train", 20, 3), trials=2)
    answer = study.answer(make(study.arms, 4, lambda arm: (0.5, 0.5)))
    path = tmp_path / TUNED
    path.write_bytes(answer.files[TUNED])
    assert len(read_tuned(path, Sample("test", 20, 3))) == len(read_tuned(path, Sample("train", 20, 4))) == 3
    with pytest.raises(ArgumentError, match="these very scenes"):
        read_tuned(path, Sample("train", 10, 3))
