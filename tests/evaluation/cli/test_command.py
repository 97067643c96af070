"""The command as users run it: files it writes, and one line for every mistake."""

import csv
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import pytest

from evaluation.cli import main
from evaluation.results.logs import read_log
from scenarios.catalogue.library import DEFINITIONS
from scenarios.catalogue.maps import shipped_map

ISSUE_COLUMNS = [
    *("scenario", "strategy", "preset", "weather", "adversaries", "seed", "v_test_kmh", "v_impact_kmh"),
    *("collided", "score", "score_max", "flag_time_s", "flag_distance_m", "stop_gap_m"),
]
PICTURES = {"speed_curves.png", "temporal_diagram.png", "birdseye.png"}
GOOD_RUN = ["cpna", "--speeds", "50", "--strategy", "rectangular,map"]


@dataclass(frozen=True, slots=True)
class Answer:
    """What a call of the command came to."""

    status: int
    out: str
    err: str


Command = Callable[..., Answer]


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        try:
            main()
        except SystemExit as stop:
            return int(stop.code or 0)
    return 0


@pytest.fixture
def command(capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Command:
    """Call the command in an empty folder."""
    monkeypatch.chdir(tmp_path)

    def answer(*arguments: object) -> Answer:
        capfd.readouterr()
        status = call(*arguments)
        return Answer(status, *capfd.readouterr())

    return answer


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A good run: one speed, two strategies."""
    folder = tmp_path_factory.mktemp("good") / "results"
    assert call(*GOOD_RUN, "--out", folder, "--quiet") == 0
    return folder


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "runs.csv").open(newline="") as file:
        return list(csv.DictReader(file))


# ---- a good run --------------------------------------------------------------------------------------------


def test_table_of_runs_has_the_columns_asked_for(results: Path) -> None:
    rows = rows_of(results)
    assert list(rows[0])[: len(ISSUE_COLUMNS)] == ISSUE_COLUMNS
    assert [(r["strategy"], r["collided"], r["score"], r["score_max"]) for r in rows] == [
        ("rectangular", "true", "2.0", "2.0"),
        ("map", "false", "2.0", "2.0"),
    ]
    assert float(rows[0]["v_impact_kmh"]) == pytest.approx(23.82, abs=3.0)
    assert float(rows[1]["v_impact_kmh"]) == 0.0
    assert rows[0]["stop_gap_m"] == ""
    assert float(rows[1]["stop_gap_m"]) > 0.0
    assert {r["scenario"] for r in rows} == {"CPNA"}


def test_configuration_and_logs_and_pictures_are_there(results: Path) -> None:
    stored = json.loads((results / "runs.json").read_text())["configuration"]
    assert {spec["v_test_kmh"] for spec in stored["specs"]} == {50.0}
    for row in rows_of(results):
        log = read_log(results / "logs" / f"{row['log']}.parquet")
        assert {"ego", "actor", "detection", "track"} <= set(log["kind"])
    assert {p.name for p in results.glob("*.png")} == PICTURES
    for picture in PICTURES:
        assert (results / picture).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_run_twice_gives_the_same_bytes(results: Path, tmp_path: Path) -> None:
    """The second run is a process of its own, as the first was one of this session."""
    run = subprocess.run(
        [
            sys.executable,
            "-c",
            "from evaluation.cli import main; main()",
            *GOOD_RUN,
            "--out",
            tmp_path / "again",
        ],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    for expected in ("rectangular", "published", "23.82", "2 runs in"):
        assert expected in run.stdout
    one, two = (
        {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
        for folder in (results, tmp_path / "again")
    )
    assert {Path(name).suffix for name in one} >= {".csv", ".json", ".parquet", ".png"}
    assert sorted(one) == sorted(two)
    assert [name for name in one if one[name] != two[name]] == []


def test_quiet_prints_nothing_and_no_pictures_draws_none(command: Command, tmp_path: Path) -> None:
    answer = command(
        "cpna", "--speeds", "20", "--strategy", "map", "-q", "--no-pictures", "--out", "here", "--seed", 4
    )
    assert answer == Answer(0, "", "")
    assert not list(tmp_path.rglob("*.png"))
    (row,) = rows_of(tmp_path / "here")
    assert (row["seed"], row["v_test_kmh"], row["collided"]) == ("4", "20.0", "false")


def test_conditions_reach_the_rows(command: Command, tmp_path: Path) -> None:
    answer = command(
        *("cpna", "--speeds", "20", "--strategy", "map", "--no-pictures", "--preset", "physical"),
        *("--weather", "dry,snow", "--impact-point", "25", "--adversaries", "static", "--at", "1,1,300"),
        *("--map", shipped_map("urban_street"), "--out", "here"),
    )
    assert answer.status == 0, answer.err
    rows = rows_of(tmp_path / "here")
    assert [(r["scenario"], r["preset"], r["weather"], r["adversaries"]) for r in rows] == [
        ("CPNA-25", "physical", "dry", "static"),
        ("CPNA-25", "physical", "snow", "static"),
    ]
    assert "published" not in answer.out
    assert "placed at --at 1,1,300.0 (x 300.0 m, y 1.8 m); a sidewalk begins at its" in answer.out


def test_number_of_processes_changes_no_byte(results: Path, tmp_path: Path) -> None:
    assert call(*GOOD_RUN, "--out", tmp_path, "--quiet", "--workers", 2) == 0
    names = sorted(str(p.relative_to(results)) for p in results.rglob("*") if p.is_file())
    assert sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file()) == names
    assert [n for n in names if (results / n).read_bytes() != (tmp_path / n).read_bytes()] == []


# ---- scenario files ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def file_results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two variations of a shipped test, with perception."""
    folder = tmp_path_factory.mktemp("files") / "results"
    arguments = ("run", "cpna", "--param", "Ego_speed_kmh=50", "--strategy", "map", "--workers", 1)
    assert call(*arguments, "--out", folder, "--quiet") == 0
    return folder


def test_a_shipped_test_is_run_with_every_variation(file_results: Path) -> None:
    rows = rows_of(file_results)
    assert [(r["scenario"], r["v_test_kmh"], r["preset"]) for r in rows] == [
        ("cpna Impact_percent=25", "50.0", "physical"),
        ("cpna Impact_percent=75", "50.0", "physical"),
    ]
    assert {r["score"] for r in rows} == {""}
    assert all(float(r["target_start_time_s"]) == pytest.approx(2.0) for r in rows)
    assert {p.name for p in file_results.glob("*.png")} == PICTURES


def test_plot_draws_a_folder_of_scenario_files_again(
    command: Command, file_results: Path, tmp_path: Path
) -> None:
    before = {name: (file_results / name).read_bytes() for name in PICTURES}
    answer = command("plot", file_results)
    assert answer.status == 0, answer.err
    assert {name: (file_results / name).read_bytes() for name in PICTURES} == before
    answer = command("plot", file_results, "--run", "nope")
    assert answer.status == 2
    assert "--run: no run 'nope'" in answer.err


def test_without_aeb_the_ego_hits_at_test_speed(command: Command, tmp_path: Path) -> None:
    answer = command("run", "crossing", "--no-aeb", "--param", "Impact_percent=10", "--out", "here")
    assert answer.status == 0, answer.err
    assert "1 of 1" in answer.out  # contacts
    (row,) = rows_of(tmp_path / "here")
    assert (row["strategy"], row["v_impact_kmh"], row["flag_time_s"]) == ("none", "40.0", "")
    # the middle of the box is 0.06 m farther than the H-point, of a width of 1.8 m
    assert float(row["impact_location_percent"]) == pytest.approx(10 + 100 * 0.06 / 1.8, abs=0.01)
    # 4.0 m + 0.06 m - 0.72 m of walking and 1 m of run-up at 5 km/h, after 2 s
    assert float(row["contact_time_s"]) == pytest.approx(2 + (4.06 - 0.72 + 1.0) * 3.6 / 5, abs=1e-3)
    assert float(row["target_speed_at_contact_kmh"]) == pytest.approx(5.0)
    assert {file.name for file in (tmp_path / "here").glob("*.png")} == PICTURES


def test_shipped_scenarios_are_listed(command: Command) -> None:
    answer = command("list")
    assert answer.status == 0
    for name, runs in (
        ("cpna_paper", "1 run"),
        ("cpna", "22 runs"),
        ("cbla", "8 runs"),
        ("cpnco", "11 runs"),
    ):
        assert any(
            line.split()[0] == name and runs in line for line in answer.out.splitlines() if line.strip()
        )
    one = command("list", "cpfa")
    assert "Target_speed_kmh = 8" in one.out
    assert "cpna" not in one.out


def test_shipped_brake_rules_are_listed_with_what_triggers_them(command: Command) -> None:
    protocols = command("list", "--protocols").out
    assert "fmvss127               98 cells  FMVSS No. 127, May 2024 text" in protocols
    assert "ancap" in protocols
    lines = command("list", "--rules").out.splitlines()
    named = [line.split()[:2] for line in lines]
    assert ["paper", "braking_factor=1"] in named
    assert ["required_deceleration", "required_decel_mps2=6"] in named
    assert ["r157", "r157_ttc_s=1.5"] in named
    assert len(named) == 10


def test_perceptions_are_listed_with_networks_and_ones_own(command: Command) -> None:
    from scenarios.sensors.lidar.chain import PERCEPTIONS
    from smartmot.lidar.learned import SHIPPED

    named = [line.split()[0] for line in command("list", "--perceptions").out.splitlines()]
    assert named == [*PERCEPTIONS, *SHIPPED, "FILE.onnx", "FILE.onnx_monitored", "package.module:name"]


# ---- protocols ---------------------------------------------------------------------------------------------


def test_a_protocol_is_run_scored_and_drawn(command: Command, tmp_path: Path) -> None:
    """The paper's protocol gives the paper's total; its cells are the runs of `cpna`."""
    answer = command(
        *("ncap", "--protocol", "paper", "--preset", "paper", "--strategy", "map", "--out", "here")
    )
    assert answer.status == 0, answer.err
    assert "dry 10 of 10" in " ".join(answer.out.split())
    rows = rows_of(tmp_path / "here")
    assert [r["v_test_kmh"] for r in rows] == ["10.0", "20.0", "30.0", "40.0", "50.0", "60.0"]
    assert {(r["strategy"], r["collided"], r["log"]) for r in rows} == {("map", "false", "")}
    assert (tmp_path / "here" / "matrix_paper.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert "SmartMOT paper" in (tmp_path / "here" / "matrix_paper.html").read_text()


def test_scenario_files_are_run_by_a_protocol(command: Command, tmp_path: Path) -> None:
    """Two rows of CPNA at 50 %, the same whatever the number of processes."""
    (tmp_path / "mine.xosc").write_text(
        (DEFINITIONS / "cpna.xosc")
        .read_text()
        .replace('filepath="crossing.xosc"', f'filepath="{DEFINITIONS}/crossing.xosc"')
        .replace('<Element value="25"/>', '<Element value="50"/>')
        .replace('<Element value="75"/>', "")
        .replace('lowerLimit="10" upperLimit="60"', 'lowerLimit="40" upperLimit="50"')
    )
    (tmp_path / "cpna.xosc").write_text((tmp_path / "mine.xosc").read_text())
    arguments = ("ncap", "cpna.xosc", "--protocol", "r152", "--strategy", "rectangular,map")
    one = command(*arguments, "--out", "one", "--workers", 1)
    two = command(*arguments, "--out", "two", "--workers", 2)
    assert (one.status, two.status) == (0, 0), one.err + two.err
    rows = rows_of(tmp_path / "one")
    assert [(r["strategy"], r["v_test_kmh"]) for r in rows] == [
        (strategy, speed) for strategy in ("rectangular", "map") for speed in ("40.0", "45.0", "50.0")
    ]
    for name in ("runs.csv", "runs.json", "matrix_r152.png", "matrix_r152.html"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert command("ncap", "mine.xosc", "--protocol", "r152").status == 2  # no test's name


@pytest.mark.parametrize(
    ("arguments", "protocol", "places", "speeds_kmh"),
    [
        # the shipped grid of CPNA is that of 2023: 25 and 75 %, by day
        (("cpna",), "r152", {50.0}, [20, 25, 30, 35, 40, 42, 45, 50, 55, 60]),
        (("cpna",), "2023", {25.0, 75.0}, [*range(10, 65, 5)]),
        (("cpla",), "2026", {10.0, 25.0, 50.0, 75.0}, [*range(10, 70, 10)]),
    ],
)
def test_the_name_of_a_shipped_test_stands_for_the_cells_of_the_protocol(
    arguments: tuple[str, ...], protocol: str, places: set[float], speeds_kmh: list[float]
) -> None:
    from evaluation.protocols.registry import named_protocol
    from evaluation.studies.ncap.grid import grid_of_shipped, has_shipped

    rules = named_protocol(protocol)
    assert has_shipped(rules, arguments)
    grid = grid_of_shipped(rules, protocol, robustness=False, tests=arguments)
    columns = [dict(run.label) for run in grid.runs if "condition" not in dict(run.label)]
    assert {each["impact_location_percent"] for each in columns} == places
    assert sorted({each["v_test_kmh"] for each in columns}) == speeds_kmh
    assert not has_shipped(rules, ("cpna", "crossing"))
    assert not has_shipped(rules, ("cpna.xosc",))
    assert not has_shipped(named_protocol("paper"), arguments)


def test_ancap_is_euro_ncap(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[object] = []
    monkeypatch.setattr(
        "evaluation.studies.ncap.run.run_grid", lambda _, name, *__, **___: given.append(name)
    )
    assert command("ncap", "--protocol", "ancap").status == 0
    assert given == ["2026"]


# ---- plot and map ------------------------------------------------------------------------------------------


def test_plot_draws_again_without_running(command: Command, results: Path) -> None:
    before = {name: (results / name).read_bytes() for name in PICTURES}
    answer = command("plot", results)
    assert (answer.status, answer.err) == (0, "")
    assert {Path(line).name for line in answer.out.split()} == PICTURES
    assert {name: (results / name).read_bytes() for name in PICTURES} == before


def test_plot_shows_the_run_asked_for_in_the_format_asked_for(command: Command, results: Path) -> None:
    log = rows_of(results)[0]["log"]
    for _ in range(2):
        assert command("plot", results, "--run", log, "--format", "svg", "--quiet") == Answer(0, "", "")
    text = (results / "temporal_diagram.svg").read_text()
    assert "<svg" in text
    assert {p.stem for p in results.glob("*.svg")} == {Path(p).stem for p in PICTURES}
    for file in results.glob("*.svg"):
        file.unlink()


def test_map_describes_and_draws(command: Command, tmp_path: Path) -> None:
    described = command("map", shipped_map("urban_intersection"))
    assert described.status == 0
    assert described.out.startswith("map: urban_intersection, ")
    assert "driving" in described.out
    for ending in ("png", "svg", "pdf"):
        for name in ("one", "two"):
            path = tmp_path / f"{name}.{ending}"
            answer = command("map", "urban_bend", "--at", "1,-1,250", "--strategy", "map", "--png", path)
            assert (answer.status, answer.err) == (0, "")
            assert f"picture: {path}" in answer.out
        assert (tmp_path / f"one.{ending}").read_bytes() == (tmp_path / f"two.{ending}").read_bytes()


def test_map_tells_what_the_law_says_ahead(command: Command) -> None:
    answer = command("map", "urban_street", "--at", "1,-1,500")
    assert answer.status == 0
    assert "crosswalk in " in answer.out


# ---- help --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["cpna", "plot", "map"])
def test_help_of_every_command_has_examples(command: Command, name: str) -> None:
    answer = command(name, "--help")
    assert answer.status == 0
    assert f"smartmot-eval {name} " in answer.out.split("Examples")[-1]
    assert "Examples" in answer.out


def test_help_lists_the_commands_and_no_arguments_give_help(command: Command) -> None:
    for arguments in (["--help"], ["-h"]):
        answer = command(*arguments)
        assert answer.status == 0
        assert all(name in answer.out for name in ("cpna", "run", "ncap", "list", "plot", "map"))
    bare = command()
    assert "Usage" in bare.out + bare.err


# ---- mistakes ----------------------------------------------------------------------------------------------

MISTAKES = {
    "missing map": (["cpna", "--map", "nope.xodr"], "nope.xodr: cannot be opened"),
    "broken map": (["cpna", "--map", "broken.xodr"], "broken.xodr: not well-formed XML"),
    "another format": (["cpna", "--map", "other.xml"], "other.xml"),
    "empty map file": (["cpna", "--map", "empty.xodr"], "empty.xodr"),
    "directory as map": (["cpna", "--map", "folder"], "folder: cannot be opened"),
    "bend": (["cpna", "--map", "urban_bend", "--at", "1,-1,250"], "no straight stretch"),
    "sidewalk": (["cpna", "--at", "1,-2,300"], "is of type sidewalk; choose a driving lane"),
    "too near the end of the road": (["cpna", "--at", "1,-1,100"], "no straight stretch"),
    "speed zero": (["cpna", "--speeds", "0"], "--speeds: '0' must be positive"),
    "speed as text": (["cpna", "--speeds", "fast"], "--speeds: 'fast' is not a number"),
    "speed beyond the limit": (["cpna", "--speeds", "150"], "test speed must lie in (0, 140] km/h, got 150"),
    "strategy": (
        ["cpna", "--strategy", "circle"],
        "--strategy: unknown 'circle'; use one or more of: rectangular",
    ),
    "preset": (["cpna", "--preset", "ideal"], "--preset: unknown 'ideal'; use one of: paper, physical, real"),
    "two presets": (["cpna", "--preset", "paper,physical"], "--preset: unknown 'paper,physical'"),
    "weather": (["cpna", "--weather", "hail"], "--weather: unknown 'hail'; use one or more of: dry"),
    "adversaries": (
        ["cpna", "--adversaries", "moving"],
        "unknown adversaries 'moving'; use one of: none, static",
    ),
    "impact point": (["cpna", "--impact-point", "150"], "impact point must lie in 0..100 %, got 150"),
    "file as folder": (["cpna", "--out", "broken.xodr"], "--out: cannot write to folder broken.xodr"),
    "folder in a file": (["cpna", "--out", "broken.xodr/x"], "--out: cannot write to folder broken.xodr/x"),
    "place with two parts": (
        ["cpna", "--at", "1,-1"],
        "--at: expected ROAD,LANE,S such as 1,-1,250.0; got '1,-1'",
    ),
    "place as text": (["cpna", "--at", "a,b,c"], "--at: expected ROAD,LANE,S"),
    "no such road": (["cpna", "--at", "99,-1,250"], "the map has no road '99'; it has 1 roads: 1"),
    "no such lane": (["cpna", "--at", "1,-9,250"], "road 1 has no lane -9 at s = 250 m"),
    "s beyond the road": (["cpna", "--at", "1,-1,6000"], "road 1 has no lane -1 at s = 6000 m"),
    "missing scenario": (["run", "nope.xosc"], "nope.xosc: "),
    "broken scenario": (["run", "broken.xodr"], "broken.xodr"),
    "no scenario": (["run", "other.xml"], "other.xml"),
    "unknown parameter": (["run", "cpna", "--param", "Speed=3"], "parameter 'Speed' is not declared"),
    "parameter without value": (["run", "cpna", "--param", "Speed"], "--param: expected NAME=VALUE"),
    "parameter twice": (["run", "cpna", "--param", "a=1", "--param", "a=2"], "--param: a is given twice"),
    "parameter outside": (["run", "crossing", "--param", "Impact_percent=120"], "Impact_percent"),
    "parameter as text": (["run", "crossing", "--param", "Ego_speed_kmh=fast"], "Ego_speed_kmh"),
    "missing map of the scenario": (["run", "crossing", "--param", "Map=no.xodr"], "no.xodr does not exist"),
    "missing map of perception": (
        ["run", "crossing", "--map", "no.xodr"],
        "no.xodr: No such file or directory",
    ),
    "map elsewhere": (["run", "crossing", "--map", "elsewhere.xodr"], "no driving lane of the map"),
    "night": (["run", "crossing", "--night", "owl"], "--night: unknown 'owl'; use one of: lidar, camera"),
    "run without strategy": (["run", "crossing", "--strategy", "x"], "--strategy: unknown 'x'"),
    "list of nothing": (["list", "nope"], "nope"),
    "unknown protocol": (
        ["ncap", "--protocol", "2019"],
        "--protocol: unknown '2019'; use one of: 2026, 2023",
    ),
    "protocol without weather": (["ncap", "--weather", "dry,wet"], "give one --weather, not dry, wet"),
    "no such scenarios": (["ncap", "nowhere"], "nowhere"),
    "folder without scenarios": (["ncap", "folder"], "folder: no .xosc files in this folder"),
    "scenario of no protocol": (
        ["ncap", "cbna", "--protocol", "r152"],
        "no scenario belongs to the protocol",
    ),
    "protocol without its file": (["ncap", "--protocol", "none.toml"], "none.toml: No such file"),
    "protocol's own scenarios": (
        ["ncap", "cpna", "--protocol", "fmvss127"],
        "protocol fmvss127 has scenarios of its own: leave out cpna",
    ),
    "plot of nothing": (["plot", "nowhere"], "nowhere: no such folder"),
    "plot of an empty folder": (["plot", "folder"], "folder"),
    "map missing": (["map", "nope.xodr"], "nope.xodr: cannot be opened"),
    "map strategy": (
        ["map", "urban_street", "--strategy", "x", "--at", "1,-1,100", "--png", "x.png"],
        "--strategy: unknown 'x'; use one of: rectangular",
    ),
    "map road": (["map", "urban_street", "--at", "5,-1,10"], "the map has no road '5'"),
    "picture in no folder": (["map", "urban_street", "--png", "no/a.png"], "--png: cannot write no/a.png"),
    "picture of no format": (
        ["map", "urban_street", "--png", "a.bmp"],
        "the ending must be .png, .svg or .pdf",
    ),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_one_line_and_status_two(command: Command, tmp_path: Path, name: str) -> None:
    (tmp_path / "broken.xodr").write_text("<OpenDRIVE><header")
    (tmp_path / "other.xml").write_text("<html/>")
    (tmp_path / "empty.xodr").touch()
    (tmp_path / "folder").mkdir()
    text = shipped_map("urban_street").read_text()
    assert 'y="0.0" hdg="0.0"' in text
    (tmp_path / "elsewhere.xodr").write_text(text.replace('y="0.0" hdg="0.0"', 'y="9000.0" hdg="0.0"'))
    arguments, message = MISTAKES[name]
    if arguments[0] in ("cpna", "run", "ncap") and "--out" not in arguments:
        arguments = [*arguments, "--out", "out"]
    answer = command(*arguments)
    assert answer.status == 2, answer
    assert answer.err.startswith("smartmot-eval: ")
    assert answer.err.count("\n") == 1
    assert message in answer.err
    assert "Traceback" not in answer.out + answer.err


@pytest.mark.parametrize(("option", "value"), [("--run", "nope"), ("--format", "bmp")])
def test_mistakes_of_plot(command: Command, results: Path, option: str, value: str) -> None:
    answer = command("plot", results, option, value)
    assert answer.status == 2
    assert answer.err.startswith(f"smartmot-eval: {option}: ")
    assert answer.err.count("\n") == 1


@pytest.mark.parametrize(
    "arguments",
    [
        ["cpna", "--seed", "-1"],
        ["cpna", "--seed", "x"],
        ["cpna", "--impact-point", "left"],
        ["cpna", "--nonsense"],
        ["drive"],
        ["map"],
        ["plot"],
        ["map", "urban_street", "--speed", "-5"],
    ],
)
def test_what_the_option_parser_refuses_ends_with_status_two(command: Command, arguments: list[str]) -> None:
    answer = command(*arguments)
    assert answer.status == 2
    assert answer.out == ""
    assert answer.err.startswith("smartmot-eval: ")
    assert answer.err.count("\n") == 1


def test_a_mistake_in_a_process_of_its_own() -> None:
    run = subprocess.run(
        [sys.executable, "-c", "from evaluation.cli import main; main()", "cpna", "--speeds", "0"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout) == (2, "")
    assert run.stderr.startswith("smartmot-eval: --speeds:")
    assert run.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "told"), [((), True), (("--robustness",), True), (("--no-robustness",), False)]
)
def test_robustness_is_left_out_on_request(
    command: Command, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], told: bool
) -> None:
    given: list[object] = []
    monkeypatch.setattr(
        "evaluation.studies.ncap.run.run_grid", lambda *_, **more: given.append(more["robustness"])
    )
    assert command("ncap", "cpna", "--protocol", "2026", *options).status == 0
    assert given == [told]


@pytest.mark.parametrize(
    ("options", "flags", "collided", "told"),
    [
        ((), (1.0, None, None), (False, False, True), "1 of 3 runs needed no emergency brake"),
        ((), (1.0, 2.0, 3.0), (False, False, False), ""),
        (("--hold-speed",), (1.0, None, None), (False, False, True), ""),
        (("--no-aeb",), (None, None, None), (False, False, False), ""),
    ],
)
def test_runs_without_an_emergency_brake_are_told(
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
    options: tuple[str, ...],
    flags: tuple[float | None, ...],
    collided: tuple[bool, ...],
    told: str,
) -> None:
    """Behind whoever is ahead the ACC may leave nothing to do, which a table of zeros does not tell."""
    rows = [
        (SimpleNamespace(flag_time_s=flag, avoided=not hit), ())
        for flag, hit in zip(flags, collided, strict=True)
    ]
    monkeypatch.setattr("evaluation.studies.suite._compare", lambda *_, **__: rows)
    answer = command("run", "crossing", *options)
    assert answer.status == 0
    assert told in answer.out
    assert ("emergency brake" in answer.out) == bool(told)


def test_an_interrupt_is_one_line(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("evaluation.studies.suite.compare_cpna", interrupted)
    answer = command("cpna", "--speeds", "50")
    assert answer.status == 130
    interrupted = "smartmot-eval: interrupted; compare, study and reference go on if started again"
    assert answer.err.strip() == interrupted


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--scenes", ""), "--scenes: nothing given"),
        (("--growth", "--full"), "--full: has no effect with --growth"),
        (("--growth", "--weather", "dry,rain"), "--weather: --growth takes one"),
        (("--growth", "--scenes", "two at once"), "--scenes: has no effect with --growth"),
        (("--growth", "--vary", "margin_m=1"), "--vary: has no effect with --growth"),
        (("--growth", "--ablation"), "--ablation: has no effect with --growth"),
        (("--maps", "."), "--maps: has no effect without --full; add it"),
        (("--full", "--maps", "nowhere"), "--maps: nowhere is no folder"),
        (("--full", "--scenes", "crosses"), "only outer maps have crosses: give their folder with --maps"),
    ],
)
def test_options_of_compare_that_do_not_go_together(
    command: Command, options: tuple[str, ...], told: str
) -> None:
    answer = command("compare", *options)
    assert answer.status == 2
    assert told in answer.err
    assert answer.err.count("\n") == 1
