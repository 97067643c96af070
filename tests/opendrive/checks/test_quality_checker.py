"""ASAM's own test maps for its OpenDRIVE checker: rule and verdict stand in their names."""

import re
from pathlib import Path

import pytest

from opendrive import MapReadError, load_map

FOLDER = Path(__file__).parents[3].parent / "shared" / "opendrive" / "qc"
VERDICTS = re.compile(r"invalid|negative|issue|valid|positive|skipped")

RULES = {
    "junction_connection_linkage": ("startalonglinkage", "endoppositelinkage"),
    "smoothness_example": ("lanesmoothnesscontactpointnohorizontalgaps",),
}
"""Rules of folders that are not named after one."""

OTHERS = {
    "lane_gap_example_issue_119": "valid",  # the issue was that a gap was reported
    "performance_avoid_redundant_info_superelevation_invalid": "refused",  # it is rolled by 16 rad
    "unsupported_schema": "valid",
    "road_lane_level_true_one_side_invalid_older_schema_version": "valid",  # the rule is of 1.7
    "road_lane_access_no_mix_of_deny_or_allow_17_invalid_older_schema_version": "valid",
    "multiple_successor_valid": "valid",
}


def cases():
    for file in sorted(FOLDER.rglob("*.xodr")):
        if file.parent.name in ("utils", "examples"):
            continue
        verdict = OTHERS.get(file.stem) or (VERDICTS.findall(file.stem) or ["invalid"])[-1]
        known = {"negative": "invalid", "issue": "invalid", "positive": "valid", "skipped": "valid"}
        yield pytest.param(file, known.get(verdict, verdict), id=file.stem)


def plain(name):
    return re.sub(r"[^a-z]", "", name.lower())


@pytest.mark.parametrize(
    ("file", "verdict"),
    list(cases()) or [pytest.param(None, "", marks=pytest.mark.skip("ASAM's test maps are absent"))],
)
def test_our_verdict_is_the_expected_one(file, verdict):
    wanted = RULES.get(file.parent.name, (plain(file.parent.name),))
    try:
        rules = {finding.rule for finding in load_map(file).findings}
    except MapReadError as error:
        rules = {error.rule}
        if verdict == "refused":
            return
    names = {plain(rule.split(":")[-1]) for rule in rules if rule}
    broken = any(
        name.startswith(w) or w.startswith(name) or name.endswith(w) for name in names for w in wanted
    )
    assert broken == (verdict == "invalid"), names
