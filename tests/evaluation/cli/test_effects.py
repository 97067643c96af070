"""Options that have no effect in a call are refused, and those that are not refused have one."""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_type_hints

import pytest
import typer.main

from evaluation.cli import app
from evaluation.cli.call.effects import Effects, For, With, Without
from evaluation.errors import ArgumentError

GROUP = typer.main.get_command(app)
VALUES = {
    "question": ("gain", "break-even", "sensor", "trigger", "severity", "tune", "lidar", "worst"),
    "source": ("scenes", "crops"),
    "form": ("simbev", "nuscenes", "kitti", "openscenario"),
    "protocol": ("2023", "2026", "ancap", "paper", "r152", "fmvss127"),
}
"""Of parameters on which effects of others hang; of `lidar score` below."""
OF_SCORE = ("kitti", "thesis", "nuscenes")


def leaves(group: Any, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """All commands with the words that call them."""
    for name, command in group.commands.items():
        if hasattr(command, "commands"):
            yield from leaves(command, (*words, name))
        else:
            yield (*words, name), command


COMMANDS = dict(leaves(GROUP))


def effects_of(words: tuple[str, ...]) -> Effects:
    """The rules of a command."""
    function = inspect.unwrap(COMMANDS[words].callback)
    module = sys.modules[function.__module__]
    own = "EXPORT_EFFECTS" if words == ("lidar", "export") else "EFFECTS"
    rules: Effects = getattr(module, own, ())
    return rules


def typed(command: Any, parameter: str, value: str | None = None) -> list[str]:
    """A parameter as it is typed, with a value that its type allows."""
    (declared,) = (param for param in command.params if param.name == parameter)
    if declared.param_type_name == "argument":
        return [value or "crossing"]
    if declared.is_flag:
        on = declared.default is True
        return [(declared.secondary_opts if on else declared.opts)[0]]
    option = max(declared.opts, key=len)
    if declared.nargs == 2:
        return [option, "obj", "x.obj"]
    if value is None:
        kind = str(get_type_hints(inspect.unwrap(command.callback))[parameter])
        value = "11" if "int" in kind else "0.5" if "float" in kind else "x"
    return [option, value]


def required(command: Any, given: list[str]) -> list[str]:
    """What a call needs beside."""
    words = []
    for param in command.params:
        names = {*param.opts}
        if not param.required or names & set(given):
            continue
        if param.param_type_name == "argument":
            words.append("gain" if param.name == "question" else "crossing")
        elif param.name == "form":
            words += ["--format", "simbev"]
        else:
            words += typed(command, param.name)
    return words


def calls() -> Iterator[Any]:
    """Every option in every case in which it has no effect."""
    for words, command in COMMANDS.items():
        for rule in effects_of(words):
            for option in rule.options:
                for given in cases(words, command, rule, option):
                    call = [*words, *required(command, given), *given]
                    if isinstance(rule, For) and rule.of == "question":
                        call = [*words, *given]
                    yield pytest.param(call, command, option, id=" ".join(call))


def cases(words: tuple[str, ...], command: Any, rule: For | With | Without, option: str) -> list[list[str]]:
    own = typed(command, option)
    if isinstance(rule, For):
        values = OF_SCORE if words == ("lidar", "score") else VALUES[rule.of]
        assert set(rule.values) < set(values)
        return [[*typed(command, rule.of, value), *own] for value in values if value not in rule.values]
    if isinstance(rule, With):
        return [own]
    return [[*typed(command, rule.other), *own]]


class AskedError(Exception):
    """What a command asked for."""


def refusal(call: list[str]) -> str:
    """What a call is refused with; empty if it is not."""
    try:
        GROUP.main(call, standalone_mode=False)
    except ArgumentError as error:
        return str(error)
    except AskedError:
        return ""
    raise AssertionError("carried out")


@pytest.mark.parametrize(("call", "command", "option"), list(calls()))
def test_an_option_without_an_effect_is_refused(
    call: list[str],
    command: Any,
    option: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    error = refusal(call)
    (declared,) = (param for param in command.params if param.name == option)
    names = (*declared.opts, *declared.secondary_opts, str(declared.metavar).strip("[]"))
    assert ": has no effect with" in error
    assert "\n" not in error
    # without what it goes with, what that goes with is named first
    assert "without" in error or any(error.startswith(f"{name}: ") for name in names)
    assert not list(tmp_path.iterdir())


# ---- options that are not refused --------------------------------------------------------------------------

PASSED = {"out", "workers", "scheduler", "quiet", "junit", "fail_on", "logs"}
"""What changes nothing that is asked: where, who works, what is said, judged, and kept beside."""
SAMPLES = {
    "preset": "paper", "rule": "rss", "strategies": "adaptive", "path_from": "map", "sensor": "hdl32",
    "split": "train", "form": "pdf", "vary": "margin_m=1", "weather": "rain", "scenes": "walking along",
    "maps": ".", "family": "pedestrian crosses", "samples": "50", "tuned": "tuned.json", "sees": "labels",
    "ego": "4,2", "columns": "x_m=x", "frame_rate": "5", "sequence": "1", "map_file": "x.xodr",
    "source": "crops", "layout": "nuscenes", "height": "2", "crops": ".", "background": ".",
    "scenario": "crossing", "perception": "cutout", "street": "furnished", "street_density": "0.5",
    "street_seed": "7", "weights": "1,2,3",
}  # fmt: skip
NEEDS = {
    "perception": ["--sensor", "hdl32"], "street": ["--sensor", "hdl32"],
    "street_density": ["--sensor", "hdl32", "--street", "furnished"],
    "street_seed": ["--sensor", "hdl32", "--street", "furnished"],
    "maps": ["--full"],
}  # fmt: skip
OWN = {
    ("study", "against"): "map",
    ("tune", "split"): "test", ("trigger", "strategies"): "map", ("study", "sensor"): "hdl64",
    ("study", "maps"): ".", ("compare", "maps"): ".", ("margin_m=2", "vary"): "reach_m=20",
    ("lidar", "sensor"): "mid70", ("lidar", "maps"): "x.xodr",
    ("crops", "sensor"): "mid70", ("crops", "maps"): "x.xodr",
}  # fmt: skip
"""Where a command or question has other values."""


PLACES = (
    "evaluation.studies.answers.command.ask", "evaluation.studies.worst.search.ask",
    "evaluation.studies.compare.command.compare", "evaluation.studies.growth.compare_growth",
    "evaluation.studies.drive.side_by_side.command.compare_drives",
    "evaluation.studies.datasets.make.make_dataset",
)  # fmt: skip


@pytest.fixture(scope="module")
def _caught() -> Iterator[None]:
    """Commands hand over what they were asked for, and carry nothing out."""

    def catch(*arguments: object, **named: object) -> None:
        kept = [value for value in arguments if not isinstance(value, Path)]
        raise AskedError(repr((kept, {name: value for name, value in named.items() if name != "out"})))

    with pytest.MonkeyPatch.context() as patch:
        for place in PLACES:
            patch.setattr(place, catch)
        tuned = (("map", "paper", (("margin_m", 1.0),)),)
        patch.setattr("evaluation.studies.answers.tuned.read_tuned", lambda *_: tuned)
        patch.setattr("scenarios.traffic.session.library", lambda: None)  # the extra may be missing
        yield


def asked(call: list[str]) -> str:
    """What a call asks for, as text."""
    try:
        GROUP.main(call, standalone_mode=False)
    except AskedError as content:
        return str(content)
    raise AssertionError("nothing was asked for")


MODES = {
    **{f"study {question}": ["study", question] for question in VALUES["question"]},
    "compare": ["compare"],
    "compare --vary": ["compare", "--vary", "margin_m=2"],
    "compare --ablation": ["compare", "--ablation"],
    "compare --growth": ["compare", "--growth"],
    "compare --drives": ["compare", "--drives", "."],
    "dataset --from scenes": ["lidar", "dataset", "make"],
    "dataset --from crops": ["lidar", "dataset", "make", "--from", "crops"],
}


def effective() -> Iterator[Any]:
    for mode, call in MODES.items():
        words = next(words for words in COMMANDS if tuple(call[: len(words)]) == words)
        for param in COMMANDS[words].params:
            if (
                param.param_type_name != "argument"
                and param.name not in PASSED
                and max(param.opts, key=len) not in call
            ):
                yield pytest.param(call, COMMANDS[words], param.name, id=f"{mode}: {param.name}")


@pytest.mark.parametrize(("call", "command", "option"), list(effective()))
@pytest.mark.usefixtures("_caught")
def test_an_option_that_is_not_refused_changes_what_is_asked(
    call: list[str],
    command: Any,
    option: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of every question and every kind of comparison or data set."""
    monkeypatch.chdir(tmp_path)
    needs = [] if option == "maps" and call[0] != "compare" else list(NEEDS.get(option, ()))
    if call[:2] == ["study", "worst"] and option != "family":
        needs += ["--family", "pedestrian crosses"]
    before = [*call, *needs] if option != "family" else [*call, "--family", "pedestrian crosses diagonally"]
    value = OWN.get((call[0], option), OWN.get((call[-1], option), SAMPLES.get(option)))
    words = [*call, *needs, *typed(command, option, value)]
    reason, after = refusal(words), ""
    if not reason:
        after = asked(words)
        assert after != asked(before)
    assert after or ": has no effect with" in reason
