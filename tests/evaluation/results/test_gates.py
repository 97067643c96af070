"""Tests for rules that say when results fail."""

from __future__ import annotations

import math
import operator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.errors import ArgumentError
from evaluation.results.gates import (
    RUN_MEASURES,
    Side,
    judge,
    measures_of_table,
    parse_rules,
    sides_of_runs,
    sides_of_table,
    write_junit,
)
from evaluation.results.tables import EMPTY, Table
from scenarios.openscenario.running.driving.criteria import Criterion
from tests.evaluation.results.conftest import HIT, STOPPED

NUMBERS = st.floats(-1e6, 1e6, allow_nan=False)
COMPARISONS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}


@given(NUMBERS, NUMBERS, st.sampled_from(list(COMPARISONS)))
def test_a_rule_is_broken_exactly_where_its_comparison_holds(value: float, limit: float, sign: str) -> None:
    (rule,) = parse_rules(f"contacts{sign}{limit!r}", ["contacts"])
    assert (rule.limit, rule.is_broken(value)) == (limit, COMPARISONS[sign](value, limit))


@pytest.mark.parametrize("value", [None, math.nan])
@pytest.mark.parametrize("sign", list(COMPARISONS))
def test_a_value_that_is_not_there_fails(value: float | None, sign: str) -> None:
    (rule,) = parse_rules(f"score{sign}9", ["score"])
    assert rule.is_broken(value)


def test_rules_may_be_for_a_side() -> None:
    rules = parse_rules(" map/contacts > 0, my.area:Corridor/score<=9 , contacts>0,contacts>0", RUN_MEASURES)
    assert [(rule.side, rule.measure, rule.sign, rule.limit) for rule in rules] == [
        ("map", "contacts", ">", 0.0),
        ("my.area:Corridor", "score", "<=", 9.0),
        (None, "contacts", ">", 0.0),
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("contacts", "'contacts' is no rule"),
        ("contacts=0", "is no rule"),
        ("contacts>", "is no rule"),
        ("contacts>many", "is no rule"),
        ("contacts>inf", "is no rule"),
        ("contacts>nan", "is no rule"),
        ("contact>0", "no measure 'contact'; use: contacts, avoided"),
        (" , ", "nothing given"),
    ],
)
def test_what_is_no_rule_is_refused(text: str, said: str) -> None:
    with pytest.raises(ArgumentError, match=f"^--fail-on: .*{said}"):
        parse_rules(text, RUN_MEASURES)


def test_a_rule_for_nobody_is_refused() -> None:
    rules = parse_rules("pedestrian/hota<60", ["hota"])
    with pytest.raises(ArgumentError, match=r"there are: car$"):
        judge(rules, [Side("car", {"hota": 90.0})])
    with pytest.raises(ArgumentError, match=r"there are: none$"):
        judge(parse_rules("hota<60", ["hota"]), [])


def test_a_side_of_that_name_alone_is_judged() -> None:
    sides = [Side("car", {"hota": 50.0}, "iou"), Side("pedestrian", {"hota": 50.0}, "iou")]
    verdicts = judge(parse_rules("car/hota<60", ["hota"]), sides)
    assert [(verdict.side.name, verdict.broken) for verdict in verdicts] == [("car", True)]
    assert verdicts[0].line == "car, iou: hota 50, fails if < 60"


def test_runs_are_counted_by_strategy() -> None:
    cut = replace(STOPPED, end_reason="time_limit", v_impact_kmh=None, score=None)
    early = replace(STOPPED, false_activation=True, score=0.0)
    met, failed, unknown = (Criterion("arrives", met, "") for met in (True, False, None))
    judged = [(HIT, []), (STOPPED, [met, failed]), (cut, [unknown]), (early, [])]
    rectangular, of_map = sides_of_runs(judged)
    assert (rectangular.name, of_map.name) == ("rectangular", "map")
    assert set(rectangular.values) == set(of_map.values) == set(RUN_MEASURES)
    assert (rectangular.values["contacts"], rectangular.values["impact_speed_kmh"]) == (1.0, 23.0)
    assert rectangular.runs["contacts"] == ["cpna at 50 km/h, clear (23.0 km/h)"]
    expected = {"runs": 3, "contacts": 0, "avoided": 1, "false_activations": 1, "cut_off": 1}
    expected |= {"criteria_failed": 1, "criteria_unknown": 1, "impact_speed_kmh": 0}
    assert {name: of_map.values[name] for name in expected} == expected
    # the run that was cut off can win no points; the early one could have won two
    assert (of_map.values["score"], of_map.values["score_percent"]) == (2.0, 50.0)


def test_runs_without_points_have_no_score() -> None:
    (side,) = sides_of_runs([(replace(STOPPED, score=None, score_max=None), [])])
    assert side.values["score"] is side.values["score_percent"] is None


def test_a_table_gives_sides() -> None:
    table = Table(("class", "view", "R40 easy", "AOE (rad)"), (("Car", "3D", "91.25", EMPTY),))
    assert measures_of_table(table) == ("class", "view", "r40_easy", "aoe_rad")
    (side,) = sides_of_table(table, texts=2)
    assert (side.name, side.detail) == ("Car", "3D")
    assert side.values == {"r40_easy": 91.25, "aoe_rad": None}


def test_junit_has_a_suite_per_side_and_a_case_per_rule(tmp_path: Path) -> None:
    sides = sides_of_runs([(HIT, []), (replace(STOPPED, scenario="<a> & \x00"), [])])
    verdicts = judge(parse_rules("contacts>0,score<1", RUN_MEASURES), sides)
    file = tmp_path / "new" / "junit.xml"
    write_junit(file, "cpna", verdicts)
    root = ElementTree.parse(file).getroot()
    assert (root.tag, root.get("tests"), root.get("failures")) == ("testsuites", "4", "2")
    suites = {suite.get("name"): suite for suite in root}
    assert {name: suite.get("failures") for name, suite in suites.items()} == {"rectangular": "2", "map": "0"}
    cases = {case.get("name"): case.find("failure") for case in suites["rectangular"]}
    failure = cases["contacts>0"]
    assert failure is not None
    assert failure.text == "cpna at 50 km/h, clear (23.0 km/h)"
    assert [case.find("failure") for case in suites["map"]] == [None, None]
    before = file.read_bytes()
    write_junit(file, "cpna", verdicts)
    assert file.read_bytes() == before


def test_junit_holds_no_character_that_xml_forbids(tmp_path: Path) -> None:
    hit = replace(HIT, scenario="a\x00b\x1b<&>")
    write_junit(
        tmp_path / "j.xml", "run", judge(parse_rules("contacts>0", RUN_MEASURES), sides_of_runs([(hit, [])]))
    )
    (failure,) = ElementTree.parse(tmp_path / "j.xml").getroot().iter("failure")
    assert str(failure.text).startswith("a\N{REPLACEMENT CHARACTER}b\N{REPLACEMENT CHARACTER}<&> at 50 km/h")
