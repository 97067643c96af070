"""Scenario files with mistakes at the command line: one line, status 2."""

import shutil
import sys
from pathlib import Path

import pytest

from evaluation import cli
from scenarios.catalogue.library import DEFINITIONS

CROSSING, CPNA = "crossing.xosc", "cpna.xosc"

MISTAKES = {
    # the shipped file, a text of it, what stands there instead, and what the message says
    "unknown element": (CROSSING, "<Story name", "<Bogus/><Story name", "<Bogus> in <Storyboard>"),
    "unknown action": (CROSSING, "<TeleportAction>", "<JumpAction/><TeleportAction>", "<JumpAction> in"),
    "circular parameters": (
        CROSSING,
        'name="Lead_s" parameterType="double" value="2.0"',
        'name="Lead_s" parameterType="double" value="${$_Lead}"',
        "in a circle: Lead_s -> _Lead -> Lead_s",
    ),
    "undeclared parameter": (CROSSING, 'value="$_Lead"', 'value="$Laed"', "parameter 'Laed' is not declared"),
    "missing catalog": (CROSSING, "catalogs/vehicles", "catalogs/none", "catalogs/none does not exist"),
    "missing entry": (CROSSING, 'entryName="ego"', 'entryName="eco"', "no entry 'eco' in catalog 'Vehicles'"),
    "wrong unit": (CROSSING, '"distance" value', '"metres" value', "dynamicsDimension='metres'"),
    "unit in a number": (CROSSING, 'value="6.5"', 'value="6.5 m"', "got '6.5 m'"),
    "not a number": (CROSSING, 'value="6.5"', 'value="NaN"', "got 'NaN'"),
    "impossible constraint": (
        CROSSING,
        'rule="lessOrEqual" value="140"',
        'rule="lessThan" value="0"',
        "breaks its constraints: greaterThan 0 and lessThan 0",
    ),
    "division by zero": (CROSSING, "${$Ego_speed_kmh/3.6}", "${$Ego_speed_kmh/0}", "has no value"),
    "missing map": (CROSSING, "urban_street.xodr", "no.xodr", "no.xodr does not exist"),
    "map of another kind": (CROSSING, "../maps/urban_street.xodr", CROSSING, "expected <OpenDRIVE>"),
    "duplicate entity": (
        CROSSING,
        'ScenarioObject name="Target"',
        'ScenarioObject name="Ego"',
        "name, 'Ego'",
    ),
    "unknown entity": (CROSSING, 'entityRef="Target"/>', 'entityRef="Nobody"/>', "no entity 'Nobody'"),
    "missing trajectory": (CROSSING, "<TrajectoryRef>", "<TrajectoryRef/><TrajectoryRef>", "<TrajectoryRef>"),
    "other encoding": (CROSSING, "UTF-8", "KLINGON", "not well-formed XML: Unsupported encoding"),
    "later version": (CROSSING, 'revMajor="1"', 'revMajor="2"', "version '2.3'"),
    "step of zero": (CPNA, 'stepWidth="5"', 'stepWidth="0"', "expected a positive number, got 0"),
    "huge range": (CPNA, 'stepWidth="5"', 'stepWidth="1e-9"', "more than 100000 variations"),
    "range upside down": (CPNA, 'lowerLimit="10"', 'lowerLimit="100"', "60 lies below lowerLimit 100"),
    "distribution of itself": (CPNA, 'filepath="crossing.xosc"', 'filepath="mine.xosc"', "not a scenario"),
    "distributed nothing": (CPNA, '"Impact_percent"', '"Imapct"', "'Imapct' is not declared"),
}


def refusal(file: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """What the command line says to a file that it refuses."""
    out = str(file.parent / "out")
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", "run", str(file), "--no-aeb", "--out", out, "--quiet"])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    said = capsys.readouterr()
    assert (caught.value.code, said.out) == (2, "")
    assert said.err.startswith("smartmot-eval: ")
    assert said.err.count("\n") == 1
    return said.err


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The shipped definitions and maps, to be spoilt."""
    shutil.copytree(DEFINITIONS, tmp_path / "definitions")
    shutil.copytree(DEFINITIONS.parent / "maps", tmp_path / "maps")
    return tmp_path / "definitions"


@pytest.mark.parametrize("name", MISTAKES)
def test_a_spoilt_file_is_refused_in_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    source, old, new, message = MISTAKES[name]
    text = (folder / source).read_text(encoding="utf-8")
    assert old in text
    file = folder / "mine.xosc"
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    assert message in refusal(file, monkeypatch, capsys)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "Document is empty"),
        (b"\x00\x01\xff" * 100, "not well-formed XML"),
        ('<?xml version="1.0" encoding="UTF-8"?><a b="ü"/>'.encode("latin-1"), "not well-formed XML"),
        (b"<html/>", "root element is <html>"),
    ],
)
def test_what_is_no_scenario_is_refused_in_one_line(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    content: bytes,
    message: str,
) -> None:
    file = folder / "mine.xosc"
    file.write_bytes(content)
    assert message in refusal(file, monkeypatch, capsys)


def test_a_catalog_that_refers_to_itself_is_refused_in_one_line(
    folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "catalogs" / "vehicles" / "circle.xosc").write_text(
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="3"/><Catalog name="Circle">'
        '<CatalogReference name="round" catalogName="Circle" entryName="round"/></Catalog></OpenSCENARIO>'
    )
    text = (folder / CROSSING).read_text(encoding="utf-8")
    file = folder / "mine.xosc"
    file.write_text(
        text.replace('catalogName="Vehicles" entryName="ego"', 'catalogName="Circle" entryName="round"')
    )
    assert "'round' is a <CatalogReference>, expected a <Vehicle>" in refusal(file, monkeypatch, capsys)


def test_a_road_in_place_of_a_level(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`--road` gives the road of a level, is refused where it is not there, and said where it is not used."""

    def run(*words: object) -> tuple[int, str]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", "run", *map(str, words)])
        with pytest.raises(SystemExit) as ended:
            cli.main()
        return int(ended.value.code or 0), capsys.readouterr().err

    shutil.copytree(DEFINITIONS / "catalogs", tmp_path / "catalogs")
    text = (DEFINITIONS / CROSSING).read_text()
    assert "../maps/urban_street.xodr" in text
    scenario = tmp_path / "level.xosc"
    scenario.write_text(text.replace("../maps/urban_street.xodr", "Town99"))
    maps, out = tmp_path / "maps", ("--no-pictures", "--strategy", "map", "--workers", 1, "--out")
    assert run(scenario, "--road", maps, *out, tmp_path / "a") == (
        2, f"smartmot-eval: --road: {maps} does not exist\n",
    )  # fmt: skip
    maps.mkdir()
    shutil.copy(DEFINITIONS.parent / "maps" / "urban_street.xodr", maps / "Town99.xodr")
    assert run(scenario, "--road", maps, *out, tmp_path / "b") == (0, "")
    other = tmp_path / "other.xodr"
    shutil.copy(DEFINITIONS.parent / "maps" / "urban_bend.xodr", other)
    assert run(scenario, "--road", maps, "--map", other, *out, tmp_path / "d") == (
        2, f"smartmot-eval: --map: {other} is not {maps / 'Town99.xodr'}, on which the scenario takes place "
        "by --road; leave --map out\n",
    )  # fmt: skip
    status, said = run("crossing", "--road", maps, *out, tmp_path / "c")
    assert status == 0
    assert f"--road {maps} is not used: the scenario has a road of its own" in said
    # the same street under another name: the same run
    on_level, on_own = ((tmp_path / name / "runs.csv").read_text() for name in "bc")
    assert on_level.replace("level", "crossing") == on_own
