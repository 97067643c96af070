"""Which files run: the table, and what it says of the files of others."""

import re
from pathlib import Path

import pytest

from scenarios.openscenario import FileCheck, FileReadError, check, scenario_files
from scenarios.openscenario.checking import markdown, table
from tests.scenarios.openscenario.conftest import (
    CAR,
    act,
    at_time,
    condition,
    criterion,
    event,
    maneuver,
    speed,
)

SHARED = Path(__file__).parents[3].parent / "shared"
DOCUMENT = (Path(__file__).parents[3] / "docs" / "openscenario.md").read_text(encoding="utf-8")
MOST_REFUSED = 9
"""Of 114 files 105 have to run."""


def test_verdicts_notes_and_counts(write, tmp_path):
    path = write()
    assert (check(path).verdict, check(path).version) == ("supported", "1.3")
    loose = CAR.replace("</Vehicle>", '<TrailerHitch dx="-1"/></Vehicle>')
    noted = check(write(other=loose), run=True)
    assert noted.verdict == "noted"
    assert noted.outcome == "by its stop trigger at 10.00 s, contact at 4.60 s"
    text = path.read_text(encoding="utf-8")
    (tmp_path / "wrong.xosc").write_text(text.replace("<Init>", "<Unit/><Init>"), encoding="utf-8")
    (tmp_path / "catalog.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="0"/><Catalog name="c"/></OpenSCENARIO>'
    )
    files = scenario_files(tmp_path)
    assert [file.name for file in files] == ["small.xosc", "wrong.xosc"]
    lines = list(table([check(file) for file in files], tmp_path))
    assert lines[0].startswith("small.xosc  1.3  noted")
    assert "refused    9: <Unit> in <Storyboard> is not supported" in lines[1]
    assert lines[2] == "2 files: 0 supported, 1 noted, 1 refused"
    (tmp_path / "nothing").mkdir()
    with pytest.raises(FileReadError, match="no scenario file"):
        scenario_files(tmp_path / "nothing")


def test_the_action_of_a_check_is_the_first_variation(write):
    held = check(write(act(maneuver(event("e", speed(2))))), run=True)
    assert held.verdict == "supported"
    assert held.outcome.startswith("by its stop trigger at 10.00 s")


def documented() -> dict[str, tuple[str, str]]:
    """The table of docs/openscenario.md: version and what came out, by file."""
    rows = re.findall(r"^\| ((?:alks|carla|esmini)\S*) \| (\S+) \| (\S+) \| (.*) \|$", DOCUMENT, re.MULTILINE)
    return {f"{source}/{name}": (version, result) for source, name, version, result in rows}


def test_the_table_of_the_document_is_what_the_command_gives():
    """Every file has its row; some of them are run again (all take minutes)."""
    folder = SHARED / "openscenario"
    if not folder.is_dir():
        pytest.skip(f"no scenario files of others at {folder}")
    rows = documented()
    names = [file.relative_to(folder).as_posix() for file in scenario_files(folder)]
    assert sorted(rows) == sorted(names)
    refused = [name for name, (_, result) in rows.items() if result.startswith("refused")]
    assert len(refused) <= MOST_REFUSED
    quick = [name for name in names if "cut off" not in rows[name][1]]
    again = quick[::20]
    assert len(again) >= 4
    checks = [check(folder / name, SHARED / "opendrive" / "maps", run=True) for name in again]
    _, _, *lines = markdown(checks, folder)
    for name, line in zip(again, lines, strict=False):
        source, _, file = name.rpartition("/")
        assert line == f"| {source} | {file} | {rows[name][0]} | {rows[name][1]} |"


def test_markdown_has_the_source_and_no_bar_of_its_own(write, tmp_path):
    (tmp_path / "theirs").mkdir()
    path = write().rename(tmp_path / "theirs" / "a.xosc")
    held = FileCheck(path, "1.3", "refused", (f"{path}:9: a | b",))
    assert list(markdown([held], tmp_path)) == [
        "| source | file | version | what came out |",
        "| --- | --- | --- | --- |",
        "| theirs | a.xosc | 1.3 | refused: 9: a \\| b |",
        "",
        "1 file: 0 supported, 0 noted, 1 refused",
    ]


def test_pass_criteria_are_listed_and_judged(write):
    """The ego at 10 m/s drives 46 m to the car ahead: a contact, and 100 m in 10 s."""
    asked = (("CollisionTest", ""), ("DrivenDistanceTest", "99"), ("RunningStopTest", ""))
    criteria = "".join(criterion(name, value) for name, value in asked)
    stop = f"<StopTrigger><ConditionGroup>{criteria}{condition(at_time(10))}</ConditionGroup></StopTrigger>"
    path = write(stop=stop)
    listed = next(iter(table([check(path)], path.parent)))
    assert listed.endswith("; pass criteria: CollisionTest, DrivenDistanceTest, RunningStopTest")
    judged = next(iter(table([check(path, run=True)], path.parent)))
    assert judged.endswith(
        "; met: DrivenDistanceTest; not met: CollisionTest; not evaluated: RunningStopTest"
    )
