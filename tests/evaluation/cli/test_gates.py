"""Tests for `--fail-on` of every command that scores: status 3 and a line where a rule is met, else 0."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from xml.etree import ElementTree

import pytest

from tests.evaluation.cli.test_command import Command, command  # noqa: F401

DATA = Path(__file__).parents[2] / "data"
SCORED = DATA / "lidar" / "nuscenes_small"
CASES = {
    "cpna": (["cpna", "--speeds", "60", "--no-pictures"], "contacts>0", "map/contacts>0"),
    "run": (
        ["run", "cpna_paper", "--param", "Ego_speed_kmh=60", "--no-pictures", "--no-aeb"],
        "contacts>0",
        "contacts>1",
    ),
    "ncap": (
        ["ncap", "--protocol", "paper", "--strategy", "map"],
        "map/score_percent<=100",
        "cells_invalid>0",
    ),
    "compare": (
        [
            "compare",
            "--scenes",
            "people on the sidewalk",
            "--strategies",
            "path",
            "--seeds",
            "1",
            "--format",
            "svg",
        ],
        "path/needless_stops>=0",
        "false_activations>1",
    ),
    "drive": (
        ["drive", DATA / "simbev", "--strategy", "path", "--no-page"],
        "requests>=0",
        "false_per_km>1e9",
    ),
    "mot": (["mot", DATA / "simbev", "--no-forecast"], "hota<=100", "car/labels<1"),
    "lidar": (
        ["lidar", "score", SCORED / "labels", SCORED / "results", "--protocol", "thesis"],
        "Car/f1<=1",
        "precision<0",
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_a_command_fails_where_a_rule_is_met(name: str, command: Command) -> None:  # noqa: F811
    if name == "mot" and importlib.util.find_spec("trackeval") is None:
        pytest.skip("trackeval is not installed (extra mot)")
    arguments, met, unmet = CASES[name]
    answer = command(*arguments, "--out", "out", "--fail-on", f"{met},{unmet}", "--junit", "j.xml", "-q")
    lines = answer.err.splitlines()
    assert answer.status == 3, lines
    assert all(line.startswith("smartmot-eval: failed: ") for line in lines)
    root = ElementTree.parse("j.xml").getroot()
    assert root.get("failures") == str(len(lines))
    assert {case.get("name") for case in root.iter("testcase")} == {met, unmet}
    assert {case.get("name") for case in root.iter("testcase") if len(case)} == {met}
    assert command(*arguments, "--out", "out", "--fail-on", unmet, "-q").status == 0


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--junit", "j.xml"], "--junit: writes the verdicts of --fail-on; add it"),
        (["--fail-on", "contact>0"], "no measure 'contact'; use: contacts"),
        (["--fail-on", "contacts"], "'contacts' is no rule"),
        (["--fail-on", "contacts>0", "--junit", "."], "cannot be read or written"),
    ],
)
def test_a_gate_that_cannot_be_closed_is_refused_before_anything_is_run(
    options: list[str],
    said: str,
    command: Command,  # noqa: F811
) -> None:
    answer = command("cpna", "--speeds", "10..200:1", "--out", "out", *options)
    assert (answer.status, len(answer.err.splitlines())) == (2, 1)
    assert said in answer.err
    assert not Path("out").exists()


def test_a_check_takes_no_gate(command: Command) -> None:  # noqa: F811
    answer = command("run", "cpna_paper", "--check", "--fail-on", "contacts>0")
    assert (answer.status, answer.err.splitlines()[0][:25]) == (2, "smartmot-eval: --fail-on:")


def test_every_command_that_scores_has_a_gate() -> None:
    """A command that scores writes results and judges: those named here show or write."""
    import typer

    from evaluation.cli.entry import app

    without = {
        "list", "plot", "report", "replay", "map", "export", "reference", "scenes", "rows",
        "lidar bench", "lidar convert", "lidar train", "lidar export",
        "lidar dataset make", "lidar dataset show", "lidar dataset check",
    }  # fmt: skip

    def commands(group: object, path: tuple[str, ...] = ()) -> dict[str, set[str]]:
        options: dict[str, set[str]] = {}
        for name, member in getattr(group, "commands", {}).items():
            own = (*path, name)
            if hasattr(member, "commands"):
                options |= commands(member, own)
            else:
                options[" ".join(own)] = {word for each in member.params for word in each.opts}
        return options

    known = commands(typer.main.get_command(app))
    gated = {name for name, words in known.items() if {"--fail-on", "--junit"} <= words}
    assert set(known) - gated == without
    docs = (Path(__file__).parents[3] / "docs" / "gates.md").read_text(encoding="utf-8")
    rows = "".join(line for line in docs.splitlines() if line.startswith("| `"))
    assert [name for name in gated if f"`{name}`" not in rows] == []
