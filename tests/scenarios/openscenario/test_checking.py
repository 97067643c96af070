"""Which files run: the table, and what it says of the files of others."""

from pathlib import Path

import pytest

from scenarios.openscenario import FileReadError, check, scenario_files
from scenarios.openscenario.checking import table
from tests.scenarios.openscenario.conftest import CAR, act, event, maneuver, speed

SHARED = Path(__file__).parents[3].parent / "shared"
RUN_AT_LEAST = 0.7
"""Share of the files; each of the others is refused in one line."""


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


def test_files_of_others_are_read_or_refused_in_one_line():
    """Begun only; `smartmot-eval run DIR --check --to-end` runs them."""
    if not (SHARED / "openscenario").is_dir():
        pytest.skip(f"no scenario files of others at {SHARED / 'openscenario'}")
    files = scenario_files(SHARED / "openscenario")[::5]  # all take half a minute
    refused = []
    for file in files:
        held = check(file, SHARED / "opendrive" / "maps")
        if held.verdict == "refused":
            refused.append(f"{file.name}: {held.lines[0]}")
            assert "\n" not in held.lines[0]
    assert len(refused) <= (1 - RUN_AT_LEAST) * len(files), "\n".join(refused)
