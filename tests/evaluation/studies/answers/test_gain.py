"""The gain of a lane filter: pairs, words and files from made-up runs."""

from __future__ import annotations

import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.rivals import RIVALS
from scenarios.settings import Setting, Settings

RATES = {"path": (0.9, 0.2), "map": (0.9, 0.05), "all, as published": (0.9, 0.2)}


def test_every_rival_is_compared_with_the_planned_path_of_its_preset_and_rule() -> None:
    study = Gain(presets=("physical", "paper"), own=("mine:Area",))
    assert len(study.arms) == 2 * (len(RIVALS) + 1)
    assert study.questions == 2 * len(study.pairs) == 2 * 2 * len(RIVALS)
    for arm, against in study.pairs:
        assert against.name == "path"
        assert (arm.preset, arm.rule) == (against.preset, against.rule)


def test_tuned_settings_stand_beside_the_published_and_meet_the_tuned_path() -> None:
    study = Gain(tuned=(("map", "paper", (("margin_m", 3.0),)), ("path", "paper", (("corridor_m", 2.0),))))
    pairs = {arm.name: (arm, against) for arm, against in study.pairs}
    arm, against = pairs["map, tuned"]
    assert dict(arm.settings)["margin_m"] == 3.0
    assert against.name == "path, tuned"
    assert pairs["map"][1].name == pairs["path, tuned"][1].name == "path"


def test_settings_that_a_rival_has_anyway_are_no_rival_of_their_own(make) -> None:
    """Chosen were: nothing for the path, for the rectangle the preset's own half width."""
    chosen = (
        ("path", "paper", ()),
        ("rectangle", "paper", (("half_width_m", 2.6),)),
        ("map", "paper", (("margin_m", 3.0),)),
    )
    study, plain = Gain(tuned=chosen, formats=()), Gain()
    assert study.questions == plain.questions + 2
    assert {arm.name for arm in study.arms} - {arm.name for arm in plain.arms} == {"map, tuned"}
    assert {arm.name: against.name for arm, against in study.pairs}["map, tuned"] == "path"
    tables = study.answer(make(study.arms, 20, lambda arm: (0.5, 0.5))).tables
    told = tables["Against the planned path: preset physical, rule paper"].caption
    assert "path, tuned, rectangle, tuned: nothing better was found" in told
    assert [
        row[-1] for row in tables["Who is who"].rows if row[0] in ("path, tuned", "rectangle, tuned")
    ] == [
        "as path: nothing better was found",
        "as rectangle: nothing better was found",
    ]


def test_the_answer_says_what_the_runs_say(make) -> None:
    study = Gain(formats=())
    results = make(study.arms, 60, lambda arm: RATES.get(arm.name, (0.5, 0.4)))
    answer = study.answer(results)
    first = answer.sentences[0]
    assert first.startswith("Preset physical, rule paper: map against path: collisions avoided 0.0 [")
    assert "unnecessary stops -15.0 [" in first
    assert "decided is the difference in unnecessary stops" in first
    assert "Avoided less stopped: +15.0 [" in first
    everything = next(line for line in answer.sentences if "all, as published against path" in line)
    assert "neither is decided" in everything
    page = answer.markdown().decode()
    assert (
        page.index(first)
        < page.index("![gain_physical_paper](gain_physical_paper.png)")
        < page.index("| map |")
    )
    rows = answer.files["gain.csv"].decode().splitlines()
    assert len(rows) == 1 + study.questions
    assert "physical,paper,map," in rows[1]
    assert ",0.0," in rows[1]


def test_what_is_the_papers_as_published_has_the_papers_rule() -> None:
    names = {rule: {arm.name for arm in Gain(rules=("paper", "rss")).arms if arm.rule == rule}
             for rule in ("paper", "rss")}  # fmt: skip
    assert names["paper"] - names["rss"] == {rival.name for rival in RIVALS if rival.is_as_published}
    assert {"path", "map", "rectangle", "rectangle, wide"} == names["rss"]


def test_the_price_of_fewer_stops_is_said(make) -> None:
    """2 points of collisions for 1 point of stops: it pays from a weight of 2 on."""
    study = Gain(formats=())
    rates = {"path": (0.9, 0.2), "map": (0.8, 0.15)}
    lines = study.answer(make(study.arms, 60, lambda arm: rates.get(arm.name, (0.5, 0.4)))).sentences
    assert "pays if a stop in a nothing scene weighs more than 2.0 collisions" in lines[0]
    assert sum("pays if" in line for line in lines) == 1


@pytest.mark.parametrize(
    "tuned",
    [(("mapp", "paper", ()),), (("map", "rss", ()),)],
    ids=["a strategy that is not run", "a rule that is not run"],
)
def test_settings_that_nobody_takes_are_refused(tuned: tuple[tuple[str, str, Settings], ...]) -> None:
    with pytest.raises(ArgumentError, match="--tuned"):
        Gain(tuned=tuned)


@pytest.mark.parametrize(
    "settings", [{"margin_m": "wide"}, {"way": "left"}, {"way": 1.0}, {"margin_m": -1.0}]
)
def test_settings_that_cannot_be_are_refused_before_the_first_run(settings: dict[str, Setting]) -> None:
    study = Gain(tuned=(("map", "paper", tuple(settings.items())),))
    with pytest.raises(ArgumentError, match=next(iter(settings)).removesuffix("_m")):
        study.items_of(())


def test_an_area_that_is_to_beat_all_meets_every_fair_rival_and_every_margin() -> None:
    tuned = (("adaptive", "paper", (("probability", 0.5),)), ("map", "paper", (("margin_m", 3.0),)))
    study = Gain(own=("adaptive",), tuned=tuned, against="adaptive", varied=(("margin_m", (0.0, 4.5)),))
    assert {against.name for _, against in study.pairs} == {"adaptive, tuned"}
    assert [arm.name for arm, _ in study.pairs] == [
        "path",
        "map",
        "map, tuned",
        "rectangle",
        "rectangle, wide",
        "map, margin_m=0",
        "map, margin_m=4.5",
    ]
    margins = [dict(arm.settings)["margin_m"] for arm, _ in study.pairs if "margin_m=" in arm.name]
    assert margins == [0.0, 4.5]


@pytest.mark.parametrize(
    ("path_rates", "standing"),
    [
        ((0.5, 0.2), "better than: path"),  # fewer collisions avoided, as many stops
        ((0.9, 0.8), "better than: path"),
        ((0.5, 0.0), "better in the one and worse in the other than: path"),
        ((0.9, 0.0), "worse than: path"),
        ((0.9, 0.25), "not decidedly different from: path"),
    ],
)
def test_standing_follows_from_decided_differences_alone(make, path_rates, standing: str) -> None:
    study = Gain(own=("adaptive",), against="adaptive", formats=())
    rates = {"path": path_rates}
    results = make(study.arms, 60, lambda arm: rates.get(arm.name, (0.9, 0.2)))
    first = study.answer(results).sentences[0]
    assert first.startswith("Preset physical, rule paper: adaptive is ")
    assert standing in first
    best = "path" if path_rates[0] - path_rates[1] > 0.7 else "map"
    assert f"less stopped is {best}, " in first


def test_what_is_compared_with_must_be_run_and_parameters_must_change_something() -> None:
    with pytest.raises(ArgumentError, match="--against: adaptive is not run; there are: path, map"):
        Gain(against="adaptive")
    with pytest.raises(ArgumentError, match="--vary probability: changes none of the areas"):
        Gain(varied=(("probability", (0.5,)),))


def test_a_varied_value_that_a_rival_has_anyway_is_no_rival_of_its_own() -> None:
    """The preset's margin is the paper's 1.8 m; a margin given twice is one."""
    plain, study = Gain(), Gain(varied=(("margin_m", (1.8, 3.0, 3.0)),))
    assert [arm.name for arm in study.arms if arm not in plain.arms] == ["map, margin_m=3"]
    assert study.questions == plain.questions + 2
