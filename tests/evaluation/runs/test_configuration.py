"""The configuration of a folder: what one command wrote, every later one uses, or says that it cannot."""

from __future__ import annotations

import json
import math
import re
import shutil
import sys
from collections.abc import Callable, Iterator
from importlib import invalidate_caches
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from evaluation.cli import app, main
from evaluation.results.files import ResultsError
from evaluation.results.logs import read_log, write_log
from evaluation.results.rows import write_runs
from evaluation.runs import logged
from evaluation.runs.configuration import SHIPPED, configuration_of, read_configuration
from evaluation.runs.cpna import CpnaSuite, load_site
from evaluation.runs.folder import RunFolder, read_folder
from evaluation.runs.specs import Conditions
from evaluation.studies.reference.cpna import CpnaStudy
from evaluation.studies.suite import draw_again
from evaluation.views.page.page import write_page
from scenarios.catalogue.library import DEFINITIONS
from scenarios.spec import RunSpec, definition_of, preset_of
from smartmot.area import MapArea

FIELD = Path(__file__).parents[2] / "data" / "field" / "runs"
LOG = "cpna_paper_map_dry_none_50kmh_seed0"

Call = Callable[..., str]


def call(*words: object) -> None:
    result = CliRunner().invoke(app, [*map(str, words), "--quiet"])
    assert result.exit_code == 0, result.output


def made_by_cpna(out: Path) -> Path:
    call("cpna", "--speeds", "30", "--strategy", "map", "--no-pictures", "--out", out)
    return out


def made_by_run(out: Path) -> Path:
    options = ["--strategy", "map", "--param", "Ego_speed_kmh=30", "--no-pictures", "--workers", "1"]
    call("run", "crossing", *options, "--out", out)
    return out


def made_by_ncap(out: Path) -> Path:
    options = ["--preset", "paper", "--strategy", "map", "--weather", "dry", "--logs", "--workers", "1"]
    call("ncap", "--protocol", "paper", *options, "--out", out)
    return out


def made_by_compare(out: Path) -> Path:
    options = ["--strategies", "map", "--vary", "margin_m=1.8", "--seeds", "1", "--workers", "1", "--logs"]
    call("compare", "--scenes", "two at once", *options, "--out", out)
    return out / "runs"


def made_by_reports(out: Path) -> Path:
    conditions = Conditions(("map",), "paper", ("rain",), "urban_street")
    study = CpnaStudy("small", CpnaSuite((30.0,), conditions))
    items = study.items(out)
    study.write(out, items, {item.key: study.kept(item, study.job(item)) for item in items})
    return out


COMMANDS = (made_by_cpna, made_by_run, made_by_ncap, made_by_compare, made_by_reports)


def edit(folder: Path, change: Callable[[Any], None]) -> None:
    """Change the configuration of a folder."""
    path = folder / "runs.json"
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))


@pytest.mark.parametrize("made", COMMANDS)
def test_what_a_command_stored_is_used(made: Callable[[Path], Path], tmp_path: Path) -> None:
    """The preset differs from today's of that name in every part."""

    def other(content: Any) -> None:
        assert content["schema"] == 2
        for preset in content["configuration"]["presets"].values():
            preset["brakes"]["max_decel_mps2"] = 3.21
            preset["sensor"]["range_m"] = 47.0
            preset["map_area"]["vru_margin_m"] = 8.0
            preset["pipeline"]["forecast"]["min_horizon_s"] = 2.5
            preset["pipeline"]["tracker"]["score_threshold"] = 0.11
            preset["pipeline"]["aeb"]["near_m"] = 7.0

    folder = made(tmp_path)
    edit(folder, other)
    read = read_folder(folder)
    assert read.notes == ()
    assert set(read.setups) == set(read.runs["log"])
    for setup in read.setups.values():
        preset = setup.preset
        assert preset.brakes.max_decel_mps2 == 3.21
        assert preset.sensor.range_m == 47.0
        assert preset.pipeline.forecast.min_horizon_s == 2.5
        assert preset.pipeline.tracker.score_threshold == 0.11  # type: ignore[union-attr]
        assert preset.pipeline.aeb.near_m == 7.0
        assert isinstance(setup.strategy, MapArea)
        assert setup.strategy.config.vru_margin_m == 8.0
    call("report", folder)
    assert draw_again(folder, None, "png")[1] == []


# ---- what is stored ----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scenario, its catalogs and its map, and results of it in a folder beside."""
    project = tmp_path_factory.mktemp("made") / "project"
    inputs = project / "inputs"
    project.mkdir()
    shutil.copytree(FIELD / "good", inputs, ignore=shutil.ignore_patterns("runs.*", "logs"))
    options = ["--strategy", "map", "--preset", "physical", "--no-pictures", "--workers", "1"]
    scenario = inputs / "cpna_paper.xosc"
    call("run", scenario, "--param", "Ego_speed_kmh=30", *options, "--out", project / "results")
    return project


@pytest.fixture
def own(project: Path, tmp_path: Path) -> Path:
    """The results of a copy of that folder."""
    return shutil.copytree(project, tmp_path / "project") / "results"


def test_the_configuration_has_everything_that_determines_a_run(own: Path) -> None:
    stored = json.loads((own / "runs.json").read_text())["configuration"]
    (spec,) = stored["specs"]
    names = ["cpna_paper.xosc", "catalogs/pedestrians/pedestrians.xosc", "catalogs/vehicles/vehicles.xosc"]
    names += ["urban_street.xodr"]
    assert sorted(spec["files"]) == sorted(f"../inputs/{name}" for name in names)
    assert set(stored["files"]) == set(spec["files"])
    assert all(len(digest) == 64 for digest in stored["files"].values())
    assert spec["file"] == "../inputs/cpna_paper.xosc"
    assert stored["weather"]["dry"]["friction"] == 0.9
    assert stored["light"]["lidar"]["range_m"] is None
    assert {"smartmot", "python", "numpy", "shapely"} <= set(stored["versions"])


def test_files_of_the_package_are_told_by_their_place_in_it(tmp_path: Path) -> None:
    spec = RunSpec("x", str(DEFINITIONS / "crossing.xosc"), (), "map", "physical", "dry", 50.0, "bend_30")
    spec = RunSpec("x", "crossing", (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)
    write_runs(tmp_path, [], configuration_of([spec], tmp_path))
    stored = json.loads((tmp_path / "runs.json").read_text())["configuration"]
    assert f"{SHIPPED}definitions/crossing.xosc" in stored["files"]
    (run,) = read_configuration(tmp_path).runs
    assert run.spec == spec
    assert run.preset == preset_of(spec, definition_of(spec))


def test_equal_presets_stand_once_and_different_ones_apart(tmp_path: Path) -> None:
    """By night the sensor of a camera sees less, and each phase is a preset of its own."""
    one = RunSpec("x", "crossing", (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)
    specs = [one, one, RunSpec(**{f: getattr(one, f) for f in one.__slots__} | {"phase_s": 0.02})]
    write_runs(tmp_path, [], configuration_of(specs, tmp_path))
    runs = read_configuration(tmp_path).runs
    assert [run.preset.sensor.phase_s for run in runs] == [0.0, 0.0, 0.02]
    assert len(json.loads((tmp_path / "runs.json").read_text())["configuration"]["presets"]) == 2


def test_an_infinite_setting_is_read_again(tmp_path: Path) -> None:
    values = (("Ego_speed_kmh", 50.0),)
    spec = RunSpec("x", "crossing", values, "map", "paper", "dry", 50.0, settings=(("reach_m", math.inf),))
    write_runs(tmp_path, [], configuration_of([spec], tmp_path))
    (run,) = read_configuration(tmp_path).runs
    assert run.spec.settings == (("reach_m", math.inf),)
    assert run.preset.map_area.reach_m is None


# ---- folders that were moved, inputs that have changed -----------------------------------------------------


def notes_of(folder: Path) -> tuple[str, ...]:
    return read_folder(folder).notes


def test_a_folder_is_moved_with_its_inputs(
    own: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    moved = tmp_path / "elsewhere"
    own.parent.rename(moved)
    monkeypatch.chdir(moved / "results")
    read = read_folder(Path())
    assert read.notes == ()
    assert [setup.network.name for setup in read.setups.values()] == ["urban_street"]


def test_a_folder_that_was_moved_without_its_inputs_is_drawn_without_lanes(own: Path, tmp_path: Path) -> None:
    moved = own.rename(tmp_path / "alone")
    (note,) = notes_of(moved)
    assert note.startswith("Lanes and monitored areas are not drawn: ")
    assert "is not there; move the files of a run together with its folder" in note
    call("report", moved)
    written, told = draw_again(moved, None, "png")
    assert [path.name for path in written] == ["speed_curves.png", "temporal_diagram.png"]
    assert told == [note]


@pytest.mark.parametrize("name", ["urban_street.xodr", "cpna_paper.xosc", "catalogs/vehicles/vehicles.xosc"])
def test_an_input_that_has_changed_is_not_drawn(own: Path, name: str) -> None:
    path = own.parent / "inputs" / name
    path.write_text(path.read_text() + "<!-- -->")
    (note,) = notes_of(own)
    assert note.endswith(f"{name} has changed since the run")
    assert read_folder(own).setups == {}


def test_a_catalog_that_was_added_is_told(own: Path) -> None:
    catalogs = own.parent / "inputs" / "catalogs" / "vehicles"
    shutil.copy(catalogs / "vehicles.xosc", catalogs / "a_first.xosc")
    (note,) = notes_of(own)
    assert note.endswith("a_first.xosc was not there when the run took place")


# ---- folders of version 0.1.0 ------------------------------------------------------------------------------


def field(tmp_path: Path, name: str) -> Path:
    return Path(shutil.copytree(FIELD / name, tmp_path / name))


def test_a_folder_of_the_first_version_is_read(tmp_path: Path) -> None:
    read = read_folder(field(tmp_path, "good"))
    assert list(read.setups) == [LOG]
    assert read.notes == (
        "Made by version 0.1.0, which wrote no hashes: scenario and map may have changed since.",
    )


def test_the_preset_of_the_first_version_is_used(tmp_path: Path) -> None:
    """Its runs.json has a margin of 8 m where today's preset has 1.8 m."""
    setup = read_folder(field(tmp_path, "run_preset_ignored")).setups[LOG]
    assert setup.preset.map_area.vru_margin_m == 8.0
    assert isinstance(setup.strategy, MapArea)
    assert setup.strategy.config.vru_margin_m == 8.0


def test_a_comparison_of_the_first_version_is_read() -> None:
    """The reference results of 0.1.0 as `cpna` wrote them: the configuration has the suite alone."""
    suite = {
        "speeds_kmh": [30.0, 50.0], "strategies": ["map", "evil:make"], "preset": "paper",
        "map": "urban_street",
        "weather": [{"name": "dry"}, {"name": "rain"}], "place": None, "impact_point_percent": None,
        "adversaries": "none", "seed": 0, "phase_s": 0.0, "settings": {},
    }  # fmt: skip
    here = FIELD / "good"
    preset = json.loads((here / "runs.json").read_text())["configuration"]["presets"]["physical dry"]
    preset["sensor"]["range_m"] = 33.0
    content = {
        "version": "0.1.0",
        "configuration": {"suite": suite, "presets": {"dry": preset, "rain": preset}},
    }
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("evaluation.runs.configuration.read_json", lambda path: content)
        stored = read_configuration(here)
    wanted = CpnaSuite((30.0, 50.0), Conditions(("map",), "paper", ("dry", "rain"), "urban_street"))
    specs = wanted.specs(load_site(wanted))
    found = [run.spec for run in stored.runs if run.spec.strategy == "map"]
    assert sorted(found, key=lambda spec: spec.log) == sorted(specs, key=lambda spec: spec.log)
    assert len(stored.runs) == 8
    assert {run.preset.sensor.range_m for run in stored.runs} == {33.0}
    assert not stored.published  # several weathers


# ---- code of a folder --------------------------------------------------------------------------------------


@pytest.fixture
def evil(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder that names a module which lies in it, as the current folder."""
    folder = field(tmp_path, "report_runs_code")
    monkeypatch.chdir(folder)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield folder
    sys.modules.pop("evil", None)


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run a command that ends well; what it says of what is missing."""

    def carry_out(*words: object) -> str:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, words), "--quiet"])
        with pytest.raises(SystemExit) as stop:
            main()
        told = capsys.readouterr().err
        assert not stop.value.code, told
        return told

    return carry_out


NOT_DRAWN = "The monitored area of evil:make is not drawn: "


@pytest.mark.parametrize(
    "words", [("report", "."), ("plot", "."), ("replay", LOG.replace("map", "evil-make"), "--fps", "1")]
)
def test_no_code_of_a_folder_runs(evil: Path, command: Call, words: tuple[str, ...]) -> None:
    """The module fails when it is imported."""
    assert f"smartmot-eval: {NOT_DRAWN}it is code of your own" in command(*words)
    assert "evil" not in sys.modules
    told = command(*words, "--allow-plugins")
    assert f"{NOT_DRAWN}evil:make: AssertionError: code of a results folder was run" in told


MINE = "from smartmot import MapArea\n\n\ndef make(scene, preset):\n"
MINE += "    return MapArea(scene.network, scene.route, preset.map_area)\n"


def test_code_that_is_allowed_is_that_of_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Call
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "corridor_a.py").write_text(MINE)
    options = ("--speeds", "30", "--strategy", "corridor_a:make", "--no-pictures")
    command("cpna", *options, "--tracker", "preset", "--out", "out")
    stored = read_configuration(tmp_path / "out")
    assert set(stored.plugins) == {"corridor_a:make"}
    (setup,) = read_folder(tmp_path / "out", allow_plugins=True).setups.values()
    assert isinstance(setup.strategy, MapArea)
    assert notes_of(tmp_path / "out") == (
        "The monitored area of corridor_a:make is not drawn: it is code of your own, which is run with "
        "--allow-plugins only.",
    )
    edit(
        tmp_path / "out", lambda content: content["configuration"]["plugins"].update({"corridor_a:make": "0"})
    )
    read: RunFolder = read_folder(tmp_path / "out", allow_plugins=True)
    assert read.notes == (
        "The monitored area of corridor_a:make is not drawn: its code has changed since the run.",
    )


def test_a_tracker_of_the_users_own_is_not_loaded_by_a_report(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: Call
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    text = "from smartmot import Tracker\n\n\nclass Mine(Tracker):\n    pass\n"
    (tmp_path / "tracker_b.py").write_text(text)
    command(
        "cpna",
        "--speeds",
        "30",
        "--strategy",
        "map",
        "--tracker",
        "tracker_b:Mine",
        "--no-pictures",
        "--out",
        "o",
    )
    del sys.modules["tracker_b"]
    (tmp_path / "tracker_b.py").unlink()
    assert command("report", "o") == ""
    assert "tracker_b" not in sys.modules
    (run,) = read_configuration(tmp_path / "o").runs
    assert run.preset.pipeline.tracker.name == "tracker_b:Mine"  # type: ignore[union-attr]


AREA = """from smartmot import MapArea


class Area:
    def __init__(self, scene, preset):
        self.area = MapArea(scene.network, scene.route, preset.map_area)

    def at(self, ego):
        {}
"""


@pytest.fixture(scope="module", params=["report", "plot", "replay"])
def failing(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A command, and a folder with results of an area of the user's own, without its hash."""
    folder = tmp_path_factory.mktemp("failing")
    module = f"area_{request.param}"
    (folder / f"{module}.py").write_text(AREA.format("return self.area.at(ego)"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.syspath_prepend(str(folder))
        call("cpna", "--speeds", "30", "--strategy", f"{module}:Area", "--no-pictures", "--out", "o")
    edit(folder / "o", lambda content: content["configuration"]["plugins"].clear())
    return request.param, folder


@pytest.mark.parametrize(
    ("body", "message"),
    [
        ("return self.area.at(ego)", None),  # without a name
        ("raise ValueError('of mine')", r"area_[a-z]+:Area: ValueError: of mine \(.*, line 9\)"),
        ("raise SystemExit(0)", r"area_[a-z]+:Area: SystemExit: 0 \(.*, line 9\)"),
        ("return None", r"area_[a-z]+:Area: made NoneType, which has no relevance\(\)"),
    ],
)
def test_an_area_that_is_allowed_and_fails_is_one_line(
    failing: tuple[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    body: str,
    message: str | None,
) -> None:
    """It may depend on what is not there any more, such as a file."""
    name, made = failing
    shutil.copytree(made / "o", tmp_path / "o")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delitem(sys.modules, f"area_{name}", raising=False)
    (tmp_path / f"area_{name}.py").write_text(AREA.format(body))
    invalidate_caches()
    (log,) = read_folder(tmp_path / "o").setups
    words = (name, f"o/{log}", "--fps", "1") if name == "replay" else (name, "o")
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *words, "--allow-plugins", "--quiet"])
    with pytest.raises(SystemExit) as stop:
        main()
    told = capsys.readouterr().err.strip().splitlines()
    if message is None:
        assert not stop.value.code
        assert len(told) == 1  # that there is no hash
    else:
        assert stop.value.code == 2
        (line,) = told
        assert re.search(message, line)


# ---- a folder that is written again ------------------------------------------------------------------------


@pytest.mark.parametrize("words", [("cpna", "--speeds", "20,30"), ("ncap", "--protocol", "paper", "--logs")])
def test_old_tables_do_not_stand_beside_new_logs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    """Logs of another preset have the same names; the second command ends after its first log."""
    options = ("--strategy", "map", "--workers", "1", "--out", str(tmp_path))
    call(*words, "--preset", "paper", *options)
    write = write_log

    def once(path: Path, table: Any) -> None:
        write(path, table)
        raise ResultsError("ended")

    monkeypatch.setattr(logged, "write_log", once)
    assert CliRunner().invoke(app, [*words, "--preset", "physical", *options, "-q"]).exit_code
    with pytest.raises(ResultsError, match=r"runs\.csv: no such file"):
        read_folder(tmp_path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda log: log[log["kind"] != "ego"], "no rows of kind 'ego'"),
        (lambda log: log.assign(length_m=0.0), "the ego's length and width must be positive"),
    ],
)
def test_a_log_without_an_ego_is_told_by_its_name(
    own: Path, change: Callable[[Any], Any], message: str
) -> None:
    (path,) = (own / "logs").iterdir()
    change(read_log(path)).to_parquet(path)
    for act in (lambda: write_page(own), lambda: draw_again(own, None, "png")):
        with pytest.raises(ResultsError, match=message) as error:
            act()
        assert str(error.value).startswith(f"{path}: ")


def test_plot_of_a_comparison_says_where_its_runs_are(tmp_path: Path) -> None:
    made_by_compare(tmp_path)
    with pytest.raises(ResultsError, match=r": a comparison over scenes; its logged runs are in .*runs$"):
        draw_again(tmp_path, None, "png")


# ---- damaged configurations --------------------------------------------------------------------------------


def broken(change: Callable[[Any], None]) -> Callable[[Path], None]:
    return lambda folder: edit(folder, change)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda folder: (folder / "runs.json").write_text("[" * 100_000), "nested too deeply"),
        (lambda folder: (folder / "runs.json").write_bytes(b"\xff\xfe{}"), "not a text file"),
        (lambda folder: (folder / "runs.json").write_text('{"a": 1, "a": 2}'), "key 'a' is there twice"),
        (broken(lambda c: c.update(schema=3)), "schema 3 is not 2"),
        (broken(lambda c: c["configuration"].update(specs={})), "specs must be a list"),
        (broken(lambda c: c["configuration"]["specs"][0].update(seed=1e300)), "seed must be a whole number"),
        (broken(lambda c: c["configuration"]["specs"][0].update(strategy=None)), "strategy must be a text"),
        (
            broken(lambda c: c["configuration"]["specs"][0].update(files=["x"])),
            "files must be of files, got 'x'",
        ),
        (broken(lambda c: c["configuration"]["presets"].clear()), "resolved_preset must be one of presets"),
        (
            broken(lambda c: c["configuration"]["specs"][0]["parameters"].update(Ego_speed_kmh=[1])),
            "parameters must be numbers, texts and truth values",
        ),
    ],
)
def test_a_damaged_configuration_is_one_clear_error(
    own: Path, damage: Callable[[Path], object], message: str
) -> None:
    damage(own)
    with pytest.raises(ResultsError, match=r"runs\.json: .*; run the test again") as error:
        read_configuration(own)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
    call("report", own)  # without lanes


def test_a_configuration_that_was_cut_off_is_one_line(tmp_path: Path, command: Call) -> None:
    told = command("report", field(tmp_path, "runs_json_cut"))
    assert len(told.strip().splitlines()) == 1
    assert "runs.json: line" in told
