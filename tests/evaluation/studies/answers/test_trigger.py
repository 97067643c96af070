"""Operating curves of the brake rules from made-up runs."""

from __future__ import annotations

from evaluation.studies.answers.trigger import SENSITIVITIES, Trigger
from scenarios.presets import named_preset
from scenarios.settings import PARAMETERS, TRIGGERS, preset_with


def test_every_rule_has_values_around_that_of_its_source() -> None:
    study = Trigger()
    for rule in study.rules:
        values = [value for value, _ in study.curve(rule)]
        assert values == sorted(values)
        assert study.usual(rule) in values
        for value, arm in study.curve(rule):
            key = TRIGGERS[rule]
            assert PARAMETERS[key].of(preset_with(named_preset("physical"), arm.settings)) == value
    assert set(SENSITIVITIES) == set(TRIGGERS.values())


def test_the_answer_names_the_best_rule_first_with_its_best_value(make) -> None:
    study = Trigger(rules=("paper", "rss"))
    best = study.curve("rss")[-1][1]
    results = make(study.arms, 50, lambda arm: (0.9, 0.1) if arm == best else (0.8, 0.2))
    answer = study.answer(results)
    assert answer.sentences[0].startswith("rss: as its source has it, 80.0 [")
    assert f"{study.curve('rss')[-1][0]:g}" in answer.sentences[0]
    assert answer.sentences[1].startswith("paper: ")
