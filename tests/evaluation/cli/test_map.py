"""`smartmot-eval map FILE --check`: what is listed, and the exit status."""

import json
import sys
from pathlib import Path

import pytest
from lxml import etree

from evaluation.cli import main
from scenarios.catalogue.maps import SHIPPED_MAPS, shipped_map


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


@pytest.fixture
def faulty(tmp_path: Path) -> Path:
    """A shipped map with one unknown lane type."""
    file = tmp_path / "faulty.xodr"
    text = shipped_map("urban_street").read_text(encoding="utf-8")
    assert 'type="sidewalk"' in text
    file.write_text(text.replace('type="sidewalk"', 'type="hyperloop"', 1), encoding="utf-8")
    return file


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_shipped_maps_are_clean(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", name, "--check", "--strict") == 0
    assert capsys.readouterr().out.splitlines() == ["0 defects"]


def test_a_faulty_map_is_listed_and_fails_only_if_strict(
    faulty: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("map", faulty, "--check") == 0
    listed = capsys.readouterr().out
    assert "unknown lane type" in listed
    assert "'hyperloop'" in listed
    assert listed.splitlines()[-1] == "1 defects"
    assert call("map", faulty, "--check", "--strict") == 1
    assert capsys.readouterr().out == listed


def test_a_map_that_cannot_be_read_gives_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "broken.xodr"
    file.write_text(shipped_map("urban_street").read_text(encoding="utf-8")[:500], encoding="utf-8")
    assert call("map", file, "--check", "--strict") != 0
    answer = capsys.readouterr()
    assert answer.out == ""
    assert len(answer.err.splitlines()) == 1
    assert "not well-formed XML" in answer.err


FIELD = Path(__file__).parents[2] / "data" / "field" / "opendrive"


def test_findings_as_json(tmp_path: Path) -> None:
    file = tmp_path / "found.json"
    call("map", FIELD / "linked_roads_apart.xodr", "--check", "--findings", file)
    found = json.loads(file.read_text(encoding="utf-8"))["findings"]
    assert {(f["kind"], f["road"], f["lane"], f["s_m"], f["unit"]) for f in found} == {
        ("gap across a link", "1", -1, 50.0, "m")
    }
    assert found[0]["amount"] == pytest.approx(164**0.5)
    assert found[0]["rule"].startswith("asam.net:xodr:1.7.0:")


def test_findings_as_a_result_file_of_quality_checkers(tmp_path: Path) -> None:
    """The middle of lane -1, which is 3.5 m wide, at the end of a road along x."""
    file = tmp_path / "found.xqar"
    call("map", FIELD / "linked_roads_apart.xodr", "--check", "--findings", file)
    root = etree.parse(file).getroot()
    assert root.tag == "CheckerResults"
    issue = root.find("CheckerBundle/Checker/Issue")
    assert issue is not None
    assert issue.get("ruleUID", "").startswith("asam.net:xodr:1.7.0:")
    assert root.find("CheckerBundle/Checker/AddressedRule") is not None
    place = issue.find("Locations/InertialLocation")
    assert place is not None
    assert [float(place.get(axis, "nan")) for axis in "xyz"] == pytest.approx([50.0, -1.75, 0.0])


def test_a_refused_map_is_a_finding_where_findings_are_written(tmp_path: Path) -> None:
    broken, file = tmp_path / "broken.xodr", tmp_path / "found.json"
    broken.write_text("<OpenDRIVE>", encoding="utf-8")
    assert call("map", broken, "--check", "--findings", file) == 1
    (finding,) = json.loads(file.read_text(encoding="utf-8"))["findings"]
    assert finding["kind"] == "refused"
    assert finding["rule"] == "asam.net:xodr:1.0.0:xml.valid_xml_document"


def test_a_folder_is_a_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "sound.xodr").write_bytes(shipped_map("urban_street").read_bytes())
    (tmp_path / "apart.xodr").write_bytes((FIELD / "linked_roads_apart.xodr").read_bytes())
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE>", encoding="utf-8")
    assert call("map", tmp_path, "--check") == 0
    lines = capsys.readouterr().out.splitlines()
    name, *cells, seconds = [cell.strip() for cell in lines[2].strip("|").split("|")]
    assert (name, *cells) == ("apart.xodr", "2", "2", "1 x gap across a link")
    assert 0.0 <= float(seconds) < 10.0
    assert lines[3].startswith("| broken.xodr | |  | refused: not well-formed XML")
    assert lines[4].startswith("| inner/sound.xodr |")
    assert lines[-1] == "3 maps: 2 loaded, 1 of them without findings; 1 refused"
    assert call("map", tmp_path, "--check", "--strict") == 1


def test_broken_rules_alone_are_no_defects_of_a_map_or_a_folder(tmp_path: Path) -> None:
    content = shipped_map("urban_street").read_text(encoding="utf-8")
    assert "<line/>" in content
    file = tmp_path / "level.xodr"
    file.write_text(content.replace("<line/>", '<arc curvature="0"/>', 1), encoding="utf-8")
    assert call("map", file, "--check", "--strict") == 0
    assert call("map", tmp_path, "--check", "--strict") == 0


def test_a_layer_can_be_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", FIELD / "lane_layers_1_9.xodr", "--layer", "temporary") == 0
    assert "1 shoulder" in capsys.readouterr().out


@pytest.mark.parametrize("options", [("--findings", "found.txt", "--check"), ("--findings", "found.json")])
def test_findings_need_a_known_ending_and_a_check(options: tuple[str, ...]) -> None:
    assert call("map", "urban_street", *options) == 2


@pytest.mark.parametrize(
    ("form", "name", "account"),
    [
        ("commonroad", "m.xml", "36 lanelets, 20 traffic signs, 4 traffic lights, 1 intersections"),
        ("lanelet2", "m.osm", "32 lanelets, 4 crosswalks, 4 traffic signs, 4 traffic lights"),
        ("gltf", "m.glb", "32 lanes, 7048 triangles"),
        ("obj", "m.obj", "32 lanes, 7048 triangles"),
    ],
)
def test_a_map_is_written_for_other_tools(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], form: str, name: str, account: str
) -> None:
    assert call("map", "urban_intersection", "--export", form, tmp_path / name) == 0
    lines = capsys.readouterr().out.splitlines()
    assert f"{form}: {tmp_path / name}, {account}" in lines
    limits = "  not carried over: 8 x signs of speed limits (lanelets have those of their lanes)"
    assert (limits in lines) == (form in ("commonroad", "lanelet2"))
    assert (tmp_path / name).stat().st_size > 10_000


@pytest.mark.parametrize(
    ("export", "reason"),
    [
        (("gltf", "m.obj"), "does not end in .glb or .gltf"),
        (("step", "m.stp"), "use one of: commonroad, lanelet2"),
        (("gltf", "absent/m.glb"), "cannot write"),
    ],
)
def test_an_export_that_is_not_possible_is_refused_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], export: tuple[str, str], reason: str
) -> None:
    assert call("map", "urban_street", "--export", export[0], tmp_path / export[1]) == 2
    answer = capsys.readouterr().err
    assert len(answer.splitlines()) == 1
    assert reason in answer


def test_warnings_of_a_map_are_lines_of_words(faulty: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("map", faulty) == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "warning: " in line]
    assert line.split()[:4] == ["warning:", "unknown", "lane", "type"]
    assert "MapWarning" not in line
