"""Every command in README, CONTRIBUTING and docs is understood; those for which small inputs do are run."""

from __future__ import annotations

import re
import shlex
import shutil
import sys
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer

from evaluation.cli import app
from tests.documents.blocks import PAGES, ROOT, Block, blocks, commands_of
from tests.documents.inputs import run_command

LANGUAGES = {"python", "sh", "sql", "text", "toml", "xml", "yaml"}
DIRECTIVES = {"{toctree}", "{eval-rst}", "{command-reference}", "{example}"}
"""Blocks that the documentation site fills in."""

OUTSIDE = re.compile(
    r"argoverse2|NCAP|\bdata\b|labels detections|other_drives|my_drives|my_detector|tracks\.(csv|parquet)"
    r"|--traffic|[\w./]+\.onnx|results/(network|before|bends|ncap|compare|seed_|traffic)|NAME|clouds|velodyne|drives/0010|--maps|foxglove/"
)
"""Inputs of others, or of commands that take long; SUMO, which `.ci/traffic` has."""
LONG = re.compile(
    r"^(study|compare|reference|scenes|lidar|ncap (cpna|--protocol fmvss127))\b"
    r"|results/(scenes|towns|physical|weather)|--perception|--weather|hdl32"
)
"""Commands that take more than a few seconds of processor time."""
SMALLER = (
    (r"^cpna (?!.*--speeds)", ["--speeds", "40"]),
    (r"^cpna .*10\.\.", ["--speeds", "40"]),
    (r"^cpna .*--speeds \d+,\d", ["--speeds", "50"]),
    (r"^cpna ", ["--no-pictures", "--quiet"]),
    (r"^run cp\w+ (?!.*--param)", ["--param", "Ego_speed_kmh=40"]),
    (r"^replay .*--(gif|mp4)", ["--fps", "2"]),
    (r"^mot .*--gif", ["--frames", "0..10"]),
)
"""Options by which commands are made small, where their line is such."""

OTHER_PROGRAMS = {
    "source", "mkdir", "ln", "cd", "colcon", "dask", "ros2", "smartmot-ros", "podman", "buildah",
    "mmdebstrap",
}  # fmt: skip
"""Programs of others, and those of tests/ros and `.ci/container`."""


@cache
def _program() -> Any:
    """The command line, as the library that reads words has it; it takes a while to be made."""
    return typer.main.get_command(app)


def understood(words: list[str]) -> dict[str, Any]:
    """What the program makes of the words after `smartmot-eval`, with the name of the command."""
    command = _program()
    context = command.make_context("smartmot-eval", list(words))
    while hasattr(command, "commands"):
        rest = [*getattr(context, "_protected_args", []), *context.args]
        name, command, rest = command.resolve_command(context, rest)
        context = command.make_context(name, rest, parent=context)
    parameters: dict[str, Any] = context.params
    return parameters


def lines_of(page: str) -> list[list[str]]:
    """The words after `smartmot-eval` of a page's lines."""
    return [words[1:] for words in commands_of(page) if words[0] == "smartmot-eval"]


def reason_not_to_run(words: list[str]) -> str | None:
    """Why a line is only understood; None: it is run."""
    line = shlex.join(words)
    if OUTSIDE.search(line):
        return "needs inputs that no test has"
    return "takes long" if LONG.search(line) else None


WITH_LINES = [page for page in PAGES if lines_of(page)]
RUNS: dict[str, list[list[str]]] = {}
"""Lines to run, each on the last page that has it: README repeats those of the documentation."""
for _page in reversed(WITH_LINES):
    _before = [line for lines in RUNS.values() for line in lines]
    RUNS[_page] = [
        line for line in lines_of(_page) if reason_not_to_run(line) is None and line not in _before
    ]


@pytest.mark.parametrize("page", PAGES)
def test_every_block_names_its_language(page: str) -> None:
    def known(block: Block) -> bool:
        return block.language in LANGUAGES or block.language.split(" ")[0] in DIRECTIVES

    assert [f"{block.page}:{block.line}" for block in blocks(page) if not known(block)] == []


@pytest.mark.parametrize("page", WITH_LINES)
def test_every_command_is_understood(page: str) -> None:
    wrong = []
    for words in lines_of(page):
        try:
            understood(words)
        except Exception as error:  # whatever it is, it names the line
            wrong.append(f"{shlex.join(words)}: {error}")
    assert wrong == []


@pytest.mark.parametrize("line", ["cpna --spedes 50", "cpn", "cpna more", "run", "lidar scores a b"])
def test_a_line_with_a_mistake_is_not_understood(line: str) -> None:
    with pytest.raises(Exception, match=r"No such|unexpected|Missing"):
        understood(shlex.split(line))


def test_other_commands_are_known() -> None:
    """Targets of make, extras of pip and scripts exist; what is left is a program of others."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    targets = set(re.findall(r"^([\w-]+(?: [\w-]+)*):", (ROOT / "Makefile").read_text(), re.M))
    targets = {target for names in targets for target in names.split()}
    wrong = []
    for page in PAGES:
        for words in commands_of(page):
            program, *arguments = words
            if program == "make":
                known = arguments[0] in targets
            elif program == "pip":
                names = re.findall(r"\[([\w,]+)\]", " ".join(arguments))
                known = arguments[0] == "install" and all(
                    n in extras for name in names for n in name.split(",")
                )
            elif program == "python":
                known = (ROOT / arguments[-1]).exists() or arguments[0] == "-m"
            else:
                known = program == "smartmot-eval" or program in OTHER_PROGRAMS
            if not known:
                wrong.append(f"{page}: {shlex.join(words)}")
    assert wrong == []


@pytest.fixture(scope="module")
def with_results(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Inputs, and the results of a first `smartmot-eval cpna`."""
    folder = tmp_path_factory.mktemp("first") / "work"
    shutil.copytree(inputs, folder, symlinks=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert run_command(patch, ["cpna", "--speeds", "40,50,60", "--quiet", "--no-pictures"]) == 0
    return folder


@pytest.mark.parametrize("page", sorted(page for page, lines in RUNS.items() if lines))
def test_commands_run_on_small_inputs(
    page: str,
    with_results: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """In the order of the page; a rule of `--fail-on` may be met (exit status 3)."""
    folder = tmp_path / "work"
    shutil.copytree(with_results, folder, symlinks=True)
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for words in RUNS[page]:
        line = shlex.join(words)
        small = [option for pattern, options in SMALLER if re.search(pattern, line) for option in options]
        status = run_command(monkeypatch, [*words, *small])
        assert status in ((0, 3) if "--fail-on" in words else (0,)), f"{line}: {capfd.readouterr().err}"


@pytest.mark.parametrize("reason", ["needs inputs that no test has", "takes long"])
def test_what_is_understood_and_not_run_is_listed(reason: str) -> None:
    """Not a skipped test, but the list of what no test runs, for the summary of the tests."""
    lines = sorted(
        {
            shlex.join(words)
            for page in WITH_LINES
            for words in lines_of(page)
            if reason_not_to_run(words) == reason
        }
    )
    assert lines
    assert all(understood(shlex.split(line)) for line in lines)
    pytest.skip(f"understood, not run, since each {reason}: {len(lines)} commands: {'; '.join(lines)}")
