"""Operating curves of the brake rules from made-up runs."""

from __future__ import annotations

import pytest

from evaluation.studies.answers.trigger import SENSITIVITIES, Trigger
from scenarios.presets import named_preset
from scenarios.settings import PARAMETERS, TRIGGERS, Settings, preset_with


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


def test_published_rules_are_tested_against_the_first(make) -> None:
    """Scenes that only one side avoids: 10 of 50, so p = 2 / 2^10, twice corrected for two questions."""
    study = Trigger(rules=("paper", "rss"))
    ((rss, paper),) = study.pairs
    assert (rss.rule, paper.rule, study.questions) == ("rss", "paper", 2)
    assert dict(rss.settings)["rss_response_s"] == study.usual("rss")
    answer = study.answer(make(study.arms, 50, lambda arm: (0.8 if arm.rule == "rss" else 0.6, 0.2)))
    line = answer.files["differences.csv"].decode().splitlines()[1].split(",")
    assert float(line[-2]) == 2 / 2**10
    assert float(line[-1]) == 4 / 2**10
    assert "Each as its source has it, against paper" in answer.tables
    assert not Trigger(rules=("paper",)).pairs


def test_the_answer_names_the_best_rule_first_with_its_best_value(make) -> None:
    study = Trigger(rules=("paper", "rss"))
    best = study.curve("rss")[-1][1]
    results = make(study.arms, 50, lambda arm: (0.9, 0.1) if arm == best else (0.8, 0.2))
    answer = study.answer(results)
    assert answer.sentences[0].startswith("rss: as its source has it, 80.0 [")
    assert f"{study.curve('rss')[-1][0]:g}" in answer.sentences[0]
    assert answer.sentences[1].startswith("paper: ")


def test_what_was_chosen_on_other_scenes_is_a_point_of_its_own(make) -> None:
    chosen = (("path", "rss", (("rss_response_s", 0.3), ("corridor_m", 2.0))),)
    study = Trigger(rules=("paper", "rss"), tuned=chosen)
    (tuned,) = (arm for arm in study.arms if arm.name == "rss, tuned")
    assert dict(tuned.settings)["corridor_m"] == 2.0
    answer = study.answer(make(study.arms, 50, lambda arm: (0.7, 0.3) if arm == tuned else (0.8, 0.2)))
    told = next(line for line in answer.sentences if line.startswith("rss: "))
    assert "80.0 [" in told.partition("; tuned on other scenes (rss_response_s=0.3, corridor_m=2")[0]
    assert "70.0 [" in told.partition("; tuned on other scenes")[2]


@pytest.mark.parametrize(
    "settings", [(), (("rss_response_s", 1.0),)], ids=["nothing", "the value of the source"]
)
def test_a_rule_for_which_nothing_better_was_found_is_run_once(settings: Settings, make) -> None:
    study, plain = Trigger(rules=("rss",), tuned=(("path", "rss", settings),)), Trigger(rules=("rss",))
    assert plain.usual("rss") == 1.0
    assert study.arms == plain.arms
    usual = next(arm for value, arm in study.curve("rss") if value == 1.0)
    answer = study.answer(make(study.arms, 50, lambda arm: (0.8, 0.2) if arm == usual else (0.6, 0.3)))
    (told,) = answer.sentences
    assert told.endswith("; tuned on other scenes, nothing better was found.")
    row = answer.tables["Every rule and value"].rows[-1]
    assert row[:3] == ("rss", "tuned", "nothing better was found")
    assert row[3].startswith("80.0 [")
