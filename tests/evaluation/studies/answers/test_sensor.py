"""Errors of a sensor: which arms there are, and which error is said to cost most."""

from __future__ import annotations

from dataclasses import replace

from evaluation.studies.answers.sensor import ERRORS, SensorErrors
from scenarios.presets import named_preset
from scenarios.sensors.variation import ERROR_NUMBERS
from scenarios.settings import PARAMETERS, preset_with

STUDY = SensorErrors(errors=("misses", "latency", "range"))


def test_an_error_that_is_left_out_has_the_value_of_the_ideal_sensor() -> None:
    settings = dict(STUDY.having(["latency"]).settings)
    ideal = named_preset("physical")
    for key in (*ERRORS["misses"], *ERRORS["range"]):
        assert settings[key] == PARAMETERS[key].of(ideal)
    assert "latency_s" not in settings
    assert len(STUDY.arms) == 2 + 2 * 3
    for arm in SensorErrors().arms:
        arm.check()


def test_without_any_error_the_sensor_is_the_ideal_one_but_for_what_it_may_see_at_all() -> None:
    study = SensorErrors()
    ideal, without = (
        preset_with(named_preset(name), arm.settings)
        for name, arm in (("physical", study.rival.arm("physical", "paper")), ("real", study.having([])))
    )
    numbers = {name: number.of(ideal.sensor) for name, number in ERROR_NUMBERS.items()}
    assert {name: number.of(without.sensor) for name, number in ERROR_NUMBERS.items()} == numbers
    plain = replace(without.sensor, errors=None, min_visible=ideal.sensor.min_visible)
    assert replace(without, name=ideal.name, sensor=plain) == ideal


def test_the_error_that_costs_most_is_named(make) -> None:
    costs = {"misses": 0.2, "latency": 0.1, "range": 0.0}

    def rates(arm) -> tuple[float, float]:
        absent = [e for e in costs if set(ERRORS[e]) <= set(dict(arm.settings))]
        return 0.9 - sum(cost for error, cost in costs.items() if error not in absent), 0.1

    answer = STUDY.answer(make(STUDY.arms, 50, rates))
    assert "benefit -30.0 [" in answer.sentences[0]
    assert answer.sentences[1].startswith("Alone, misses cost most: collisions avoided -20.0 [")
    assert answer.sentences[2].startswith("Among all others, misses cost most")
    # misses: 10 of 50, p = 2 / 2^10 in two of twelve questions; latency: 5, p = 2 / 2^5
    assert answer.sentences[-1] == (
        "Decided, corrected for 12 questions: misses alone against no error, collisions avoided; "
        "all errors against all but misses, collisions avoided."
    )
    assert answer.files["sensor.csv"].decode().splitlines()[1].startswith("misses,-0.2")
