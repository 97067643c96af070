"""Drives end to end: what is requested on them, what is kept of them, and what is refused."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.progress import Progress
from evaluation.results.logs import read_log, write_log
from evaluation.studies.drive.drive import Drive, DriveSpec, carry_out, drivable
from evaluation.studies.drive.exposure import Exposure, exposure_of, total
from evaluation.studies.drive.folder import read_drive_folder
from evaluation.studies.drive.measures import ALL
from evaluation.studies.drive.recordings import Source
from evaluation.studies.drive.study import Options, drive_all, prepare
from evaluation.studies.drive.tables import DRIVE_COLUMNS, EVENT_COLUMNS
from evaluation.studies.drive.verdicts import FALSE, UNDECIDED
from evaluation.views.account.explain import explain
from evaluation.views.frames import frames_of
from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import read_csv
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.vehicles import VEHICLES, Vehicle, vehicle_of
from scenarios.sources.requests import EMERGENCY

MAPS = Path(__file__).parents[4] / "scenarios" / "maps"
SPEED_MPS = 10.0


class NoProgress:
    def begin(self, description: str, total: int) -> None:
        pass

    def done(self) -> None:
        pass


SILENT: Progress = NoProgress()


@pytest.fixture
def sequence_of(write: Callable[..., Path]) -> Callable[..., Sequence]:
    def make(persons: list[tuple[float, float]], **rest: object) -> Sequence:
        [sequence] = read_csv(write(persons, **rest)).sequences
        return drivable(sequence)

    return make


def emergencies(drive: Drive) -> list[tuple[str, str]]:
    return [(v.verdict, v.reason) for r, v in drive.requests if r.kind == EMERGENCY]


# --- requests -----------------------------------------------------------------------------------------------


def test_each_person_who_is_driven_over_is_one_request(sequence_of: Callable[..., Sequence]) -> None:
    # the rule holds until standstill, which the recorded ego never comes to: the second would be lost
    drive = carry_out(sequence_of([(60.0, 0.0), (140.0, 0.0)]), DriveSpec("all", preset="physical"))
    assert emergencies(drive) == [(UNDECIDED, "entered")] * 2
    first, second = (r for r, _ in drive.requests)
    assert second.time_s - first.time_s == pytest.approx(8.0, abs=0.2)
    assert first.category == "pedestrian"
    assert first.ttc_s == pytest.approx(first.gap_m / SPEED_MPS, abs=0.11)  # boxes are 0.1 s apart
    assert 0.0 < drive.held_s < 5.0
    assert drive.frames == 201


def test_the_outline_of_the_recording_vehicle_counts(
    sequence_of: Callable[..., Sequence],
) -> None:
    sequence = sequence_of([(60.0, 1.3)])  # its near edge is 1 m beside the axis
    narrow = DriveSpec("all", preset="physical", vehicle=Vehicle(4.4, 1.8))
    assert emergencies(carry_out(sequence, narrow)) == []
    wide = DriveSpec("all", preset="physical", vehicle=Vehicle(4.4, 2.4))
    assert emergencies(carry_out(sequence, wide)) == [(UNDECIDED, "entered")]


def test_detections_without_a_label_are_a_false_activation(sequence_of: Callable[..., Sequence]) -> None:
    sequence = sequence_of([(60.0, 0.0)])
    ghost = replace(sequence, labels=sequence.labels[:0] if sequence.labels is not None else None)
    drive = carry_out(ghost, DriveSpec("path", preset="physical"))
    assert emergencies(drive) == [(FALSE, "")]
    unlabelled = carry_out(replace(sequence, labels=None), DriveSpec("path", preset="physical"))
    assert emergencies(unlabelled) == [(UNDECIDED, "no labels")]


def test_labels_stand_in_for_detections_with_the_latency_of_the_preset(
    sequence_of: Callable[..., Sequence],
) -> None:
    sequence = sequence_of([(60.0, 0.0)], detected=False)
    drive = carry_out(sequence, DriveSpec("path", preset="real", sees="labels", seed=3))
    assert drive.frames == 200  # what is measured in the last frame arrives after the end
    assert (UNDECIDED, "entered") in emergencies(drive)
    again = carry_out(sequence, DriveSpec("path", preset="real", sees="labels", seed=3))
    for name, column in drive.log.items():
        assert np.array_equal(column, again.log[name], equal_nan=column.dtype.kind == "f")


def test_the_log_is_one_that_the_other_commands_read(
    sequence_of: Callable[..., Sequence], tmp_path: Path
) -> None:
    drive = carry_out(sequence_of([(60.0, 0.0)], seconds=8.0), DriveSpec("path", preset="physical"))
    write_log(tmp_path / "log.parquet", drive.log)
    frames = frames_of(read_log(tmp_path / "log.parquet"))
    assert len(frames) == 81
    assert frames.rows("actor", 10)["x_m"].tolist() == [160.0]
    account = explain(frames)
    assert any(text.startswith("Emergency brake since") for text in account.story)
    assert account.story[-1] == "The way is free: drives on." or not account.story[-1].startswith("Emergency")


# --- the map ------------------------------------------------------------------------------------------------


def test_with_a_map_its_lanes_are_monitored_and_off_it_the_rectangle(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    # lane -1 of the shipped street runs along y = -1.75 m
    data = write([(60.0, 0.0)], seconds=8.0, y_m=-1.75)
    options = Options(Source(data, map_file=MAPS / "urban_street.xodr"))
    study = prepare(options)
    assert [spec.strategy for spec in study.specs] == ["rectangular", "map", "all", "path", "adaptive"]
    result = drive_all(study, tmp_path / "out", SILENT)
    by_strategy = {drive.spec.strategy: emergencies(drive) for drive in result.drives}
    assert by_strategy["map"] == [(UNDECIDED, "entered")]
    beside = write([(60.0, 0.0)], seconds=8.0, y_m=400.0, name="beside")
    with pytest.raises(DatasetError, match=r"--map: does not cover the data: .* way of sequence 0 x 100"):
        prepare(Options(Source(beside, map_file=options.source.map_file)))
    verge = write([(60.0, 0.0)], seconds=8.0, y_m=5.8, name="verge")
    off_map = prepare(Options(Source(verge, map_file=options.source.map_file), strategies=("map",)))
    with pytest.raises(DatasetError, match="runs on no driving lane of the map"):
        drive_all(off_map, tmp_path, SILENT)


# --- exposure -----------------------------------------------------------------------------------------------


def test_exposure_is_way_time_and_pedestrians_met(sequence_of: Callable[..., Sequence]) -> None:
    sequence = sequence_of([(60.0, 5.0), (100.0, 5.1), (190.0, -2.0), (230.0, 0.0)])
    exposure = exposure_of(carry_out(sequence, DriveSpec("path")).motion)
    assert exposure.km == pytest.approx(0.2)
    assert exposure.hours == pytest.approx(20.0 / 3600.0)
    assert exposure.pedestrians == 2  # one is 5.1 m beside the axis, one 30 m ahead of the end
    assert exposure.at_most_per_km == pytest.approx(15.0)


def test_exposures_add_up() -> None:
    both = total([Exposure(1.0, 0.1, 3), Exposure(2.0, 0.2, None)])
    assert both == Exposure(3.0, pytest.approx(0.3), 3)
    assert both.at_most_per_km == pytest.approx(1.0)  # no event on 3 km
    assert Exposure(0.0, 0.1, None).at_most_per_km is None


# --- the command --------------------------------------------------------------------------------------------


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_command_writes_tables_and_logs(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    data, out = write([(60.0, 0.0)], seconds=8.0), tmp_path / "out"
    chosen = ("--no-page", "--strategy", "all,path", "--rule", "paper,cascade", "--preset", "physical")
    done = run("drive", data, "--out", out, *chosen)
    assert done.status == 0, done.err
    assert "which no planner knows" in " ".join(done.out.split())
    rows = rows_of(out / "drives.csv")
    assert tuple(rows[0]) == DRIVE_COLUMNS
    assert [(row["strategy"], row["rule"]) for row in rows] == [
        ("all", "paper"), ("all", "cascade"), ("path", "paper"), ("path", "cascade"),
    ]  # fmt: skip
    assert all(row["sequence"] != ALL for row in rows)  # there is only one
    events = rows_of(out / "events.csv")
    assert tuple(events[0]) == EVENT_COLUMNS
    assert {(event["kind"], event["reason"]) for event in events} >= {("emergency", "entered")}
    for row in rows:
        log = read_log(out / "logs" / f"{row['log']}.parquet")
        assert set(log["kind"]) >= {"ego", "actor", "detection", "track"}
    assert json.loads((out / "drives.json").read_text())["configuration"]["command"] == "drive"


def test_strategies_are_alike_but_for_their_areas(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    data, out = write([(60.0, 0.0)], seconds=2.0), tmp_path / "out"
    assert run("drive", data, "--out", out, "--no-page", "--strategy", "path,rectangular").status == 0
    fair = "ego_forecast=path, way=path, standing=path"
    assert [row["settings"] for row in rows_of(out / "drives.csv")] == [fair, fair]
    assert f"Settings of all: {fair}." in (out / "table.md").read_text()
    published = ("--vary", "ego_forecast=ctrv", "--vary", "way=area", "--vary", "standing=area")
    assert run("drive", data, "--out", out, "--no-page", "--strategy", "path", *published).status == 0
    [row] = rows_of(out / "drives.csv")
    assert row["settings"] == "ego_forecast=ctrv, way=area, standing=area"
    assert row["log"].endswith("_path_paper_ego_forecast=ctrv_way=area_standing=area_seed0")


def test_settings_are_rows_of_their_own_in_every_file(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    data, out = write([(60.0, 1.3)], seconds=8.0), tmp_path / "out"
    vary = ("--vary", "half_width_m=0.5,2.6", "--vary", "rule=paper,cascade", "--preset", "physical")
    done = run("drive", data, "--out", out, "--strategy", "rectangular,path", *vary)
    assert done.status == 0, done.err
    rows = rows_of(out / "drives.csv")
    sides = [(row["strategy"], row["rule"], row["settings"].partition(", ")[0]) for row in rows]
    assert sides == [
        ("rectangular", "paper", "half_width_m=0.5"), ("rectangular", "cascade", "half_width_m=0.5"),
        ("rectangular", "paper", "half_width_m=2.6"), ("rectangular", "cascade", "half_width_m=2.6"),
        ("path", "paper", "ego_forecast=path"), ("path", "cascade", "ego_forecast=path"),
    ]  # fmt: skip
    assert len({row["log"] for row in rows}) == 6
    assert {event["settings"] for event in rows_of(out / "events.csv")} <= {row["settings"] for row in rows}
    page = (out / "report.html").read_text()
    assert "rectangular, half_width_m=0.5, paper" in page
    assert "are not drawn" not in page
    folder = read_drive_folder(out)
    widths = {
        view.row["settings"].partition(",")[0]: float(np.ptp(view.frames.areas(0)[0][1][:, 1]))
        for view in (folder.view(row["log"]) for row in rows if row["strategy"] == "rectangular")
    }
    assert widths == {"half_width_m=0.5": pytest.approx(1.0), "half_width_m=2.6": pytest.approx(5.2)}
    assert "| rectangular | half_width_m=0.5 | paper |" in (out / "table.md").read_text()


def test_errors_of_map_and_localisation_can_be_asked_for(write: Callable[..., Path], tmp_path: Path) -> None:
    # 7 m to the left lies the opposite sidewalk of the shipped street
    data = write([(60.0, 8.0)], seconds=8.0, y_m=-1.75)
    source = Source(data, map_file=MAPS / "urban_street.xodr")

    def kept(**vary: float) -> int:
        values = {name: (value,) for name, value in vary.items()}
        study = prepare(Options(source, strategies=("map",), preset="physical", vary=values))
        [drive] = drive_all(study, tmp_path / "out", SILENT).drives
        return int((drive.log["kind"] == "track").sum())

    exact = kept()
    assert kept(localisation_lateral_m=0.0) == kept(map_lane_m=0.0) == exact
    assert kept(localisation_lateral_m=-7.0) != exact
    assert kept(map_lane_m=7.0) != exact


def test_odometry_errors_change_no_speed_that_is_written(sequence_of: Callable[..., Sequence]) -> None:
    sequence = sequence_of([(60.0, 0.0)])
    biased = DriveSpec("path", preset="physical", settings=(("odometry_speed", 0.1),))
    drive = carry_out(sequence, biased)
    assert [r.speed_mps for r, _ in drive.requests] == [pytest.approx(SPEED_MPS)]
    ego = drive.log["kind"] == "ego"
    assert drive.log["speed_mps"][ego] == pytest.approx(SPEED_MPS)
    exact = carry_out(sequence, replace(biased, settings=()))
    # who takes itself for faster brakes earlier
    assert drive.requests[0][0].time_s < exact.requests[0][0].time_s


def test_data_sets_of_a_folder_are_driven_together(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    logs, out = tmp_path / "logs", tmp_path / "out"
    (logs / "notes").mkdir(parents=True)
    (logs / "readme.txt").write_text("two drives")
    for name, ahead_m in (("first", 60.0), ("second", 30.0)):
        write([(ahead_m, 0.0)], seconds=6.0, name=f"logs/{name}")
    done = run("drive", logs, "--out", out, "--strategy", "path", "--preset", "physical")
    assert done.status == 0, done.err
    assert "note: no recordings in notes" in done.out
    rows = rows_of(out / "drives.csv")
    assert [row["sequence"] for row in rows] == ["first/0", "second/0", ALL]
    alone = run(
        "drive", logs / "second", "--out", tmp_path / "alone", "--strategy", "path", "--preset", "physical"
    )
    assert alone.status == 0
    [single] = rows_of(tmp_path / "alone" / "drives.csv")
    other = ("sequence", "log")
    assert {k: v for k, v in single.items() if k not in other} == {
        k: v for k, v in rows[1].items() if k not in other
    }
    only = run("drive", logs, "--out", out, "--strategy", "path", "--sequence", "second/0", "--no-page")
    assert only.status == 0
    assert [row["sequence"] for row in rows_of(out / "drives.csv")] == ["second/0"]
    refused = run("drive", logs, "--out", out, "--sequence", "0")
    assert refused.err.startswith("smartmot-eval: --sequence: no '0'; there are: first/0, second/0")


def test_detections_of_some_and_labels_of_others_are_not_counted_together(
    write: Callable[..., Path], tmp_path: Path
) -> None:
    (tmp_path / "logs").mkdir()
    write([(60.0, 0.0)], seconds=1.0, name="logs/a")
    write([(60.0, 0.0)], seconds=1.0, name="logs/b", detected=False)
    with pytest.raises(DatasetError, match="a has detections and b has labels alone"):
        prepare(Options(Source(tmp_path / "logs")))
    both = prepare(Options(Source(tmp_path / "logs", sees="labels")))
    assert {spec.sees for spec in both.specs} == {"labels"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--vary", "rate_hz=5"], "--vary rate_hz: means nothing on recorded drives"),
        (["--vary", "range_m=40"], "--vary range_m: means nothing for recorded detections"),
        (["--vary", "miss_rate=0.1"], "--vary miss_rate: means nothing for recorded detections"),
        (["--vary", "map_kerb_m=1"], "--vary map_kerb_m: means nothing without a map, and 0 has none"),
        (["--vary", "localisation_lateral_m=1"], "--vary localisation_lateral_m: means nothing without"),
        (["--vary", "path_from=map"], "--vary path_from: means nothing without a map"),
        (
            ["--vary", "margin_m=1"],
            "--vary margin_m: means nothing for rectangular, all, path, adaptive; it ",
        ),
        (["--vary", "speed=1"], "--vary: expected NAME=VALUES with one of"),
        (["--vary", "half_width_m=-1"], "--vary half_width_m=-1, rule paper: "),
        (["--vary", "r157_ttc_s=2"], "--vary r157_ttc_s=2, rule paper: r157_ttc_s is a parameter of rule="),
        (["--vary", "rule=paper", "--rule", "paper"], "--rule and --vary rule say the same"),
        (
            ["--vary", "horizon_s=2,2.0000001"],
            "2 drives would be called 0_rectangular_paper_horizon_s=2_seed0",
        ),
        (["--strategy", "map"], "strategy map: the data have no map; give --map FILE.xodr"),
        (["--detections", "guesses"], "--detections: unknown 'guesses'; use one of: labels, detections"),
        (["--rule", "none"], "--rule: unknown 'none'"),
        (["--sequence", "x"], "--sequence: no 'x'; there are:"),
        (["--ego", "4"], "--ego: expected LENGTH,WIDTH or LENGTH,WIDTH,AHEAD in m, got '4'"),
        (["--ego", "400,2"], "--ego: vehicle: length must lie in 0.5..30 m"),
        (["--preset", "ideal"], "--preset: unknown 'ideal'"),
    ],
)
def test_command_refuses_in_one_line(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = run("drive", write([(60.0, 0.0)], seconds=2.0), "--out", tmp_path / "out", *arguments)
    assert done.status == 2
    assert done.err.startswith(f"smartmot-eval: {message}")
    assert done.err.count("\n") == 1


def test_what_cannot_be_driven_is_named(write: Callable[..., Path]) -> None:
    data = write([(60.0, 0.0)], seconds=2.0, labelled=False)
    with pytest.raises(DatasetError, match=r"--detections labels: sequence .* has no labels"):
        prepare(Options(Source(data, sees="labels")))
    (data / "ego.csv").unlink()
    with pytest.raises(DatasetError, match="has no ego poses, which decisions need"):
        prepare(Options(Source(data)))


def test_times_must_ascend(sequence_of: Callable[..., Sequence]) -> None:
    sequence = sequence_of([(60.0, 0.0)], seconds=1.0)
    stamp_s = sequence.stamp_s.copy()
    stamp_s[4] = stamp_s[3]
    with pytest.raises(DatasetError, match=r"is not later than the one before \(0\.3 s\)"):
        drivable(replace(sequence, stamp_s=stamp_s))
    shifted = drivable(replace(sequence, stamp_s=sequence.stamp_s + 1.5e9))
    assert shifted.stamp_s[[0, -1]] == pytest.approx([0.0, 1.0])


def test_vehicles_of_the_data_sets() -> None:
    assert vehicle_of("csv") == Vehicle()
    assert set(VEHICLES) >= {"kitti", "nuscenes"}
    with pytest.raises(DatasetError, match=r"must be within 4\.4 m of the middle"):
        Vehicle(center_ahead_m=9.0)


# --- reference data -----------------------------------------------------------------------------------------


def test_a_kitti_sequence_end_to_end(kitti: Path, tmp_path: Path) -> None:
    study = prepare(Options(Source(kitti, sequences="0014"), strategies=("rectangular", "all", "path")))
    result = drive_all(study, tmp_path, SILENT)
    assert {drive.frames for drive in result.drives} == {106}
    exposure = exposure_of(result.drives[0].motion)
    assert exposure.hours == pytest.approx(10.5 / 3600.0)
    rows = rows_of(tmp_path / "drives.csv")
    for row in rows:
        assert int(row["requests"]) == int(row["false_activations"]) + int(row["undecided"])
        assert bool(row["at_most_per_km"]) == (row["requests"] == "0")
    assert result.spent_s * 20.0 < study.recorded_s
