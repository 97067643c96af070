"""Presets from the plain values that JSON holds: which brake rule, with which parameters."""

import json
from dataclasses import asdict, replace

import pytest

from evaluation.runs.decoding import decode
from evaluation.runs.fingerprint import fingerprint
from scenarios.presets import PHYSICAL, Preset
from scenarios.settings import TRIGGERS, preset_with
from scenarios.spec import RunSpec
from smartmot.decision.shipped import RULES


@pytest.mark.parametrize("rule", RULES)
def test_a_stored_rule_is_read_back(rule: str) -> None:
    preset = preset_with(PHYSICAL, (("rule", rule), (TRIGGERS[rule], 0.7)))
    values = json.loads(json.dumps(asdict(preset)))
    assert decode(Preset, values, "preset") == preset


def test_every_rule_and_every_trigger_makes_another_run() -> None:
    spec = RunSpec("CPNA", "crossing", (), "map", "physical", "dry", 50.0)
    settings = [(("rule", rule),) for rule in RULES]
    settings += [(("rule", rule), (TRIGGERS[rule], 0.7)) for rule in RULES]
    prints = [fingerprint(replace(spec, settings=setting)) for setting in settings]
    assert len(set(prints)) == len(prints)
    assert prints[0] == fingerprint(spec)
