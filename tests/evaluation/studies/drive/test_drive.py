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
from evaluation.studies.drive.requests import EMERGENCY
from evaluation.studies.drive.study import Options, drive_all, prepare
from evaluation.studies.drive.tables import ALL, DRIVE_COLUMNS, EVENT_COLUMNS
from evaluation.studies.drive.verdicts import FALSE, UNDECIDED
from evaluation.views.account.explain import explain
from evaluation.views.frames import frames_of
from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import read_csv
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.vehicles import VEHICLES, Vehicle, vehicle_of

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
    options = Options(data, map_file=MAPS / "urban_street.xodr")
    study = prepare(options)
    assert [spec.strategy for spec in study.specs] == ["rectangular", "map", "all", "path"]
    result = drive_all(study, tmp_path / "out", SILENT)
    by_strategy = {drive.spec.strategy: emergencies(drive) for drive in result.drives}
    assert by_strategy["map"] == [(UNDECIDED, "entered")]
    beside = write([(60.0, 0.0)], seconds=8.0, y_m=400.0, name="beside")
    with pytest.raises(DatasetError, match="runs on no driving lane of the map"):
        drive_all(prepare(Options(beside, strategies=("map",), map_file=options.map_file)), tmp_path, SILENT)


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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--strategy", "map"], "--strategy map: the data have no map; give --map FILE.xodr"),
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
        prepare(Options(data, sees="labels"))
    (data / "ego.csv").unlink()
    with pytest.raises(DatasetError, match="has no ego poses, which decisions need"):
        prepare(Options(data))


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
    study = prepare(Options(kitti, sequences="0014", strategies=("rectangular", "all", "path")))
    result = drive_all(study, tmp_path, SILENT)
    assert {drive.frames for drive in result.drives} == {106}
    exposure = exposure_of(result.drives[0].motion)
    assert exposure.hours == pytest.approx(10.5 / 3600.0)
    rows = rows_of(tmp_path / "drives.csv")
    for row in rows:
        assert int(row["requests"]) == int(row["false_activations"]) + int(row["undecided"])
        assert bool(row["at_most_per_km"]) == (row["requests"] == "0")
    assert result.spent_s * 20.0 < study.recorded_s
